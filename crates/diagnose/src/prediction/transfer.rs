//! Compares a group of recordings with the group that made a model: in which parameters they differ.
//!
//! The deviation of the new group is estimated as in a refit. The model's own group is known from a few recordings only, so the difference
//! of two groups of `m` and `n` recordings has `m / (m + n)` of the information that the `n` recordings have on their own group: the
//! variances of two means add up.

use super::group_deviation::{Factor, PARAMETERS, Refit, Values};
use super::group_fit::GroupFit;
use super::group_update::GroupEstimate;
use super::predicted_recording::{PredictionCurves, predict_one};
use super::prepared::Prepared;
use super::refit::RefittedGroup;
use super::target::Target;
use crate::diagnosis_json::Diagnosis;
use crate::error::DiagnoseError;
use crate::input_checks::NamedRecording;
use crate::repeated_insertions::segmented_recording::SPEED_TOLERANCE;
use serde::{Deserialize, Serialize};
use stylet_scenario::Scenario;
use stylet_stats::Z95;
use stylet_stats::parallel::*;

/// Posterior probability of a difference from which a parameter is named: the median probability model (Barbieri and Berger 2004).
pub const DIFFERENCE_PROBABILITY: f64 = 0.5;
/// Ratio of the misfit on the new group, with all parameters of every recording updated, to misfit and scatter on the model's own group above
/// which the new group follows another law.
pub const MAX_MISFIT_RATIO: f64 = 2.0;

/// Result of a comparison of two groups.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TransferVerdict {
    /// No difference was found.
    Same,
    /// Named parameters differ.
    Differs,
    /// The groups differ, but the recordings do not show in which parameter.
    Ambiguous,
    /// The new group follows another law.
    #[serde(rename = "another_law")]
    AnotherModel,
}

/// Difference of the new group in one parameter.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ParameterTransfer {
    /// The parameter.
    pub parameter: Refit,
    /// Whether the groups differ in it.
    pub differs: bool,
    /// Posterior probability that they do.
    pub probability: f64,
    /// Shift of the surface in m, else factor relative to the model, if this and the named parameters differ.
    pub value: f64,
    /// Lower end of the 95 % interval.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// Error on one recording of the new group.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RecordingTransfer {
    /// Name.
    pub name: String,
    /// RMS error (N) of the model.
    pub before_n: f64,
    /// RMS error (N) of the updated model.
    pub after_n: f64,
    /// Whether the model was fitted to it.
    #[serde(rename = "made_the_law")]
    pub is_training_recording: bool,
    /// Offset of the sensor's zero in N, which was subtracted; `None` if it is negligible.
    #[serde(default)]
    pub zero_offset_n: Option<f64>,
}

/// Comparison of a group of recordings with the group that made a model: `transfer.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Transfer {
    /// Result.
    pub verdict: TransferVerdict,
    /// Posterior probability that no parameter differs.
    pub probability_same: f64,
    /// All parameters.
    pub parameters: Vec<ParameterTransfer>,
    /// Number of recordings that made the model.
    pub model_recordings: usize,
    /// Recordings of the new group.
    pub recordings: Vec<RecordingTransfer>,
    /// RMS error (N) of the model on its own recordings: misfit and scatter.
    pub model_n: f64,
    /// The same on the new group.
    pub before_n: f64,
    /// The same after an update of all parameters.
    pub after_n: f64,
    /// RMS error (N) with all parameters of every recording updated: misfit without scatter.
    pub own_n: f64,
    /// `own_n` over `model_n`.
    pub misfit_ratio: f64,
    /// Whether the new group has a speed without recordings of the model.
    pub is_unseen_speed: bool,
}

/// A comparison with the curves of its report.
#[derive(Clone, Debug)]
pub struct TransferResult {
    /// Comparison.
    pub transfer: Transfer,
    /// Curves of every recording, predicted by the model for an unseen group.
    pub before: Vec<PredictionCurves>,
    /// The same, predicted by the updated model.
    pub after: Vec<PredictionCurves>,
}

/// Compares recordings of a new group with those that made a model.
///
/// # Errors
/// [`DiagnoseError`] when the recordings do not fit the scenario, or when the diagnosis has no summary of its recordings.
pub fn compare_groups(
    scenario: &Scenario,
    diagnosis: &Diagnosis,
    recordings: &[NamedRecording],
) -> Result<TransferResult, DiagnoseError> {
    crate::input_checks::check_recordings(scenario, recordings)?;
    let training = diagnosis.training.as_ref().ok_or(DiagnoseError::NoTrainingSummary)?;
    let prepared = Prepared::new(scenario, Some(diagnosis), recordings);
    let n = recordings.len();
    let targets: Vec<Target> = (0..n).map(|r| Target::new(&prepared, r)).collect();
    let all: Vec<usize> = (0..n).collect();
    let varying = Factor::ALL;
    let fit = GroupFit::new(&prepared, &targets, &Refit::ALL, &varying, &all).ok_or(DiagnoseError::NoFit)?;
    let information = fit.information(None);
    let group = GroupEstimate::from_information(&information, fit.group_sd);
    let model_recordings = training.runs.len();
    let share = model_recordings as f64 / (model_recordings + n) as f64;
    let of_difference = |sd: Values| GroupEstimate::from_information(&information.times(share), sd);
    let difference = of_difference(fit.group_sd);
    let differs = |k: usize| difference.probability[k] >= DIFFERENCE_PROBABILITY;
    let parameters = (0..PARAMETERS)
        .map(|k| {
            let is_free = |j: usize| j == k || differs(j);
            let given =
                of_difference(std::array::from_fn(|j| if is_free(j) { fit.group_sd[j] } else { 0.0 }));
            let (mean, sd, parameter) = (given.full_mean[k], given.sd()[k], Refit::ALL[k]);
            ParameterTransfer {
                parameter,
                differs: differs(k),
                probability: difference.probability[k],
                value: parameter.shift_or_factor(mean),
                low: parameter.shift_or_factor(mean - Z95 * sd),
                high: parameter.shift_or_factor(mean + Z95 * sd),
            }
        })
        .collect();
    let model_n = prepared.misfit_n();
    let rms_n = |of: &[usize], deviation: Values| fit.rms_n(of, |_| deviation).ok_or(DiagnoseError::NoFit);
    let (before_n, after_n) = (rms_n(&all, [0.0; PARAMETERS])?, rms_n(&all, group.full_mean)?);
    let extra_misfit_n = (after_n.powi(2) - model_n.powi(2)).max(0.0).sqrt();
    let predicted = |deviation: Option<Values>| {
        let one = |target: &Target| {
            let group = deviation.map(|deviation| RefittedGroup {
                deviation,
                estimate: group.clone(),
                extra_misfit_n,
            });
            predict_one(&prepared, target, None, group, &varying)
        };
        let each: Option<Vec<_>> = targets.par_iter().map(|t| Some(one(t)?.1)).collect();
        each.ok_or(DiagnoseError::NoFit)
    };
    let (before, after) = (predicted(None)?, predicted(Some(group.full_mean))?);
    let recordings = all
        .iter()
        .map(|r| {
            Ok(RecordingTransfer {
                name: prepared.names[*r].clone(),
                before_n: rms_n(&[*r], [0.0; PARAMETERS])?,
                after_n: rms_n(&[*r], group.full_mean)?,
                is_training_recording: targets[*r].training_index.is_some(),
                zero_offset_n: prepared.zero_offset_n[*r],
            })
        })
        .collect::<Result<_, DiagnoseError>>()?;
    let own_n = fit.own_rms_n().ok_or(DiagnoseError::NoFit)?;
    let misfit_ratio = own_n / model_n;
    let verdict = if misfit_ratio > MAX_MISFIT_RATIO {
        TransferVerdict::AnotherModel
    } else if (0..PARAMETERS).any(differs) {
        TransferVerdict::Differs
    } else if difference.probability_of_none < DIFFERENCE_PROBABILITY {
        TransferVerdict::Ambiguous
    } else {
        TransferVerdict::Same
    };
    let unseen =
        prepared.courses.iter().any(|c| training.ln_speed_ratio(c.speed_mps) > libm::log1p(SPEED_TOLERANCE));
    let transfer = Transfer {
        verdict,
        probability_same: difference.probability_of_none,
        parameters,
        model_recordings,
        recordings,
        model_n,
        before_n,
        after_n,
        own_n,
        misfit_ratio,
        is_unseen_speed: unseen,
    };
    Ok(TransferResult { transfer, before, after })
}
