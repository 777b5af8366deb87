//! Confidence intervals from the curvature of the objective (Laplace approximation), with rupture times marginalised.
//!
//! Under random effects, a shared parameter is a mean over few recordings, whose variance is estimated from the same recordings. Variances
//! therefore use the remaining degrees of freedom (restricted likelihood, Patterson and Thompson 1971), and intervals are Student's t with
//! the degrees of freedom of Satterthwaite (1946), `nu = V^2 / sum(V_k^2/nu_k)`, where `V_k` is the part of the variance `V` due to random
//! effect `k`.
//!
//! The noise model includes the slow part of the residual; a bootstrap (`bootstrap_noise`) corrects for what the fitted parameters absorb.
//! Derivatives with respect to layer boundaries use a step as large as their uncertainty.

use crate::bootstrap_noise::bootstrap_noise;
use crate::diagnosis_json::Estimate;
use rand::Rng;
use stylet_identify::fit::{Effort, Fit, Linearization};
use stylet_identify::likelihood::FitData;
use stylet_identify::model::{Model, Parameter, ParameterRole};
use stylet_identify::rupture_likelihood::{RuptureEvent, evaluate_rupture, rupture_sds};
use stylet_stats::linear_algebra::{CholeskyFactor, SymmetricMatrix};
use stylet_stats::{normal, student_t};
use stylet_tissue::{FitScale, ParameterInfo, Proposal};

/// Cumulative probability at the upper end of a 95 % interval.
const UPPER_PROBABILITY: f64 = 0.975;
/// Calibration factor on all half widths from 400 simulated cases with one effect (seed 1001). It covers the approximation of the noise by
/// an autoregression of block means, and the selection of effects on the same data.
const CALIBRATION_FACTOR: f64 = 1.1;
/// Number that represents an infinite upper end in JSON.
const UNBOUNDED: f64 = 1e300;
/// Relative increase of the variance of a random effect, to determine its contribution by a finite difference.
const VARIANCE_INCREASE: f64 = 0.02;
/// Largest number of updates of the step for layer boundaries.
const MAX_STEP_UPDATES: usize = 4;
/// Relative change of the step for layer boundaries below which it has converged.
const STEP_TOLERANCE: f64 = 0.1;
/// Degrees of freedom that count as infinite.
const INFINITE_FREEDOM: f64 = 1e4;

/// Covariance of the fitted parameters at an optimum.
pub struct Covariance<'a> {
    pub(crate) fit: &'a Fit,
    pub(crate) linearization: Linearization,
    matrix: SymmetricMatrix,
    pub(crate) factor: CholeskyFactor,
    /// Factors with one random-effect variance increased, and the degrees of freedom of that variance.
    with_increased_variance: Vec<(CholeskyFactor, f64)>,
    /// Factors under bootstrap estimates of the noise.
    bootstrap: Vec<CholeskyFactor>,
}

/// The random effects with estimated variances.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum RandomEffect {
    Surface,
    Friction,
    RuptureForce,
    RuptureDepth,
}

impl<'a> Covariance<'a> {
    /// Covariance including the uncertainty of the estimated noise.
    pub fn new(fit: &'a Fit, data: &FitData, rng: &mut impl Rng) -> Self {
        let mut covariance = Self::with_known_noise(fit, data);
        covariance.bootstrap = bootstrap_noise(&covariance.linearization, data, &covariance.matrix, rng)
            .iter()
            .map(SymmetricMatrix::cholesky)
            .collect();
        covariance
    }

    /// Covariance under known noise.
    pub(crate) fn with_known_noise(fit: &'a Fit, data: &FitData) -> Self {
        let mut linearization = Linearization::new(&fit.model, data, &fit.residuals);
        let mut wide_m = 0.0;
        for _ in 0..MAX_STEP_UPDATES {
            let Some(next_m) = boundary_sd_m(&linearization, &fit.model) else { break };
            if (next_m / wide_m - 1.0).abs() < STEP_TOLERANCE {
                break;
            }
            wide_m = next_m;
            // One step for all boundaries, so that parameters that move a boundary in opposite directions cancel.
            let step = |n: &Parameter| {
                moves_a_kink(n.role, &fit.model).then_some(wide_m.min(0.25 * (n.high - n.low)))
            };
            linearization = linearization.with_wide_differences(&fit.model, data, &fit.residuals, &step);
        }
        let estimated: Vec<(RandomEffect, f64, f64)> = [
            RandomEffect::Surface,
            RandomEffect::Friction,
            RandomEffect::RuptureForce,
            RandomEffect::RuptureDepth,
        ]
        .into_iter()
        .filter_map(|kind| degrees_of_freedom(kind, fit).map(|(count, freedom)| (kind, count, freedom)))
        .collect();
        // Scales the variances to their degrees of freedom.
        let mut matrix = linearization.normal_matrix.clone();
        for (kind, count, freedom) in &estimated {
            scale_variance(&mut matrix, &linearization, fit, *kind, (1.0, count / freedom));
        }
        let with_increased_variance = estimated
            .iter()
            .map(|(kind, count, freedom)| {
                let mut increased = matrix.clone();
                let now = count / freedom;
                scale_variance(
                    &mut increased,
                    &linearization,
                    fit,
                    *kind,
                    (now, now * (1.0 + VARIANCE_INCREASE)),
                );
                (increased.cholesky(), *freedom)
            })
            .collect();
        Self {
            fit,
            factor: matrix.cholesky(),
            matrix,
            linearization,
            with_increased_variance,
            bootstrap: Vec::new(),
        }
    }

    /// Half width of the 95 % interval of a linear combination of parameters.
    fn half_width(&self, gradient: &[f64]) -> f64 {
        let (sd, freedom) = self.deviation(gradient);
        CALIBRATION_FACTOR * sd * student_t::quantile(UPPER_PROBABILITY, freedom)
    }

    /// Standard deviation of a linear combination of parameters, and its degrees of freedom.
    pub(crate) fn deviation(&self, gradient: &[f64]) -> (f64, f64) {
        let variance = |f: &CholeskyFactor| f.forward_substitute(gradient).iter().map(|y| y * y).sum::<f64>();
        let all = variance(&self.factor);
        let mut weighted_squares = 0.0;
        for (increased, freedom) in &self.with_increased_variance {
            let part = ((variance(increased) - all) / VARIANCE_INCREASE).max(0.0).min(all);
            weighted_squares += part * part / freedom;
        }
        // Mean and scatter of the variance under bootstrap estimates of the noise.
        let bootstrap: Vec<f64> = self.bootstrap.iter().map(|f| variance(f) / all).collect();
        let (mean, sd) = (stylet_stats::mean(&bootstrap), stylet_stats::sd(&bootstrap));
        let estimated = mean > 0.0 && sd.is_finite();
        if estimated {
            weighted_squares += 0.5 * (all * sd / mean).powi(2);
        }
        let freedom = if weighted_squares > 0.0 { all * all / weighted_squares } else { f64::INFINITY };
        let all = if estimated { all / mean.min(1.0) } else { all };
        (all.sqrt(), freedom.clamp(1.0, INFINITE_FREEDOM))
    }

    /// Evidence (nats) against zero strength of an effect: half the squared normal deviate with the same tail probability as Student's t,
    /// the largest over its strengths. `None` if no strength can be zero in the scale of the fit.
    pub fn nats_against_zero(&self, effect: usize) -> Option<f64> {
        let choice = &self.fit.model.effects[effect];
        let strengths = choice.info.parameters.iter().zip(&choice.values).enumerate();
        let nats = strengths.filter(|(_, (p, _))| p.strength).filter_map(|(k, (p, value))| {
            let off = match p.fit_scale() {
                FitScale::Linear => value - p.inactive,
                // For the deviation of the reciprocal, to first order.
                FitScale::Reciprocal => *value,
                FitScale::Log => return None,
            };
            let (sd, freedom) = self.deviation(&self.gradient(effect, k));
            let rare = normal::quantile(student_t::sf((off / sd).abs(), freedom));
            Some(0.5 * rare * rare)
        });
        nats.reduce(f64::max)
    }

    /// Index of a shared parameter in the covariance; `None` when it is not free.
    pub(crate) fn index_of(&self, role: ParameterRole) -> Option<usize> {
        self.linearization.shared.iter().position(|n| n.role == role)
    }

    /// Gradient of `scale` times a shared parameter; `None` when it is not free.
    pub(crate) fn shared_gradient(&self, role: ParameterRole, scale: f64) -> Option<Vec<f64>> {
        let mut gradient = vec![0.0; self.factor.size()];
        gradient[self.index_of(role)?] = scale;
        Some(gradient)
    }

    /// Gradient of a parameter of an effect with respect to the fitted parameters.
    pub(crate) fn gradient(&self, effect: usize, parameter: usize) -> Vec<f64> {
        let value = self.fit.model.effects[effect].values[parameter];
        let mut gradient = vec![0.0; self.linearization.normal_matrix.size];
        for (i, n) in self.linearization.shared.iter().enumerate() {
            if !matches!(n.role, ParameterRole::Effect { effect: e, .. } if e == effect) {
                continue;
            }
            let mut moved = self.fit.model.clone();
            moved.set(n.role, 0, moved.get(n.role, 0) + n.step);
            let change = (moved.effects[effect].values[parameter] - value) / n.step;
            gradient[i] = if change.is_finite() { change } else { 0.0 };
        }
        gradient
    }

    /// Value and half width of the 95 % interval of a shared parameter, in the scale of the fit; `None` when it is not
    /// free.
    pub fn shared_parameter(&self, role: ParameterRole) -> Option<(f64, f64)> {
        let i = self.index_of(role)?;
        let half = self.half_width(&self.shared_gradient(role, 1.0)?);
        let by_prior = || {
            self.linearization.shared[i].prior_sd * student_t::quantile(UPPER_PROBABILITY, INFINITE_FREEDOM)
        };
        Some((self.fit.model.get(role, 0), if half > 0.0 { half } else { by_prior() }))
    }

    /// [`unreached_puncture`] of a puncture force; `None` for another parameter.
    pub fn unreached_puncture(&self, role: ParameterRole) -> Option<UnreachedPuncture> {
        unreached_puncture(self.fit, self.linearization.shared.iter().find(|n| n.role == role)?)
    }

    /// Paths of the parameters of an effect that are at a bound of the search.
    pub fn effect_bounds(&self, effect: usize) -> Vec<String> {
        let choice = &self.fit.model.effects[effect];
        let parameters = choice.info.parameters.iter().zip(&choice.values).enumerate();
        // An infinite value is the rigid limit, not a bound.
        let at_bound = |(parameter, (_, value)): &(usize, (&ParameterInfo, &f64))| {
            value.is_finite() && self.at_bound(ParameterRole::Effect { effect, parameter: *parameter })
        };
        parameters.filter(at_bound).map(|(_, (p, _))| p.path.to_owned()).collect()
    }

    /// Whether a shared parameter is at a bound.
    pub fn at_bound(&self, role: ParameterRole) -> bool {
        self.linearization
            .shared
            .iter()
            .find(|n| n.role == role)
            .is_some_and(|n| n.is_at_bound(self.fit.model.get(role, 0), 1e-6))
    }

    /// Estimate of an effect parameter with its 95 % interval.
    pub fn effect_parameter(&self, effect: usize, parameter: usize) -> Estimate {
        let choice = &self.fit.model.effects[effect];
        let p = &choice.info.parameters[parameter];
        let value = choice.values[parameter];
        if p.integer {
            return Estimate { value, low: value, high: value };
        }
        if value == f64::INFINITY {
            // Rigid limit: only the reciprocal is determined.
            let (x, half) =
                self.shared_parameter(ParameterRole::Effect { effect, parameter }).unwrap_or_default();
            let low = (1.0 / (x + half)).min(UNBOUNDED).max(p.low);
            return Estimate { value: UNBOUNDED, low, high: UNBOUNDED };
        }
        let half = self.half_width(&self.gradient(effect, parameter));
        let (low, high) = match p.fit_scale() {
            FitScale::Log => (value * libm::exp(-half / value), value * libm::exp(half / value)),
            FitScale::Reciprocal => {
                // The interval is symmetric in the reciprocal.
                let (x, half) = (1.0 / value, half / (value * value));
                (1.0 / (x + half), if x > half { 1.0 / (x - half) } else { f64::INFINITY })
            }
            FitScale::Linear => (value - half, value + half),
        };
        Estimate { value, low: low.max(p.low), high: high.min(p.high).min(UNBOUNDED) }
    }
}

/// Decrease of the log likelihood (nats) at the end of a 95 % interval.
pub(crate) fn interval_end_nats() -> f64 {
    0.5 * normal::quantile(UPPER_PROBABILITY).powi(2)
}

/// What is known of a puncture force that the data do not bound from above.
pub(crate) struct UnreachedPuncture {
    /// Largest elastic force (N) of the layer in any recording, reduced by the 95 % range of the scatter of its puncture force.
    pub reached_n: f64,
    /// Upper end of the 95 % interval of the prior, in the scale of the fit.
    pub prior_upper_end: f64,
}

/// The limits of a puncture force that the data do not bound from above; `None` for one that they do, and for another parameter.
pub(crate) fn unreached_puncture(fit: &Fit, n: &Parameter) -> Option<UnreachedPuncture> {
    let ParameterRole::Puncture(layer) = n.role else { return None };
    let events = fit.residuals.ruptures.iter().filter_map(|e| e.get(layer));
    let scatter = 1.0 - normal::quantile(UPPER_PROBABILITY) * fit.model.scatter.rupture_force;
    is_open_above(fit, n).then(|| UnreachedPuncture {
        reached_n: events.map(|e| e.elastic_n).fold(0.0, f64::max) * scatter.max(0.0),
        prior_upper_end: n.prior_mean + n.prior_sd * normal::quantile(UPPER_PROBABILITY),
    })
}

/// Whether the data do not bound a puncture force from above, because every recording reached it only at the end of its layer.
fn is_open_above(fit: &Fit, n: &Parameter) -> bool {
    let ParameterRole::Puncture(layer) = n.role else { return false };
    let scatter = &fit.model.scatter;
    let times = n.high / fit.model.get(n.role, 0);
    let loss = |e: &RuptureEvent| {
        let force = (e.force_excess + 1.0) / times - 1.0;
        let beyond =
            RuptureEvent { force_excess: force, force_excess_rate: e.force_excess_rate / times, ..*e };
        evaluate_rupture(&beyond, scatter).nats - evaluate_rupture(e, scatter).nats
    };
    fit.residuals.ruptures.iter().filter_map(|e| e.get(layer)).map(loss).sum::<f64>() < interval_end_nats()
}

/// Sets puncture forces that the data do not bound from above to their prior mean and refits, so that they do not constrain stiffness and
/// relaxation; the fit is unchanged if that increases the objective too much.
pub fn release_unreached_punctures(fit: Fit, data: &FitData) -> Fit {
    let below = |n: &Parameter| n.prior_mean > fit.model.get(n.role, 0) && is_open_above(&fit, n);
    let open: Vec<Parameter> = fit.model.shared_parameters().into_iter().filter(below).collect();
    if open.is_empty() {
        return fit;
    }
    let mut model = fit.model.clone();
    open.iter().for_each(|n| model.set(n.role, 0, n.prior_mean));
    let free = stylet_identify::fit::fit(&model, data, Effort::FULL);
    free.filter(|f| f.nats() < fit.nats() + interval_end_nats()).unwrap_or(fit)
}

/// Median standard deviation (m) of the parameters that move a kink of the force.
fn boundary_sd_m(linearization: &Linearization, model: &Model) -> Option<f64> {
    let variances = linearization.factor().inverse_diagonal();
    let with_kink = linearization
        .shared
        .iter()
        .zip(variances)
        .filter(|(n, v)| moves_a_kink(n.role, model) && v.is_finite());
    let mut sd: Vec<f64> = with_kink.filter(|(n, v)| v.sqrt() > n.step).map(|(_, v)| v.sqrt()).collect();
    (!sd.is_empty()).then(|| stylet_stats::order_statistics::median(&mut sd))
}

/// Whether the parameter moves a boundary at which the force has a kink.
fn moves_a_kink(role: ParameterRole, model: &Model) -> bool {
    match role {
        ParameterRole::Surface | ParameterRole::Thickness(_) | ParameterRole::RecordingSurface => true,
        ParameterRole::Effect { effect, parameter } => {
            let info = model.effects[effect].info;
            matches!(info.proposal, Proposal::LayerFaces(_) | Proposal::MembraneRupture)
                && info.parameters[parameter].unit == "m"
        }
        _ => false,
    }
}

/// Number of values that determine the variance of a random effect, and the remaining degrees of freedom; `None` if the model does not
/// contain it.
fn degrees_of_freedom(random_effect: RandomEffect, fit: &Fit) -> Option<(f64, f64)> {
    let model = &fit.model;
    let recordings = model.per_recording.len() as f64;
    // Effective number of ruptures per layer for this variance.
    let estimated = |risk: usize| -> Vec<f64> {
        (0..model.layers())
            .map(|l| {
                let events = fit.residuals.ruptures.iter().filter_map(|e| e.get(l)).filter(|e| e.ruptured);
                events.map(|e| evaluate_rupture(e, &model.scatter).shares[risk].powi(2)).sum()
            })
            .collect()
    };
    let (count, fitted) = match random_effect {
        RandomEffect::Surface if model.free.recording_surface => (recordings, f64::from(model.free.surface)),
        RandomEffect::Friction if model.free.recording_friction => (recordings, 1.0),
        RandomEffect::RuptureForce if model.scatter.rupture_force > 0.0 => {
            let estimated = estimated(0);
            (estimated.iter().sum(), estimated.iter().filter(|n| **n > 0.5).count() as f64)
        }
        RandomEffect::RuptureDepth if model.scatter.rupture_depth_m > 0.0 => {
            let estimated = estimated(1);
            let boundaries = estimated.iter().filter(|n| **n > 0.5).count() as f64;
            (estimated.iter().sum(), if model.free.thickness { boundaries } else { 0.0 })
        }
        _ => return None,
    };
    (count > 0.0).then(|| (count, (count - fitted).clamp(1.0_f64.min(count), count)))
}

/// Updates the information matrix for a change of a random-effect variance from `from` to `to` times the fitted one.
fn scale_variance(
    matrix: &mut SymmetricMatrix,
    linearization: &Linearization,
    fit: &Fit,
    random_effect: RandomEffect,
    (from, to): (f64, f64),
) {
    let shared = linearization.shared.len();
    let (role, row) = match random_effect {
        RandomEffect::Surface => (Some(ParameterRole::RecordingSurface), 0),
        RandomEffect::Friction => (Some(ParameterRole::RecordingFriction), 0),
        RandomEffect::RuptureForce => (None, 0),
        RandomEffect::RuptureDepth => (None, 1),
    };
    if let Some(role) = role {
        let Some(o) = linearization.per_recording.iter().position(|n| n.role == role) else { return };
        let information =
            1.0 / (linearization.per_recording[o].prior_sd * linearization.per_recording[o].prior_sd);
        for r in 0..fit.model.per_recording.len() {
            let i = linearization.index_of(o, r);
            matrix.add(i, i, information * (1.0 / to - 1.0 / from));
        }
        return;
    }
    let scatter = &fit.model.scatter;
    for (r, events) in fit.residuals.ruptures.iter().enumerate() {
        for (l, event) in events.iter().enumerate() {
            let (force, place) = rupture_sds(event, scatter);
            let (total, own) = if random_effect == RandomEffect::RuptureForce {
                (force, scatter.rupture_force)
            } else {
                (place, scatter.rupture_depth_m)
            };
            let weight = |times: f64| total * total / (total * total + (times - 1.0) * own * own);
            let change = weight(to) - weight(from);
            let at = |k: usize| {
                linearization.columns[k].rupture_rows.get(r).and_then(|c| c.get(4 * l + row)).copied()
            };
            let shared_parameters = (0..shared).map(|i| (i, i));
            let recording_parameters =
                (0..linearization.per_recording.len()).map(|o| (linearization.index_of(o, r), shared + o));
            let derivatives: Vec<(usize, f64)> = shared_parameters
                .chain(recording_parameters)
                .filter_map(|(i, k)| at(k).filter(|c| *c != 0.0).map(|c| (i, c)))
                .collect();
            for (n, (i, a)) in derivatives.iter().enumerate() {
                derivatives[..=n].iter().for_each(|(j, b)| matrix.add(*i, *j, change * a * b));
            }
        }
    }
}

#[cfg(test)]
mod tests;
