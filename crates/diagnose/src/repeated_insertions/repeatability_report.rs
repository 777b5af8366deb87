//! Repeatability section of a diagnosis: errors by recording, speed and phase, scatter, and data quality.

use super::cross_validation::{HeldOutPrediction, PHASE_NAMES, PredictionScore};
use super::instrument_faults::InstrumentReport;
use super::nested_cross_validation::NestedCrossValidation;
use super::random_effects_population::Population;
use super::scored_model::ScoredModel;
use super::segmented_recording::{SegmentedRecording, mean_speeds};
use serde::Serialize;
use stylet_identify::model::NO_RUPTURE;

/// Errors at one speed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SpeedReport {
    /// Mean advance speed (m/s).
    pub speed_mps: f64,
    /// Number of recordings.
    pub recordings: usize,
    /// Repeatability floor (N): RMS error of the mean of the other recordings; `None` for a single one.
    pub floor_n: Option<f64>,
    /// The floor (N), corrected for the scatter of that mean.
    pub floor_unbiased_n: Option<f64>,
    /// Leave-one-out RMS error of the base law (N).
    pub base_n: f64,
    /// Leave-one-out RMS error of the selected model (N).
    pub model_n: f64,
    /// The same with the empirical discrepancy (N).
    pub with_discrepancy_n: f64,
    /// Share of held-out samples inside the 90 % band.
    pub coverage: f64,
    /// RMS error of the selected model with this speed held out (N).
    pub held_out_speed_n: Option<f64>,
    /// Share of samples inside its 90 % band.
    pub held_out_speed_coverage: Option<f64>,
    /// RMS error of the base law with this speed held out (N).
    pub base_held_out_speed_n: Option<f64>,
}

/// Held-out error of a model or of a model without one term.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AblationRow {
    /// Name of the model or term.
    pub step: String,
    /// Held-out RMS error with it (N).
    pub held_out_n: f64,
    /// Held-out RMS error without it (N).
    pub without_n: Option<f64>,
    /// Whether it is part of the selected model.
    pub kept: bool,
}

/// Errors in one phase, pooled over recordings.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PhaseReport {
    /// One of [`PHASE_NAMES`].
    pub phase: &'static str,
    /// Repeatability floor (N).
    pub floor_n: Option<f64>,
    /// Leave-one-out RMS error of the selected model (N).
    pub model_n: f64,
    /// The same with the empirical discrepancy (N).
    pub with_discrepancy_n: f64,
}

/// Standard deviations between recordings and between days.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Variability {
    /// Surface, between recordings (m).
    pub surface_m: f64,
    /// Logarithm of friction.
    pub friction: f64,
    /// Puncture force, relative.
    pub puncture: f64,
    /// Surface, between days (m); a day is a group of one speed and stroke.
    pub day_surface_m: f64,
    /// Logarithm of friction between days.
    pub day_friction: f64,
    /// Per layer: number of recordings that show its rupture.
    pub drops: Vec<usize>,
    /// Per layer: mean and standard deviation of the release position (m).
    pub release_positions_m: Vec<Option<(f64, f64)>>,
    /// RMS residual by phase (N).
    pub residual_n: Vec<f64>,
}

/// Repeatability section of `diagnosis.json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RepeatabilityReport {
    /// Errors and random effects per recording.
    pub recordings: Vec<RecordingReport>,
    /// Errors per speed, slowest first.
    pub speeds: Vec<SpeedReport>,
    /// Means over the speeds.
    pub mean: MeanReport,
    /// Errors per phase.
    pub phases: Vec<PhaseReport>,
    /// Scatter between recordings and days.
    pub variability: Variability,
    /// Number of starts, and number of those that reached the same optimum.
    pub starts: (usize, usize),
    /// Candidate models and terms of the selected model.
    pub ablation: Vec<AblationRow>,
    /// Assessment of the instrument.
    pub instrument: InstrumentReport,
    /// Composition of layers measured alone.
    pub composition: Option<CompositionReport>,
    /// Nested cross-validation, if requested.
    pub nested: Option<NestedCrossValidation>,
}

/// Errors and random effects of one recording.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RecordingReport {
    /// Name.
    pub name: String,
    /// Speed (m/s).
    pub speed_mps: f64,
    /// Surface relative to the mean, including the day effect (m).
    pub surface_shift_m: f64,
    /// Friction factor, including the day effect.
    pub friction: f64,
    /// Per layer: elastic force at the rupture (N).
    pub puncture_n: Vec<Option<f64>>,
    /// Per layer: release position (m), where the force shows it.
    pub releases_m: Vec<Option<f64>>,
    /// Leave-one-out RMS error of the base law (N).
    pub base_n: f64,
    /// Leave-one-out RMS error of the selected model (N).
    pub model_n: f64,
    /// The same with the empirical discrepancy (N).
    pub with_discrepancy_n: f64,
    /// Share of samples inside the 90 % band.
    pub coverage: f64,
    /// Repeatability floor (N).
    pub floor_n: Option<f64>,
}

/// Means over the speeds.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct MeanReport {
    /// Repeatability floor (N).
    pub floor_n: Option<f64>,
    /// The floor (N), corrected for the scatter of the mean.
    pub floor_unbiased_n: Option<f64>,
    /// Base law (N).
    pub base_n: f64,
    /// Selected model (N).
    pub model_n: f64,
    /// Selected model with the empirical discrepancy (N).
    pub with_discrepancy_n: f64,
    /// Coverage of the 90 % band.
    pub coverage: f64,
    /// Selected model with a speed held out (N).
    pub held_out_speed_n: Option<f64>,
    /// Coverage of its 90 % band.
    pub held_out_speed_coverage: Option<f64>,
    /// Base law with a speed held out (N).
    pub base_held_out_speed_n: Option<f64>,
}

/// Result of the composition of single layers.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CompositionReport {
    /// Per layer: name, repeatability floor and leave-one-out RMS error of its own model (N).
    pub single_layers: Vec<(String, Option<f64>, f64)>,
    /// RMS error of the composed model on the whole stack (N), by speed.
    pub composed_n: Vec<f64>,
    /// Mean over the speeds.
    pub mean_n: f64,
}

/// Inputs of the report.
pub struct ReportInputs<'a> {
    /// Recordings.
    pub recordings: &'a [&'a SegmentedRecording],
    /// Selected model.
    pub model: &'a ScoredModel,
    /// Its leave-one-out predictions.
    pub held_out: &'a [HeldOutPrediction],
    /// Those of the base law.
    pub base_held_out: &'a [HeldOutPrediction],
    /// Scores with whole speeds held out.
    pub held_out_speeds: Option<&'a [PredictionScore]>,
    /// Those of the base law.
    pub base_held_out_speeds: Option<&'a [PredictionScore]>,
    /// Repeatability floors with the number of recordings averaged.
    pub floors: &'a [Option<(PredictionScore, usize)>],
}

/// Computes the report.
#[must_use]
pub fn repeatability_report(
    s: &ReportInputs,
    ablation: Vec<AblationRow>,
    instrument: InstrumentReport,
) -> RepeatabilityReport {
    let recordings = recording_reports(s);
    let speeds: Vec<SpeedReport> =
        mean_speeds(s.recordings).iter().map(|(v, m)| speed_report(*v, m, s)).collect();
    RepeatabilityReport {
        mean: mean_report(&speeds),
        phases: phase_reports(s),
        variability: variability(s),
        starts: s.model.set_fit.starts,
        ablation,
        instrument,
        composition: None,
        nested: None,
        speeds,
        recordings,
    }
}

fn recording_reports(s: &ReportInputs) -> Vec<RecordingReport> {
    let fit = &s.model.set_fit.fit;
    let model = &fit.model;
    s.recordings
        .iter()
        .enumerate()
        .map(|(r, run)| {
            let effects = model.per_recording.get(r).copied().unwrap_or_default();
            let day = model.day_of.get(r).and_then(|d| model.days.get(*d)).copied().unwrap_or_default();
            let at = |l: usize| {
                let ruptured = model.rupture_times_s[r].get(l).is_some_and(|t| *t < NO_RUPTURE);
                let event = fit.residuals.ruptures.get(r).and_then(|e| e.get(l));
                event.filter(|_| ruptured).map(|e| e.elastic_n)
            };
            RecordingReport {
                name: run.name.clone(),
                speed_mps: run.speed_mps,
                surface_shift_m: effects.surface_m + day.surface_m,
                friction: libm::exp(effects.ln_friction + day.ln_friction),
                puncture_n: (0..model.layers()).map(at).collect(),
                releases_m: run.releases_m.clone(),
                base_n: s.base_held_out[r].model_score.rmse_n,
                model_n: s.held_out[r].model_score.rmse_n,
                with_discrepancy_n: s.held_out[r].score.rmse_n,
                coverage: s.held_out[r].score.coverage,
                floor_n: s.floors[r].as_ref().map(|f| f.0.rmse_n),
            }
        })
        .collect()
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    stylet_stats::mean(&values.collect::<Vec<_>>())
}

/// Factor on the floor that corrects for the scatter of a mean of `n`.
fn floor_correction(n: usize) -> f64 {
    (n as f64 / (n + 1) as f64).sqrt()
}

fn speed_report(v: f64, members: &[usize], s: &ReportInputs) -> SpeedReport {
    let of = |what: &dyn Fn(usize) -> f64| mean(members.iter().map(|i| what(*i)));
    let floor = |what: &dyn Fn(&(PredictionScore, usize)) -> f64| {
        let all: Option<Vec<f64>> = members.iter().map(|i| s.floors[*i].as_ref().map(what)).collect();
        all.map(|all| stylet_stats::mean(&all))
    };
    let left = |out: Option<&[PredictionScore]>, what: &dyn Fn(&PredictionScore) -> f64| {
        out.filter(|o| o.len() == s.recordings.len()).map(|o| mean(members.iter().map(|i| what(&o[*i]))))
    };
    SpeedReport {
        speed_mps: v,
        recordings: members.len(),
        floor_n: floor(&|f| f.0.rmse_n),
        floor_unbiased_n: floor(&|f| f.0.rmse_n * floor_correction(f.1)),
        base_n: of(&|i| s.base_held_out[i].model_score.rmse_n),
        model_n: of(&|i| s.held_out[i].model_score.rmse_n),
        with_discrepancy_n: of(&|i| s.held_out[i].score.rmse_n),
        coverage: of(&|i| s.held_out[i].score.coverage),
        held_out_speed_n: left(s.held_out_speeds, &|o| o.rmse_n),
        held_out_speed_coverage: left(s.held_out_speeds, &|o| o.coverage),
        base_held_out_speed_n: left(s.base_held_out_speeds, &|o| o.rmse_n),
    }
}

fn mean_report(speeds: &[SpeedReport]) -> MeanReport {
    let optional = |what: &dyn Fn(&SpeedReport) -> Option<f64>| {
        let all: Option<Vec<f64>> = speeds.iter().map(what).collect();
        all.map(|all| stylet_stats::mean(&all))
    };
    MeanReport {
        floor_n: optional(&|s| s.floor_n),
        floor_unbiased_n: optional(&|s| s.floor_unbiased_n),
        base_n: mean(speeds.iter().map(|s| s.base_n)),
        model_n: mean(speeds.iter().map(|s| s.model_n)),
        with_discrepancy_n: mean(speeds.iter().map(|s| s.with_discrepancy_n)),
        coverage: mean(speeds.iter().map(|s| s.coverage)),
        held_out_speed_n: optional(&|s| s.held_out_speed_n),
        held_out_speed_coverage: optional(&|s| s.held_out_speed_coverage),
        base_held_out_speed_n: optional(&|s| s.base_held_out_speed_n),
    }
}

fn phase_reports(s: &ReportInputs) -> Vec<PhaseReport> {
    let pooled = |scores: &mut dyn Iterator<Item = &PredictionScore>, k: usize| {
        let (sum, n) =
            scores.fold((0.0, 0.0), |(sum, n), x| (sum + x.phase_squares[k].0, n + x.phase_squares[k].1));
        (n > 0.0).then(|| (sum / n).sqrt())
    };
    PHASE_NAMES
        .iter()
        .enumerate()
        .filter_map(|(k, part)| {
            let extended_n = pooled(&mut s.held_out.iter().map(|o| &o.score), k)?;
            let floor_n = pooled(&mut s.floors.iter().flatten().map(|f| &f.0), k);
            let model_n = pooled(&mut s.held_out.iter().map(|o| &o.model_score), k)?;
            Some(PhaseReport { phase: part, floor_n, model_n, with_discrepancy_n: extended_n })
        })
        .collect()
}

fn variability(s: &ReportInputs) -> Variability {
    let model = &s.model.set_fit.fit.model;
    let (scatter, free) = (&model.scatter, model.free);
    let when = |free: bool, x: f64| if free { x } else { 0.0 };
    let population = Population::from_fit(&s.model.set_fit, s.recordings);
    Variability {
        surface_m: when(free.recording_surface, scatter.surface_m),
        friction: when(free.recording_friction, scatter.ln_friction),
        puncture: scatter.rupture_force,
        day_surface_m: when(free.day_surface, scatter.day_surface_m),
        day_friction: when(free.day_friction, scatter.day_ln_friction),
        drops: (0..model.layers())
            .map(|l| s.recordings.iter().filter(|r| r.ruptures_s[l].is_finite()).count())
            .collect(),
        release_positions_m: (0..model.layers())
            .map(|l| {
                let all: Vec<f64> = s.recordings.iter().filter_map(|r| r.releases_m[l]).collect();
                let sd = if all.len() > 1 { stylet_stats::sd(&all) } else { 0.0 };
                (!all.is_empty()).then(|| (stylet_stats::mean(&all), sd))
            })
            .collect(),
        residual_n: population.residual_n.to_vec(),
    }
}

#[cfg(test)]
mod tests;
