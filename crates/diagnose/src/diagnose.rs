//! Diagnoses recordings: identifies the effects that the scenario lacks, with intervals and the improvement on held-out recordings.

use crate::base_law_fit::{PreparedRecordings, ReplayCount, assumptions_of, fit_base_law};
use crate::check_json::{CheckItem, Rating};
use crate::claims::{self, Context, have_one_motion};
use crate::competing_effects::{CompetingEffect, find_competing_effects};
use crate::diagnosis_json::*;
use crate::error::DiagnoseError;
use crate::experiment_check::{check_before_fit, effects_item, parameters_item};
use crate::fast_tone_cause::{fast_tone_cause, mark_mains, tone_mean_square_n2, without_removed_tones};
use crate::fast_tones::{FastTone, remove_fast_tones};
use crate::formula_proposals::propose_formulas;
use crate::general_forms::mark_general_forms;
use crate::held_out::{
    FreeRunResidual, JackknifeResult, held_out_residuals, jackknife_effects, pooled_rms,
    pooled_rms_given_scatter, sample_noise_sd_n,
};
use crate::identifiability::{advice, not_identifiable, visible_effects};
use crate::input_checks::{
    CleanRecordings, NamedRecording, average_blocks, check_recordings, clean_recordings, force_outlier_notes,
};
use crate::measured_start::{first_effect, search_from_any_start};
use crate::model_grade::grade;
use crate::motion_period::common_motion_period_s;
use crate::negligible_effects::{Negligible, negligible_effects};
use crate::parameters_by_recording::parameters_by_recording;
use crate::partial_model::partial_model;
use crate::selection_state::{Search, SearchStage};
use crate::sensor_artefact_causes::sensor_artefact_causes;
use crate::verdict::{Assessment, assess_search, is_kept, move_negligible};
use crate::zero_steps::{ZeroStepReport, zero_effects};
use std::sync::Arc;
use stylet_identify::block_averages::BLOCK_S;
use stylet_identify::fit::Fit;
use stylet_identify::likelihood::FitData;
use stylet_identify::model::Model;
use stylet_record::sensor_artefacts::SensorArtefacts;
use stylet_record::{QualityKind, Recording};
use stylet_scenario::Scenario;
use stylet_tissue::{AnyEffect, Effect};

/// Options of a diagnosis.
#[derive(Clone, Copy, Debug, Default)]
pub struct Options {
    /// Skips the check of the recordings, held-out errors and identifiability.
    pub brief: bool,
    /// Diagnoses recordings although their check rates them unusable.
    pub force: bool,
}

/// A diagnosis with the data for its report.
pub struct DiagnosisResult {
    /// The result, as written to `diagnosis.json`.
    pub diagnosis: Diagnosis,
    /// The scenario with fitted parameters and the identified effects.
    pub extended_scenario: Scenario,
    /// The proposed formulas as custom effects.
    pub proposed_effects: Vec<AnyEffect>,
    /// The selection of effects.
    pub search: Search,
    /// Effects that compete with each effect of the best model, in its order.
    pub competing_effects: Vec<Vec<CompetingEffect>>,
    /// Held-out residuals of the base law.
    pub base_held_out: Vec<Option<FreeRunResidual>>,
}

/// Reason why an effect is negligible in the presence of an unmodelled one.
pub const REASON_IMITATES_UNMODELLED: &str = "may imitate an effect that the library does not contain";

/// Diagnoses recordings with a scenario that has as many layers as the tissue; replays are added to `replayed`.
pub(crate) fn diagnose_given_layers(
    scenario: &Scenario,
    recordings: &[NamedRecording],
    options: &Options,
    replayed: &ReplayCount,
    progress: &mut dyn FnMut(&str),
) -> Result<DiagnosisResult, DiagnoseError> {
    let mut check = Vec::new();
    let force_ratios = match check_recordings(scenario, recordings) {
        Ok(ratios) => ratios,
        Err(why) if options.force && why.is_implausible() => {
            check.push(CheckItem::new("recordings", Rating::Unusable, why.to_string()));
            vec![None; recordings.len()]
        }
        Err(why) => return Err(why),
    };
    let CleanRecordings { recordings: mut clean, mut notes, raw } = clean_recordings(recordings);
    if !options.brief {
        check.extend(check_before_fit(scenario, recordings, &clean, &notes));
        let unusable: Vec<&str> =
            check.iter().filter(|i| i.light == Rating::Unusable).map(|i| i.message.as_str()).collect();
        if !unusable.is_empty() && !options.force {
            return Err(DiagnoseError::Unusable { reasons: unusable.join("; ") });
        }
    }
    for (notes, outlier) in notes.iter_mut().zip(force_outlier_notes(&force_ratios)) {
        notes.extend(outlier);
    }
    progress("fitting the base law");
    let (prepared, tones) = prepare(scenario, &mut clean, &raw, replayed);
    let one_motion = have_one_motion(&clean);
    let (mut search, prepared) =
        search_from_any_start(prepared, &clean, progress).ok_or(DiagnoseError::NoFit)?;
    let mut is_search_limit_reached = prepared.is_search_limit_reached();
    let mut competing = find_competing_effects(&mut search);
    progress("assessing the residual");
    let mut assessment = assess_search(&mut search, &competing);
    // With a coarse force resolution the residual may be quantisation error.
    assessment.unknown &= !raw.step_n.is_some_and(|s| s > 0.5 * sample_noise_sd_n(&search.data));
    let mut unweighted: Vec<(&str, JackknifeResult)> = Vec::new();
    if assessment.unknown && recordings.len() > 1 {
        progress("reweighting for an unmodelled effect");
        let reweighted = search.continue_reweighted(&prepared);
        is_search_limit_reached |= prepared.is_search_limit_reached();
        if let Some(mut reweighted) = reweighted {
            let results = jackknife_effects(&search.best, &search.data, sample_noise_sd_n(&search.data));
            unweighted = search.best.model.effects.iter().map(|e| e.info.id).zip(results).collect();
            competing = find_competing_effects(&mut reweighted);
            let after = assess_search(&mut reweighted, &competing);
            let share = after.residual_structure.share;
            assessment = Assessment {
                unknown: true,
                has_tones: assessment.has_tones,
                residual_structure: ResidualStructureReport { share, ..assessment.residual_structure },
                ..after
            };
            search = reweighted;
        }
    }
    let (base_held_out, extended_held_out) = if options.brief {
        (Vec::new(), Vec::new())
    } else {
        progress("predicting held-out recordings");
        let base = held_out_residuals(&search.base, &search.data);
        let same = search.best.model.effects.is_empty() && search.best.model.zero_step_count() == 0;
        let extended = if same { base.clone() } else { held_out_residuals(&search.best, &search.data) };
        (base, extended)
    };
    let noise_n = sample_noise_sd_n(&search.data);
    let mut zeros = ZeroStepReport::new(&search);
    let mut negligible = Vec::new();
    if !options.brief {
        let small = negligible_effects(
            &search,
            &extended_held_out,
            &zeros.with_causes(&assessment.causes),
            &assessment.nats_against_zero,
        );
        negligible = move_negligible(&mut assessment, small);
    }
    let mut artefacts = sensor_artefact_causes(&raw, noise_n);
    artefacts.extend(fast_tone_cause(&tones, &scenario.effects, &clean));
    let named_tones_n = artefacts.iter().map(tone_mean_square_n2).sum::<f64>().sqrt();
    if assessment.unknown {
        let results = jackknife_effects(&search.best, &search.data, noise_n);
        let effects = search.best.model.effects.iter().zip(&results);
        let unweighted = |id: &str| unweighted.iter().find(|l| l.0 == id).map(|l| &l.1);
        let kept: Vec<&str> = effects
            .filter(|(e, r)| is_kept(e.info, r, unweighted(e.info.id)))
            .map(|(e, _)| e.info.id)
            .collect();
        let dropped = assessment.causes.iter().filter(|c| !kept.contains(&c.effect.as_str()));
        let dropped = dropped
            .map(|c| Negligible { effect: c.effect.clone(), reason: REASON_IMITATES_UNMODELLED.to_owned() })
            .collect();
        negligible.extend(move_negligible(&mut assessment, dropped));
        zeros.keep_strong();
    }
    let mut causes = assessment.causes;
    zeros.add_to(&mut causes);
    for (notes, zero) in notes.iter_mut().zip(zeros.notes) {
        notes.extend(zero);
    }
    if !options.brief {
        mark_general_forms(&mut causes, &search);
    }
    mark_mains(&mut causes, &search);
    let has_cause = has_cause(&search, &causes);
    // Without an identified effect the base law is the final model, unless the best model predicts better despite an unmodelled force.
    let partial_model = || partial_model(&search, &base_held_out, &extended_held_out, noise_n);
    let partial = assessment.unknown.then(partial_model).flatten();
    let extended_held_out =
        if has_cause || partial.is_some() { extended_held_out } else { base_held_out.clone() };
    let verdict = if assessment.unknown {
        Verdict::Unknown
    } else if causes.iter().any(|c| !c.equivalent.is_empty()) {
        Verdict::Ambiguous
    } else if causes.is_empty() && artefacts.is_empty() {
        Verdict::None
    } else {
        Verdict::Named
    };
    causes.append(&mut artefacts);
    let (visible_effects, not_identifiable) = if options.brief {
        (Vec::new(), Vec::new())
    } else {
        let visible = visible_effects(&search.best, &search.data);
        let hidden = not_identifiable(&search.best, &search.data, &visible);
        (visible, hidden)
    };
    let with_tones = |error_n: f64| libm::hypot(error_n, named_tones_n);
    let gain = Gain {
        held_out: recordings.len() > 1,
        recordings: recordings.iter().map(|r| r.name.clone()).collect(),
        rmse_before_n: with_tones(pooled_rms(&base_held_out, &search.data)),
        rmse_after_n: pooled_rms(&extended_held_out, &search.data),
        rmse_given_scatter_n: pooled_rms_given_scatter(&extended_held_out, &search.data),
        floor_n: noise_n,
        per_recording_n: errors_per_recording_n(&base_held_out, &search)
            .map(with_tones)
            .zip(errors_per_recording_n(&extended_held_out, &search))
            .collect(),
    };
    let mut data_quality = Vec::new();
    for (r, notes) in recordings.iter().zip(notes) {
        let notes = notes.into_iter().filter(|note| note.kind != QualityKind::Converted);
        data_quality.extend(notes.map(|note| DataQualityNote { recording: r.name.clone(), note }));
    }
    let (parameters, covariance) = labels_of_causes(assessment.labels, &causes);
    if !options.brief {
        check.extend([parameters_item(&parameters), effects_item(&visible_effects)]);
    }
    let mut diagnosis = Diagnosis {
        verdict,
        check,
        visible_effects,
        partial,
        advice: advice(&causes, &not_identifiable, common_motion_period_s(&search.data)),
        base_parameters: assessment.base_parameters,
        by_recording: if options.brief {
            Vec::new()
        } else {
            progress("fitting each recording alone");
            parameters_by_recording(&search.best, &search.data, &parameters)
        },
        parameters,
        covariance,
        not_identifiable,
        gain,
        negligible,
        residual_structure: assessment.residual_structure,
        data_quality,
        search_steps: search.stages.iter().map(search_step).collect(),
        noise: NoiseReport { sd_n: noise_n, ar: autoregression(&search), from_air: false },
        random_effect_sd: random_effect_sd(&search.best.model),
        causes,
        ..Diagnosis::default()
    };
    let context = Context {
        one_motion,
        sensor_noise_n: scenario.sensor.force_torque().map(|s| s.noise_n),
        air_noise_n: air_noise_n(scenario, &search.data),
        resolution_n: raw.step_n.unwrap_or(0.0),
        is_search_limit_reached,
    };
    claims::compare_with_scenario(&mut diagnosis.base_parameters, scenario);
    claims::apply(&mut diagnosis, &context);
    diagnosis.grade = (!options.brief).then(|| grade(&diagnosis, context.resolution_n));
    let extended_scenario = extended_scenario(scenario, &search, &diagnosis);
    Ok(DiagnosisResult {
        diagnosis,
        extended_scenario,
        proposed_effects: Vec::new(),
        search,
        competing_effects: competing,
        base_held_out,
    })
}

impl DiagnosisResult {
    /// Adds formulas for the residual, if the library does not explain it.
    pub(crate) fn with_proposals(mut self, options: &Options, progress: &mut dyn FnMut(&str)) -> Self {
        if self.diagnosis.verdict == Verdict::Unknown && !options.brief {
            let model = reported_model(&self.search, &self.diagnosis);
            let held_out_n = self.diagnosis.gain.rmse_after_n;
            let found = propose_formulas(model, &self.search.data, held_out_n, progress);
            if let Some((formulas, effects)) = found {
                (self.diagnosis.formulas, self.proposed_effects) = (Some(formulas), effects);
            }
        }
        self
    }
}

/// Removes fast tones from recordings and divides them into blocks; returns the tones too.
fn prepare(
    scenario: &Scenario,
    clean: &mut [Recording],
    raw: &SensorArtefacts,
    replayed: &ReplayCount,
) -> (PreparedRecordings, Vec<FastTone>) {
    let tones = remove_fast_tones(clean, &raw.exclude, BLOCK_S);
    let assumed = Arc::new(without_removed_tones(assumptions_of(scenario), &tones));
    let prepared = PreparedRecordings::new(assumed, average_blocks(clean, raw), raw.quantisation_sd_n());
    (PreparedRecordings { replayed: Arc::clone(replayed), ..prepared }, tones)
}

/// The best model with at most one effect, if it leaves only noise; `None` also when the limit of replays was reached before.
pub(crate) fn simple_explanation(
    scenario: &Scenario,
    recordings: &[NamedRecording],
    replayed: &ReplayCount,
    progress: &mut dyn FnMut(&str),
) -> Option<Fit> {
    let CleanRecordings { mut recordings, raw, .. } = clean_recordings(recordings);
    let (prepared, _) = prepare(scenario, &mut recordings, &raw, replayed);
    if prepared.is_search_limit_reached() {
        return None;
    }
    let (base, data) = fit_base_law(&prepared)?;
    let mut found = first_effect(&prepared, base, data, progress);
    found.search.finish(&found.prepared);
    found.search.leaves_noise(&found.search.best).then_some(found.search.best)
}

/// Labels and covariance of the base parameters and of effects that are causes.
fn labels_of_causes(
    (labels, covariance): (Vec<LabelledParameter>, Vec<Vec<f64>>),
    causes: &[Cause],
) -> (Vec<LabelledParameter>, Vec<Vec<f64>>) {
    let is_kept =
        |l: &LabelledParameter| l.effect.as_ref().is_none_or(|e| causes.iter().any(|c| c.effect == *e));
    let kept: Vec<bool> = labels.iter().map(is_kept).collect();
    let chosen = |row: Vec<f64>| row.into_iter().zip(&kept).filter(|(_, k)| **k).map(|(x, _)| x).collect();
    let rows = covariance.into_iter().zip(&kept).filter(|(_, k)| **k).map(|(row, _)| chosen(row));
    (labels.into_iter().filter(is_kept).collect(), rows.collect())
}

/// RMS error (N) of each recording, including the noise of samples within their blocks.
fn errors_per_recording_n(
    residuals: &[Option<FreeRunResidual>],
    search: &Search,
) -> impl Iterator<Item = f64> {
    residuals.iter().zip(search.data.recordings.iter()).map(|(l, b)| {
        l.as_ref().map_or(f64::NAN, |l| (l.mean_square_n2 + b.within_block_sd_n().powi(2)).sqrt())
    })
}

/// Standard deviations of the random effects of a model.
pub(crate) fn random_effect_sd(model: &Model) -> RandomEffectSd {
    let (s, free) = (&model.scatter, &model.free);
    RandomEffectSd {
        puncture: s.rupture_force,
        rupture_depth_m: s.rupture_depth_m,
        surface_m: if free.recording_surface { s.surface_m } else { 0.0 },
        friction: if free.recording_friction { s.ln_friction } else { 0.0 },
    }
}

/// Standard deviation (N) of the samples within blocks in air, before the assumed surface; `None` if there are too few.
fn air_noise_n(scenario: &Scenario, data: &FitData) -> Option<f64> {
    /// Smallest number of blocks in air: the standard deviation is then known to 10 %.
    const MIN_AIR_BLOCKS: usize = 50;
    let end_m = scenario.tissue.surface_m - 2.0 * scenario.surface_tolerance_m;
    let mut squares = Vec::new();
    for b in data.recordings.iter() {
        let e = b.sample_residuals(&vec![0.0; b.len()]);
        let mut sums = vec![(0.0, 0.0); b.len()];
        for (e, k) in e.iter().zip(b.sample_block.iter()) {
            let sum: &mut (f64, f64) = &mut sums[*k as usize];
            *sum = (sum.0 + e * e, sum.1 + 1.0);
        }
        let in_air = |k: usize| b.motion.at(b.mid_s(k)).0 < end_m;
        squares.extend(
            (0..b.len()).filter(|k| b.used[*k] && in_air(*k)).map(|k| sums[k].0 / f64::max(sums[k].1, 1.0)),
        );
    }
    (squares.len() >= MIN_AIR_BLOCKS).then(|| stylet_stats::mean(&squares).sqrt())
}

/// First two autoregressive coefficients per block in the range of the smallest forces.
fn autoregression(search: &Search) -> [f64; 2] {
    search.data.noise.bins.first().map_or([0.0; 2], |b| [b.ar[0], b.ar[1]])
}

fn search_step(stage: &SearchStage) -> SearchStep {
    SearchStep {
        included: stage.included.iter().map(|s| (*s).to_owned()).collect(),
        candidates: stage
            .candidates
            .iter()
            .map(|(name, gain, numbers)| SearchCandidate {
                effect: (*name).to_owned(),
                gain_nats: *gain,
                parameters: *numbers,
                screened_only: false,
            })
            .collect(),
        required_nats: stage.required_nats,
        selected: stage.selected.map(|t| t.0.to_owned()),
    }
}

/// Whether any effect of the best model is a cause.
fn has_cause(search: &Search, causes: &[Cause]) -> bool {
    search.best.model.zero_step_count() > 0
        || search.best.model.effects.iter().any(|e| causes.iter().any(|c| c.effect == e.info.id))
}

/// The model of the extended scenario.
fn reported_model<'a>(search: &'a Search, d: &Diagnosis) -> &'a Fit {
    let none = search.best.model.effects.is_empty() && d.verdict != Verdict::Unknown;
    let best = none || d.partial.is_some() || has_cause(search, &d.causes);
    if best { &search.best } else { &search.base }
}

/// The scenario with the identified effects; with an unmodelled force, with those of the partial model.
fn extended_scenario(scenario: &Scenario, search: &Search, d: &Diagnosis) -> Scenario {
    let mut out = scenario.clone();
    let source = reported_model(search, d);
    out.tissue = source.model.tissue.clone();
    out.effects.extend(zero_effects(search, &d.causes));
    let in_partial = |id: &str| d.partial.as_ref().is_some_and(|p| p.effects.iter().any(|e| e == id));
    let named = |id: &str| in_partial(id) || d.causes.iter().any(|c| c.effect == id);
    out.effects.extend(source.model.effects.iter().filter(|e| named(e.info.id)).filter_map(|e| e.effect()));
    let given: Vec<&str> = out.effects.iter().map(Effect::id).collect();
    let missing: Vec<&Cause> = d.causes.iter().filter(|c| !given.contains(&c.effect.as_str())).collect();
    for c in missing.into_iter().filter(|c| source.model.effects.iter().all(|e| e.info.id != c.effect)) {
        let Some(info) = stylet_tissue::known_effect_info(&c.effect) else { continue };
        let values: Vec<f64> =
            info.parameters.iter().filter_map(|p| c.parameters.get(p.path)).map(|e| e.value).collect();
        out.effects.extend(info.with_parameters(&values));
    }
    out
}

#[cfg(test)]
mod tests;
