//! Replay in blocks of 20 ms with a compliant needle or a lagging sensor agrees with a fine integration sampled
//! every 5 ms: through stops and starts, whose transients decay within a few samples, and through ripples.

use crate::common;

use common::one_layer;
use std::sync::Arc;
use stylet_identify::block_averages::{BLOCK_S, BlockAverages};
use stylet_identify::likelihood::{FitData, replay};
use stylet_identify::model::{EffectTerm, Model, NO_RUPTURE};
use stylet_identify::noise::Noise;
use stylet_record::Recording;
use stylet_tissue::effect_info;

/// Stiffness (N/m) and friction (Ns/m²) of the only layer, which starts at zero.
const LAYER: (f64, f64) = (60.0, 9000.0);

/// Time step of the reference in s.
const STEP_S: f64 = 2e-5;

/// Position (m) of the base: a ripple, a stop, a start, a retraction, none of them at a block border.
fn base(t: f64) -> f64 {
    let rippled = |t: f64| 0.004 * t + 0.003 / 9.0 * (1.0 - (9.0 * t).cos());
    let z = match t {
        t if t < 6.013 => rippled(t),
        t if t < 8.007 => rippled(6.013),
        t if t < 11.011 => rippled(6.013) + 0.006 * (t - 8.007),
        t => rippled(6.013) + 0.006 * 3.004 - 0.005 * (t - 11.011),
    };
    z - 0.002
}

/// Force (N) every 20 µs from the balance `k_s (z - z_tip) = K z_tip + b z_tip v_tip`, implicit Euler.
fn followed(needle: f64, end_s: f64) -> Vec<f64> {
    let (k, b) = LAYER;
    let dt = STEP_S;
    let (mut tip, mut out) = (base(0.0), vec![0.0]);
    for i in 1..=(end_s / dt) as usize {
        let z = base(i as f64 * dt);
        let inside = b * f64::max(tip, 0.0) / dt;
        tip = if z <= 0.0 { z } else { (needle * z + inside * tip) / (needle + k + inside) };
        out.push(if z <= 0.0 { 0.0 } else { needle * (z - tip) });
    }
    out
}

#[test]
fn a_compliant_needle_agrees_with_fine_integration() {
    let assumptions = one_layer(0.06, LAYER);
    let t: Vec<f64> = (0..2800).map(|k| f64::from(k) * 0.005).collect();
    let z = t.iter().map(|t| base(*t)).collect();
    let r = Recording::new(t.clone(), z, vec![0.0; t.len()]).expect("a recording");
    let blocks = BlockAverages::new(&r, &vec![false; t.len()], BLOCK_S);
    let data = FitData::new(Arc::new(vec![blocks.clone()]), Noise::white(0.02), 0.0);
    let info = effect_info("needle_compliance").expect("in the library");
    for needle in [5000.0, 20_000.0, 80_000.0] {
        let mut model =
            Model::base(Arc::clone(&assumptions), 1).with_effect(EffectTerm::new(info, &[needle]));
        model.rupture_times_s = vec![vec![NO_RUPTURE]];
        let predicted = replay(&model, &data, 0).expect("a replay").force_n;
        let force = followed(needle, 14.1);
        let largest = force.iter().fold(0.0_f64, |m, f| m.max(f.abs()));
        assert!(largest > 1.0, "{largest}");
        let (worst_n, at_s) = worst(&blocks, &predicted, &force);
        assert!(worst_n < 0.01, "{needle} N/m: off by {worst_n} N of {largest} N at {at_s} s");
    }
}

/// Largest difference (N) of a block's prediction from the mean of its samples, and where (s).
fn worst(blocks: &BlockAverages, predicted: &[f64], force: &[f64]) -> (f64, f64) {
    let off = |k: usize| {
        let samples = |t: &&f64| **t > blocks.start_s[k] && **t < blocks.end_s[k];
        let sampled =
            blocks.sample_time_s.iter().filter(samples).map(|t| force[(t / STEP_S).round() as usize]);
        let (sum, n) = sampled.fold((0.0, 0.0), |(sum, n), f| (sum + f, n + 1.0));
        ((predicted[k] - sum / n).abs(), blocks.start_s[k])
    };
    let used = (0..blocks.len()).filter(|k| blocks.used[*k]);
    used.map(off).fold((0.0, 0.0), |most, off| if off.0 > most.0 { off } else { most })
}

#[test]
fn a_lagging_sensor_agrees_with_fine_integration() {
    let assumptions = one_layer(0.06, LAYER);
    let t: Vec<f64> = (0..2800).map(|k| f64::from(k) * 0.005).collect();
    let z = t.iter().map(|t| base(*t)).collect();
    let r = Recording::new(t.clone(), z, vec![0.0; t.len()]).expect("a recording");
    let blocks = BlockAverages::new(&r, &vec![false; t.len()], BLOCK_S);
    let data = FitData::new(Arc::new(vec![blocks.clone()]), Noise::white(0.02), 0.0);
    let info = effect_info("low_pass_lag").expect("in the library");
    let (k, b) = LAYER;
    for lag_s in [0.004, 0.009, 0.021, 0.1] {
        let mut model = Model::base(Arc::clone(&assumptions), 1).with_effect(EffectTerm::new(info, &[lag_s]));
        model.rupture_times_s = vec![vec![NO_RUPTURE]];
        let predicted = replay(&model, &data, 0).expect("a replay").force_n;
        let (mut lagged, mut force) = (0.0, vec![0.0]);
        for i in 1..=(14.1 / STEP_S) as usize {
            let z = base(i as f64 * STEP_S);
            let speed = (z - base((i - 1) as f64 * STEP_S)) / STEP_S;
            lagged += (1.0 - (-STEP_S / lag_s).exp()) * (z.max(0.0) * (k + b * speed) - lagged);
            force.push(lagged);
        }
        let (worst_n, at_s) = worst(&blocks, &predicted, &force);
        assert!(worst_n < 0.01, "{lag_s} s: off by {worst_n} N at {at_s} s");
    }
}
