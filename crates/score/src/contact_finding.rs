//! Beginning of a recording: form of the force baseline in air, position of the contact, and whether the recording begins in air at all.
//!
//! The online core ([`stylet_core`]) estimates the baseline and finds the contact. Whether there was any air is decided over the whole
//! recording: a second core starts in the tissue, and the start with the better one-step prediction is chosen.

use serde::Serialize;
use stylet_core::config::{Algorithm, Contact};
use stylet_core::{Baseline, BaselineKind, EnhanceConfig, Enhancer, Output, Sample, Units, ZeroStep};

/// Log odds in nats, from the prediction errors of both starts, above which the recording begins in the tissue; high because the errors
/// are correlated and most recordings start in air.
const MIN_LOADED_NATS: f64 = 30.0;
/// Prediction errors closer than this (s) count as one, because model errors are correlated from sample to sample.
const INDEPENDENT_S: f64 = 5e-3;
/// Used samples from which the baseline in air is known.
const BASELINE_SAMPLES: f64 = 100.0;
/// Largest factor by which learning a moving baseline raises the variance in air.
const LEARNING_FACTOR: f64 = 1.2;
/// Travel below this (m) counts as no motion.
const MIN_TRAVEL_M: f64 = 1e-9;

/// Hypothesis about the beginning of a recording.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ContactHypothesis {
    /// The needle does not move.
    AtRest,
    /// A constant offset until contact.
    #[default]
    ConstantOffset,
    /// A drift in time until contact.
    DriftInTime,
    /// A force linear in position until contact.
    LineInPosition,
    /// A drift or a line: the motion in air does not separate them.
    DriftOrLine,
    /// The zero jumped in air; the baseline may move, too.
    ZeroStep,
    /// The needle is in tissue from the first sample on.
    BeginsLoaded,
    /// There is no contact.
    NeverTouches,
}

impl ContactHypothesis {
    /// Its name in messages.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::AtRest => "at rest",
            Self::ConstantOffset => "constant offset",
            Self::DriftInTime => "drift in time",
            Self::LineInPosition => "line in position",
            Self::DriftOrLine => "drift in time or line in position",
            Self::ZeroStep => "step of the zero",
            Self::BeginsLoaded => "begins loaded",
            Self::NeverTouches => "never touches",
        }
    }
}

/// How a recording begins.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ContactFinding {
    /// The setting: `auto`, `known` or `none`.
    pub setting: &'static str,
    /// The hypothesis.
    pub hypothesis: ContactHypothesis,
    /// Probability that the load is a contact, not a moving baseline or a step of the zero, 0 to 1; absent if the contact is configured.
    pub probability: Option<f64>,
    /// Position of the contact in m.
    pub contact_m: Option<f64>,
    /// 95 % interval of the position in m, where it is estimated.
    pub contact_interval_m: Option<[f64; 2]>,
    /// Baseline in air.
    pub baseline: Baseline,
    /// Steps of the zero, in air and in tissue.
    pub zero_steps: Vec<ZeroStep>,
}

impl ContactFinding {
    /// A constant or moving baseline in words.
    fn baseline_text(&self, hypothesis: ContactHypothesis) -> String {
        let b = &self.baseline;
        let pm = |value: f64, sd: f64, scale: f64| {
            format!("{:.3} ± {:.2}", scale * value, scale * stylet_stats::normal::Z95 * sd)
        };
        let drift = pm(b.drift_n_per_s, b.sd[1], 1e3);
        let line = pm(b.line_n_per_m, b.sd[2], 1.0);
        match hypothesis {
            ContactHypothesis::DriftInTime => format!("a drift of {drift} mN/s"),
            ContactHypothesis::LineInPosition => format!("a force of {line} N/m linear in position"),
            ContactHypothesis::DriftOrLine => {
                format!("a drift of {drift} mN/s or a line of {line} N/m (one speed does not separate them)")
            }
            _ => format!("a constant offset of {:.3} N", b.offset_n + 0.0),
        }
    }

    /// The finding in one sentence, with the setting.
    #[must_use]
    pub fn sentence(&self) -> String {
        let setting = format!("--contact {}", self.setting);
        let b = &self.baseline;
        let steps = self.zero_steps.iter().filter(|s| !s.in_tissue).count();
        let before = match self.hypothesis {
            ContactHypothesis::AtRest => return format!("the needle is at rest; no contact ({setting})"),
            ContactHypothesis::NeverTouches => {
                return format!(
                    "the needle never touches: offset, drift, line and steps of the zero explain the force ({setting}; if the recording \
                     begins in the tissue, use --contact none)"
                );
            }
            ContactHypothesis::BeginsLoaded if self.setting == "auto" => {
                return format!(
                    "the recording begins loaded: a start in the tissue predicts the force better than any in air; enhanced as \
                     with --contact none, where forces are absolute ({setting}); use --contact known to give the surface's position"
                );
            }
            ContactHypothesis::BeginsLoaded => {
                return format!("the recording begins loaded, as given ({setting}); forces are absolute");
            }
            ContactHypothesis::ZeroStep => match moving_baseline(b.kind) {
                Some(moving) => format!("{steps} step(s) of the zero and {}", self.baseline_text(moving)),
                None => format!("{steps} step(s) of the zero"),
            },
            baseline => self.baseline_text(baseline),
        };
        let place = match (self.contact_m, self.contact_interval_m) {
            (Some(z), Some([low, high])) => {
                format!(
                    "contact at {} mm (95 %: {} to {})",
                    millimetres(z),
                    millimetres(low),
                    millimetres(high)
                )
            }
            (Some(z), None) => format!("contact at {} mm", millimetres(z)),
            _ => "no contact yet".to_owned(),
        };
        format!("{place}, after {before} ({setting})")
    }

    /// True if contact detection was requested, but the recording begins loaded.
    #[must_use]
    pub fn is_loaded_unexpectedly(&self) -> bool {
        self.hypothesis == ContactHypothesis::BeginsLoaded && self.setting == Contact::Detected.name()
    }

    /// The finding without a contact, baseline and steps in air.
    #[must_use]
    pub fn without_contact(&self) -> Self {
        Self { setting: self.setting, hypothesis: self.hypothesis, ..Self::default() }
    }

    /// True for anything but a constant offset.
    #[must_use]
    pub fn is_remarkable(&self) -> bool {
        self.hypothesis != ContactHypothesis::ConstantOffset || !self.zero_steps.is_empty()
    }
}

/// The hypothesis of a moving baseline.
fn moving_baseline(kind: BaselineKind) -> Option<ContactHypothesis> {
    match kind {
        BaselineKind::Constant => None,
        BaselineKind::Drift => Some(ContactHypothesis::DriftInTime),
        BaselineKind::Line => Some(ContactHypothesis::LineInPosition),
        BaselineKind::DriftOrLine => Some(ContactHypothesis::DriftOrLine),
    }
}

/// A length in mm with two decimals; no negative zero.
fn millimetres(metres: f64) -> String {
    let text = format!("{:.2}", 1e3 * metres);
    if text == "-0.00" { "0.00".to_owned() } else { text }
}

/// Mean squares in N² of the errors of a start in air and of one in the tissue, and the mean product of neighbouring errors of the first.
#[derive(Clone, Copy, Debug, Default)]
struct Errors {
    air_n2: f64,
    neighbours_n2: f64,
    loaded_n2: f64,
    count: f64,
    /// Number of independent errors.
    independent: f64,
}

impl Errors {
    fn push(&mut self, air_n: f64, before_n: f64, loaded_n: f64, interval_s: f64) {
        if !(air_n.is_finite() && before_n.is_finite() && loaded_n.is_finite()) {
            return;
        }
        self.count += 1.0;
        self.independent += (interval_s / INDEPENDENT_S).clamp(0.0, 1.0);
        let share = 1.0 / self.count;
        self.air_n2 += share * (air_n * air_n - self.air_n2);
        self.neighbours_n2 += share * (air_n * before_n - self.neighbours_n2);
        self.loaded_n2 += share * (loaded_n * loaded_n - self.loaded_n2);
    }

    /// Log odds in nats of a start in the tissue, if the errors in air have this variance.
    fn nats(&self, air_n2: f64) -> f64 {
        if self.loaded_n2 > 0.0 { 0.5 * self.independent * libm::log(air_n2 / self.loaded_n2) } else { 0.0 }
    }
}

/// Computes a finding sample by sample.
#[derive(Clone, Debug, Default)]
pub struct ContactAssessor {
    /// The core that starts in the tissue, without stored samples.
    loaded: Option<Enhancer<Vec<Sample>>>,
    /// Prediction errors after the contact.
    behind: Errors,
    /// Deviations from the baseline in air, and errors of the start in the tissue, as long as there is no contact.
    in_air: Errors,
    /// The last deviation in N, its time in s, and the number of used samples.
    last_deviation_n: f64,
    last_s: f64,
    used: f64,
    zero_steps: Vec<ZeroStep>,
    last: Option<(Option<f64>, f64, f64)>,
    /// Baseline when the contact was declared.
    air_baseline: Baseline,
    span_m: Option<[f64; 2]>,
}

impl ContactAssessor {
    /// Creates an assessor for a core with this configuration and surface.
    #[must_use]
    pub fn new(config: &EnhanceConfig, surface_m: f64, units: Units) -> Self {
        let detected = config.contact == Contact::Detected && config.active_algorithm() == Algorithm::Stylet;
        let start = || {
            let config = EnhanceConfig { contact: Contact::None, ..config.clone() };
            Enhancer::with_units(config, surface_m, units, Vec::new())
        };
        Self { loaded: detected.then(start), ..Self::default() }
    }

    /// Adds a sample and its output.
    pub fn push(&mut self, sample: &Sample, out: &Output) {
        self.zero_steps.extend(out.zero_step);
        if out.contact_m.is_none() || self.last.is_none_or(|(contact, ..)| contact.is_none()) {
            self.air_baseline = out.baseline;
        }
        self.last = Some((out.contact_m, out.contact_sd_m, out.contact_probability));
        let loaded = self.loaded.as_mut().map(|core| core.step(*sample));
        if !out.used {
            return;
        }
        let z = sample.position_m;
        let [low, high] = self.span_m.unwrap_or([z; 2]);
        self.span_m = Some([low.min(z), high.max(z)]);
        self.used += 1.0;
        let deviation_n = sample.force_n - out.baseline.offset_n;
        let interval_s = sample.time_s - self.last_s;
        if let Some(loaded) = loaded.filter(|o| o.used && sample.velocity_mps > 0.0) {
            if out.contact_m.is_some() {
                self.behind.push(out.error_n, 0.0, loaded.error_n, interval_s);
            } else if self.used > BASELINE_SAMPLES {
                self.in_air.push(deviation_n, self.last_deviation_n, loaded.error_n, interval_s);
            }
        }
        (self.last_deviation_n, self.last_s) = (deviation_n, sample.time_s);
    }

    /// The finding for this setting.
    #[must_use]
    pub fn finish(&self, setting: Contact) -> ContactFinding {
        let (contact_m, sd_m, probability) = self.last.unwrap_or_default();
        let [low, high] = self.span_m.unwrap_or_default();
        let estimated = setting == Contact::Detected && sd_m > 0.0;
        let interval = contact_m
            .filter(|_| estimated)
            .map(|z| [z - stylet_stats::normal::Z95 * sd_m, z + stylet_stats::normal::Z95 * sd_m]);
        let mut finding = ContactFinding {
            setting: setting.name(),
            hypothesis: self.baseline_hypothesis(),
            probability: (estimated && contact_m.is_some()).then_some(probability),
            contact_m,
            contact_interval_m: interval,
            baseline: self.air_baseline,
            zero_steps: self.zero_steps.clone(),
        };
        finding.hypothesis = match setting {
            Contact::None => ContactHypothesis::BeginsLoaded,
            _ if high - low < MIN_TRAVEL_M => ContactHypothesis::AtRest,
            Contact::Detected if self.loaded_nats() > MIN_LOADED_NATS => ContactHypothesis::BeginsLoaded,
            Contact::Detected if contact_m.is_none() => ContactHypothesis::NeverTouches,
            _ => finding.hypothesis,
        };
        finding
    }

    fn baseline_hypothesis(&self) -> ContactHypothesis {
        if self.zero_steps.iter().any(|s| !s.in_tissue) {
            return ContactHypothesis::ZeroStep;
        }
        moving_baseline(self.air_baseline.kind).unwrap_or(ContactHypothesis::ConstantOffset)
    }

    /// Log odds in nats of a start in the tissue: from the errors after the contact or, without a contact, from the whitened deviations
    /// from the baseline.
    fn loaded_nats(&self) -> f64 {
        if self.behind.count > 0.0 {
            return self.behind.nats(self.behind.air_n2);
        }
        let e = &self.in_air;
        let unpredicted_n2 = e.air_n2 - e.neighbours_n2 * e.neighbours_n2 / e.air_n2.max(f64::MIN_POSITIVE);
        e.nats(unpredicted_n2 / LEARNING_FACTOR)
    }
}

#[cfg(test)]
mod tests;
