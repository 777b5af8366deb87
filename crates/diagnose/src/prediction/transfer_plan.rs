//! Plans how many recordings of a new group bring the prediction near its floor.
//!
//! Groups are drawn from the documented spreads, and recordings from each group: their deviations scatter as those that made the model did,
//! and their information comes from the derivatives of the force along the planned motion. The update is the one of a refit, so the error
//! of the estimated group, and with it the expected prediction error, follows for every number of recordings without a simulation of forces.

use super::group_deviation::{Factor, PARAMETERS, Values, group_sd};
use super::group_update::{GroupEstimate, GroupInformation, product, rescaled, slopes};
use super::prepared::Prepared;
use super::training_curves::{TrainingRun, TrainingSummary};
use super::uncertainty::SEED;
use crate::diagnosis_json::Diagnosis;
use crate::error::DiagnoseError;
use crate::input_checks::NamedRecording;
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};
use stylet_record::Recording;
use stylet_scenario::Scenario;
use stylet_stats::linear_algebra::{SymmetricMatrix, dot};
use stylet_stats::median_of;
use stylet_stats::parallel::*;

/// Numbers of insertions that are compared.
const INSERTIONS: [usize; 6] = [0, 1, 2, 3, 5, 10];
/// Largest ratio of the expected prediction error to its floor that counts as near.
const MAX_RATIO: f64 = 1.1;
/// Probability of a ratio up to [`MAX_RATIO`] from which a number of insertions suffices.
const MIN_PROBABILITY: f64 = 0.9;
/// Number of drawn groups: the standard error of a probability of 0.9 is then 0.7 %.
const GROUPS: usize = 2000;
/// Sampling interval (s) of a planned motion: two samples per block.
const STEP_S: f64 = 0.01;

/// Expected prediction error after a number of insertions.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlannedInsertions {
    /// Speeds (m/s) of the insertions, used in turn.
    pub speeds_mps: Vec<f64>,
    /// Number of insertions.
    pub insertions: usize,
    /// Probability that the prediction error is within 10 % of its floor.
    pub probability: f64,
    /// Median ratio of the prediction error to its floor.
    pub median_ratio: f64,
}

/// Plan of the insertions of a new group: `transfer_plan.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TransferPlan {
    /// Factors in which the new group differs.
    pub varying: Vec<Factor>,
    /// Prediction error (N) for a known group: misfit and scatter of the recordings that made the model.
    pub floor_n: f64,
    /// The fewest insertions with a probability of at least 0.9; `None` if ten do not suffice.
    pub recommended: Option<PlannedInsertions>,
    /// All choices of speeds and numbers of insertions.
    pub choices: Vec<PlannedInsertions>,
}

/// A planned motion: information and error of one recording, per deviation.
struct PlannedMotion {
    speed_mps: f64,
    /// Information matrix.
    information: SymmetricMatrix,
    /// Mean square force error (N²) as a quadratic form of an error of the deviation.
    error: SymmetricMatrix,
}

/// Plans the insertions of a new group that differs in the factors `varying`, at the speeds of the recordings that made the model.
///
/// # Errors
/// [`DiagnoseError`] when the diagnosis has no summary of its recordings, or the model cannot be evaluated.
pub fn plan_transfer(
    scenario: &Scenario,
    diagnosis: &Diagnosis,
    varying: &[Factor],
) -> Result<TransferPlan, DiagnoseError> {
    let training = diagnosis.training.as_ref().ok_or(DiagnoseError::NoTrainingSummary)?;
    let group_sd = group_sd(varying);
    let motions = planned_motions(scenario, diagnosis, training, &group_sd).ok_or(DiagnoseError::NoFit)?;
    let floor_n = training.residual_rms_n;
    let single = (0..motions.len()).map(|m| vec![m]);
    let in_turn = (motions.len() > 1).then(|| (0..motions.len()).collect());
    let mut choices: Vec<PlannedInsertions> = single
        .chain(in_turn)
        .flat_map(|used: Vec<usize>| {
            let used: Vec<&PlannedMotion> = used.iter().map(|m| &motions[*m]).collect();
            let ratios = ratios(&motions, &used, &group_sd, &training.recording_sd, floor_n);
            INSERTIONS
                .iter()
                .enumerate()
                .map(move |(k, insertions)| {
                    let near = ratios.iter().filter(|r| r[k] <= MAX_RATIO).count();
                    PlannedInsertions {
                        speeds_mps: used.iter().map(|m| m.speed_mps).collect(),
                        insertions: *insertions,
                        probability: near as f64 / GROUPS as f64,
                        median_ratio: median_of(ratios.iter().map(|r| r[k])),
                    }
                })
                .collect::<Vec<_>>()
        })
        .collect();
    // Among equal numbers of insertions, the most probable choice of speeds comes first.
    choices.sort_by(|a, b| a.insertions.cmp(&b.insertions).then(b.probability.total_cmp(&a.probability)));
    let recommended = choices.iter().find(|c| c.probability >= MIN_PROBABILITY).cloned();
    Ok(TransferPlan { varying: varying.to_vec(), floor_n, recommended, choices })
}

/// Ratios of the expected prediction error to its floor, per drawn group and number of insertions.
fn ratios(
    motions: &[PlannedMotion],
    used: &[&PlannedMotion],
    group_sd: &Values,
    recording_sd: &Values,
    floor_n: f64,
) -> Vec<[f64; INSERTIONS.len()]> {
    let most = INSERTIONS[INSERTIONS.len() - 1];
    let roots: Vec<_> = used.iter().map(|m| m.information.cholesky()).collect();
    (0..GROUPS)
        .into_par_iter()
        .map(|group| {
            let mut rng = ChaCha8Rng::seed_from_u64(SEED + group as u64);
            let mut normal = || -> Values { std::array::from_fn(|_| StandardNormal.sample(&mut rng)) };
            let z = normal();
            let deviation: Values = std::array::from_fn(|k| group_sd[k] * z[k]);
            let mut known = GroupInformation::none();
            let mut out = [0.0; INSERTIONS.len()];
            for n in 0..=most {
                if let Some(k) = INSERTIONS.iter().position(|i| *i == n) {
                    let mean = GroupEstimate::from_information(&known, *group_sd).mean;
                    let off: Values = std::array::from_fn(|k| mean[k] - deviation[k]);
                    let square: f64 = motions.iter().map(|m| dot(&off, &product(&m.error, &off))).sum();
                    out[k] = (1.0 + square / motions.len() as f64 / floor_n.powi(2)).sqrt();
                }
                let motion = n % used.len();
                let (z, noise) = (normal(), roots[motion].multiply(&normal()));
                let own: Values = std::array::from_fn(|k| deviation[k] + recording_sd[k] * z[k]);
                let pull = product(&used[motion].information, &own);
                let weighted: Values = std::array::from_fn(|k| pull[k] + noise[k]);
                known.add(&used[motion].information, &weighted, recording_sd);
            }
            out
        })
        .collect()
}

/// One motion for each speed and stroke of the recordings that made the model.
fn planned_motions(
    scenario: &Scenario,
    diagnosis: &Diagnosis,
    training: &TrainingSummary,
    group_sd: &Values,
) -> Option<Vec<PlannedMotion>> {
    let mut distinct: Vec<&TrainingRun> = Vec::new();
    for run in training.runs.iter().filter(|run| run.speed_mps > 0.0) {
        if !distinct.iter().any(|d| d.is_like(run.speed_mps, run.stroke_m)) {
            distinct.push(run);
        }
    }
    let recordings: Vec<NamedRecording> = distinct
        .iter()
        .map(|run| NamedRecording {
            name: run.name.clone(),
            recording: insertion(training.range.start_m, run.stroke_m, run.speed_mps),
            notes: Vec::new(),
        })
        .collect();
    let prepared = Prepared::new(scenario, Some(diagnosis), &recordings);
    // The finite differences of a refit.
    let sd: Values = std::array::from_fn(|k| libm::hypot(group_sd[k], training.recording_sd[k]));
    let per_sd = sd.map(|sd| 1.0 / sd);
    distinct
        .par_iter()
        .enumerate()
        .map(|(r, run)| {
            let mean_residual = training.mean_residual(run.speed_mps, run.stroke_m, None);
            let force = |u: &Values| prepared.force(Some(training), r, u, &mean_residual);
            let blocks = force(&[0.0; PARAMETERS])?.len();
            let slopes = slopes(&force, &[0.0; PARAMETERS], &sd, blocks);
            let mut square = SymmetricMatrix::zeros(PARAMETERS);
            for i in 0..PARAMETERS {
                (0..=i).for_each(|j| square.add(i, j, dot(&slopes[i], &slopes[j])));
            }
            let times = |factor: f64| rescaled(&square, &per_sd.map(|x| x * factor.sqrt()));
            Some(PlannedMotion {
                speed_mps: run.speed_mps,
                information: times(prepared.weight(Some(training), r)),
                error: times(1.0 / blocks as f64),
            })
        })
        .collect()
}

/// Advance to `stroke_m` and retraction at one speed.
fn insertion(start_m: f64, stroke_m: f64, speed_mps: f64) -> Recording {
    let length_m = stroke_m - start_m;
    let duration_s = length_m / speed_mps;
    let time_s: Vec<f64> =
        (0..=(2.0 * duration_s / STEP_S).ceil() as usize).map(|k| k as f64 * STEP_S).collect();
    let position_m: Vec<f64> = time_s.iter().map(|t| stroke_m - speed_mps * (t - duration_s).abs()).collect();
    let velocity_mps = time_s.iter().map(|t| if *t < duration_s { speed_mps } else { -speed_mps }).collect();
    Recording {
        force_n: vec![0.0; time_s.len()],
        time_s,
        position_m,
        velocity_mps,
        velocity_measured: true,
        ..Recording::default()
    }
}
