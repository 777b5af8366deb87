//! Before the fit: what recordings can show, and what they cannot.

use crate::base_law_fit::{PreparedRecordings, fit_base_law};
use crate::claims::have_one_motion;
use crate::confidence_intervals::Covariance;
use crate::diagnose::assumptions_of;
use crate::diagnosis_json::{BaseParameter, LabelledParameter, ParameterLabel};
use crate::error::DiagnoseError;
use crate::identifiability::{MIN_DETECTABLE_NATS, typical_size};
use crate::input_checks::{CleanRecordings, NamedRecording, check_recordings, clean_recordings};
use crate::parameter_labels::label_parameters;
use crate::verdict::base_parameters;
use rand::{SeedableRng, rngs::ChaCha8Rng};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Arc;
use stylet_core::{EnhanceConfig, Sample};
use stylet_identify::block_averages::{BLOCK_S, BlockAverages};
use stylet_identify::score_test::{ScoreTest, scale_strengths};
use stylet_record::Recording;
use stylet_scenario::Scenario;
use stylet_score::{ContactFinding, ContactHypothesis, Trace};
use stylet_tissue::EffectInfo;

/// Speeds inside the tissue that differ by less than this factor count as one.
const ONE_SPEED_FACTOR: f64 = 1.2;
/// A speed below this share of the largest one is a hold.
const HOLD_SHARE: f64 = 0.05;
/// A hold of this duration in s shows relaxation.
const MIN_HOLD_S: f64 = 0.5;
/// Largest multiple of an effect's typical size that is plausible.
const MAX_PLAUSIBLE_FACTOR: f64 = 30.0;
/// Seed of the bootstrap: equal recordings give equal results.
const BOOTSTRAP_SEED: u64 = 1;

/// How far recordings serve.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Light {
    /// Nothing stands against a diagnosis.
    Good,
    /// A diagnosis will be limited.
    Limited,
    /// A diagnosis would mean nothing.
    Unusable,
}

impl Light {
    /// As the command and its report print it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Light::Good => "good",
            Light::Limited => "limited",
            Light::Unusable => "unusable",
        }
    }
}

/// One aspect of an experiment.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct CheckItem {
    /// What was checked: `recordings`, `contact`, `motion`, `depth`, `parameters` or `effects`.
    pub topic: String,
    /// How far the recordings serve.
    pub light: Light,
    /// The reason, in one sentence.
    pub message: String,
}

/// From which size on an effect would be seen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EffectVisibility {
    /// Effect id.
    pub effect: String,
    /// Whether its typical size would be seen.
    pub visible: bool,
    /// Parameters at the smallest size that would be seen; `None` when no plausible size would.
    pub smallest: Option<BTreeMap<String, f64>>,
}

/// What recordings can show: `check.json`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ExperimentCheck {
    /// The aspects, in the order in which to read them.
    pub items: Vec<CheckItem>,
    /// Parameters of the base law as these recordings determine them, without any effect.
    pub base_parameters: Vec<BaseParameter>,
    /// What the recordings say about each of them.
    pub parameters: Vec<LabelledParameter>,
    /// The effects of the library.
    pub effects: Vec<EffectVisibility>,
}

impl ExperimentCheck {
    /// Whether a diagnosis would mean anything.
    #[must_use]
    pub fn is_usable(&self) -> bool {
        self.items.iter().all(|item| item.light != Light::Unusable)
    }

    fn add(&mut self, topic: &str, light: Light, message: String) {
        self.items.push(CheckItem { topic: topic.to_owned(), light, message });
    }
}

/// Checks what recordings can show about a scenario, before any effect is searched. What makes a diagnosis meaningless is an item of the
/// result, not an error.
///
/// # Errors
/// [`DiagnoseError::NoFit`] when the scenario cannot be replayed along the recordings.
pub fn check_experiment(
    scenario: &Scenario,
    recordings: &[NamedRecording],
) -> Result<ExperimentCheck, DiagnoseError> {
    let mut out = ExperimentCheck::default();
    if let Err(why) = check_recordings(scenario, recordings) {
        out.add("recordings", Light::Unusable, why.to_string());
        return Ok(out);
    }
    let CleanRecordings { recordings: clean, notes, raw } = clean_recordings(recordings);
    for (r, note) in recordings.iter().zip(&notes).flat_map(|(r, notes)| notes.iter().map(move |n| (r, n))) {
        let light = if note.blocking { Light::Unusable } else { Light::Limited };
        out.add("recordings", light, format!("{}: {}", r.name, note.message));
    }
    if out.items.is_empty() {
        let what = if clean.len() == 1 { "one recording" } else { "recordings" };
        let hz = stylet_stats::median_of(clean.iter().map(Recording::sample_hz));
        out.add("recordings", Light::Good, format!("{what} without gaps or spikes, {hz:.0} Hz"));
    }
    if clean.len() == 1 {
        out.add(
            "recordings",
            Light::Limited,
            "one recording: no prediction can be tested on another; record at least two".to_owned(),
        );
    }
    check_contact(&mut out, recordings, &clean);
    check_motion(&mut out, scenario, &clean);
    let blocks: Vec<BlockAverages> =
        clean.par_iter().zip(&raw.exclude).map(|(r, x)| BlockAverages::new(r, x, BLOCK_S)).collect();
    let min_noise_n = raw.step_n.unwrap_or(0.0) * stylet_stats::UNIFORM_SD;
    let prepared = PreparedRecordings::new(Arc::new(assumptions_of(scenario)), blocks, min_noise_n);
    let (fit, data) = fit_base_law(&prepared).ok_or(DiagnoseError::NoFit)?;
    let covariance = Covariance::new(&fit, &data, &mut ChaCha8Rng::seed_from_u64(BOOTSTRAP_SEED));
    out.base_parameters = base_parameters(&covariance);
    out.parameters = label_parameters(&covariance, &data, &out.base_parameters, &[]).0;
    check_parameters(&mut out);
    let score_test = ScoreTest::new(&fit, &data);
    let effects: Vec<&'static EffectInfo> = fit.model.assumed.candidates().collect();
    out.effects = effects.par_iter().filter_map(|info| visibility(info, &score_test)).collect();
    check_effects(&mut out);
    Ok(out)
}

/// How each recording begins, by the online algorithm.
fn check_contact(out: &mut ExperimentCheck, recordings: &[NamedRecording], clean: &[Recording]) {
    let config = EnhanceConfig::default();
    let find = |r: &Recording| {
        Trace::run_measured(r, &r.force_n, &config, 0.0, None::<fn(&Sample, usize) -> f64>).contact
    };
    let found: Vec<ContactFinding> = clean.par_iter().map(find).collect();
    let is_none = |c: &ContactFinding| {
        matches!(c.hypothesis, ContactHypothesis::NeverTouches | ContactHypothesis::AtRest)
    };
    let all_without = found.iter().all(is_none);
    for (r, contact) in recordings.iter().zip(&found) {
        let light = match contact.hypothesis {
            _ if is_none(contact) && all_without => Light::Unusable,
            ContactHypothesis::ConstantOffset => Light::Good,
            _ => Light::Limited,
        };
        out.add("contact", light, format!("{}: {}", r.name, contact.sentence()));
    }
}

/// What the motion excites: speeds, holds, retraction, and depth.
fn check_motion(out: &mut ExperimentCheck, scenario: &Scenario, recordings: &[Recording]) {
    let tissue = &scenario.tissue;
    let (mut slowest, mut fastest) = (f64::INFINITY, 0.0_f64);
    let (mut hold_s, mut is_retracted, mut deepest_m) = (0.0_f64, false, f64::NEG_INFINITY);
    let peak_mps = recordings.iter().flat_map(|r| &r.velocity_mps).fold(0.0, |m: f64, v| m.max(v.abs()));
    for r in recordings {
        let step_s = r.median_interval_s();
        let mut held_s = 0.0;
        for s in r.samples().filter(|s| s.position_m > tissue.surface_m) {
            deepest_m = deepest_m.max(s.position_m);
            if s.velocity_mps.abs() < HOLD_SHARE * peak_mps {
                held_s += step_s;
                hold_s = hold_s.max(held_s);
                continue;
            }
            held_s = 0.0;
            is_retracted |= s.velocity_mps < 0.0;
            if s.velocity_mps > 0.0 {
                (slowest, fastest) = (slowest.min(s.velocity_mps), fastest.max(s.velocity_mps));
            }
        }
    }
    let mm = |mps: f64| format!("{:.3} mm/s", 1e3 * mps);
    if fastest > ONE_SPEED_FACTOR * slowest {
        out.add(
            "motion",
            Light::Good,
            format!("speeds from {} to {} in the tissue", mm(slowest), mm(fastest)),
        );
    } else {
        out.add(
            "motion",
            Light::Limited,
            format!(
                "one constant speed of {} in the tissue: most friction laws look the same, and the stiffness of a layer separates from its friction \
                 only where it ruptures; vary the speed within each layer",
                mm(fastest)
            ),
        );
    }
    let missing: Vec<&str> = [
        (hold_s < MIN_HOLD_S, "no hold inside the tissue, which would show relaxation"),
        (!is_retracted, "no retraction, which would show friction alone"),
        (
            have_one_motion(recordings),
            "all recordings have the same motion: a second one would confirm a cause",
        ),
    ]
    .into_iter()
    .filter_map(|(is_missing, what)| is_missing.then_some(what))
    .collect();
    if !missing.is_empty() {
        out.add("motion", Light::Limited, missing.join("; "));
    }
    let unreached = (0..tissue.layers.len()).filter(|k| tissue.front_m(*k) >= deepest_m).count();
    if unreached > 0 {
        out.add(
            "depth",
            Light::Limited,
            format!(
                "the needle reaches {:.1} mm and not the last {unreached} of {} layers: their numbers stay as assumed",
                1e3 * deepest_m,
                tissue.layers.len()
            ),
        );
    }
}

fn check_parameters(out: &mut ExperimentCheck) {
    let open: Vec<String> = out
        .parameters
        .iter()
        .filter(|p| p.label != ParameterLabel::Determined)
        .map(|p| format!("{p} ({})", p.label_in_words()))
        .collect();
    let total = out.parameters.len();
    if open.is_empty() {
        out.add("parameters", Light::Good, format!("all {total} parameters of the layers are determined"));
    } else {
        let count = total - open.len();
        let message = format!("{count} of {total} parameters are determined; not: {}", open.join(", "));
        out.add("parameters", Light::Limited, message);
    }
}

fn check_effects(out: &mut ExperimentCheck) {
    let hidden: Vec<&str> = out.effects.iter().filter(|e| !e.visible).map(|e| e.effect.as_str()).collect();
    let total = out.effects.len();
    if hidden.is_empty() {
        out.add("effects", Light::Good, format!("all {total} effects would be seen at their typical size"));
    } else {
        let message = format!(
            "{} of {total} effects would be seen at their typical size; not: {}",
            total - hidden.len(),
            hidden.join(", ")
        );
        out.add("effects", Light::Limited, message);
    }
}

/// Visibility of an effect; `None` for those that have no column to test.
fn visibility(info: &'static EffectInfo, score_test: &ScoreTest) -> Option<EffectVisibility> {
    let (values, nats) = typical_size(info, score_test)?;
    let factor = (MIN_DETECTABLE_NATS / nats.max(1e-12)).sqrt();
    let smallest = (factor <= MAX_PLAUSIBLE_FACTOR).then(|| {
        let scaled = scale_strengths(info, &[&values], &[factor]);
        info.parameters.iter().map(|p| p.path.to_owned()).zip(scaled).collect()
    });
    Some(EffectVisibility { effect: info.id.to_owned(), visible: nats >= MIN_DETECTABLE_NATS, smallest })
}
