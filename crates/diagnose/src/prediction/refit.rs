//! Decides by prediction errors whether a group's fitted deviation is used.

use super::group_deviation::{PARAMETERS, Refit, Values};
use super::group_fit::GroupFit;
use super::group_update::GroupEstimate;
use serde::{Deserialize, Serialize};

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
pub struct GroupRefit<'a> {
    /// Result.
    pub report: RefitReport,
    fit: GroupFit<'a>,
    choice: Choice,
    /// RMS error (N) of the model on the training recordings.
    misfit_n: f64,
}

impl<'a> GroupRefit<'a> {
    /// Selects the deviation with the smallest error; `misfit_n` is that of the model on the training recordings.
    pub fn new(fit: GroupFit<'a>, misfit_n: f64) -> Option<Self> {
        let mut out = Self {
            report: RefitReport {
                moved: true,
                recordings: fit.recordings.len(),
                parameters: Vec::new(),
                before_n: fit.rms_n(&fit.recordings, |_| [0.0; PARAMETERS])?,
                after_n: 0.0,
            },
            fit,
            choice: Choice::Law,
            misfit_n,
        };
        out.report.after_n = out.report.before_n;
        // With one recording, the refit cannot be tested on another.
        let all = if out.report.recordings > 1 {
            &[Choice::Averaged, Choice::Full][..]
        } else {
            &[Choice::Averaged]
        };
        for choice in all {
            let error_n = out.fit.rms_n(&out.fit.recordings, |r| choice.deviation(&out.estimate_for(r)))?;
            if error_n < out.report.after_n {
                (out.choice, out.report.after_n) = (*choice, error_n);
            }
        }
        out.report.moved = out.choice != Choice::Law;
        let whole = out.estimate_without(None);
        let sd = whole.sd();
        out.report.parameters = (0..PARAMETERS)
            .filter(|k| whole.is_free(*k))
            .map(|k| FittedParameter {
                parameter: Refit::ALL[k],
                value: out.choice.deviation(&whole)[k],
                sd: sd[k],
                prior_sd: out.fit.group_sd[k],
                probability: whole.probability[k],
            })
            .collect();
        Some(out)
    }

    /// Distribution of the group's deviation from all fitted recordings but one.
    fn estimate_without(&self, out: Option<usize>) -> GroupEstimate {
        GroupEstimate::from_information(&self.fit.information(out), self.fit.group_sd)
    }

    /// Distribution of the group's deviation for recording `r`.
    fn estimate_for(&self, r: usize) -> GroupEstimate {
        self.estimate_without((self.fit.recordings.len() > 1).then_some(r))
    }

    /// Deviation for the prediction of recording `r`: fitted to the others, or to itself if it is the only one.
    pub fn group_for(&self, r: usize) -> RefittedGroup {
        let estimate = self.estimate_for(r);
        let beyond = (self.report.after_n.powi(2) - self.misfit_n.powi(2)).max(0.0);
        RefittedGroup { deviation: self.choice.deviation(&estimate), estimate, extra_misfit_n: beyond.sqrt() }
    }
}
