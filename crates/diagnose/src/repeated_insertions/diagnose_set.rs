//! Diagnoses a set of repeated recordings, with held-out errors.

use super::ablation::ModelTerm;
use super::cross_validation::{HeldOutPrediction, leave_one_out, leave_speed_out, repeatability_floor};
use super::data_quality_notes::data_quality;
use super::held_out_loss::paired_confidence;
use super::instrument_faults::{CalibratedRecordings, InstrumentReport, ReferenceRecordings};
use super::mean_scenario::mean_scenario;
use super::model_selection::{CandidateModels, select_model};
use super::nested_cross_validation::nested_cross_validation;
use super::parameter_estimates::{ParameterEstimate, base_parameters, jackknife_estimates};
use super::repeatability_report::{
    AblationRow, MeanReport, RepeatabilityReport, ReportInputs, repeatability_report,
};
use super::scored_model::{ModelFamily, ScoredModel, active_effects};
use super::segmented_recording::{SegmentedRecording, have_several_speeds};
use crate::claims::{self, Context, SIGNIFICANT_P_VALUE};
use crate::diagnose::random_effect_sd;
use crate::diagnosis_json::{
    Cause, Diagnosis, Estimate, Gain, NegligibleEffect, NoiseReport, ResidualStructureReport,
    SearchCandidate, SearchStep, Verdict,
};
use crate::model_grade::grade;
use crate::residual_tests;
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use std::collections::BTreeMap;
use stylet_identify::insertion_phases::noise_n;
use stylet_record::sensor_artefacts;
use stylet_scenario::Scenario;
use stylet_tissue::{DelayedPuncture, Effect, PowerLawFriction, RateDependentPuncture, ShaftSlip, Tissue};

/// Seed of the random start values, constant so that equal recordings give equal results.
const START_VALUE_SEED: u64 = 1;
/// Verdict `unknown`: smallest unexplained share of the base law's mean square error above the floor.
const MAX_UNEXPLAINED_SHARE: f64 = 0.1;
/// Verdict `unknown`: smallest excess of the held-out error over the floor, as a share of the floor; both are required, and residuals that
/// depend on a feature.
const MAX_EXCESS_OVER_FLOOR: f64 = 0.2;

/// Result of the diagnosis of repeated recordings.
pub struct SetDiagnosis {
    /// Candidate models.
    pub candidates: CandidateModels,
    /// Leave-one-out predictions of the best model.
    pub held_out: Vec<HeldOutPrediction>,
    /// Leave-one-out predictions of the base law.
    pub base_held_out: Vec<HeldOutPrediction>,
    /// Verdict, causes and evidence.
    pub diagnosis: Diagnosis,
    /// Repeatability section of the report.
    pub report: RepeatabilityReport,
    /// The mean insertion as a scenario.
    pub mean_scenario: Scenario,
    /// Recordings after correction of instrument faults.
    pub recordings: Vec<SegmentedRecording>,
}

impl SetDiagnosis {
    /// Compares the parameters of the base law with the numbers and tolerances of a scenario: findings, and the verdict
    /// [`Verdict::Parameters`] if no effect is missing.
    pub fn compare_with_scenario(&mut self, scenario: &Scenario) {
        let d = &mut self.diagnosis;
        claims::compare_with_scenario(&mut d.base_parameters, scenario);
        if d.verdict == Verdict::Parameters {
            d.verdict = Verdict::None;
        }
        claims::apply(d, &Context::default());
        d.grade = Some(grade(d, 0.0));
    }

    /// Runs the nested cross-validation and adds it to the report.
    pub fn run_nested_cross_validation(&mut self) {
        let recordings: Vec<&SegmentedRecording> = self.recordings.iter().collect();
        self.report.nested = nested_cross_validation(&self.candidates, &recordings);
    }
}

/// Diagnoses repeated recordings after correction of instrument faults. The numbers of a `scenario` are a guess that may be right; those of
/// the `assumed` tissue of a data set are not used, only its layers. `None` when the base law cannot be fitted.
#[must_use]
pub fn diagnose_set(
    name: &str,
    assumed: &Tissue,
    scenario: Option<&Scenario>,
    recordings: &[&SegmentedRecording],
    references: &ReferenceRecordings,
    progress: &mut dyn FnMut(&str),
) -> Option<SetDiagnosis> {
    let mut instrument = InstrumentReport::assess(references, recordings, assumed.surface_m);
    // What the scenario assumes is in the model; a correction would apply it twice.
    let is_assumed = |id: &str| scenario.is_some_and(|s| s.effects.iter().any(|e| e.info().id == id));
    instrument.detected.retain(|fault| !is_assumed(&fault.effect));
    let CalibratedRecordings { recordings: corrected, artefacts } = instrument.calibrate(recordings);
    let recordings: Vec<&SegmentedRecording> = corrected.iter().collect();
    let recordings = recordings.as_slice();
    let mut rng = ChaCha8Rng::seed_from_u64(START_VALUE_SEED);
    let candidates = select_model((assumed, scenario), recordings, &artefacts, &mut rng, progress)?;
    progress("leave-one-out predictions");
    let held_out = leave_one_out(&candidates.best.set_fit, recordings);
    let base_held_out = base_predictions(&candidates, &held_out, recordings);
    let by_speed = |candidate: &ScoredModel| {
        have_several_speeds(recordings).then(|| leave_speed_out(&candidate.set_fit, recordings))
    };
    let (held_out_speeds, base_held_out_speeds) = (by_speed(&candidates.best), by_speed(&candidates.base));
    let floors = repeatability_floor(recordings);
    let inputs = ReportInputs {
        recordings,
        model: &candidates.best,
        held_out: &held_out,
        base_held_out: &base_held_out,
        held_out_speeds: held_out_speeds.as_deref(),
        base_held_out_speeds: base_held_out_speeds.as_deref(),
        floors: &floors,
    };
    let repeats = repeatability_report(&inputs, ablation_rows(&candidates), instrument);
    let diagnosis = diagnosis(&candidates, recordings, assumed, &held_out, &repeats, &artefacts);
    let mut extended =
        mean_scenario(name, &candidates.best.set_fit.fit.model, recordings, &repeats.instrument);
    if let Some(s) = scenario {
        (extended.tolerance, extended.thickness_tolerance) = (s.tolerance, s.thickness_tolerance);
        extended.surface_tolerance_m = s.surface_tolerance_m;
        extended.candidates = s.candidates.clone();
    }
    Some(SetDiagnosis {
        candidates,
        held_out,
        base_held_out,
        diagnosis,
        report: repeats,
        mean_scenario: extended,
        recordings: corrected,
    })
}

/// Leave-one-out predictions of the base law; `held_out` are those of the best model.
fn base_predictions(
    candidates: &CandidateModels,
    held_out: &[HeldOutPrediction],
    recordings: &[&SegmentedRecording],
) -> Vec<HeldOutPrediction> {
    match candidates.best.family {
        ModelFamily::Base => held_out.to_vec(),
        _ => leave_one_out(&candidates.base.set_fit, recordings),
    }
}

/// Held-out errors of the candidate models and of the ablated terms.
fn ablation_rows(candidates: &CandidateModels) -> Vec<AblationRow> {
    let model = |step: &str, candidate: &ScoredModel| AblationRow {
        step: step.to_owned(),
        held_out_n: candidate.held_out_n(),
        without_n: None,
        kept: candidate.family == candidates.best.family,
    };
    let term = |term: &ModelTerm| AblationRow {
        step: term.name.clone(),
        held_out_n: candidates.best.held_out_n(),
        without_n: Some(stylet_stats::mean(&term.without_n)).filter(|e| e.is_finite()),
        kept: term.kept,
    };
    let library = candidates.library.as_ref().map(|c| model("base law with library effects", c));
    let slip = candidates.slip.as_ref().map(|c| model("stick-slip of the shaft", c));
    library.into_iter().chain(slip).chain(candidates.terms.iter().map(term)).collect()
}

fn diagnosis(
    candidates: &CandidateModels,
    recordings: &[&SegmentedRecording],
    assumed: &Tissue,
    held_out: &[HeldOutPrediction],
    repeats: &RepeatabilityReport,
    artefacts: &sensor_artefacts::SensorArtefacts,
) -> Diagnosis {
    let best = &candidates.best;
    let model = &best.set_fit.fit.model;
    let estimates = jackknife_estimates(&best.set_fit, held_out);
    let mean = &repeats.mean;
    let noise = repeats
        .instrument
        .noise_n
        .unwrap_or_else(|| stylet_stats::median_of(recordings.iter().map(|r| noise_n(&r.recording.force_n))));
    let unsure = |id: &str| candidates.terms.iter().any(|p| p.is_uncertain() && p.effect == id);
    let mut causes: Vec<Cause> = active_effects(model)
        .into_iter()
        .filter(|id| !unsure(id))
        .map(|id| {
            let term = candidates.terms.iter().find(|p| p.kept && p.name == id);
            let without = match id {
                ShaftSlip::ID => &candidates.base.errors_n[..],
                _ => term.map_or(&[][..], |p| &p.without_n),
            };
            let confidence = paired_confidence(without, &best.errors_n);
            cause(id, &estimates, confidence, without, best, &candidates.base)
        })
        .collect();
    causes.sort_by(|a, b| b.share.total_cmp(&a.share));
    for fault in &repeats.instrument.detected {
        add_fault(&mut causes, fault.cause(), fault.is_corrected());
    }
    causes.extend(crate::sensor_artefact_causes::sensor_artefact_causes(artefacts, noise));
    let floor_n = mean.floor_n.unwrap_or(noise);
    let beyond = |e: f64| (e * e - floor_n * floor_n).max(0.0);
    let share = if best.family == ModelFamily::Base {
        1.0
    } else {
        (beyond(mean.model_n) / beyond(mean.base_n).max(1e-12)).min(1.0)
    };
    let structure = residual_tests::test_residuals(&best.set_fit.fit, &best.set_fit.data).coloured_noise;
    let unknown = is_unknown(share, mean, structure.p_value);
    let verdict = match (unknown, causes.is_empty()) {
        (true, _) => Verdict::Unknown,
        (false, true) => Verdict::None,
        (false, false) => Verdict::Named,
    };
    let mut diagnosis = Diagnosis {
        verdict,
        causes,
        base_parameters: base_parameters(&estimates, &best.set_fit.fit, assumed),
        not_identifiable: unidentified_effects(best, recordings),
        gain: Gain {
            held_out: true,
            recordings: recordings.iter().map(|r| r.name.clone()).collect(),
            rmse_before_n: mean.base_n,
            rmse_after_n: mean.with_discrepancy_n,
            rmse_given_scatter_n: if mean.floor_n.is_some() { mean.with_discrepancy_n } else { 0.0 },
            floor_n,
            per_recording_n: repeats.recordings.iter().map(|r| (r.base_n, r.with_discrepancy_n)).collect(),
        },
        negligible: negligible_effects(candidates),
        residual_structure: ResidualStructureReport {
            p_value: structure.p_value,
            depends_on: structure.depends_on.iter().map(|d| d.0.clone()).collect(),
            nats: structure.nats,
            share: if unknown || best.family != ModelFamily::Base { share } else { 0.0 },
        },
        data_quality: data_quality(recordings),
        search_steps: vec![search_step(candidates)],
        noise: NoiseReport {
            sd_n: noise,
            ar: [repeats.instrument.ar1.unwrap_or(0.0), 0.0],
            from_air: repeats.instrument.noise_n.is_some(),
        },
        random_effect_sd: random_effect_sd(model),
        advice: advice(best, &estimates),
        ..Diagnosis::default()
    };
    // The repeatability floor already contains the scatter between recordings.
    claims::apply(&mut diagnosis, &Context::default());
    diagnosis.grade = Some(grade(&diagnosis, 0.0));
    diagnosis
}

/// Whether a share of the base law's error and an excess over the floor are left by residuals that depend on a feature (`p_value`).
fn is_unknown(share: f64, mean: &MeanReport, p_value: f64) -> bool {
    share > MAX_UNEXPLAINED_SHARE
        && mean.floor_n.is_some_and(|floor_n| mean.model_n > (1.0 + MAX_EXCESS_OVER_FLOOR) * floor_n)
        && p_value < SIGNIFICANT_P_VALUE
}

/// Adds a fault of the instrument. Where the model has the same effect for what a correction left, as of a drift, both are one cause, or none if their
/// sum may be zero.
fn add_fault(causes: &mut Vec<Cause>, fault: Cause, is_corrected: bool) {
    let Some(k) = causes.iter().position(|c| c.effect == fault.effect) else {
        causes.push(fault);
        return;
    };
    let cause = &mut causes[k];
    cause.confidence = cause.confidence.max(fault.confidence);
    if !is_corrected {
        return;
    }
    for (path, corrected) in fault.parameters {
        if let Some(e) = cause.parameters.get_mut(&path) {
            (e.value, e.low, e.high) =
                (e.value + corrected.value, e.low + corrected.value, e.high + corrected.value);
        }
    }
    if cause.parameters.values().all(|e| e.low <= 0.0 && e.high >= 0.0) {
        causes.remove(k);
    }
}

/// Effects that recordings at a single speed do not identify.
fn unidentified_effects(best: &ScoredModel, recordings: &[&SegmentedRecording]) -> Vec<String> {
    let all = [PowerLawFriction::ID, RateDependentPuncture::ID, DelayedPuncture::ID];
    let named = active_effects(&best.set_fit.fit.model);
    let unidentified = all.iter().filter(|id| !have_several_speeds(recordings) && !named.contains(id));
    unidentified.map(|id| (*id).to_owned()).collect()
}

fn cause(
    id: &str,
    estimates: &[ParameterEstimate],
    confidence: f64,
    without: &[f64],
    best: &ScoredModel,
    base: &ScoredModel,
) -> Cause {
    let parameters: BTreeMap<String, Estimate> =
        estimates.iter().filter(|t| t.owner == id).map(|t| (t.path.clone(), t.estimate())).collect();
    let at_bound: Vec<String> =
        estimates.iter().filter(|t| t.owner == id && t.at_bound).map(|t| t.path.clone()).collect();
    let square = |e: &[f64]| stylet_stats::mean(&e.iter().map(|e| e * e).collect::<Vec<_>>());
    let explained = (square(&base.errors_n) - square(&best.errors_n)).max(1e-12);
    let share = (square(without) - square(&best.errors_n)) / explained;
    Cause {
        effect: id.to_owned(),
        confidence,
        parameters,
        gain_nats: (base.set_fit.fit.nats() - best.set_fit.fit.nats()).max(0.0),
        share: if share.is_finite() { share.clamp(0.0, 1.0) } else { 1.0 },
        at_bound,
        ..Cause::default()
    }
}

/// Removed terms, and effects that improve prediction without significance.
fn negligible_effects(candidates: &CandidateModels) -> Vec<NegligibleEffect> {
    let part = |p: &ModelTerm| NegligibleEffect {
        effect: p.effect.to_owned(),
        parameters: BTreeMap::new(),
        reason: format!(
            "{}: held-out RMS error {:.3} N without it, {:.3} N with it{}",
            p.name,
            stylet_stats::mean(&p.without_n),
            candidates.best.held_out_n(),
            if p.kept {
                "; not significant: it stays in the model and is not reported as a cause"
            } else {
                ""
            }
        ),
    };
    candidates.terms.iter().filter(|p| !p.kept || p.is_uncertain()).map(part).collect()
}

fn search_step(candidates: &CandidateModels) -> SearchStep {
    let tried = |name: &str, model: &ScoredModel| SearchCandidate {
        effect: name.to_owned(),
        gain_nats: candidates.base.set_fit.fit.nats() - model.set_fit.fit.nats(),
        parameters: model.set_fit.fit.model.effect_parameter_count(),
        screened_only: false,
    };
    let mut all = Vec::new();
    all.extend(candidates.slip.as_ref().map(|l| tried(ShaftSlip::ID, l)));
    all.extend(
        candidates.library.as_ref().map(|l| tried(&active_effects(&l.set_fit.fit.model).join(", "), l)),
    );
    SearchStep {
        included: Vec::new(),
        candidates: all,
        required_nats: 0.0,
        selected: (candidates.best.family != ModelFamily::Base)
            .then(|| active_effects(&candidates.best.set_fit.fit.model).join(", ")),
    }
}

/// Warnings about the fit.
fn advice(best: &ScoredModel, estimates: &[ParameterEstimate]) -> Vec<String> {
    let mut warnings = Vec::new();
    let bounds: Vec<String> =
        estimates.iter().filter(|t| t.at_bound).map(|t| format!("{} of {}", t.path, t.owner)).collect();
    if !bounds.is_empty() {
        warnings.push(format!(
            "These parameters are at their bounds and therefore not determined by the data: {}.",
            bounds.join(", ")
        ));
    }
    let (starts, agree) = best.set_fit.starts;
    if best.family == ModelFamily::ShaftSlip && 2 * agree < starts {
        warnings.push(format!(
            "Only {agree} of {starts} starts reached this optimum: more recordings would make it more certain."
        ));
    }
    warnings
}

#[cfg(test)]
mod tests;
