//! Plans how many recordings of a new group bring the prediction near its floor.
//!
//! Groups are drawn from the documented spreads, and recordings from each group: their deviations scatter as those that made the model did,
//! and their information comes from the derivatives of the force along the planned motion. The estimate of the group is that of a refit;
//! the floor is the error on further drawn recordings when the group is known.

use super::group_deviation::{Factor, PARAMETERS, Values, group_sd};
use super::group_update::{GroupEstimate, GroupInformation, product, slopes};
use super::insertion_course::Curve;
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
const INSERTIONS: [usize; 7] = [0, 1, 2, 3, 5, 10, 20];
/// Largest ratio of the expected prediction error to its floor that counts as near.
const MAX_RATIO: f64 = 1.1;
/// Probability of a ratio up to [`MAX_RATIO`] from which a number of insertions suffices.
const MIN_PROBABILITY: f64 = 0.9;
/// Number of drawn groups: the standard error of a probability of 0.9 is then 2 %.
const GROUPS: usize = 200;
/// Number of drawn recordings of a group and motion that are predicted: the mean of their square errors scatters by a fifth.
const NEW_RECORDINGS: usize = 20;
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
    /// The fewest insertions with a probability of at least 0.9; `None` if twenty do not suffice.
    pub recommended: Option<PlannedInsertions>,
    /// All choices of speeds and numbers of insertions.
    pub choices: Vec<PlannedInsertions>,
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
    let motions = PlannedMotions::new(scenario, diagnosis, training, varying).ok_or(DiagnoseError::NoFit)?;
    let all: Vec<usize> = (0..motions.speeds_mps.len()).collect();
    let single = all.iter().map(|m| vec![*m]);
    let in_turn = (all.len() > 1).then(|| all.clone());
    let mut choices = Vec::new();
    for used in single.chain(in_turn) {
        let ratios = motions.ratios(&used).ok_or(DiagnoseError::NoFit)?;
        for (k, insertions) in INSERTIONS.into_iter().enumerate() {
            let near = ratios.iter().filter(|r| r[k] <= MAX_RATIO).count();
            choices.push(PlannedInsertions {
                speeds_mps: used.iter().map(|m| motions.speeds_mps[*m]).collect(),
                insertions,
                probability: near as f64 / GROUPS as f64,
                median_ratio: median_of(ratios.iter().map(|r| r[k])),
            });
        }
    }
    // Among equal numbers of insertions, the most probable choice of speeds comes first.
    choices.sort_by(|a, b| a.insertions.cmp(&b.insertions).then(b.probability.total_cmp(&a.probability)));
    let recommended = choices.iter().find(|c| c.probability >= MIN_PROBABILITY).cloned();
    Ok(TransferPlan { varying: varying.to_vec(), floor_n: training.residual_rms_n, recommended, choices })
}

/// One motion for each speed and stroke of the recordings that made the model.
struct PlannedMotions<'a> {
    prepared: Prepared<'a>,
    training: &'a TrainingSummary,
    speeds_mps: Vec<f64>,
    mean_residuals: Vec<Curve>,
    /// Information matrix of a recording of every motion.
    information: Vec<SymmetricMatrix>,
    group_sd: Values,
}

impl<'a> PlannedMotions<'a> {
    fn new(
        scenario: &Scenario,
        diagnosis: &'a Diagnosis,
        training: &'a TrainingSummary,
        varying: &[Factor],
    ) -> Option<Self> {
        let mut distinct: Vec<&TrainingRun> = Vec::new();
        for run in training.runs.iter().filter(|run| run.speed_mps > 0.0) {
            if !distinct.iter().any(|d| d.is_like(run.speed_mps, run.stroke_m)) {
                distinct.push(run);
            }
        }
        let recording = |run: &&TrainingRun| NamedRecording {
            name: run.name.clone(),
            recording: insertion(training.range.start_m, run.stroke_m, run.speed_mps),
            notes: Vec::new(),
        };
        let recordings: Vec<NamedRecording> = distinct.iter().map(recording).collect();
        let mut out = Self {
            prepared: Prepared::new(scenario, Some(diagnosis), &recordings),
            training,
            speeds_mps: distinct.iter().map(|run| run.speed_mps).collect(),
            mean_residuals: distinct
                .iter()
                .map(|run| training.mean_residual(run.speed_mps, run.stroke_m, None))
                .collect(),
            information: Vec::new(),
            group_sd: group_sd(varying),
        };
        // The finite differences of a refit.
        let sd: Values = std::array::from_fn(|k| libm::hypot(out.group_sd[k], training.recording_sd[k]));
        for m in 0..distinct.len() {
            let blocks = out.force(m, &[0.0; PARAMETERS])?.len();
            let slopes = slopes(&|u: &Values| out.force(m, u), &[0.0; PARAMETERS], &sd, blocks);
            let weight = out.prepared.weight(m);
            let mut information = SymmetricMatrix::zeros(PARAMETERS);
            for i in 0..PARAMETERS {
                for j in 0..=i {
                    information.add(i, j, weight * dot(&slopes[i], &slopes[j]) / (sd[i] * sd[j]));
                }
            }
            out.information.push(information);
        }
        (!distinct.is_empty()).then_some(out)
    }

    fn force(&self, m: usize, deviation: &Values) -> Option<Vec<f64>> {
        self.prepared.force(m, deviation, &self.mean_residuals[m])
    }

    fn forces(&self, deviation: &Values) -> Option<Vec<Vec<f64>>> {
        (0..self.speeds_mps.len()).map(|m| self.force(m, deviation)).collect()
    }

    /// Ratios of the expected prediction error over all motions to its floor, per drawn group and number of insertions with the motions `used`
    /// in turn.
    fn ratios(&self, used: &[usize]) -> Option<Vec<[f64; INSERTIONS.len()]>> {
        let roots: Vec<_> = self.information.iter().map(SymmetricMatrix::cholesky).collect();
        let recording_sd = &self.training.recording_sd;
        let misfit = self.misfit_n2()?;
        let one = |group: usize| {
            let mut rng = ChaCha8Rng::seed_from_u64(SEED + group as u64);
            let mut normal = || -> Values { std::array::from_fn(|_| StandardNormal.sample(&mut rng)) };
            let z = normal();
            let deviation: Values = std::array::from_fn(|k| self.group_sd[k] * z[k]);
            let new = self.new_recordings(&deviation, &mut normal)?;
            let floor = misfit + mean_square(&new, &self.forces(&deviation)?);
            let mut known = GroupInformation::none();
            let mut recordings = 0;
            let mut out = [0.0; INSERTIONS.len()];
            for (ratio, insertions) in out.iter_mut().zip(INSERTIONS) {
                while recordings < insertions {
                    let m = used[recordings % used.len()];
                    let (z, noise) = (normal(), roots[m].multiply(&normal()));
                    let own: Values = std::array::from_fn(|k| deviation[k] + recording_sd[k] * z[k]);
                    let pull = product(&self.information[m], &own);
                    let weighted: Values = std::array::from_fn(|k| pull[k] + noise[k]);
                    known.add(&self.information[m], &weighted, recording_sd);
                    recordings += 1;
                }
                let mean = GroupEstimate::from_information(&known, self.group_sd).mean;
                let error = misfit + mean_square(&new, &self.forces(&mean)?);
                *ratio = (error / floor).sqrt();
            }
            Some(out)
        };
        (0..GROUPS).into_par_iter().map(one).collect()
    }

    /// Square of the misfit (N²) in a group without scatter between its recordings.
    fn misfit_n2(&self) -> Option<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(SEED);
        let none = [0.0; PARAMETERS];
        let new = self.new_recordings(&none, || std::array::from_fn(|_| StandardNormal.sample(&mut rng)))?;
        let scatter = mean_square(&new, &self.forces(&none)?);
        let noise_n = self.prepared.uncertainty.block_n;
        Some((self.training.residual_rms_n.powi(2) - scatter).max(noise_n.powi(2)))
    }

    /// Forces of recordings of a group with this deviation, from independent standard normal values.
    fn new_recordings(
        &self,
        deviation: &Values,
        mut normal: impl FnMut() -> Values,
    ) -> Option<Vec<Vec<Vec<f64>>>> {
        let own = |z: Values| std::array::from_fn(|k| deviation[k] + self.training.recording_sd[k] * z[k]);
        (0..NEW_RECORDINGS).map(|_| self.forces(&own(normal()))).collect()
    }
}

/// Mean square difference (N²) of new recordings from a prediction.
fn mean_square(recordings: &[Vec<Vec<f64>>], predicted: &[Vec<f64>]) -> f64 {
    let pairs = recordings.iter().flat_map(|r| r.iter().zip(predicted));
    let each: Vec<f64> = pairs
        .map(|(a, b)| a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / a.len().max(1) as f64)
        .collect();
    stylet_stats::mean(&each)
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
