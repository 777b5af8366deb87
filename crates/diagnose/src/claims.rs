//! Derives agreement, verdict and confidence of a diagnosis from its numbers by one rule.
//!
//! Input: a finished diagnosis with held-out errors, noise, residual tests, parameters at bounds and scatter between recordings. Output:
//! [`Diagnosis::findings`], and agreement, verdict and confidences that do not contradict them.

use crate::base_law_fit::MAX_REPLAYS;
use crate::check_json::Rating;
use crate::diagnosis_json::{
    BaseParameter, Diagnosis, Finding, FindingKind, Gain, ResidualStructureReport, Verdict,
};
use stylet_record::{QualityKind, Recording};
use stylet_scenario::Scenario;
use stylet_stats::number_format::{p_value, significant};

/// Ratio of the prediction error (given the scatter between recordings) to the noise above which predictions contradict the model.
const MAX_ERROR_RATIO: f64 = 2.0;
/// p-value below which the residual depends on a feature.
pub const SIGNIFICANT_P_VALUE: f64 = 1e-3;
/// Relative standard deviation of puncture force or friction between recordings from which one model does not describe them.
const MAX_RELATIVE_SCATTER: f64 = 0.3;
/// Standard deviation (m) of rupture depth or surface between recordings from which one model does not describe them.
const MAX_SCATTER_M: f64 = 5e-3;
/// Ratio to its reference above which the noise counts as too high: sensors of one type differ by less.
const MAX_NOISE_RATIO: f64 = 5.0;
/// Largest confidence of a cause together with a finding that contradicts the model.
pub const MAX_CONFIDENCE_CONTRADICTED: f64 = 0.8;
/// Largest confidence of a cause from one recording, which no prediction confirms, or from recordings of one motion, in which effects of
/// time, depth or speed can coincide.
const MAX_CONFIDENCE_FEW: f64 = 0.9;
/// Largest RMS difference of the positions of recordings with the same motion, as a share of the travel.
const SAME_MOTION_SHARE: f64 = 0.01;
/// Number of positions compared.
const MOTION_POINTS: usize = 200;

/// Input of the rule in addition to the diagnosis.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Context {
    /// Whether all of several recordings have the same motion.
    pub one_motion: bool,
    /// Noise of the scenario's sensor in N.
    pub sensor_noise_n: Option<f64>,
    /// Noise of the samples in air in N.
    pub air_noise_n: Option<f64>,
    /// Resolution of the recorded force in N; errors of this size are not a misfit.
    pub resolution_n: f64,
    /// Whether the search for effects ended at its limit.
    pub is_search_limit_reached: bool,
}

/// Adds the findings to a diagnosis, and sets agreement, verdict and confidences from them.
pub(crate) fn apply(d: &mut Diagnosis, context: &Context) {
    d.findings = findings(d, context);
    if d.verdict == Verdict::None && d.base_parameters.iter().any(|b| b.out_of_tolerance) {
        d.verdict = Verdict::Parameters;
    }
    let contradicted = d.findings.iter().any(|f| contradicts(f.kind));
    d.agrees = d.verdict == Verdict::None && !contradicted;
    let most = max_confidence(&d.findings);
    for cause in &mut d.causes {
        cause.confidence = cause.confidence.min(most);
    }
}

/// Whether a finding contradicts agreement.
#[must_use]
pub fn contradicts(kind: FindingKind) -> bool {
    use FindingKind as K;
    !matches!(kind, K::OneRecording | K::OneMotion | K::OutOfTolerance | K::LayerCount)
}

/// Largest confidence that these findings allow.
fn max_confidence(findings: &[Finding]) -> f64 {
    let most = |f: &Finding| match f.kind {
        FindingKind::OneRecording | FindingKind::OneMotion => MAX_CONFIDENCE_FEW,
        FindingKind::OutlierRecording | FindingKind::OutOfTolerance | FindingKind::LayerCount => 1.0,
        _ => MAX_CONFIDENCE_CONTRADICTED,
    };
    findings.iter().map(most).fold(1.0, f64::min)
}

fn findings(d: &Diagnosis, context: &Context) -> Vec<Finding> {
    let mut out = Vec::new();
    let mut add = |kind: FindingKind, message: Option<String>| {
        out.extend(message.map(|message| Finding { kind, message }));
    };
    for item in d.check.iter().filter(|item| item.light == Rating::Unusable) {
        let message = format!("diagnosed although it means nothing: {}", item.message);
        add(FindingKind::Unusable, Some(message));
    }
    for b in d.base_parameters.iter().filter(|b| b.out_of_tolerance) {
        add(FindingKind::OutOfTolerance, Some(out_of_tolerance(b)));
    }
    add(FindingKind::PredictionError, prediction_error(&d.gain, context.resolution_n));
    add(FindingKind::ResidualStructure, residual_structure(&d.residual_structure));
    add(FindingKind::AtBound, parameters_at_bound(d));
    add(FindingKind::Scatter, scatter(d));
    add(FindingKind::NoiseLevel, noise_level(d.gain.floor_n, context));
    let search_limit = format!(
        "the search for effects ended at its limit of {MAX_REPLAYS} replays, a further effect may be missing: diagnose fewer or shorter \
        recordings"
    );
    add(FindingKind::SearchLimit, context.is_search_limit_reached.then_some(search_limit));
    for q in d.data_quality.iter().filter(|q| q.note.kind == QualityKind::OutlierRecording) {
        let message = format!("{} is not like the other recordings", q.recording);
        add(FindingKind::OutlierRecording, Some(message));
    }
    let few = match d.gain.recordings.len() {
        1 => Some((FindingKind::OneRecording, "one recording: the model predicted no other")),
        _ if context.one_motion => Some((
            FindingKind::OneMotion,
            "all recordings have the same motion: causes that differ under another one cannot be distinguished",
        )),
        _ => None,
    };
    if let Some((kind, what)) = few {
        let limit = match d.causes.is_empty() {
            true => String::new(),
            false => format!(", so no cause has a confidence above {MAX_CONFIDENCE_FEW}"),
        };
        add(kind, Some(format!("{what}{limit}")));
    }
    out
}

/// Finding: prediction errors above noise and scatter between recordings.
fn prediction_error(g: &Gain, resolution_n: f64) -> Option<String> {
    let floor_n = g.floor_n.max(resolution_n);
    let misfit_n = g.misfit_n();
    (misfit_n > MAX_ERROR_RATIO * floor_n && floor_n > 0.0).then(|| {
        let what = if g.held_out { "held-out recordings are predicted" } else { "the recording is fitted" };
        format!(
            "{what} to {} N, {} times the noise of {} N",
            significant(misfit_n, 3),
            significant(misfit_n / floor_n, 2),
            significant(floor_n, 3)
        )
    })
}

/// Finding: a residual that depends on a feature.
fn residual_structure(structure: &ResidualStructureReport) -> Option<String> {
    let on = structure.depends_on.join(", ");
    (structure.p_value < SIGNIFICANT_P_VALUE)
        .then(|| format!("the residual depends on {on} ({})", p_value(structure.p_value)))
}

/// Finding: parameters at their bounds.
fn parameters_at_bound(d: &Diagnosis) -> Option<String> {
    let base = d.base_parameters.iter().filter(|b| b.at_bound && !b.at_least).map(parameter_name);
    let of_causes =
        d.causes.iter().flat_map(|c| c.at_bound.iter().map(|path| format!("{path} of {}", c.effect)));
    let all: Vec<String> = base.chain(of_causes).collect();
    let stand = if all.len() == 1 { "is at its bound" } else { "are at their bounds" };
    (!all.is_empty()).then(|| {
        format!("{} {stand}: the data ask for another value, or do not determine one", all.join(", "))
    })
}

/// Compares the fitted parameters with the scenario's values and tolerances, even if the fit started from others.
pub(crate) fn compare_with_scenario(parameters: &mut [BaseParameter], scenario: &Scenario) {
    // Fronts are compared relative to the surface, which is reported itself.
    let surface = parameters.iter().find(|b| b.name == "surface_m");
    let surface_m = surface.map_or(scenario.tissue.surface_m, |b| b.value);
    for b in parameters {
        let layer = b.layer.checked_sub(1).and_then(|l| scenario.tissue.layers.get(l));
        let (assumed, tolerance) = match (b.name.as_str(), layer) {
            ("stiffness_n_per_m", Some(l)) => (l.stiffness_n_per_m, scenario.tolerance * l.stiffness_n_per_m),
            ("friction_ns_per_m2", Some(l)) => {
                (l.friction_ns_per_m2, scenario.tolerance * l.friction_ns_per_m2)
            }
            // Sets have a puncture force of every layer, also of one that the scenario gives none.
            ("puncture_n", Some(l)) if l.puncture_n.is_some() || b.assumed > 0.0 => {
                let assumed = l.puncture_n.unwrap_or(b.assumed);
                (assumed, scenario.tolerance * assumed)
            }
            ("thickness_m", Some(l)) => (l.thickness_m, scenario.thickness_tolerance * l.thickness_m),
            // The front of the first layer is the surface.
            ("front_m", Some(_)) if b.layer > 1 => {
                let depth_m = scenario.tissue.front_m(b.layer - 1) - scenario.tissue.surface_m;
                (surface_m + depth_m, scenario.surface_tolerance_m + scenario.thickness_tolerance * depth_m)
            }
            ("surface_m", _) => (scenario.tissue.surface_m, scenario.surface_tolerance_m),
            _ => continue,
        };
        b.assumed = assumed;
        b.changed = assumed < b.low || assumed > b.high;
        b.out_of_tolerance = b.low > assumed + tolerance || (b.high < assumed - tolerance && !b.at_least);
    }
}

/// Message for a parameter outside its tolerance.
fn out_of_tolerance(b: &BaseParameter) -> String {
    let (scale, unit) = match b.name.as_str() {
        "stiffness_n_per_m" => (1.0, "N/m"),
        "friction_ns_per_m2" => (1.0, "N s/m²"),
        "puncture_n" => (1.0, "N"),
        _ => (1e3, "mm"),
    };
    let what = b.name.split('_').next().unwrap_or_default();
    let what = match what {
        "puncture" => "puncture force",
        what => what,
    };
    let is_position = b.layer == 0 || b.name == "front_m";
    let of_layer = if b.layer > 0 { format!(" of layer {}", b.layer) } else { String::new() };
    let of =
        if is_position { format!("position of the {what}{of_layer}") } else { what.to_owned() + &of_layer };
    let number = |x: f64| significant(scale * x, 3);
    let off = if is_position {
        format!("off by {} mm", number((b.value - b.assumed).abs()))
    } else {
        let (factor, word) =
            if b.assumed > b.value { (b.assumed / b.value, "large") } else { (b.value / b.assumed, "small") };
        format!("{} times too {word}", significant(factor, 2))
    };
    let fitted = if b.at_least {
        format!("at least {}", number(b.low))
    } else {
        format!("{} ({} to {})", number(b.value), number(b.low), number(b.high))
    };
    format!("the assumed {of} is {off}: {fitted}, not {} {unit}", number(b.assumed))
}

/// Name of a base parameter with its layer.
#[must_use]
pub fn parameter_name(b: &BaseParameter) -> String {
    if b.layer == 0 { b.name.clone() } else { format!("{} of layer {}", b.name, b.layer) }
}

/// Finding: scatter between recordings that one model does not describe.
fn scatter(d: &Diagnosis) -> Option<String> {
    let s = &d.random_effect_sd;
    let mut what = Vec::new();
    for (name, share) in [("puncture forces", s.puncture), ("friction", s.friction)] {
        if share >= MAX_RELATIVE_SCATTER {
            what.push(format!("{name} by {} %", significant(100.0 * share, 2)));
        }
    }
    for (name, m) in [("rupture depths", s.rupture_depth_m), ("the surface", s.surface_m)] {
        if m >= MAX_SCATTER_M {
            what.push(format!("{name} by {} mm", significant(1e3 * m, 2)));
        }
    }
    (!what.is_empty()).then(|| {
        format!("recordings differ too much for one model: {} (one standard deviation)", what.join(", "))
    })
}

/// Finding: noise far above that of the sensor or that in air.
fn noise_level(noise_n: f64, context: &Context) -> Option<String> {
    let references =
        [(context.sensor_noise_n, "that of the scenario's sensor"), (context.air_noise_n, "that in air")];
    let above = |(reference, what): (Option<f64>, &str)| {
        let reference_n = reference?.max(context.resolution_n);
        (reference_n > 0.0 && noise_n > MAX_NOISE_RATIO * reference_n).then(|| {
            format!(
                "the noise of {} N is {} times {what}, {} N",
                significant(noise_n, 3),
                significant(noise_n / reference_n, 2),
                significant(reference_n, 3)
            )
        })
    };
    references.into_iter().find_map(above)
}

/// Whether two or more recordings all have the same motion.
pub(crate) fn have_one_motion(recordings: &[Recording]) -> bool {
    let Some((first, others)) = recordings.split_first().filter(|(_, others)| !others.is_empty()) else {
        return false;
    };
    let reference = resampled(first);
    let travel_m = range(&reference);
    let duration_s = duration(first);
    others.iter().all(|r| {
        let z = resampled(r);
        let square: f64 =
            z.iter().zip(&reference).map(|(a, b)| (a - b) * (a - b)).sum::<f64>() / MOTION_POINTS as f64;
        (duration(r) / duration_s.max(1e-9) - 1.0).abs() < SAME_MOTION_SHARE
            && square.sqrt() <= SAME_MOTION_SHARE * travel_m.max(range(&z))
    })
}

fn duration(r: &Recording) -> f64 {
    r.time_s.last().zip(r.time_s.first()).map_or(0.0, |(b, a)| b - a)
}

fn range(x: &[f64]) -> f64 {
    let (low, high) = stylet_stats::extremes(x);
    (high - low).max(0.0)
}

/// Positions at evenly spaced times.
fn resampled(r: &Recording) -> Vec<f64> {
    let (start_s, duration_s) = (r.time_s.first().copied().unwrap_or(0.0), duration(r));
    let last = r.len().saturating_sub(1);
    (0..MOTION_POINTS)
        .map(|k| {
            let t = start_s + duration_s * k as f64 / (MOTION_POINTS - 1) as f64;
            let i = r.time_s.partition_point(|x| *x < t).min(last);
            r.position_m.get(i).copied().unwrap_or(0.0)
        })
        .collect()
}

#[cfg(test)]
mod tests;
