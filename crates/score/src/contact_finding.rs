//! How a recording begins: which baseline the force follows before contact, where contact is, and whether there is any air at all.
//!
//! The online core ([`stylet_core`]) follows the baseline and finds the contact. A recording as a whole shows more: if what the core
//! took for air is explained neither by an offset, a drift and a line in position nor by the steps of the zero that were found in it,
//! the needle was loaded from the first sample on. A step at a change of speed is friction, and a line steeper than the layer behind
//! the contact is a layer.

use serde::Serialize;
use stylet_core::config::Contact;
use stylet_core::{Baseline, BaselineKind, Output, Sample, ZeroStep};

/// Most block averages kept of a recording; when they are full, neighbours are merged.
const MAX_BLOCKS: usize = 512;
/// Fewest blocks in air from which a misfit of the baseline is judged.
const MIN_BLOCKS: usize = 12;
/// Variance of the residuals over that of the noise above which no baseline explains the air: three standard deviations.
const MAX_VARIANCE_RATIO: f64 = 9.0;
/// Residuals below this share of the range of the force are wander of the sensor.
const MIN_RANGE_SHARE: f64 = 0.02;
/// Change of speed, as a share of the larger one, at which a jump of the force is friction.
const MIN_SPEED_CHANGE_SHARE: f64 = 0.5;
/// Travel below this share of its noise, or of nothing, is no motion, in m.
const MIN_TRAVEL_M: f64 = 1e-9;
/// Median absolute deviation to standard deviation, for second differences of white block averages: `1.4826/sqrt(6)`.
const SECOND_DIFFERENCE_SD: f64 = 0.6053;

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
    /// The zero jumped in air.
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
    /// Probability of the contact against a baseline or a step of the zero without one, 0 to 1; absent where the contact is
    /// given.
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
    /// The finding in one sentence, with the setting.
    #[must_use]
    pub fn sentence(&self) -> String {
        let setting = format!("--contact {}", self.setting);
        let b = &self.baseline;
        let pm = |value: f64, sd: f64, scale: f64| format!("{:.3} ± {:.2}", scale * value, scale * 1.96 * sd);
        let drift = || pm(b.drift_n_per_s, b.sd[1], 1e3);
        let line = || pm(b.line_n_per_m, b.sd[2], 1.0);
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
                    "the recording begins loaded: no offset, drift, line in position or step of the zero explains its beginning; enhanced as \
                     with --contact none, where forces are absolute ({setting}); use --contact known to give the surface's position"
                );
            }
            ContactHypothesis::BeginsLoaded => {
                return format!("the recording begins loaded, as given ({setting}); forces are absolute");
            }
            ContactHypothesis::ConstantOffset => "a constant offset".to_owned(),
            ContactHypothesis::ZeroStep => format!("{steps} step(s) of the zero"),
            ContactHypothesis::DriftInTime => format!("a drift of {} mN/s", drift()),
            ContactHypothesis::LineInPosition => format!("a force of {} N/m linear in position", line()),
            ContactHypothesis::DriftOrLine => {
                format!(
                    "a drift of {} mN/s or a line of {} N/m (one speed does not tell them apart)",
                    drift(),
                    line()
                )
            }
        };
        let place = match (self.contact_m, self.contact_interval_m) {
            (Some(z), Some([low, high])) => {
                format!("contact at {:.2} mm (95 %: {:.2} to {:.2})", 1e3 * z, 1e3 * low, 1e3 * high)
            }
            (Some(z), None) => format!("contact at {:.2} mm", 1e3 * z),
            _ => "no contact yet".to_owned(),
        };
        format!("{place}, after {before} ({setting})")
    }

    /// The contact was to be detected, and the recording begins loaded.
    #[must_use]
    pub fn is_loaded_unexpectedly(&self) -> bool {
        self.hypothesis == ContactHypothesis::BeginsLoaded && self.setting == Contact::Detected.name()
    }

    /// The finding without a contact and without the baseline and the steps in air that led to one.
    #[must_use]
    pub fn without_contact(&self) -> Self {
        Self { setting: self.setting, hypothesis: self.hypothesis, ..Self::default() }
    }

    /// The finding is remarkable: anything but a constant offset.
    #[must_use]
    pub fn is_remarkable(&self) -> bool {
        self.hypothesis != ContactHypothesis::ConstantOffset || !self.zero_steps.is_empty()
    }
}

/// Means of consecutive samples.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Block {
    time_s: f64,
    position_m: f64,
    force_n: f64,
}

/// Collects what a finding needs, sample by sample, in bounded memory.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ContactAssessor {
    blocks: Vec<Block>,
    unit: usize,
    open: Block,
    count: usize,
    zero_steps: Vec<ZeroStep>,
    last: Option<(Option<f64>, f64, f64)>,
    /// Baseline when the contact was declared.
    air_baseline: Baseline,
    baseline: Baseline,
    span_m: Option<[f64; 2]>,
    /// Stiffness in N/m of the layer behind the contact.
    first_stiffness_n_per_m: Option<f64>,
}

impl ContactAssessor {
    /// Takes a sample and its output.
    pub fn push(&mut self, sample: &Sample, out: &Output) {
        self.zero_steps.extend(out.zero_step);
        if out.contact_m.is_none() || self.last.is_none_or(|(contact, ..)| contact.is_none()) {
            self.air_baseline = out.baseline;
        }
        self.last = Some((out.contact_m, out.contact_sd_m, out.contact_probability));
        self.baseline = out.baseline;
        if !out.used {
            return;
        }
        if out.contact_m.is_some() && out.ruptures == 0 {
            self.first_stiffness_n_per_m = Some(out.theta[0]);
        }
        let z = sample.position_m;
        let [low, high] = self.span_m.unwrap_or([z; 2]);
        self.span_m = Some([low.min(z), high.max(z)]);
        self.unit = self.unit.max(1);
        self.count += 1;
        let share = 1.0 / self.count as f64;
        let mix = |mean: f64, x: f64| mean + share * (x - mean);
        self.open = Block {
            time_s: mix(self.open.time_s, sample.time_s),
            position_m: mix(self.open.position_m, z),
            force_n: mix(self.open.force_n, sample.force_n),
        };
        if self.count < self.unit {
            return;
        }
        self.blocks.push(std::mem::take(&mut self.open));
        self.count = 0;
        if self.blocks.len() == MAX_BLOCKS {
            self.blocks = self
                .blocks
                .chunks_exact(2)
                .map(|pair| Block {
                    time_s: 0.5 * (pair[0].time_s + pair[1].time_s),
                    position_m: 0.5 * (pair[0].position_m + pair[1].position_m),
                    force_n: 0.5 * (pair[0].force_n + pair[1].force_n),
                })
                .collect();
            self.unit *= 2;
        }
    }

    /// The finding for this setting.
    #[must_use]
    pub fn finish(&self, setting: Contact) -> ContactFinding {
        let (contact_m, sd_m, probability) = self.last.unwrap_or_default();
        let [low, high] = self.span_m.unwrap_or_default();
        let estimated = setting == Contact::Detected && sd_m > 0.0;
        let interval = contact_m.filter(|_| estimated).map(|z| [z - 1.96 * sd_m, z + 1.96 * sd_m]);
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
            Contact::Detected if self.is_unexplained(contact_m) => ContactHypothesis::BeginsLoaded,
            Contact::Detected if contact_m.is_none() => ContactHypothesis::NeverTouches,
            _ => finding.hypothesis,
        };
        finding
    }

    fn baseline_hypothesis(&self) -> ContactHypothesis {
        match self.air_baseline.kind {
            BaselineKind::Drift => ContactHypothesis::DriftInTime,
            BaselineKind::Line => ContactHypothesis::LineInPosition,
            BaselineKind::DriftOrLine => ContactHypothesis::DriftOrLine,
            BaselineKind::Constant if self.zero_steps.iter().any(|s| !s.in_tissue) => {
                ContactHypothesis::ZeroStep
            }
            BaselineKind::Constant => ContactHypothesis::ConstantOffset,
        }
    }

    /// Neither offset, drift, line nor the steps found explain the force before the contact, or all of it without one.
    fn is_unexplained(&self, contact_m: Option<f64>) -> bool {
        let half_s = match self.blocks.as_slice() {
            [first, second, ..] => second.time_s - first.time_s,
            _ => return false,
        };
        let steps: Vec<f64> = self.zero_steps.iter().filter(|s| !s.in_tissue).map(|s| s.time_s).collect();
        let until = contact_m
            .and_then(|z| self.blocks.iter().position(|b| b.position_m >= z))
            .unwrap_or(self.blocks.len());
        let air: Vec<&Block> = self.blocks[..until]
            .iter()
            .filter(|b| steps.iter().all(|t| (b.time_s - t).abs() > half_s))
            .collect();
        let steps: Vec<f64> = steps.into_iter().filter(|t| !self.speed_changes_at(*t)).collect();
        if air.len() < MIN_BLOCKS + steps.len() {
            return false;
        }
        let step = |b: &Block, t: &f64| f64::from(u8::from(b.time_s > *t));
        let (t0, z0) = (air[0].time_s, air[0].position_m);
        let regression = |baseline: &dyn Fn(&Block) -> Vec<f64>| {
            let rows: Vec<Vec<f64>> = air
                .iter()
                .map(|b| baseline(b).into_iter().chain(steps.iter().map(|t| step(b, t))).collect())
                .collect();
            let columns = rows[0].len();
            let design = nalgebra::DMatrix::from_fn(air.len(), columns, |i, j| rows[i][j]);
            let force = nalgebra::DVector::from_fn(air.len(), |i, _| air[i].force_n);
            let fit = design.clone().svd(true, true).solve(&force, 1e-9).ok()?;
            let variance = (force - design * &fit).norm_squared() / (air.len() - columns) as f64;
            Some((fit, variance))
        };
        let Some((_, variance)) = regression(&|b| vec![1.0, b.time_s - t0, 1e3 * (b.position_m - z0)]) else {
            return false;
        };
        let mut bends: Vec<f64> =
            air.windows(3).map(|w| (w[0].force_n - 2.0 * w[1].force_n + w[2].force_n).abs()).collect();
        bends.sort_by(f64::total_cmp);
        let noise_n = SECOND_DIFFERENCE_SD * bends.get(bends.len() / 2).copied().unwrap_or(0.0);
        let forces = self.blocks.iter().map(|b| b.force_n);
        let range_n = forces.clone().fold(f64::NEG_INFINITY, f64::max) - forces.fold(f64::INFINITY, f64::min);
        let least_n = MIN_RANGE_SHARE * range_n;
        if variance > MAX_VARIANCE_RATIO * noise_n * noise_n && variance > least_n * least_n {
            return true;
        }
        let line = regression(&|b| vec![1.0, 1e3 * (b.position_m - z0)]);
        let steepest = self.first_stiffness_n_per_m.filter(|_| contact_m.is_some());
        line.zip(steepest).is_some_and(|((fit, _), stiffness)| 1e3 * fit[1] > stiffness)
    }

    /// Whether the speed changes at a time (s): between the two blocks before and the two after.
    fn speed_changes_at(&self, time_s: f64) -> bool {
        let at = self.blocks.partition_point(|b| b.time_s < time_s);
        let speed = |from: usize| {
            let [a, b] = [self.blocks.get(from)?, self.blocks.get(from + 1)?];
            Some((b.position_m - a.position_m) / (b.time_s - a.time_s))
        };
        let (Some(before), Some(after)) = (at.checked_sub(3).and_then(speed), speed(at + 1)) else {
            return false;
        };
        (after - before).abs() > MIN_SPEED_CHANGE_SHARE * before.abs().max(after.abs())
    }
}

#[cfg(test)]
mod tests;
