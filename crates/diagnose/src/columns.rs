//! The Jacobian's columns of the base parameters from a single replay.
//!
//! With imposed ruptures the force is linear in every layer's stiffness and friction, whatever most
//! effects make of it, and the puncture force shows in the rupture's event alone. Where that is not so
//! (a needle that gives, releases kept back, a sensor that clips), or where a strain before the last one
//! may count (punctures that depend on speed), there is no short cut.

use crate::fit::{Data, Residuals, WORTH_THREADS};
use crate::forward::Replay;
use crate::model::{Model, Role, Slot};
use crate::track::Track;
use rayon::prelude::*;
use stylet_tissue::{AnyEffect, Measurement, Reading};

/// Relative step by which the events' slopes are told.
const STEP: f64 = 1e-4;

/// Whether stiffness and friction act linearly and puncture forces on events alone.
#[must_use]
pub fn are_linear(model: &Model) -> bool {
    let bent = |e: &AnyEffect| {
        matches!(
            e,
            AnyEffect::NeedleCompliance(_)
                | AnyEffect::IncompleteRelease(_)
                | AnyEffect::SoftBoundary(_)
                | AnyEffect::RateDependentPuncture(_)
                | AnyEffect::Saturation(_)
                | AnyEffect::Quantisation(_)
        )
    };
    let tried = |id: &str| {
        matches!(id, "needle_compliance" | "incomplete_release" | "soft_boundary" | "rate_dependent_puncture")
    };
    !model.given.iter().any(bent) && !model.effects.iter().any(|c| tried(c.info.id))
}

/// The columns of the base parameters, whitened samples then events, in the order of the base slots;
/// `None` where there is no short cut.
#[must_use]
pub fn base(model: &Model, data: &Data, at: &Residuals, slots: &[Slot]) -> Option<Vec<Vec<f64>>> {
    if !are_linear(model) {
        return None;
    }
    let compiled = model.compile()?;
    let mut effects = model.given.clone();
    for choice in &model.effects {
        effects.push(choice.effect()?);
    }
    effects.retain(|e| {
        matches!(e, AnyEffect::ForceGain(_) | AnyEffect::LowPassLag(_) | AnyEffect::TimeDelay(_))
    });
    let linear = Measurement::new(&effects);
    let mut wanted: Vec<(usize, usize, f64)> = Vec::new(); // layer, what, value
    for slot in slots {
        if let Role::Base { layer, what } = slot.role {
            wanted.push((layer, what, model.get(slot)));
        }
    }
    let (n, layers) = (at.w.len(), model.assumed.layers.len());
    let mut columns = vec![vec![0.0; n + at.events.len()]; wanted.len()];
    let column_of = |layer: usize, what: usize| wanted.iter().position(|w| w.0 == layer && w.1 == what);
    let elastic: Vec<Option<usize>> = (0..layers).map(|l| column_of(l, 0)).collect();
    let viscous: Vec<Option<usize>> = (0..layers).map(|l| column_of(l, 1)).collect();
    let from: Vec<usize> = data
        .tracks
        .iter()
        .scan(0, |next, t| {
            let first = *next;
            *next += t.len();
            Some(first)
        })
        .collect();
    let whitened = |(k, (track, ruptures)): (usize, (&Track, &Vec<f64>))| {
        let mut raw = vec![vec![0.0; track.len()]; wanted.len()];
        let mut replay = Replay::start(&compiled, track);
        for i in 0..track.len() {
            let force = replay.tissue(&compiled, track, ruptures, i);
            if let Some(&Some(column)) = elastic.get(force.active_layer - 1) {
                raw[column][i] = -force.elastic_n / wanted[column].2;
            }
            let z = replay.state.tip_m();
            if z > compiled.law.slabs()[0].front_m {
                let v = compiled.law.viscous_velocity(replay.state.tip_velocity_mps());
                for (slab, column) in compiled.law.slabs().iter().zip(&viscous) {
                    if let Some(column) = *column {
                        raw[column][i] = -v * slab.friction_ns_per_m2 * slab.inside_m(z) / wanted[column].2;
                    }
                }
            }
        }
        for (raw, _) in raw.iter_mut().zip(&wanted).filter(|(_, w)| w.1 < 2) {
            if !linear.is_plain() {
                let mut state = linear.start(track.sample_hz * 4.0);
                for (i, x) in raw.iter_mut().enumerate() {
                    *x = linear.step(
                        &mut state,
                        &Reading { time_s: track.t[i], tissue_n: *x, ..Reading::default() },
                    );
                }
            }
            // The sample of a drop may be mixed: it tells no slope.
            for k in ruptures.iter().map(|r| track.first_from(*r)).filter(|k| *k < track.len()) {
                raw[k] = 0.0;
            }
            if data.dead_n > 0.0 {
                let at = &at.e[from[k]..];
                raw.iter_mut().zip(at).filter(|(_, e)| **e == 0.0).for_each(|(x, _)| *x = 0.0);
            }
            let mut out = vec![0.0; track.len()];
            data.noise.whiten(track, raw, &mut out);
            *raw = out;
        }
        raw
    };
    let parts = data.tracks.iter().zip(&data.ruptures).enumerate();
    let parts: Vec<Vec<Vec<f64>>> = if n < WORTH_THREADS {
        parts.map(whitened).collect()
    } else {
        data.tracks.par_iter().zip(&data.ruptures).enumerate().map(whitened).collect()
    };
    for (k, part) in parts.iter().enumerate() {
        for (j, &(layer, what, value)) in wanted.iter().enumerate() {
            if what < 2 {
                columns[j][from[k]..from[k] + part[j].len()].copy_from_slice(&part[j]);
            }
            let Some(event) = at.events.get(k * layers + layer) else { continue };
            let (by_elastic, by_puncture) = match what {
                0 => (STEP, 0.0),
                1 => continue,
                _ => (0.0, STEP),
            };
            columns[j][n + k * layers + layer] =
                (event.u_at(by_elastic, by_puncture) - event.u_at(0.0, 0.0)) / (STEP * value);
        }
    }
    Some(columns)
}

#[cfg(test)]
mod tests {
    use super::base;
    use crate::fit::{Data, Residuals, jacobian_by_differences, residuals};
    use crate::hidden::{self, Kind};
    use crate::model::Model;
    use crate::noise::Noise;
    use crate::search::choice;
    use crate::track::Track;
    use std::sync::Arc;

    /// One replay gives the columns that a replay per parameter gives.
    #[test]
    fn one_replay_gives_the_columns_of_finite_differences() {
        let case = hidden::case(&hidden::sketch_of(3, 1, Kind::Clean, 1).drawn);
        let tracks: Vec<Track> = case.recordings.iter().map(|r| Track::new(r, &[])).collect();
        let noise = Noise::of([0.5, 0.1], 0.02);
        let data = Data {
            tracks: Arc::new(tracks),
            ruptures: case.ruptures.clone(),
            reach: Arc::default(),
            dead_n: 0.0,
            noise,
        };
        let plain = Model::base(&case.believed.tissue, 0.3, &[]);
        for (id, values) in [
            ("", vec![]),
            ("nonlinear_elasticity", vec![12.0]),
            ("stress_relaxation", vec![0.3, 1.5]),
            ("coulomb_friction", vec![4.0]),
            ("power_law_friction", vec![0.7]),
            ("asymmetric_friction", vec![0.2]),
            ("presliding_friction", vec![4.0, 1e-3]),
            ("respiration", vec![1e-3, 0.2, 0.4]),
            ("boundary_shift", vec![1.0, 0.003]),
            ("low_pass_lag", vec![0.05]),
            ("time_delay", vec![0.032]),
            ("position_scale", vec![0.03]),
            ("hidden_membrane", vec![0.02, 90.0, 0.4]),
            ("tool_inertia", vec![0.4]),
        ] {
            let mut model = plain.clone();
            if let Some(choice) = choice(id, &values) {
                model = model.with(choice);
            }
            let (mut at, mut work) = (Residuals::default(), Residuals::default());
            assert!(residuals(&model, &data, &mut at), "{id}");
            let slots = model.slots();
            let fast = base(&model, &data, &at, &slots).expect("linear");
            let slow = jacobian_by_differences(&model, &data, &at, &mut work);
            let mut mixed = vec![false; at.w.len() + at.events.len()];
            let mut from = 0;
            for (track, ruptures) in data.tracks.iter().zip(&data.ruptures) {
                for k in ruptures.iter().map(|r| track.first_from(*r)).filter(|k| *k < track.len()) {
                    mixed[from + k..(from + k + 3).min(from + track.len())].fill(true);
                }
                // A chain with memory sees jumps between samples, which the columns see at the next one: told well
                // enough for a fit, but not here.
                let jumps =
                    track.kinks.iter().map(|k| k.sample).chain(ruptures.iter().map(|r| track.first_from(*r)));
                for k in jumps.filter(|k| *k < track.len() && matches!(id, "low_pass_lag" | "time_delay")) {
                    mixed[from + k.saturating_sub(2)..(from + k + 200).min(from + track.len())].fill(true);
                }
                from += track.len();
            }
            for (j, column) in fast.iter().enumerate() {
                let size = slow.columns[j].iter().fold(1e-9_f64, |m, x| m.max(x.abs()));
                for (i, (a, b)) in column.iter().zip(&slow.columns[j]).enumerate().filter(|x| !mixed[x.0]) {
                    let near = if i < at.w.len() { 1e-4 } else { 2e-3 };
                    assert!((a - b).abs() < near * size, "{id}, number {j}, row {i}: {a} against {b}");
                }
            }
        }
    }
}
