//! One Levenberg-Marquardt step within bounds, and its extrapolation.

use super::Linearization;
use crate::likelihood::FitData;
use crate::model::{Model, NO_RUPTURE, Parameter, ParameterRole};
use stylet_stats::linear_algebra::dot;

/// Largest change of a rupture time in one step, in blocks; the linearization is not valid beyond.
const MAX_RUPTURE_STEP_BLOCKS: f64 = 1.5;

/// Smallest extrapolation factor that is tried; a smaller one gains too little for a further replay.
const MIN_EXTRAPOLATION: f64 = 1.3;
/// Largest extrapolation factor, which limits the error of the parabola.
const MAX_EXTRAPOLATION: f64 = 4.0;

/// Clamps every shared parameter to its bounds.
pub(super) fn clamp_to_bounds(model: &mut Model) {
    for n in model.shared_parameters() {
        let x = model.get(n.role, 0);
        if x < n.low || x > n.high {
            model.set(n.role, 0, x.clamp(n.low, n.high));
        }
    }
}

/// Extrapolation factor of the step `delta`: minimum of the parabola that has the slope of the linearization at zero and has fallen by
/// `gained` (nats) at one. The linearization weights outliers more than the Huber loss does, so that full steps are consistently too short.
/// `None` if the factor is below [`MIN_EXTRAPOLATION`].
pub(super) fn extrapolation_factor(t: &Linearization, delta: &[f64], gained: f64) -> Option<f64> {
    let falls = dot(&t.neg_gradient, delta);
    let share = if gained < falls { falls / (2.0 * (falls - gained)) } else { MAX_EXTRAPOLATION };
    (share > MIN_EXTRAPOLATION).then_some(share.min(MAX_EXTRAPOLATION))
}

/// One damped step within bounds over the parameters with `among(index)`, in the order of the normal matrix; `None` when none can move.
pub(super) fn damped_step(
    model: &Model,
    data: &FitData,
    t: &Linearization,
    damping: f64,
    among: impl Fn(usize) -> bool,
) -> Option<Vec<f64>> {
    let ns = t.shared.len();
    let size = t.normal_matrix.size;
    let mut damped = t.normal_matrix.clone();
    for i in 0..size {
        damped.add(i, i, damping * t.normal_matrix.at(i, i));
    }
    let parameter = |i: usize| -> (Parameter, usize) {
        if i < ns {
            (t.shared[i], 0)
        } else {
            (t.per_recording[(i - ns) % t.per_recording.len()], (i - ns) / t.per_recording.len())
        }
    };
    let mut free: Vec<usize> = (0..size).filter(|i| among(*i) && t.normal_matrix.at(*i, *i) > 0.0).collect();
    let mut delta = vec![0.0; size];
    // Active set: parameters at a bound are fixed there, the others are solved for again.
    for _ in 0..6 {
        let rhs: Vec<f64> = free
            .iter()
            .map(|&i| {
                let held: f64 = (0..size)
                    .filter(|j| delta[*j] != 0.0 && !free.contains(j))
                    .map(|j| t.normal_matrix.at(i, j) * delta[j])
                    .sum();
                t.neg_gradient[i] - held
            })
            .collect();
        let x = damped.submatrix(&free).cholesky().solve(&rhs);
        let mut kept = Vec::new();
        let mut hit = false;
        for (&i, x) in free.iter().zip(&x) {
            let (n, r) = parameter(i);
            let now = model.get(n.role, r);
            let (mut low, mut high) = (n.low - now, n.high - now);
            if let ParameterRole::RuptureTime(_) = n.role {
                let b = &data.recordings[r];
                let reach = MAX_RUPTURE_STEP_BLOCKS * b.sample_step_s * b.samples_per_block as f64;
                (low, high) = (-reach, reach);
            }
            if *x < low || *x > high {
                delta[i] = x.clamp(low, high);
                hit = true;
            } else {
                delta[i] = *x;
                kept.push(i);
            }
        }
        if !hit {
            break;
        }
        kept.iter().for_each(|i| delta[*i] = 0.0);
        free = kept;
        if free.is_empty() {
            break;
        }
    }
    if delta.iter().all(|d| *d == 0.0) || delta.iter().any(|d| !d.is_finite()) {
        return None;
    }
    Some(delta)
}

/// The model after `share` of a step, clamped to the bounds of the parameters.
#[must_use]
pub fn apply_step(model: &Model, data: &FitData, t: &Linearization, delta: &[f64], share: f64) -> Model {
    let mut next = model.clone();
    for (n, d) in t.shared.iter().zip(delta) {
        next.set(n.role, 0, (model.get(n.role, 0) + share * d).clamp(n.low, n.high));
    }
    for r in 0..data.recording_count() {
        for (o, n) in t.per_recording.iter().enumerate() {
            let x = model.get(n.role, r);
            if x < NO_RUPTURE {
                let there = x + share * delta[t.index_of(o, r)];
                let bound = !matches!(n.role, ParameterRole::RuptureTime(_));
                next.set(n.role, r, if bound { there.clamp(n.low, n.high) } else { there });
            }
        }
        order_rupture_times(&mut next.rupture_times_s[r], data.recordings[r].span_s());
    }
    next
}

/// Keeps rupture times inside the recording and in order.
pub(super) fn order_rupture_times(rupture_times: &mut [f64], (first, last): (f64, f64)) {
    let mut before = first;
    for t in rupture_times.iter_mut().filter(|t| **t < NO_RUPTURE) {
        *t = t.clamp(before, last);
        before = *t;
    }
}
