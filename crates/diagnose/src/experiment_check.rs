//! Checks before the effect search what recordings can show about a scenario.

use crate::base_law_fit::{PreparedRecordings, assumptions_of, fit_base_law};
use crate::check_json::{CheckItem, EffectVisibility, Rating};
use crate::claims::have_one_motion;
use crate::confidence_intervals::Covariance;
use crate::diagnosis_json::{BaseParameter, LabelledParameter, ParameterLabel};
use crate::error::DiagnoseError;
use crate::identifiability::visible_effects;
use crate::input_checks::{
    CleanRecordings, NamedRecording, average_blocks, check_recordings, clean_recordings,
};
use crate::parameter_labels::label_parameters;
use crate::verdict::{BOOTSTRAP_SEED, base_parameters};
use rand::{SeedableRng, rngs::ChaCha8Rng};
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use stylet_core::{EnhanceConfig, Sample};
use stylet_record::{QualityKind, QualityNote, Recording};
use stylet_scenario::Scenario;
use stylet_score::{ContactFinding, ContactHypothesis, Trace};
use stylet_stats::parallel::*;
use stylet_tissue::Tissue;

/// Ratio below which the speeds inside the tissue count as one.
const ONE_SPEED_FACTOR: f64 = 1.2;
/// Share of the largest speed below which the needle holds.
const HOLD_SHARE: f64 = 0.05;
/// Duration (s) from which a hold shows relaxation.
const MIN_HOLD_S: f64 = 0.5;

/// Result of the check, serialised as `check.json`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ExperimentCheck {
    /// The aspects, most important first.
    pub items: Vec<CheckItem>,
    /// Estimated parameters of the base law, without effects.
    pub base_parameters: Vec<BaseParameter>,
    /// Identifiability of each parameter.
    pub parameters: Vec<LabelledParameter>,
    /// Detectable size of each library effect.
    pub effects: Vec<EffectVisibility>,
}

impl ExperimentCheck {
    /// Whether no item rates the recordings unusable.
    #[must_use]
    pub fn is_usable(&self) -> bool {
        self.items.iter().all(|item| item.light != Rating::Unusable)
    }
}

/// Checks what recordings can show about a scenario, before effects are searched. Reasons against a diagnosis are items of the result, not
/// errors.
///
/// # Errors
/// [`DiagnoseError::NoFit`] when the scenario cannot be replayed along the recordings.
pub fn check_experiment(
    scenario: &Scenario,
    recordings: &[NamedRecording],
) -> Result<ExperimentCheck, DiagnoseError> {
    let mut out = ExperimentCheck::default();
    if let Err(why) = check_recordings(scenario, recordings) {
        out.items.push(CheckItem::new("recordings", Rating::Unusable, why.to_string()));
        return Ok(out);
    }
    let CleanRecordings { recordings: clean, notes, raw } = clean_recordings(recordings);
    out.items = check_before_fit(scenario, recordings, &clean, &notes);
    let blocks = average_blocks(&clean, &raw);
    let prepared =
        PreparedRecordings::new(Arc::new(assumptions_of(scenario)), blocks, raw.quantisation_sd_n());
    let (fit, data) = fit_base_law(&prepared).ok_or(DiagnoseError::NoFit)?;
    let covariance = Covariance::new(&fit, &data, &mut ChaCha8Rng::seed_from_u64(BOOTSTRAP_SEED));
    out.base_parameters = base_parameters(&covariance);
    out.parameters = label_parameters(&covariance, &data, &out.base_parameters, &[]).0;
    out.effects = visible_effects(&fit, &data);
    out.items.push(parameters_item(&out.parameters));
    out.items.push(effects_item(&out.effects));
    Ok(out)
}

/// Checks that need no fit: data quality, contact, motion and depth. `clean` are the recordings without non-finite samples, `notes` the
/// notes on their quality.
pub(crate) fn check_before_fit(
    scenario: &Scenario,
    recordings: &[NamedRecording],
    clean: &[Recording],
    notes: &[Vec<QualityNote>],
) -> Vec<CheckItem> {
    let mut items = Vec::new();
    let all = recordings.iter().zip(notes).flat_map(|(r, notes)| notes.iter().map(move |n| (r, n)));
    let (converted, remarks): (Vec<_>, Vec<_>) = all.partition(|(_, n)| n.kind == QualityKind::Converted);
    for (r, note) in remarks {
        let light = if note.blocking { Rating::Unusable } else { Rating::Limited };
        items.push(CheckItem::new("recordings", light, format!("{}: {}", r.name, note.message)));
    }
    if items.is_empty() {
        let what = if clean.len() == 1 { "one recording" } else { "recordings" };
        let hz = stylet_stats::median_of(clean.iter().map(Recording::sample_hz));
        let message = format!("{what} without gaps or spikes, {hz:.0} Hz");
        items.push(CheckItem::new("recordings", Rating::Good, message));
    }
    let mut conversions: Vec<&str> = converted.iter().map(|(_, note)| note.message.as_str()).collect();
    let mut known = std::collections::BTreeSet::new();
    conversions.retain(|message| known.insert(*message));
    if !conversions.is_empty() {
        items.push(CheckItem::new("recordings", Rating::Good, conversions.join("; ")));
    }
    if clean.len() == 1 {
        let message = "one recording: no prediction can be tested on another; record at least two";
        items.push(CheckItem::new("recordings", Rating::Limited, message.to_owned()));
    }
    items.extend(check_contact(recordings, clean));
    items.extend(check_motion(&scenario.tissue, clean));
    items
}

/// Contact at the start of each recording, from the online algorithm.
fn check_contact(recordings: &[NamedRecording], clean: &[Recording]) -> Vec<CheckItem> {
    let config = EnhanceConfig::default();
    let find = |r: &Recording| {
        Trace::run_measured(r, &r.force_n, &config, 0.0, None::<fn(&Sample, usize) -> f64>).contact
    };
    let found: Vec<ContactFinding> = clean.par_iter().map(find).collect();
    let is_none = |c: &ContactFinding| {
        matches!(c.hypothesis, ContactHypothesis::NeverTouches | ContactHypothesis::AtRest)
    };
    let all_without = found.iter().all(is_none);
    let item = |(r, contact): (&NamedRecording, &ContactFinding)| {
        let light = match contact.hypothesis {
            _ if is_none(contact) && all_without => Rating::Unusable,
            ContactHypothesis::ConstantOffset => Rating::Good,
            _ => Rating::Limited,
        };
        CheckItem::new("contact", light, format!("{}: {}", r.name, contact.sentence()))
    };
    recordings.iter().zip(&found).map(item).collect()
}

/// Excitation by the motion: speeds, holds, retraction, depth.
fn check_motion(tissue: &Tissue, recordings: &[Recording]) -> Vec<CheckItem> {
    let mut items = Vec::new();
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
    items.push(if fastest > ONE_SPEED_FACTOR * slowest {
        let message = format!("speeds from {} to {} in the tissue", mm(slowest), mm(fastest));
        CheckItem::new("motion", Rating::Good, message)
    } else {
        let message = format!(
            "one constant speed of {} in the tissue: most friction laws look the same, and the stiffness of a layer separates from its \
             friction only where it ruptures; vary the speed within each layer",
            mm(fastest)
        );
        CheckItem::new("motion", Rating::Limited, message)
    });
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
        items.push(CheckItem::new("motion", Rating::Limited, missing.join("; ")));
    }
    let unreached = (0..tissue.layers.len()).filter(|k| tissue.front_m(*k) >= deepest_m).count();
    if unreached > 0 {
        let message = format!(
            "the needle reaches {:.1} mm and not the last {unreached} of {} layers: their numbers stay as assumed",
            1e3 * deepest_m,
            tissue.layers.len()
        );
        items.push(CheckItem::new("depth", Rating::Limited, message));
    }
    items
}

/// Item: number of determined layer parameters.
pub(crate) fn parameters_item(parameters: &[LabelledParameter]) -> CheckItem {
    let of_layers = || parameters.iter().filter(|p| p.effect.is_none());
    let open: Vec<String> = of_layers()
        .filter(|p| p.label != ParameterLabel::Determined)
        .map(|p| format!("{p} ({})", p.label_in_words()))
        .collect();
    let total = of_layers().count();
    if open.is_empty() {
        let message = format!("all {total} parameters of the layers are determined");
        return CheckItem::new("parameters", Rating::Good, message);
    }
    let message =
        format!("{} of {total} parameters are determined; not: {}", total - open.len(), open.join(", "));
    CheckItem::new("parameters", Rating::Limited, message)
}

/// Item: number of effects detectable at their typical size.
pub(crate) fn effects_item(effects: &[EffectVisibility]) -> CheckItem {
    let hidden: Vec<&str> = effects.iter().filter(|e| !e.visible).map(|e| e.effect.as_str()).collect();
    let total = effects.len();
    if hidden.is_empty() {
        let message = format!("all {total} effects would be seen at their typical size");
        return CheckItem::new("effects", Rating::Good, message);
    }
    let seen = total - hidden.len();
    let message =
        format!("{seen} of {total} effects would be seen at their typical size; not: {}", hidden.join(", "));
    CheckItem::new("effects", Rating::Limited, message)
}
