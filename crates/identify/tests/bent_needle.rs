//! A needle that gives is replayed in blocks of 20 ms as if it had been followed at every instant: through stops and starts, whose
//! effect fades within a few blocks, and through ripples, which its tip follows late.

mod common;

use common::one_layer;
use std::sync::Arc;
use stylet_identify::blocks::{BLOCK_S, Blocks};
use stylet_identify::model::{Choice, Model, NEVER};
use stylet_identify::noise::Noise;
use stylet_identify::objective::{Data, replay};
use stylet_record::Recording;
use stylet_tissue::info;

/// Stiffness (N/m) and friction (Ns/m²) of the only layer, which begins at zero.
const LAYER: (f64, f64) = (60.0, 9000.0);

/// Step of the reference in s.
const STEP_S: f64 = 2e-5;

/// Position (m) of the base: a ripple, a stop, a start, a retraction, none of them where a block ends.
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

/// Force (N) every 20 us by the balance `k_s (z - z_tip) = K z_tip + b z_tip v_tip`, implicit Euler.
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
fn a_needle_that_gives_is_replayed_in_blocks_as_if_followed_at_every_instant() {
    let belief = one_layer(0.06, LAYER);
    let t: Vec<f64> = (0..2800).map(|k| f64::from(k) * 0.005).collect();
    let z = t.iter().map(|t| base(*t)).collect();
    let r = Recording::new(t.clone(), z, vec![0.0; t.len()]).expect("a recording");
    let blocks = Blocks::new(&r, &vec![false; t.len()], BLOCK_S);
    let data = Data::new(Arc::new(vec![blocks.clone()]), Noise::white(0.02), 0.0);
    let info = info("needle_compliance").expect("in the library");
    for needle in [5000.0, 20_000.0, 80_000.0] {
        let mut model = Model::base(Arc::clone(&belief), 1).with(Choice::new(info, &[needle]));
        model.instants = vec![vec![NEVER]];
        let predicted = replay(&model, &data, 0).expect("a replay").f;
        let force = followed(needle, 14.1);
        let largest = force.iter().fold(0.0_f64, |m, f| m.max(f.abs()));
        assert!(largest > 1.0, "{largest}");
        let mean = |k: usize| {
            let at = |t: f64| ((t.max(0.0) / STEP_S) as usize).min(force.len() - 1);
            let inside = &force[at(blocks.from_s[k])..=at(blocks.to_s[k])];
            inside.iter().sum::<f64>() / inside.len() as f64
        };
        let off = |k: &usize| (predicted[*k] - mean(*k)).abs();
        let worst = (0..blocks.len()).filter(|k| blocks.used[*k]).max_by(|a, b| off(a).total_cmp(&off(b)));
        let worst = worst.expect("blocks");
        assert!(
            off(&worst) < 0.015,
            "{needle} N/m: off by {} N of {largest} N at {} s",
            off(&worst),
            blocks.from_s[worst]
        );
    }
}
