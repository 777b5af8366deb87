//! A force delay is identified to a fraction of the sampling interval, although friction jumps only show
//! between which samples they lie.

use crate::common;

use common::one_layer;
use std::sync::Arc;
use stylet_identify::block_averages::{BLOCK_S, BlockAverages};
use stylet_identify::delay_refinement::{delay_s, refine_delay};
use stylet_identify::fit::{Effort, fit};
use stylet_identify::likelihood::FitData;
use stylet_identify::model::{EffectTerm, Model, NO_RUPTURE};
use stylet_identify::noise::Noise;
use stylet_record::Recording;
use stylet_tissue::effect_info;

/// Stiffness (N/m) and friction (Ns/m²) of the only layer, which starts at zero.
const LAYER: (f64, f64) = (60.0, 12_000.0);
/// Sampling interval in s.
const STEP_S: f64 = 0.005;

/// Position (m) and velocity (m/s) of a base that moves back and forth at changing speeds.
fn base(t: f64) -> (f64, f64) {
    const SPEEDS: [f64; 8] = [0.003, 0.006, -0.002, 0.005, 0.0, 0.004, -0.004, 0.003];
    const LASTS_S: f64 = 1.7317;
    let mut z = -0.002;
    for (k, v) in SPEEDS.iter().enumerate() {
        let since = t - k as f64 * LASTS_S;
        if since < LASTS_S || k + 1 == SPEEDS.len() {
            return (z + v * since, *v);
        }
        z += v * LASTS_S;
    }
    (z, 0.0)
}

fn force(t: f64) -> f64 {
    let (z, v) = base(t);
    let (k, b) = LAYER;
    if z > 0.0 { k * z + b * z * v } else { 0.0 }
}

#[test]
fn a_delay_is_estimated_to_a_fraction_of_the_sampling_interval() {
    let assumptions = one_layer(0.08, LAYER);
    let (mut worst, mut worst_at_instants) = (0.0_f64, 0.0_f64);
    for truth in [0.0117, 0.0234, 0.0301, 0.0468] {
        let t: Vec<f64> = (0..2700).map(|k| f64::from(k) * STEP_S).collect();
        let z: Vec<f64> = t.iter().map(|t| base(*t).0).collect();
        // A small unmodelled force, the same for every delay.
        let f: Vec<f64> =
            t.iter().enumerate().map(|(k, t)| force(t - truth) + 2e-3 * (k as f64 * 2.4).sin()).collect();
        let recording = Recording::new(t, z, f).expect("a recording");
        let blocks = BlockAverages::new(&recording, &vec![false; recording.time_s.len()], BLOCK_S);
        let data = FitData::new(Arc::new(vec![blocks]), Noise::white(1e-3), 0.0);
        let info = effect_info("time_delay").expect("an effect");
        let mut model = Model::base(Arc::clone(&assumptions), 1).with_effect(EffectTerm::new(info, &[0.02]));
        model.rupture_times_s = vec![vec![NO_RUPTURE]];
        let found = fit(&model, &data, Effort::FULL).expect("a fit");
        worst_at_instants = worst_at_instants.max((delay_s(&found.model) - truth).abs());
        let (found, _) = refine_delay(&found, &data).expect("an improved fit");
        worst = worst.max((delay_s(&found.model) - truth).abs());
    }
    assert!(worst < 0.02 * STEP_S, "{worst} s");
    // The error without the refinement.
    assert!(worst_at_instants > 0.1 * STEP_S, "{worst_at_instants} s");
}
