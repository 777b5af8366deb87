//! Predicts recordings that were not used for the model, for example of another day or needle.
//!
//! Ruptures follow from the model's own puncture forces (free run). If the training recordings are known, the mean of their
//! residuals is added, and the prediction band contains the model discrepancy.
//!
//! | module | contents |
//! |---|---|
//! | `insertion_course` | phase coordinate over advance, hold and retraction |
//! | `training_curves`, `training_summary` | curves, discrepancy and scatter of the training recordings |
//! | `group_deviation` | deviation of another group of recordings, with its prior |
//! | `group_update` | Gaussian update of a group's deviation |
//! | `group_fit` | fit of the deviations of a group's recordings |
//! | `refit` | whether a group's deviation is used |
//! | `transfer` | in which parameters a group differs from that which made the model |
//! | `transfer_plan` | how many recordings of a new group its prediction needs |
//! | `uncertainty`, `prediction_band` | draws of the next recording, and their band |
//! | `zero_offset` | offset of the sensor's zero, which is subtracted |
//! | `prepared`, `target`, `predicted_recording` | prediction of one recording |

mod group_deviation;
mod group_fit;
mod group_update;
mod insertion_course;
mod predicted_recording;
mod prediction_band;
mod prepared;
mod refit;
mod target;
mod training_curves;
mod training_summary;
mod transfer;
mod transfer_plan;
mod uncertainty;
mod zero_offset;

use crate::base_law_fit::assumptions_of;
use crate::diagnosis_json::Diagnosis;
use crate::error::DiagnoseError;
use crate::input_checks::NamedRecording;
pub use group_deviation::{Factor, Refit};
use group_fit::GroupFit;
use predicted_recording::ErrorSums;
pub use predicted_recording::{PredictionCurves, RecordingPrediction};
pub use prediction_band::BAND_LEVEL;
use prepared::Prepared;
pub use refit::{FittedParameter, RefitReport};
use serde::{Deserialize, Serialize};
use stylet_identify::model::Model;
use stylet_scenario::Scenario;
use stylet_stats::parallel::*;
use target::Target;
pub use training_curves::{TrainingRun, TrainingSummary};
pub use transfer::{
    MAX_MISFIT_RATIO, ParameterTransfer, RecordingTransfer, Transfer, TransferResult, TransferVerdict,
    compare_groups,
};
pub use transfer_plan::{PlannedInsertions, TransferPlan, plan_transfer};

/// Options of a prediction.
#[derive(Clone, Debug, Default)]
pub struct PredictionOptions {
    /// Parameters that are fitted to recordings of the new group.
    pub refit: Vec<Refit>,
    /// Recordings of the new group for that fit; without any, each recording is predicted from the others.
    pub refit_on: Vec<NamedRecording>,
    /// Factors that differ from the training recordings. `None`: no factor for the training recordings themselves, all for others.
    pub varying: Option<Vec<Factor>>,
}

/// Coverage of the two bands: share of the measured force inside, 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CoverageByGroup {
    /// In the band of a new recording of the training group.
    pub same: f64,
    /// In the band of an unseen group.
    pub unseen: f64,
}

/// A model-free prediction from the training recordings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Baseline {
    /// `mean_curve` (training recordings at this speed) or `stretched_mean` (those at other speeds, aligned by depth and hold).
    pub name: String,
    /// Its RMS error in N.
    pub rmse_n: f64,
    /// RMS error of the prediction on the same recordings, in N.
    pub prediction_rmse_n: f64,
    /// Whether the model predicts worse than this baseline.
    pub prediction_is_worse: bool,
}

/// Prediction of all recordings: `predict.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Prediction {
    /// Per recording.
    pub recordings: Vec<RecordingPrediction>,
    /// RMS error over all recordings in N.
    pub rmse_n: f64,
    /// RMS error of the assumed scenario in N.
    pub assumed_rmse_n: Option<f64>,
    /// Standard deviation of the sensor noise in N, the lower limit of the error.
    pub floor_n: f64,
    /// Share of the measured force inside the 90 % band, 0 to 1.
    pub band_coverage: f64,
    /// Factors in which the band assumes a difference from the training recordings; empty for their own group.
    pub varying: Vec<Factor>,
    /// Coverage of both bands; `None` with a refit.
    pub coverage_by_group: Option<CoverageByGroup>,
    /// Components of the band, such as noise, scatter between recordings, parameter intervals.
    pub band_includes: Vec<String>,
    /// Result of the refit, if any.
    pub refit: Option<RefitReport>,
    /// Whether every prediction is of a recording that its parameters were not fitted to.
    pub held_out: bool,
    /// Predictions without a model.
    pub baselines: Vec<Baseline>,
}

/// A prediction with the curves of its report.
#[derive(Clone, Debug)]
pub struct PredictionResult {
    /// Summary.
    pub prediction: Prediction,
    /// Curves of every recording.
    pub curves: Vec<PredictionCurves>,
}

/// Summary of the training recordings for `diagnosis.json`; `None` when the model cannot be evaluated on them.
#[must_use]
pub fn training_summary(
    scenario: &Scenario,
    diagnosis: &Diagnosis,
    recordings: &[NamedRecording],
) -> Option<TrainingSummary> {
    if crate::input_checks::check_recordings(scenario, recordings).is_err() {
        return None;
    }
    training_summary::summarise(&Prepared::new(scenario, Some(diagnosis), recordings))
}

/// Predicts recordings with a scenario. `diagnosis`, if any, is the one that produced the scenario: it gives noise, scatter, intervals and
/// the curves of its recordings. `assumed` is the scenario before the diagnosis.
///
/// # Errors
/// [`DiagnoseError`] when the recordings do not fit the scenario.
pub fn predict(
    scenario: &Scenario,
    diagnosis: Option<&Diagnosis>,
    assumed: Option<&Scenario>,
    options: &PredictionOptions,
    evidence: &[NamedRecording],
) -> Result<PredictionResult, DiagnoseError> {
    crate::input_checks::check_recordings(scenario, evidence)?;
    if !options.refit_on.is_empty() {
        crate::input_checks::check_recordings(scenario, &options.refit_on)?;
    }
    let all: Vec<NamedRecording> = evidence.iter().chain(&options.refit_on).cloned().collect();
    let prepared = Prepared::new(scenario, diagnosis, &all);
    let targets: Vec<Target> = (0..all.len()).map(|r| Target::new(&prepared, r)).collect();
    let is_known = targets.iter().all(|t| t.training_index.is_some());
    let varying =
        options.varying.clone().unwrap_or_else(|| if is_known { Vec::new() } else { Factor::ALL.to_vec() });
    let n = evidence.len();
    let fitted: Vec<usize> = if all.len() > n { (n..all.len()).collect() } else { (0..n).collect() };
    let refit = if options.refit.is_empty() {
        None
    } else {
        let fit = GroupFit::new(&prepared, &targets, &options.refit, &varying, &fitted);
        let refit = fit.and_then(|fit| refit::GroupRefit::new(fit, prepared.misfit_n()));
        Some(refit.ok_or(DiagnoseError::NoFit)?)
    };
    let before = assumed.map(|b| Model::base(std::sync::Arc::new(assumptions_of(b)), all.len()));
    let each: Option<Vec<_>> = (0..n)
        .into_par_iter()
        .map(|r| {
            predicted_recording::predict_one(
                &prepared,
                &targets[r],
                before.as_ref(),
                refit.as_ref().map(|refit| refit.group_for(r)),
                &varying,
            )
        })
        .collect();
    let each = each.ok_or(DiagnoseError::NoFit)?;
    let sums: Vec<ErrorSums> = each.iter().map(|(_, _, sums)| *sums).collect();
    let (recordings, curves) = each.into_iter().map(|(predicted, shown, _)| (predicted, shown)).unzip();
    let total = sums.iter().fold(ErrorSums::default(), |all, one| all.plus(one));
    let blocks = total.blocks.max(1.0);
    let prediction = Prediction {
        recordings,
        rmse_n: (total.after / blocks).sqrt(),
        assumed_rmse_n: assumed.map(|_| (total.before / blocks).sqrt()),
        floor_n: prepared.uncertainty.floor_n,
        band_coverage: total.inside / blocks,
        coverage_by_group: refit.is_none().then(|| CoverageByGroup {
            same: total.inside_same / blocks,
            unseen: total.inside_unseen / blocks,
        }),
        band_includes: prepared.uncertainty.components(prepared.training, &varying),
        varying,
        held_out: refit.is_none() || all.len() > n || n > 1,
        refit: refit.map(|r| r.report),
        baselines: baselines(&sums),
    };
    Ok(PredictionResult { prediction, curves })
}

/// Errors of the baselines, over the recordings that have them.
fn baselines(sums: &[ErrorSums]) -> Vec<Baseline> {
    let one = |name: &str, square: &dyn Fn(&ErrorSums) -> Option<f64>| {
        let known: Vec<(&ErrorSums, f64)> = sums.iter().filter_map(|s| Some((s, square(s)?))).collect();
        let blocks: f64 = known.iter().map(|(s, _)| s.blocks).sum();
        let rms = |sum: f64| (sum / blocks.max(1.0)).sqrt();
        let (own, without) = (
            rms(known.iter().map(|(s, _)| s.after).sum()),
            rms(known.iter().map(|(_, square)| square).sum()),
        );
        (!known.is_empty()).then(|| Baseline {
            name: name.to_owned(),
            rmse_n: without,
            prediction_rmse_n: own,
            prediction_is_worse: own > without,
        })
    };
    [one("mean_curve", &|s| s.mean_curve), one("stretched_mean", &|s| s.stretched_mean)]
        .into_iter()
        .flatten()
        .collect()
}
