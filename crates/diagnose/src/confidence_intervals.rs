//! Intervals of all numbers by the curvature of the likelihood, the instants of ruptures marginalised.
//!
//! Where insertions differ from one another (a surface, a friction, a puncture force of each recording's own) a shared number is a
//! mean of few, and how much they differ is told by the same few: the variance is taken with as many degrees of freedom as are left
//! of them (restricted likelihood: Patterson and Thompson 1971), and the interval is Student's with those of Satterthwaite (1946),
//! `nu = V^2 / sum(V_k^2/nu_k)`, `V_k` the part of the variance `V` that comes from the scatter `k`.
//!
//! The noise is what is left, its slow wander over tens of seconds and through breaks included
//! ([`From::Lasting`](stylet_identify::noise::From)), and as much as the fitted numbers have taken from it is given back
//! (`told_again`); and where a face lies is told by moving it as far as it is uncertain.

use crate::bootstrap_noise::bootstrap_noise;
use crate::diagnosis_json::Estimate;
use rand::Rng;
use stylet_identify::fit::{Effort, Fit, Linearization};
use stylet_identify::likelihood::FitData;
use stylet_identify::model::{Model, Parameter, ParameterRole};
use stylet_identify::rupture_likelihood::{RuptureEvent, evaluate_rupture, rupture_sds};
use stylet_stats::linear_algebra::{CholeskyFactor, SymmetricMatrix};
use stylet_stats::{normal, student_t};
use stylet_tissue::{FitScale, Proposal};

/// Probability below the upper end of a 95 % interval.
const UPPER: f64 = 0.975;
/// Drawn recordings (seed 1001, 400 cases with one effect) lie so much further from what was told than the curvature says: the middle and
/// the outer parts of the errors alike. Noise of any colour is an autoregression of block means here, and the law was chosen by the data.
const AS_DRAWN: f64 = 1.1;
/// What an interval ends with that has no end.
const NO_END: f64 = 1e300;
/// A scatter's variance is raised by this share to see what comes from it.
const RAISED: f64 = 0.02;
/// The curvature is taken anew at most so often over the standard deviations that it gave ...
const WIDER: usize = 4;
/// ... until none changes by more than this share.
const SETTLED: f64 = 0.1;
/// More degrees of freedom are as good as infinitely many.
const MANY: f64 = 1e4;

/// The curvature at an optimum.
pub struct Covariance<'a> {
    fit: &'a Fit,
    tangent: Linearization,
    matrix: SymmetricMatrix,
    factor: CholeskyFactor,
    /// The same with one scatter raised, and its degrees of freedom.
    raised: Vec<(CholeskyFactor, f64)>,
    /// Under noises estimated again.
    again: Vec<CholeskyFactor>,
}

/// A scatter between insertions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    OwnSurface,
    OwnFriction,
    Force,
    Place,
}

const KINDS: [Kind; 4] = [Kind::OwnSurface, Kind::OwnFriction, Kind::Force, Kind::Place];

impl<'a> Covariance<'a> {
    /// Of a fit to recordings whose noise is told by what the fit leaves.
    #[must_use]
    pub fn new(fit: &'a Fit, data: &FitData, rng: &mut impl Rng) -> Self {
        let mut it = Self::known(fit, data);
        it.again = bootstrap_noise(&it.tangent, data, &it.matrix, rng)
            .iter()
            .map(SymmetricMatrix::cholesky)
            .collect();
        it
    }

    /// Of a fit to recordings whose noise is known.
    fn known(fit: &'a Fit, data: &FitData) -> Self {
        let mut tangent = Linearization::new(&fit.model, data, &fit.residuals);
        let mut wide_m = 0.0;
        for _ in 0..WIDER {
            let Some(next_m) = uncertainty_m(&tangent, &fit.model) else { break };
            if (next_m / wide_m - 1.0).abs() < SETTLED {
                break;
            }
            wide_m = next_m;
            // All by the same: what moves one face there and back again has to stay where it is.
            let step =
                |n: &Parameter| bends(n.role, &fit.model).then_some(wide_m.min(0.25 * (n.high - n.low)));
            tangent = tangent.with_wide_differences(&fit.model, data, &fit.residuals, &step);
        }
        let told: Vec<(Kind, f64, f64)> = KINDS
            .into_iter()
            .filter_map(|kind| of_scatter(kind, fit).map(|(count, freedom)| (kind, count, freedom)))
            .collect();
        // Variances as the degrees of freedom that are left tell them.
        let mut matrix = tangent.normal_matrix.clone();
        for (kind, count, freedom) in &told {
            raise(&mut matrix, &tangent, fit, *kind, (1.0, count / freedom));
        }
        let raised = told
            .iter()
            .map(|(kind, count, freedom)| {
                let mut more = matrix.clone();
                let now = count / freedom;
                raise(&mut more, &tangent, fit, *kind, (now, now * (1.0 + RAISED)));
                (more.cholesky(), *freedom)
            })
            .collect();
        Self { fit, factor: matrix.cholesky(), matrix, tangent, raised, again: Vec::new() }
    }

    /// Half the width of the 95 % interval of a combination of the numbers.
    fn half_width(&self, gradient: &[f64]) -> f64 {
        let (sd, freedom) = self.deviation(gradient);
        AS_DRAWN * sd * student_t::quantile(UPPER, freedom)
    }

    /// Standard deviation of a combination of the numbers, and the degrees of freedom by which it is told.
    fn deviation(&self, gradient: &[f64]) -> (f64, f64) {
        let variance = |f: &CholeskyFactor| f.forward_substitute(gradient).iter().map(|y| y * y).sum::<f64>();
        let all = variance(&self.factor);
        let mut lost = 0.0;
        for (more, freedom) in &self.raised {
            let part = ((variance(more) - all) / RAISED).clamp(0.0, all);
            lost += part * part / freedom;
        }
        // What becomes of a variance when the noise is told anew by what the fit leaves of it: how much too small, and how variable.
        let again: Vec<f64> = self.again.iter().map(|f| variance(f) / all).collect();
        let (mean, sd) = (stylet_stats::mean(&again), stylet_stats::sd(&again));
        let told = mean > 0.0 && sd.is_finite();
        if told {
            lost += 0.5 * (all * sd / mean).powi(2);
        }
        let freedom = if lost > 0.0 { all * all / lost } else { f64::INFINITY };
        let all = if told { all / mean.min(1.0) } else { all };
        (all.sqrt(), freedom.clamp(1.0, MANY))
    }

    /// Nats that speak against an effect's having none of its strengths: half the square of the normal deviate that is as rare as
    /// Student's is, the largest over the strengths. `None` where no strength can be none in the scale of the fit.
    #[must_use]
    pub fn nats_against_zero(&self, effect: usize) -> Option<f64> {
        let choice = &self.fit.model.effects[effect];
        let strengths = choice.info.parameters.iter().zip(&choice.values).enumerate();
        let nats = strengths.filter(|(_, (p, _))| p.strength).filter_map(|(k, (p, value))| {
            let off = match p.fit_scale() {
                FitScale::Linear => value - p.inactive,
                // So many deviations of the reciprocal, to first order.
                FitScale::Reciprocal => *value,
                FitScale::Log => return None,
            };
            let (sd, freedom) = self.deviation(&self.gradient(effect, k));
            let rare = normal::quantile(student_t::sf((off / sd).abs(), freedom));
            Some(0.5 * rare * rare)
        });
        nats.reduce(f64::max)
    }

    /// How a parameter of an effect changes with each number of the fit.
    fn gradient(&self, effect: usize, parameter: usize) -> Vec<f64> {
        let value = self.fit.model.effects[effect].values[parameter];
        let mut gradient = vec![0.0; self.tangent.normal_matrix.size];
        for (i, n) in self.tangent.shared.iter().enumerate() {
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

    /// Value and half width of the 95 % interval of a shared number, in the scale of the fit; `None` when it is not free.
    #[must_use]
    pub fn shared_parameter(&self, role: ParameterRole) -> Option<(f64, f64)> {
        let i = self.tangent.shared.iter().position(|n| n.role == role)?;
        let mut unit = vec![0.0; self.tangent.normal_matrix.size];
        unit[i] = 1.0;
        let half = self.half_width(&unit);
        let by_prior = || self.tangent.shared[i].prior_sd * student_t::quantile(UPPER, MANY);
        Some((self.fit.model.get(role, 0), if half > 0.0 { half } else { by_prior() }))
    }

    /// As far as a puncture force may lie beyond its value, in the scale of the fit, where no measurement ends it.
    #[must_use]
    pub fn prior_upper_end(&self, role: ParameterRole) -> Option<f64> {
        let n = self.tangent.shared.iter().find(|n| n.role == role)?;
        open_above(self.fit, n).then(|| n.prior_mean + n.prior_sd * normal::quantile(UPPER))
    }

    /// Whether a shared number stands at a bound.
    #[must_use]
    pub fn at_bound(&self, role: ParameterRole) -> bool {
        self.tangent.shared.iter().find(|n| n.role == role).is_some_and(|n| {
            let x = self.fit.model.get(role, 0);
            let near = 1e-6 * (n.high - n.low).min(1.0);
            x <= n.low + near || x >= n.high - near
        })
    }

    /// A parameter of an effect of the model with its interval.
    #[must_use]
    pub fn effect_parameter(&self, effect: usize, parameter: usize) -> Estimate {
        let choice = &self.fit.model.effects[effect];
        let p = &choice.info.parameters[parameter];
        let value = choice.values[parameter];
        if p.integer {
            return Estimate { value, low: value, high: value };
        }
        if value == f64::INFINITY {
            // As good as rigid: told by the reciprocal alone.
            let (x, half) =
                self.shared_parameter(ParameterRole::Effect { effect, parameter }).unwrap_or_default();
            let low = (1.0 / (x + half)).min(NO_END).max(p.low);
            return Estimate { value: NO_END, low, high: NO_END };
        }
        let half = self.half_width(&self.gradient(effect, parameter));
        let (low, high) = match p.fit_scale() {
            FitScale::Log => (value * libm::exp(-half / value), value * libm::exp(half / value)),
            FitScale::Reciprocal => {
                // Evenly about the reciprocal.
                let (x, half) = (1.0 / value, half / (value * value));
                (1.0 / (x + half), if x > half { 1.0 / (x - half) } else { f64::INFINITY })
            }
            FitScale::Linear => (value - half, value + half),
        };
        Estimate { value, low: low.max(p.low), high: high.min(p.high).min(NO_END) }
    }
}

/// Nats that an end of a 95 % interval may lack.
fn rare_nats() -> f64 {
    0.5 * normal::quantile(UPPER).powi(2)
}

/// Whether a puncture force that every insertion came up to just where its layer's face was may as well never have been reached.
fn open_above(fit: &Fit, n: &Parameter) -> bool {
    let ParameterRole::Puncture(layer) = n.role else { return false };
    let scatter = &fit.model.scatter;
    let times = n.high / fit.model.get(n.role, 0);
    let lost = |e: &RuptureEvent| {
        let force = (e.force_excess + 1.0) / times - 1.0;
        let beyond =
            RuptureEvent { force_excess: force, force_excess_rate: e.force_excess_rate / times, ..*e };
        evaluate_rupture(&beyond, scatter).nats - evaluate_rupture(e, scatter).nats
    };
    fit.residuals.ruptures.iter().filter_map(|e| e.get(layer)).map(lost).sum::<f64>() < rare_nats()
}

/// A fit whose puncture forces that may as well never have been reached are as believed, and hold nothing any more: what holds a force to
/// where it happened to stand at a face holds stiffness and relaxation with it.
#[must_use]
pub fn release_unreached_punctures(fit: Fit, data: &FitData) -> Fit {
    let below = |n: &Parameter| n.prior_mean > fit.model.get(n.role, 0) && open_above(&fit, n);
    let open: Vec<Parameter> = fit.model.shared_parameters().into_iter().filter(below).collect();
    if open.is_empty() {
        return fit;
    }
    let mut model = fit.model.clone();
    open.iter().for_each(|n| model.set(n.role, 0, n.prior_mean));
    let free = stylet_identify::fit::fit(&model, data, Effort::FULL);
    free.filter(|f| f.nats() < fit.nats() + rare_nats()).unwrap_or(fit)
}

/// How uncertain in m the faces are at which the force bends: the middle one.
fn uncertainty_m(tangent: &Linearization, model: &Model) -> Option<f64> {
    let variances = tangent.factor().inverse_diagonal();
    let bent = tangent.shared.iter().zip(variances).filter(|(n, v)| bends(n.role, model) && v.is_finite());
    let mut sd: Vec<f64> = bent.filter(|(n, v)| v.sqrt() > n.step).map(|(_, v)| v.sqrt()).collect();
    (!sd.is_empty()).then(|| stylet_stats::order_statistics::median(&mut sd))
}

/// Whether the force bends where such a number puts a face.
fn bends(role: ParameterRole, model: &Model) -> bool {
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

/// How many numbers tell a scatter of a fit, and how many degrees of freedom are left of them; `None` where there is no such
/// scatter.
fn of_scatter(kind: Kind, fit: &Fit) -> Option<(f64, f64)> {
    let model = &fit.model;
    let recordings = model.per_recording.len() as f64;
    // Per layer, how many ruptures tell this scatter: the share of each that it has.
    let told = |risk: usize| -> Vec<f64> {
        (0..model.layers())
            .map(|l| {
                let events = fit.residuals.ruptures.iter().filter_map(|e| e.get(l)).filter(|e| e.ruptured);
                events.map(|e| evaluate_rupture(e, &model.scatter).shares[risk].powi(2)).sum()
            })
            .collect()
    };
    let (count, fitted) = match kind {
        Kind::OwnSurface if model.free.recording_surface => (recordings, f64::from(model.free.surface)),
        Kind::OwnFriction if model.free.recording_friction => (recordings, 1.0),
        Kind::Force if model.scatter.rupture_force > 0.0 => {
            let told = told(0);
            (told.iter().sum(), told.iter().filter(|n| **n > 0.5).count() as f64)
        }
        Kind::Place if model.scatter.rupture_depth_m > 0.0 => {
            let told = told(1);
            let faces = told.iter().filter(|n| **n > 0.5).count() as f64;
            (told.iter().sum(), if model.free.thickness { faces } else { 0.0 })
        }
        _ => return None,
    };
    (count > 0.0).then(|| (count, (count - fitted).clamp(1.0_f64.min(count), count)))
}

/// Changes a normal matrix as if the variance of a scatter were `to` times what the fit has, where it was `from` times that.
fn raise(
    matrix: &mut SymmetricMatrix,
    tangent: &Linearization,
    fit: &Fit,
    kind: Kind,
    (from, to): (f64, f64),
) {
    let shared = tangent.shared.len();
    let (role, row) = match kind {
        Kind::OwnSurface => (Some(ParameterRole::RecordingSurface), 0),
        Kind::OwnFriction => (Some(ParameterRole::RecordingFriction), 0),
        Kind::Force => (None, 0),
        Kind::Place => (None, 1),
    };
    if let Some(role) = role {
        let Some(o) = tangent.per_recording.iter().position(|n| n.role == role) else { return };
        let information = 1.0 / (tangent.per_recording[o].prior_sd * tangent.per_recording[o].prior_sd);
        for r in 0..fit.model.per_recording.len() {
            let i = tangent.index_of(o, r);
            matrix.add(i, i, information * (1.0 / to - 1.0 / from));
        }
        return;
    }
    let scatter = &fit.model.scatter;
    for (r, events) in fit.residuals.ruptures.iter().enumerate() {
        for (l, event) in events.iter().enumerate() {
            let (force, place) = rupture_sds(event, scatter);
            let (all, own) = if kind == Kind::Force {
                (force, scatter.rupture_force)
            } else {
                (place, scatter.rupture_depth_m)
            };
            let weight = |times: f64| all * all / (all * all + (times - 1.0) * own * own);
            let change = weight(to) - weight(from);
            let at =
                |k: usize| tangent.columns[k].rupture_rows.get(r).and_then(|c| c.get(4 * l + row)).copied();
            let numbers = (0..shared).map(|i| (i, i));
            let own_numbers = (0..tangent.per_recording.len()).map(|o| (tangent.index_of(o, r), shared + o));
            let told: Vec<(usize, f64)> = numbers
                .chain(own_numbers)
                .filter_map(|(i, k)| at(k).filter(|c| *c != 0.0).map(|c| (i, c)))
                .collect();
            for (n, (i, a)) in told.iter().enumerate() {
                told[..=n].iter().for_each(|(j, b)| matrix.add(*i, *j, change * a * b));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{AS_DRAWN, Covariance, RAISED, release_unreached_punctures};
    use rand::rngs::ChaCha8Rng;
    use rand::{RngExt, SeedableRng};
    use std::sync::Arc;
    use stylet_identify::block_averages::{BLOCK_S, BlockAverages};
    use stylet_identify::fit::{Effort, Fit, Linearization, fit};
    use stylet_identify::likelihood::{FitData, ReplayCache, replay, residuals};
    use stylet_identify::model::{Assumptions, EffectTerm, Model, ParameterRole};
    use stylet_identify::noise::Noise;
    use stylet_record::Recording;
    use stylet_stats::linear_algebra::SymmetricMatrix;
    use stylet_stats::student_t;
    use stylet_tissue::{Layer, Tissue};

    fn belief() -> Assumptions {
        let layer = Layer {
            thickness_m: 0.02,
            stiffness_n_per_m: 90.0,
            friction_ns_per_m2: 6000.0,
            puncture_n: None,
            name: String::new(),
        };
        Assumptions {
            tissue: Tissue { surface_m: 0.002, layers: vec![layer] },
            known_effects: Vec::new(),
            tolerance: vec![0.3],
            thickness_tolerance: vec![0.1],
            surface_tolerance_m: 0.05,
        }
    }

    /// Half way into the layer, and out again.
    fn blocks() -> BlockAverages {
        let (mut t, mut z, mut at) = (Vec::new(), Vec::new(), -0.004);
        for k in 0..1600 {
            let s = f64::from(k) / 200.0;
            at += if s < 5.0 { 0.003 + 0.001 * (3.0 * s).sin() } else { -0.004 } / 200.0;
            t.push(s);
            z.push(at);
        }
        let f = vec![0.0; t.len()];
        let r = Recording::new(t, z, f).expect("a recording");
        BlockAverages::new(&r, &vec![false; r.time_s.len()], BLOCK_S)
    }

    /// Insertions that differ in what one number of each recording's own is told by `set`, with a little noise.
    fn insertions(own: &[f64], set: impl Fn(&mut Model, f64)) -> (Model, FitData) {
        into(belief(), own, set)
    }

    /// The same into what is believed to be so.
    fn into(belief: Assumptions, own: &[f64], set: impl Fn(&mut Model, f64)) -> (Model, FitData) {
        let blank = FitData::new(Arc::new(vec![blocks(); own.len()]), Noise::white(1e-3), 0.0);
        let model = Model::base(Arc::new(belief), own.len());
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let mut full: Vec<BlockAverages> = blank.recordings.to_vec();
        for (r, x) in own.iter().enumerate() {
            let mut there = model.clone();
            set(&mut there, *x);
            let instants = ReplayCache::new(&there, &blank, r).expect("a trail").free_rupture_times();
            there.rupture_times_s[r] = instants;
            full[r].force_n = replay(&there, &blank, r).expect("a replay").force_n;
            full[r].force_n.iter_mut().for_each(|f| *f += 3.4e-3 * (rng.random::<f64>() - 0.5));
        }
        (model, FitData::new(Arc::new(full), Noise::white(1e-3), 0.0))
    }

    /// A layer of 6 mm comes to 0.54 N at its far face: there it gives way, whether 0.54 N would have broken it or not.
    #[test]
    fn a_puncture_force_that_no_insertion_reached_may_be_any_larger_one() {
        let of = |believed_n: f64, true_n: f64| {
            let mut b = belief();
            b.tissue.layers[0].thickness_m = 0.006;
            b.tissue.layers[0].puncture_n = Some(believed_n);
            into(b, &[0.0, 0.0], |m, _| m.tissue.layers[0].puncture_n = Some(true_n))
        };
        let at = |model: &Model, data: &FitData, f_n: f64| {
            let mut model = model.clone();
            for r in 0..2 {
                model.rupture_times_s[r] =
                    ReplayCache::new(&model, data, r).expect("a trail").free_rupture_times();
            }
            model.tissue.layers[0].puncture_n = Some(f_n);
            fit(&model, data, Effort::FULL).expect("a fit")
        };
        let role = ParameterRole::Puncture(0);
        let (model, data) = of(0.7, 0.7);
        let tied = at(&model, &data, 0.54);
        let open = Covariance::known(&tied, &data).prior_upper_end(role).expect("open");
        assert!((open - 1.0 - 0.3 * 1.96).abs() < 1e-3, "{open}");
        let free = release_unreached_punctures(tied.clone(), &data);
        assert!((free.model.get(role, 0) - 1.0).abs() < 1e-6, "{}", free.model.get(role, 0));
        assert!(free.nats() < tied.nats() + 1.93);
        // One that broke the layer before its face is told.
        let (model, data) = of(0.4, 0.4);
        let told = at(&model, &data, 0.4);
        assert_eq!(Covariance::known(&told, &data).prior_upper_end(role), None);
        assert_eq!(
            release_unreached_punctures(told.clone(), &data).model.get(role, 0),
            told.model.get(role, 0)
        );
        assert_eq!(Covariance::known(&told, &data).prior_upper_end(ParameterRole::Stiffness(0)), None);
    }

    /// The mean of four that differ is known as well as four numbers tell a mean: Student's interval of three degrees of freedom.
    #[test]
    fn a_number_that_differs_between_insertions_has_the_interval_of_a_mean_of_few() {
        let own = [-4e-4, 7e-4, 1e-4, -8e-4];
        let wanted = |own: &[f64]| AS_DRAWN * student_t::quantile(0.975, 3.0) * stylet_stats::sd(own) / 2.0;
        let (mut model, data) = insertions(&own, |m, x| m.tissue.surface_m += x);
        model.free.recording_surface = true;
        model.per_recording.iter_mut().zip(own).for_each(|(o, x)| o.surface_m = x);
        let told = fit(&model, &data, Effort::FULL).expect("a fit");
        let (_, half) =
            Covariance::known(&told, &data).shared_parameter(ParameterRole::Surface).expect("free");
        assert!((half / wanted(&own) - 1.0).abs() < 0.1, "{half} for {}", wanted(&own));

        let own = [-0.03, 0.05, 0.02, -0.05];
        let (mut model, data) =
            insertions(&own, |m, x| m.tissue.layers[0].friction_ns_per_m2 *= libm::exp(x));
        model.free.recording_friction = true;
        model.per_recording.iter_mut().zip(own).for_each(|(o, x)| o.ln_friction = x);
        let told = fit(&model, &data, Effort::FULL).expect("a fit");
        let (_, half) =
            Covariance::known(&told, &data).shared_parameter(ParameterRole::Friction(0)).expect("free");
        assert!((half / wanted(&own) - 1.0).abs() < 0.1, "{half} for {}", wanted(&own));
    }
    /// Where the noise is known a strength is told as a normal deviate tells it; where it is told by what the fit leaves, as Student's does,
    /// which is less.
    #[test]
    fn a_strength_is_told_from_none_by_the_degrees_of_freedom_that_its_interval_has() {
        let (mut model, data) = insertions(&[0.0, 0.0], |_, _| ());
        let mut drifting: Vec<BlockAverages> = data.recordings.to_vec();
        for b in &mut drifting {
            b.force_n.iter_mut().zip(&b.start_s).for_each(|(f, t)| *f += 0.005 * t);
        }
        let mut noise = Noise::white(0.004);
        noise.bins[0].ar[0] = 0.9;
        let data = FitData::new(Arc::new(drifting), noise, 0.0);
        model.free.thickness = false;
        let drift = stylet_tissue::effect_info("force_drift").expect("in the library");
        let told =
            fit(&model.with_effect(EffectTerm::new(drift, &[0.005])), &data, Effort::FULL).expect("a fit");
        let nats = |s: &Covariance, dof: f64| {
            let e = s.effect_parameter(0, 0);
            0.5 * (AS_DRAWN * e.value / (e.high - e.low) * 2.0 * student_t::quantile(0.975, dof)).powi(2)
        };
        let known = Covariance::known(&told, &data);
        let by_normal = known.nats_against_zero(0).expect("a strength");
        assert!(by_normal > 8.0 && (by_normal / nats(&known, 1e4) - 1.0).abs() < 0.01, "{by_normal}");
        let own = Covariance::new(&told, &data, &mut ChaCha8Rng::seed_from_u64(3));
        let by_student = own.nats_against_zero(0).expect("a strength");
        assert!(by_student < 0.97 * nats(&own, 1e4), "{by_student} of {}", nats(&own, 1e4));
    }

    /// Under a slow noise the place at which a force bends is far less sure than a derivative says, which sees a jump there; under a white
    /// one both agree.
    #[test]
    fn the_place_of_a_bend_is_as_sure_as_the_noise_lets_it_be_and_not_surer() {
        let (mut model, mut data) = insertions(&[0.0, 0.0], |_, _| ());
        // The far face is never reached.
        model.free.thickness = false;
        for (slow, least, most) in [(0.0, 0.97, 1.06), (0.98, 1.5, 20.0)] {
            let mut noise = Noise::white(0.02);
            noise.bins[0].ar[0] = slow;
            data = data.with_noise(noise);
            let told = fit(&model, &data, Effort::FULL).expect("a fit");
            let tangent = Linearization::new(&told.model, &data, &told.residuals);
            let at = tangent.shared.iter().position(|n| n.role == ParameterRole::Surface).expect("free");
            let by_derivative = AS_DRAWN * stylet_stats::Z95 * tangent.factor().inverse_diagonal()[at].sqrt();
            let (_, half) =
                Covariance::known(&told, &data).shared_parameter(ParameterRole::Surface).expect("free");
            let ratio = half / by_derivative;
            assert!(ratio > least && ratio < most, "{slow}: {ratio}");
        }
    }

    /// A scatter that makes a share of a variance takes the square of that share over its degrees of freedom, a noise told anew half the
    /// square of how variable it leaves it (Welch and Satterthwaite).
    #[test]
    fn a_deviation_has_the_degrees_of_freedom_of_what_its_variance_is_made_of() {
        let (model, data) = insertions(&[0.0, 0.0], |_, _| ());
        let told = fit(&model, &data, Effort { max_iterations: 1, min_gain_nats: 1.0 }).expect("a fit");
        let of = |raised: &[(f64, f64)], again: &[f64]| {
            let known = Covariance::known(&told, &data);
            let size = known.tangent.normal_matrix.size;
            // A variance of so much for each number.
            let even = |variance: f64| {
                let mut m = SymmetricMatrix::zeros(size);
                (0..size).for_each(|i| m.add(i, i, 1.0 / variance));
                m.cholesky()
            };
            let spread = Covariance {
                factor: even(0.5),
                raised: raised.iter().map(|(s, f)| (even(0.5 * (1.0 + RAISED * s)), *f)).collect(),
                again: again.iter().map(|a| even(0.5 * a)).collect(),
                ..known
            };
            let mut gradient = vec![0.0; size];
            (gradient[0], gradient[1]) = (0.8, 0.6);
            spread.deviation(&gradient)
        };
        let near = |(sd, freedom): (f64, f64), variance: f64, wanted: f64| {
            assert!((sd / variance.sqrt() - 1.0).abs() < 1e-4, "{sd} for {}", variance.sqrt());
            assert!((freedom / wanted - 1.0).abs() < 1e-3, "{freedom} for {wanted}");
        };
        near(of(&[], &[]), 0.5, 1e4);
        near(of(&[(0.5, 3.0), (0.25, 5.0)], &[]), 0.5, 1.0 / (0.25 / 3.0 + 0.0625 / 5.0));
        // More than the whole of it is the whole, less than nothing nothing; one degree of freedom is the least.
        near(of(&[(3.0, 7.0)], &[]), 0.5, 7.0);
        near(of(&[(-0.5, 7.0)], &[]), 0.5, 1e4);
        near(of(&[(1.0, 0.4)], &[]), 0.5, 1.0);
        // Noise told anew at four fifths, and by a fifth of one more or less.
        near(of(&[], &[0.6, 0.8, 1.0]), 0.5 / 0.8, 2.0 * 16.0);
        near(of(&[(0.5, 3.0)], &[0.6, 0.8, 1.0]), 0.5 / 0.8, 1.0 / (0.25 / 3.0 + 1.0 / 32.0));
        // Where it would be larger nothing is taken away; one alone says nothing.
        near(of(&[], &[1.2, 1.4]), 0.5, 2.0 * (1.3 / 0.02_f64.sqrt()).powi(2));
        near(of(&[], &[0.5]), 0.5, 1e4);
    }

    /// A model where it stands, fitted or not.
    fn standing(model: Model, data: &FitData) -> Fit {
        Fit { residuals: residuals(&model, data).expect("a replay"), model }
    }

    #[test]
    fn a_shared_number_stands_at_a_bound_within_a_millionth() {
        let (model, data) = insertions(&[0.0], |_, _| ());
        let n =
            *model.shared_parameters().iter().find(|n| n.role == ParameterRole::Stiffness(0)).expect("free");
        let near = 1e-6 * (n.high - n.low).min(1.0);
        for (x, at) in [
            (n.low + 0.9 * near, true),
            (n.low + 1.1 * near, false),
            (n.prior_mean, false),
            (n.high - 1.1 * near, false),
            (n.high - 0.9 * near, true),
        ] {
            let mut moved = model.clone();
            moved.set(n.role, 0, x);
            let fit = standing(moved, &data);
            let spread = Covariance::known(&fit, &data);
            assert_eq!(spread.at_bound(n.role), at, "{x}");
            assert!(!spread.at_bound(ParameterRole::Puncture(0)), "nothing punctures");
        }
    }

    /// A time goes by its logarithm, what is rigid when neutral by its reciprocal.
    #[test]
    fn intervals_lie_evenly_in_the_scale_of_the_fit() {
        let (model, data) = insertions(&[0.0, 0.0], |_, _| ());
        let of = |id: &str, values: &[f64], parameter: usize| {
            let choice = EffectTerm::new(stylet_tissue::effect_info(id).expect("in the library"), values);
            let fit = standing(model.with_effect(choice), &data);
            let spread = Covariance::known(&fit, &data);
            (spread.effect_parameter(0, parameter), spread.nats_against_zero(0))
        };
        let (e, _) = of("periodic_interference", &[3e-4, 1.7, 0.2], 1);
        assert!(e.low < 1.7 && e.high < 3.0, "{e:?}");
        assert!((e.low * e.high / (1.7 * 1.7) - 1.0).abs() < 1e-9, "{e:?}");
        let (e, against) = of("needle_compliance", &[40_000.0], 0);
        let (below, above) = (1.0 / e.value - 1.0 / e.high, 1.0 / e.low - 1.0 / e.value);
        assert!(below > 0.0 && (below / above - 1.0).abs() < 1e-9, "{e:?}");
        let deviations = AS_DRAWN / e.value / above * stylet_stats::Z95;
        let wanted = 0.5 * deviations * deviations;
        let against = against.expect("a strength");
        assert!((against / wanted - 1.0).abs() < 0.02, "{against} for {wanted}");
        // So stiff that it may as well be rigid.
        let (e, against) = of("needle_compliance", &[1e9], 0);
        assert!(e.high == 1e300 && e.low > 1e4 && e.low < 1e9, "{e:?}");
        assert!(against.is_some_and(|nats| nats < 0.5), "{against:?}");
        let (e, _) = of("needle_compliance", &[f64::INFINITY], 0);
        assert!(e.value == 1e300 && e.high == 1e300 && e.low > 1e4 && e.low < 1e9, "{e:?}");
        // None of less than nothing.
        let (e, against) = of("coulomb_friction", &[1e-4], 0);
        assert!(e.low == 0.0 && e.high > 1e-3 && against.is_some_and(|nats| nats < 0.5), "{e:?}");
    }

    #[test]
    fn what_is_not_free_has_no_interval_and_what_nothing_tells_that_of_its_prior() {
        let (mut model, data) = insertions(&[0.0, 0.0], |_, _| ());
        let fit = standing(model.clone(), &data);
        let spread = Covariance::known(&fit, &data);
        assert!(spread.shared_parameter(ParameterRole::Puncture(0)).is_none());
        let (value, half) = spread.shared_parameter(ParameterRole::Stiffness(0)).expect("free");
        assert!(value == fit.model.get(ParameterRole::Stiffness(0), 0) && half > 0.0 && half < 0.1, "{half}");
        // A layer that the needle never leaves.
        let n =
            *model.shared_parameters().iter().find(|n| n.role == ParameterRole::Thickness(0)).expect("free");
        let (_, half) = spread.shared_parameter(n.role).expect("free");
        assert!(
            (half / (AS_DRAWN * n.prior_sd * stylet_stats::Z95) - 1.0).abs() < 0.01,
            "{half} for {}",
            n.prior_sd
        );
        model.free.thickness = false;
        let fit = standing(model, &data);
        assert!(Covariance::known(&fit, &data).shared_parameter(n.role).is_none());
    }
}
