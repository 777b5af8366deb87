//! Gaussian update of a group's deviation from the model by its recordings.
//!
//! The deviation `u_r` of recording `r` is normal about the deviation `u` of its group, which is normal about zero. The force is linearised
//! about the best `u_r` of each recording, so the update of `u` is linear (Gelman and others, *Bayesian Data Analysis*, chapters 5 and 15).
//! A group may differ in some parameters only, or in none: the mean is averaged over all subsets of parameters by their marginal
//! likelihoods (Hoeting and others 1999), which shrinks it if evidence is weak. The prior probability of no deviation equals that of all
//! other subsets together.

use super::group_deviation::{PARAMETERS, Values};
use stylet_stats::linear_algebra::{CholeskyFactor, SymmetricMatrix};

/// Largest number of Gauss-Newton iterations per recording.
const MAX_ITERATIONS: usize = 10;
/// Gain (nats) of an iteration below which the fit has converged.
const MIN_GAIN_NATS: f64 = 1e-3;
/// Finite difference in standard deviations of the prior; over it, ruptures move by more than a sample.
const DERIVATIVE_STEP: f64 = 0.25;
/// Largest number of halvings of a step that does not decrease the objective.
const MAX_HALVINGS: usize = 6;
/// Start values of the surface, in standard deviations of the prior.
const SURFACE_STARTS: [f64; 9] = [0.0, -1.0, 1.0, -2.0, 2.0, -3.0, 3.0, -4.0, 4.0];
/// Start values of the puncture force, in standard deviations of the prior: a rupture far from the measured one attracts no gradient.
const PUNCTURE_STARTS: [f64; 5] = [0.0, -1.0, 1.0, -2.0, 2.0];

/// Estimated deviation of one recording.
#[derive(Clone, Debug)]
pub struct RecordingEstimate {
    /// Most probable deviation.
    pub deviation: Values,
    /// Information matrix of the recording alone.
    information: SymmetricMatrix,
    /// Standard deviations of the prior.
    prior_sd: Values,
}

/// A recording to be fitted, per block.
pub struct Observation<'a> {
    /// Measured force in N.
    pub force_n: &'a [f64],
    /// Whether the block is compared.
    pub used: &'a [bool],
    /// Weight of a squared error, in 1/N²: independent samples per block over the variance.
    pub weight: f64,
}

impl Observation<'_> {
    fn nats(&self, predicted_n: &[f64]) -> f64 {
        let square = self.residuals(predicted_n).map(|(_, e)| e * e).sum::<f64>();
        0.5 * self.weight * square
    }

    /// Index and residual of every compared block.
    fn residuals<'b>(&'b self, predicted_n: &'b [f64]) -> impl Iterator<Item = (usize, f64)> + 'b {
        let all = self.force_n.iter().zip(predicted_n).zip(self.used).enumerate();
        all.filter(|(_, (_, used))| **used).map(|(k, ((y, f), _))| (k, y - f))
    }
}

/// Derivatives of the force in every block by the deviation in units of `sd`, at the deviation `v` in these units; zero where `sd` is.
pub fn slopes(
    force: &impl Fn(&Values) -> Option<Vec<f64>>,
    v: &Values,
    sd: &Values,
    blocks: usize,
) -> Vec<Vec<f64>> {
    (0..PARAMETERS)
        .map(|j| {
            let moved =
                |by: f64| force(&std::array::from_fn(|k| sd[k] * (v[k] + if k == j { by } else { 0.0 })));
            let both = (sd[j] > 0.0).then(|| moved(-DERIVATIVE_STEP).zip(moved(DERIVATIVE_STEP)));
            both.flatten().map_or_else(
                || vec![0.0; blocks],
                |(a, b)| a.iter().zip(&b).map(|(a, b)| (b - a) / (2.0 * DERIVATIVE_STEP)).collect(),
            )
        })
        .collect()
}

/// Fits the deviation of one recording; `force` predicts its blocks (N) for a deviation. The best of the minima from several starts is kept.
pub fn estimate_recording(
    observed: &Observation,
    force: impl Fn(&Values) -> Option<Vec<f64>>,
    prior_sd: Values,
) -> Option<RecordingEstimate> {
    let fit = RecordingFit { observed, force, prior_sd };
    let free = |starts: &'static [f64], k: usize| if prior_sd[k] > 0.0 { starts } else { &starts[..1] };
    let mut best: Option<(f64, RecordingEstimate)> = None;
    for puncture in free(&PUNCTURE_STARTS, 3) {
        let starts = free(&SURFACE_STARTS, 0).iter().map(|surface| [*surface, 0.0, 0.0, *puncture]);
        let start = starts
            .filter_map(|v| fit.at(v))
            .reduce(|best, next| if next.nats < best.nats { next } else { best });
        let Some((nats, found)) = start.map(|start| fit.minimum(start)) else { continue };
        if best.as_ref().is_none_or(|(least, _)| nats < *least) {
            best = Some((nats, found));
        }
    }
    best.map(|(_, estimate)| estimate)
}

/// A recording with its prior.
struct RecordingFit<'a, F> {
    observed: &'a Observation<'a>,
    force: F,
    prior_sd: Values,
}

/// A trial deviation.
struct Trial {
    /// Deviation in standard deviations of the prior.
    v: Values,
    /// Negative log posterior.
    nats: f64,
    /// Predicted force in N.
    predicted: Vec<f64>,
}

impl<F: Fn(&Values) -> Option<Vec<f64>>> RecordingFit<'_, F> {
    fn scaled(&self, v: &Values) -> Values {
        std::array::from_fn(|j| v[j] * self.prior_sd[j])
    }

    fn at(&self, v: Values) -> Option<Trial> {
        let predicted = (self.force)(&self.scaled(&v))?;
        let nats = self.observed.nats(&predicted) + 0.5 * v.iter().map(|v| v * v).sum::<f64>();
        Some(Trial { v, nats, predicted })
    }

    /// Local minimum (Gauss-Newton) and its negative log posterior.
    fn minimum(&self, start: Trial) -> (f64, RecordingEstimate) {
        let mut here = start;
        let mut information = SymmetricMatrix::zeros(PARAMETERS);
        let weight = self.observed.weight;
        for _ in 0..MAX_ITERATIONS {
            let slopes = slopes(&self.force, &here.v, &self.prior_sd, here.predicted.len());
            information = SymmetricMatrix::zeros(PARAMETERS);
            let mut gradient = here.v.map(|v| -v);
            for (k, e) in self.observed.residuals(&here.predicted) {
                for i in 0..PARAMETERS {
                    gradient[i] += weight * slopes[i][k] * e;
                    (0..=i).for_each(|j| information.add(i, j, weight * slopes[i][k] * slopes[j][k]));
                }
            }
            let step = with_identity(&information).solve(&gradient);
            let shares = (0..=MAX_HALVINGS).map(|k| libm::exp2(-(k as f64)));
            let better = shares
                .filter_map(|share| self.at(std::array::from_fn(|j| here.v[j] + share * step[j])))
                .find(|trial| trial.nats < here.nats);
            let Some(next) = better else { break };
            let gain = here.nats - next.nats;
            here = next;
            if gain < MIN_GAIN_NATS {
                break;
            }
        }
        let per_sd = self.prior_sd.map(|sd| if sd > 0.0 { 1.0 / sd } else { 0.0 });
        let found = RecordingEstimate {
            deviation: self.scaled(&here.v),
            information: rescaled(&information, &per_sd),
            prior_sd: self.prior_sd,
        };
        (here.nats, found)
    }
}

impl RecordingEstimate {
    /// Information matrix times the deviation that would fit the recording best without a prior.
    fn weighted(&self) -> Values {
        let pull = product(&self.information, &self.deviation);
        std::array::from_fn(|k| {
            let sd = self.prior_sd[k];
            pull[k] + if sd > 0.0 { self.deviation[k] / (sd * sd) } else { 0.0 }
        })
    }
}

/// Cholesky factor of a matrix plus the identity.
fn with_identity(matrix: &SymmetricMatrix) -> CholeskyFactor {
    let mut sum = matrix.clone();
    (0..sum.size).for_each(|k| sum.add(k, k, 1.0));
    sum.cholesky()
}

/// `D A D` for a diagonal `D`.
fn rescaled(matrix: &SymmetricMatrix, by: &Values) -> SymmetricMatrix {
    let mut out = SymmetricMatrix::zeros(PARAMETERS);
    for i in 0..PARAMETERS {
        (0..=i).for_each(|j| out.add(i, j, by[i] * matrix.at(i, j) * by[j]));
    }
    out
}

/// Product of a matrix and a vector.
pub fn product(matrix: &SymmetricMatrix, by: &Values) -> Values {
    std::array::from_fn(|i| (0..PARAMETERS).map(|j| matrix.at(i, j) * by[j]).sum())
}

/// Information of a group's recordings on its deviation.
#[derive(Clone, Debug)]
pub struct GroupInformation {
    /// Information matrix.
    information: SymmetricMatrix,
    /// Information matrix times the deviation that fits best.
    weighted: Values,
}

impl GroupInformation {
    /// Without a recording.
    pub fn none() -> Self {
        Self { information: SymmetricMatrix::zeros(PARAMETERS), weighted: [0.0; PARAMETERS] }
    }

    /// Information of recordings that scatter by `recording_sd`.
    pub fn new(recordings: &[&RecordingEstimate], recording_sd: &Values) -> Self {
        let mut out = Self::none();
        recordings.iter().for_each(|r| out.add(&r.information, &r.weighted(), recording_sd));
        out
    }

    /// Adds a recording with its information matrix, and that matrix times its best deviation.
    pub fn add(&mut self, information: &SymmetricMatrix, weighted: &Values, recording_sd: &Values) {
        // (A^-1 + R^2)^-1 = A - A R (1 + R A R)^-1 R A, without an inverse of A.
        let inner = with_identity(&rescaled(information, recording_sd));
        let reduced = |x: &Values| -> Values {
            let scaled: Vec<f64> = x.iter().zip(recording_sd).map(|(x, sd)| x * sd).collect();
            let solved = inner.solve(&scaled);
            let back: Values = std::array::from_fn(|k| recording_sd[k] * solved[k]);
            let less = product(information, &back);
            std::array::from_fn(|k| x[k] - less[k])
        };
        for j in 0..PARAMETERS {
            let column = reduced(&std::array::from_fn(|i| information.at(i, j)));
            (j..PARAMETERS).for_each(|i| self.information.add(i, j, column[i]));
        }
        let of_group = reduced(weighted);
        (0..PARAMETERS).for_each(|k| self.weighted[k] += of_group[k]);
    }

    /// The same multiplied by `share`.
    pub fn times(&self, share: f64) -> Self {
        let root = [share.sqrt(); PARAMETERS];
        Self { information: rescaled(&self.information, &root), weighted: self.weighted.map(|w| share * w) }
    }
}

/// Distribution of a group's deviation.
#[derive(Clone, Debug)]
pub struct GroupEstimate {
    /// Mean over the subsets of parameters.
    pub mean: Values,
    /// Mean if all parameters deviate.
    pub full_mean: Values,
    /// Probability that each parameter deviates.
    pub probability: Values,
    /// Probability that none deviates.
    pub probability_of_none: f64,
    /// Standard deviations before the update.
    prior_sd: Values,
    /// Factor of the precision with all parameters, relative to the prior's.
    precision: CholeskyFactor,
}

/// Posterior of the deviation if only parameters with a positive standard deviation deviate.
struct Subset {
    mean: Values,
    precision: CholeskyFactor,
    /// Log marginal likelihood relative to no deviation.
    ln_evidence: f64,
}

impl Subset {
    fn new(known: &GroupInformation, sd: &Values) -> Self {
        let precision = with_identity(&rescaled(&known.information, sd));
        let scaled: Values = std::array::from_fn(|k| sd[k] * known.weighted[k]);
        let solved = precision.solve(&scaled);
        let gain: f64 = scaled.iter().zip(&solved).map(|(a, b)| a * b).sum();
        Self {
            mean: std::array::from_fn(|k| sd[k] * solved[k]),
            ln_evidence: 0.5 * (gain - precision.log_determinant()),
            precision,
        }
    }
}

impl GroupEstimate {
    /// Estimate from recordings of the group, which may be none.
    pub fn new(recordings: &[&RecordingEstimate], group_sd: Values, recording_sd: Values) -> Self {
        Self::from_information(&GroupInformation::new(recordings, &recording_sd), group_sd)
    }

    /// Estimate from the information of the recordings.
    pub fn from_information(known: &GroupInformation, group_sd: Values) -> Self {
        let free: Vec<usize> = (0..PARAMETERS).filter(|k| group_sd[*k] > 0.0).collect();
        let subsets: Vec<(Values, Subset)> = (0..1_usize << free.len())
            .map(|mask| {
                let is_in =
                    |k: usize| free.iter().position(|f| *f == k).is_some_and(|bit| mask >> bit & 1 == 1);
                let sd = std::array::from_fn(|k| if is_in(k) { group_sd[k] } else { 0.0 });
                (sd, Subset::new(known, &sd))
            })
            .collect();
        let best = subsets.iter().map(|(_, s)| s.ln_evidence).fold(f64::NEG_INFINITY, f64::max);
        let others = (subsets.len() - 1).max(1) as f64;
        let (mut mean, mut probability, mut total) = ([0.0; PARAMETERS], [0.0; PARAMETERS], 0.0);
        let mut none = 0.0;
        for (mask, (sd, subset)) in subsets.iter().enumerate() {
            let prior = if mask == 0 { others } else { 1.0 };
            let weight = prior * libm::exp(subset.ln_evidence - best);
            total += weight;
            none += if mask == 0 { weight } else { 0.0 };
            for k in 0..PARAMETERS {
                mean[k] += weight * subset.mean[k];
                probability[k] += if sd[k] > 0.0 { weight } else { 0.0 };
            }
        }
        let full = Subset::new(known, &group_sd);
        Self {
            mean: mean.map(|m| m / total),
            full_mean: full.mean,
            probability: probability.map(|p| p / total),
            probability_of_none: none / total,
            prior_sd: group_sd,
            precision: full.precision,
        }
    }

    /// Whether a parameter may deviate.
    pub fn is_free(&self, parameter: usize) -> bool {
        self.prior_sd[parameter] > 0.0
    }

    /// Standard deviations if all parameters may deviate.
    pub fn sd(&self) -> Values {
        let variance = self.precision.inverse_diagonal();
        std::array::from_fn(|k| self.prior_sd[k] * variance[k].max(0.0).sqrt())
    }

    /// Difference from the mean for independent standard normal values.
    pub fn draw(&self, independent: &Values) -> Values {
        let off = self.precision.back_substitute(independent);
        std::array::from_fn(|k| self.prior_sd[k] * off[k])
    }
}

#[cfg(test)]
mod tests;
