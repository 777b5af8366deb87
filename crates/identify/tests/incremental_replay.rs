//! Jacobian columns are computed by incremental replay, which must equal a full replay bit for bit, whatever
//! effects the model has.

use std::sync::Arc;
use stylet_identify::block_averages::{BLOCK_S, BlockAverages};
use stylet_identify::likelihood::{FitData, ReplayCache, replay};
use stylet_identify::model::{Assumptions, EffectTerm, Model};
use stylet_identify::noise::Noise;
use stylet_record::Recording;
use stylet_tissue::{Layer, Tissue, general_effects};

fn assumptions() -> Assumptions {
    let layer = |k: f64, b: f64, f: Option<f64>, d: f64| Layer {
        thickness_m: d,
        stiffness_n_per_m: k,
        friction_ns_per_m2: b,
        puncture_n: f,
        name: String::new(),
    };
    Assumptions {
        tissue: Tissue {
            surface_m: 0.002,
            layers: vec![
                layer(90.0, 4000.0, Some(0.6), 0.012),
                layer(150.0, 9000.0, None, 0.01),
                layer(60.0, 6000.0, Some(1.1), 0.03),
            ],
        },
        known_effects: Vec::new(),
        further_effects: Vec::new(),
        tolerance: vec![0.3; 3],
        thickness_tolerance: vec![0.1; 3],
        surface_tolerance_m: 0.002,
    }
}

/// Insertion with a ripple, a hold, insertion, retraction.
fn recording() -> Recording {
    let (mut t, mut z, mut at) = (Vec::new(), Vec::new(), -0.002);
    for k in 0..4000 {
        let s = f64::from(k) / 200.0;
        let v = match s {
            s if s < 7.0 => 0.004 + 0.002 * (4.0 * s).sin(),
            s if s < 8.5 => 0.0,
            s if s < 14.0 => 0.004,
            _ => -0.005,
        };
        at += v / 200.0;
        t.push(s);
        z.push(at);
    }
    let f = vec![0.0; t.len()];
    Recording::new(t, z, f).expect("a recording")
}

#[test]
fn incremental_replay_equals_a_full_replay_for_every_effect() {
    let assumptions = Arc::new(assumptions());
    let r = recording();
    let blocks = vec![BlockAverages::new(&r, &vec![false; r.time_s.len()], BLOCK_S)];
    let data = FitData::new(Arc::new(blocks), Noise::white(0.02), 0.0);
    let mut models = vec![("none", Model::base(Arc::clone(&assumptions), 1))];
    for info in general_effects() {
        let values: Vec<f64> = info
            .parameters
            .iter()
            .map(|p| if p.integer { 1.0 } else { 0.5 * (p.search.0 + p.search.1) })
            .collect();
        let term = EffectTerm::new(info, &values);
        if term.effect().is_some() {
            models.push((info.id, models[0].1.with_effect(term)));
        }
    }
    assert!(models.len() > 20, "{}", models.len());
    let mut compared = 0;
    // Rupture times anywhere between two checkpoints.
    let rupture_times = (0..24)
        .map(|k| vec![2.1 + 0.02 * f64::from(k), 4.6 + 0.03 * f64::from(k), 9.7 + 0.07 * f64::from(k)]);
    for ((name, mut model), rupture_times) in models.into_iter().zip(rupture_times.cycle()) {
        model.rupture_times_s = vec![rupture_times];
        model.free.recording_surface = true;
        model.free.recording_friction = true;
        let Some(cache) = ReplayCache::new(&model, &data, 0) else { continue };
        for n in model.shared_parameters().iter().chain(&model.recording_parameters()) {
            if matches!(n.role, stylet_identify::model::ParameterRole::Effect { .. }) {
                continue;
            }
            let mut moved = model.clone();
            moved.set(n.role, 0, model.get(n.role, 0) + n.step);
            let (Some(whole), Some(part)) = (replay(&moved, &data, 0), cache.replay(&moved, &data, 0)) else {
                continue;
            };
            let differ =
                whole.force_n.iter().zip(&part.force_n).position(|(a, b)| a.to_bits() != b.to_bits());
            assert_eq!(
                differ,
                None,
                "{name}, {:?}: {:?}",
                n.role,
                differ.map(|k| (whole.force_n[k], part.force_n[k]))
            );
            assert_eq!(whole.ruptures, part.ruptures, "{name}, {:?}", n.role);
            compared += 1;
        }
    }
    assert!(compared > 300, "{compared}");
}
