//! Determines the number of layers from the recordings, without a scenario or where they contradict it.

use crate::base_law_fit::ReplayCount;
use crate::claims;
use crate::diagnose::{DiagnosisResult, Options, diagnose_given_layers, simple_explanation};
use crate::diagnosis_json::{Diagnosis, Finding, FindingKind, Verdict};
use crate::error::DiagnoseError;
use crate::found_tissue::FoundTissue;
use crate::input_checks::{CleanRecordings, NamedRecording, check_length, clean_recordings};
use stylet_identify::model::Assumptions;
use stylet_scenario::{Motion, Scenario};
use stylet_score::MIN_FORCE_SHARE;
use stylet_tissue::Tissue;

/// Finds the layers that recordings show (`layers` of them, or all) and diagnoses the recordings with them under weak priors. Returns the
/// scenario at the start and the diagnosis.
///
/// Without `layers`, a last layer without elastic force is the space behind the tissue, and the diagnosis is repeated without it.
///
/// # Errors
/// [`DiagnoseError`] when a recording is too short, none has a contact, or fewer than `layers` are found.
pub fn identify(
    name: &str,
    recordings: &[NamedRecording],
    layers: Option<usize>,
    options: &Options,
    mut progress: impl FnMut(&str),
) -> Result<(Scenario, DiagnosisResult), DiagnoseError> {
    let progress: &mut dyn FnMut(&str) = &mut progress;
    progress("looking for layers");
    let scenario = scenario_from_recordings(name, recordings, layers)?;
    let replayed = ReplayCount::default();
    if layers.is_some() {
        let result = diagnose_given_layers(&scenario, recordings, options, &replayed, progress)?;
        return Ok((scenario, result.with_proposals(options, progress)));
    }
    let (scenario, result) =
        diagnose_without_empty_layer(scenario, recordings, options, &replayed, progress)?;
    Ok((scenario, result.with_proposals(options, progress)))
}

/// Compares recordings with the prediction of a scenario. If findings contradict the result, and another number of layers with at most one
/// effect leaves only noise, the diagnosis is repeated with those layers; that result is returned, with a finding, if no finding
/// contradicts it.
///
/// # Errors
/// [`DiagnoseError`] when the recordings do not fit the scenario.
pub fn diagnose(
    scenario: &Scenario,
    recordings: &[NamedRecording],
    options: &Options,
    mut progress: impl FnMut(&str),
) -> Result<DiagnosisResult, DiagnoseError> {
    let result = diagnose_with_layers_of_data(scenario, recordings, options, &mut progress)?;
    Ok(result.with_proposals(options, &mut progress))
}

/// As [`diagnose`], without proposed formulas.
fn diagnose_with_layers_of_data(
    scenario: &Scenario,
    recordings: &[NamedRecording],
    options: &Options,
    progress: &mut dyn FnMut(&str),
) -> Result<DiagnosisResult, DiagnoseError> {
    let replayed = ReplayCount::default();
    let result = diagnose_given_layers(scenario, recordings, options, &replayed, progress)?;
    let is_contradicted = |d: &Diagnosis| {
        d.verdict == Verdict::Unknown || d.findings.iter().any(|f| claims::contradicts(f.kind))
    };
    if !is_contradicted(&result.diagnosis) {
        return Ok(result);
    }
    progress("looking for another number of layers");
    let Some(start) = other_layers(scenario, recordings, &replayed, progress) else {
        return Ok(result);
    };
    progress("starting again with the layers in the data");
    let (tolerance, thickness_tolerance) = (scenario.tolerance, scenario.thickness_tolerance);
    // If the diagnosis with other layers fails, the first result remains valid.
    let Ok((start, mut other)) =
        diagnose_without_empty_layer(start, recordings, options, &replayed, progress)
    else {
        return Ok(result);
    };
    let (count, assumed) = (start.tissue.layers.len(), scenario.tissue.layers.len());
    if is_contradicted(&other.diagnosis) || count == assumed {
        return Ok(result);
    }
    let message =
        format!("the recordings show {count} layer{}, not {assumed}", if count == 1 { "" } else { "s" });
    let d = &mut other.diagnosis;
    d.findings.insert(0, Finding { kind: FindingKind::LayerCount, message });
    d.agrees = false;
    if d.verdict == Verdict::None {
        d.verdict = Verdict::Parameters;
    }
    (other.extended_scenario.tolerance, other.extended_scenario.thickness_tolerance) =
        (tolerance, thickness_tolerance);
    Ok(other)
}

/// The scenario with the layers that the recordings show; `None` if these are as many as assumed, or leave more than noise with a single
/// effect, or the search has reached its limit.
fn other_layers(
    scenario: &Scenario,
    recordings: &[NamedRecording],
    replayed: &ReplayCount,
    progress: &mut dyn FnMut(&str),
) -> Option<Scenario> {
    let Scenario { tissue, tolerance, thickness_tolerance, .. } =
        scenario_from_recordings(&scenario.name, recordings, None).ok()?;
    let mut other = Scenario { tissue, tolerance, thickness_tolerance, ..scenario.clone() };
    loop {
        let fit = simple_explanation(&other, recordings, replayed, progress)?;
        let count = other.tissue.layers.len();
        if count == 1 || carries_force(&fit.model.tissue, recordings) {
            return (count != scenario.tissue.layers.len()).then_some(other);
        }
        other.tissue.layers.truncate(count - 1);
    }
}

/// Diagnoses, and repeats the diagnosis without the last layer as long as that carries no force and the search has not reached its limit.
fn diagnose_without_empty_layer(
    mut scenario: Scenario,
    recordings: &[NamedRecording],
    options: &Options,
    replayed: &ReplayCount,
    progress: &mut dyn FnMut(&str),
) -> Result<(Scenario, DiagnosisResult), DiagnoseError> {
    loop {
        let result = diagnose_given_layers(&scenario, recordings, options, replayed, progress)?;
        let count = scenario.tissue.layers.len();
        let is_cut_short = result.diagnosis.findings.iter().any(|f| f.kind == FindingKind::SearchLimit);
        if count == 1 || is_cut_short || carries_force(&result.search.best.model.tissue, recordings) {
            return Ok((scenario, result));
        }
        progress("again without the last layer, which carries no force");
        scenario.tissue.layers.truncate(count - 1);
    }
}

/// Whether the last layer's elastic force at the deepest point is a noticeable share of the largest force.
fn carries_force(tissue: &Tissue, recordings: &[NamedRecording]) -> bool {
    let Some(last) = tissue.layers.len().checked_sub(1) else { return true };
    let largest = |values: &[f64]| values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let over_all = |f: fn(&NamedRecording) -> &[f64]| {
        recordings.iter().map(|r| largest(f(r))).fold(f64::NEG_INFINITY, f64::max)
    };
    let depth_m = over_all(|r| &r.recording.position_m) - tissue.front_m(last);
    let depth_m = depth_m.min(tissue.layers[last].thickness_m);
    tissue.layers[last].stiffness_n_per_m * depth_m > MIN_FORCE_SHARE * over_all(|r| &r.recording.force_n)
}

/// A scenario with the layers that recordings show (`layers` of them, or all), and weak priors on their parameters.
///
/// # Errors
/// [`DiagnoseError`] when a recording is too short, none has a contact, or fewer than `layers` are found.
pub fn scenario_from_recordings(
    name: &str,
    recordings: &[NamedRecording],
    layers: Option<usize>,
) -> Result<Scenario, DiagnoseError> {
    check_length(recordings)?;
    let CleanRecordings { recordings: clean, .. } = clean_recordings(recordings);
    let found = FoundTissue::new(&clean, layers).ok_or(DiagnoseError::NoContact)?;
    if let Some(asked) = layers.filter(|asked| *asked > found.layers.len()) {
        return Err(DiagnoseError::FewerLayers { asked, found: found.layers.len() });
    }
    let mut scenario = Scenario::new(name.to_owned(), found.tissue(), Motion::Recorded);
    (scenario.tolerance, scenario.thickness_tolerance) =
        (Assumptions::WEAK_TOLERANCE, Assumptions::GUESSED_TOLERANCE);
    Ok(scenario)
}
