//! Fits a group's deviation to its recordings, and decides by prediction errors whether it is used.

use super::group_deviation::{Factor, PARAMETERS, RECORDING_SD, Refit, Values, group_sd};
use super::group_update::{GroupEstimate, Observation, RecordingEstimate, estimate_recording};
use super::prepared::Prepared;
use super::target::{Target, with_unseen_speed};
use super::training_curves::TrainingSummary;
use serde::{Deserialize, Serialize};
use stylet_stats::parallel::*;

/// A refitted parameter.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FittedParameter {
    /// The parameter.
    pub parameter: Refit,
    /// Deviation from the model: m for the surface, else the natural logarithm of the factor.
    pub value: f64,
    /// Standard deviation after the update.
    pub sd: f64,
    /// Standard deviation before it.
    pub prior_sd: f64,
    /// Posterior probability that the group deviates in this parameter.
    pub probability: f64,
}

/// Result of a refit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RefitReport {
    /// Whether the deviation is used instead of the model's own values.
    pub moved: bool,
    /// Number of fitted recordings.
    pub recordings: usize,
    /// Deviation of the group, estimated from all of them.
    pub parameters: Vec<FittedParameter>,
    /// RMS error (N) of these recordings without the refit.
    pub before_n: f64,
    /// The same with the refit: each predicted from the others, or from itself if it is the only one.
    pub after_n: f64,
}

/// Deviation of a group as used in the prediction of one recording.
#[derive(Clone, Debug)]
pub struct RefittedGroup {
    /// Deviation.
    pub deviation: Values,
    /// Its distribution.
    pub estimate: GroupEstimate,
    /// Standard deviation (N) of the discrepancy in this group in addition to that of the training recordings.
    pub extra_misfit_n: f64,
}

/// Deviation that is used for a group.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Choice {
    /// No deviation.
    Law,
    /// Mean over the subsets of parameters.
    Averaged,
    /// Mean if all parameters deviate.
    Full,
}

impl Choice {
    fn deviation(self, estimate: &GroupEstimate) -> Values {
        match self {
            Self::Law => [0.0; PARAMETERS],
            Self::Averaged => estimate.mean,
            Self::Full => estimate.full_mean,
        }
    }
}

/// Refit of a group, for the prediction of each of its recordings.
pub struct GroupRefit {
    /// Result.
    pub report: RefitReport,
    fitted: Vec<usize>,
    estimates: Vec<RecordingEstimate>,
    group_sd: Values,
    recording_sd: Values,
    choice: Choice,
    /// RMS error (N) of the model on the training recordings.
    misfit_n: f64,
}

impl GroupRefit {
    /// Fits the deviation to the recordings `fitted`.
    pub fn new(
        prepared: &Prepared,
        training: Option<&TrainingSummary>,
        targets: &[Target],
        parameters: &[Refit],
        varying: &[Factor],
        fitted: &[usize],
    ) -> Option<Self> {
        let is_free = |k: usize| parameters.contains(&Refit::ALL[k]);
        let wide = fitted
            .iter()
            .map(|r| with_unseen_speed(group_sd(varying), prepared, training, *r))
            .fold([0.0; PARAMETERS], |a, b| std::array::from_fn(|k| f64::max(a[k], b[k])));
        let group_sd: Values = std::array::from_fn(|k| if is_free(k) { wide[k] } else { 0.0 });
        let recording_sd = training.map_or(RECORDING_SD, |t| t.recording_sd);
        // The deviation of a recording is that of its group plus its own.
        let prior_sd: Values = std::array::from_fn(|k| {
            if group_sd[k] > 0.0 { libm::hypot(group_sd[k], recording_sd[k]) } else { 0.0 }
        });
        let estimates: Vec<RecordingEstimate> = fitted
            .par_iter()
            .map(|r| {
                let b = &prepared.data.recordings[*r];
                let observed =
                    Observation { force_n: &b.force_n, used: &b.used, weight: prepared.weight(training, *r) };
                let force = |u: &Values| prepared.force(training, *r, u, &targets[*r].mean_residual);
                estimate_recording(&observed, force, prior_sd)
            })
            .collect::<Option<_>>()?;
        let mut out = Self {
            report: RefitReport {
                moved: true,
                recordings: fitted.len(),
                parameters: Vec::new(),
                before_n: 0.0,
                after_n: 0.0,
            },
            fitted: fitted.to_vec(),
            estimates,
            group_sd,
            recording_sd,
            choice: Choice::Law,
            misfit_n: prepared.misfit_n(training),
        };
        let whole = out.estimate_without(None);
        let error = |r: usize, deviation: &Values| -> Option<(f64, f64)> {
            let b = &prepared.data.recordings[r];
            let force = prepared.force(training, r, deviation, &targets[r].mean_residual)?;
            let used = b.force_n.iter().zip(&force).zip(&b.used).filter(|(_, used)| **used);
            Some(used.fold((0.0, 0.0), |(s, n), ((y, f), _)| (s + (y - f).powi(2), n + 1.0)))
        };
        let pooled = |deviation: &(dyn Fn(usize) -> Values + Sync)| -> Option<f64> {
            let each: Vec<(f64, f64)> =
                fitted.par_iter().map(|r| error(*r, &deviation(*r))).collect::<Option<_>>()?;
            let (square, blocks) = each.iter().fold((0.0, 0.0), |(s, n), e| (s + e.0, n + e.1));
            Some((square / f64::max(blocks, 1.0)).sqrt())
        };
        out.report.before_n = pooled(&|_| [0.0; PARAMETERS])?;
        out.report.after_n = out.report.before_n;
        // With one recording, the refit cannot be tested on another.
        let all = if fitted.len() > 1 { &[Choice::Averaged, Choice::Full][..] } else { &[Choice::Averaged] };
        for choice in all {
            let error_n = pooled(&|r| choice.deviation(&out.estimate_for(r)))?;
            if error_n < out.report.after_n {
                (out.choice, out.report.after_n) = (*choice, error_n);
            }
        }
        out.report.moved = out.choice != Choice::Law;
        let sd = whole.sd();
        out.report.parameters = (0..PARAMETERS)
            .filter(|k| is_free(*k))
            .map(|k| FittedParameter {
                parameter: Refit::ALL[k],
                value: out.choice.deviation(&whole)[k],
                sd: sd[k],
                prior_sd: group_sd[k],
                probability: whole.probability[k],
            })
            .collect();
        Some(out)
    }

    /// Distribution of the group's deviation from all fitted recordings but one.
    fn estimate_without(&self, out: Option<usize>) -> GroupEstimate {
        let kept = self.fitted.iter().zip(&self.estimates).filter(|(r, _)| Some(**r) != out);
        GroupEstimate::new(&kept.map(|(_, e)| e).collect::<Vec<_>>(), self.group_sd, self.recording_sd)
    }

    /// Distribution of the group's deviation for recording `r`.
    fn estimate_for(&self, r: usize) -> GroupEstimate {
        self.estimate_without((self.fitted.len() > 1).then_some(r))
    }

    /// Deviation for the prediction of recording `r`: fitted to the others, or to itself if it is the only one.
    pub fn group_for(&self, r: usize) -> RefittedGroup {
        let estimate = self.estimate_for(r);
        let beyond = (self.report.after_n.powi(2) - self.misfit_n.powi(2)).max(0.0);
        RefittedGroup { deviation: self.choice.deviation(&estimate), estimate, extra_misfit_n: beyond.sqrt() }
    }
}
