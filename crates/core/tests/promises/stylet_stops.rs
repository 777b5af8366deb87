//! Promise of `algorithm: Stylet` for velocities derived from the positions of an encoder by a causal filter: a stop, which takes away the
//! shaft friction and shows one position late, is no rupture. A drop beyond that friction is declared at once, a smaller one as soon as
//! the positions show further motion.

use crate::support::{Insertion, enhance, gels, insertion, stylet};
use std::f64::consts::TAU;
use stylet_core::{EnhanceConfig, Sample};
use stylet_tissue::Tissue;

const HZ: f64 = 200.0;
const SPEED_MPS: f64 = 0.0023;
/// Number of positions that the velocity is derived from.
const WINDOW: usize = 6;

fn config() -> EnhanceConfig {
    let mut config = stylet();
    config.stylet.derived_velocity = true;
    config
}

/// Positions rounded to `step_m`, velocities from the last of them.
fn encoded(mut data: Insertion, step_m: f64) -> Insertion {
    for s in &mut data.samples {
        s.position_m = step_m * (s.position_m / step_m).round();
    }
    let at: Vec<(f64, f64)> = data.samples.iter().map(|s| (s.time_s, s.position_m)).collect();
    for (k, s) in data.samples.iter_mut().enumerate().skip(1) {
        let from = at[k.saturating_sub(WINDOW)];
        s.velocity_mps = (at[k].1 - from.1) / (at[k].0 - from.0);
    }
    data
}

fn declared(samples: &[Sample]) -> Vec<f64> {
    enhance(&config(), samples).iter().filter_map(|o| o.detection).map(|d| d.time_s).collect()
}

/// The paper's gels with this share of their stiffness, and so of their drops.
fn gels_of(share: f64) -> Tissue {
    let mut tissue = gels();
    tissue.layers.iter_mut().for_each(|layer| layer.stiffness_n_per_m *= share);
    tissue
}

#[test]
fn stops_are_no_ruptures_and_ruptures_wait_for_two_steps_of_the_encoder() {
    // In the second and third layer, where friction is known.
    let stop = |t: f64| if (20.0..22.0).contains(&t) || (38.0..38.5).contains(&t) { 0.0 } else { SPEED_MPS };
    for step_m in [1e-6, 5e-6, 2e-5] {
        for share in [1.0, 0.3, 0.15] {
            for seed in 0..5 {
                let data = encoded(insertion(&gels_of(share), -0.005, 53.0, HZ, 0.01, seed, stop), step_m);
                let found = declared(&data.samples);
                assert_eq!(found.len(), 3, "{step_m} m, {share}, seed {seed}: {found:?}");
                for (found_s, truth) in found.iter().zip(&data.ruptures) {
                    let delay_s = found_s - truth.time_s;
                    let latest_s = 2.0 * step_m / SPEED_MPS + 2.1 / HZ;
                    assert!(
                        (0.0..latest_s).contains(&delay_s),
                        "{step_m} m, {share}, seed {seed}: {delay_s} s"
                    );
                }
            }
        }
    }
}

#[test]
fn a_drop_beyond_the_friction_is_declared_at_once_and_a_smaller_one_at_the_next_position() {
    // The friction of the first layer is 0.8 N; at a rippled speed it is known. Drops of 2.3, 1.1, 0.3 and 0.2 N.
    let rippled = |t: f64| SPEED_MPS * (1.0 + 0.4 * (TAU * 0.3 * t).sin());
    for (share, samples) in [(2.0, 1), (1.0, 1), (0.3, 2), (0.15, 2)] {
        for seed in 0..5 {
            let data = encoded(insertion(&gels_of(share), -0.005, 20.0, HZ, 0.01, seed, rippled), 1e-6);
            let found = declared(&data.samples);
            assert_eq!(found.len(), 1, "{share}, seed {seed}: {found:?}");
            let seen = data.samples.iter().filter(|s| s.time_s > data.ruptures[0].time_s);
            let waited = seen.filter(|s| s.time_s <= found[0]).count();
            assert_eq!(waited, samples, "{share}, seed {seed}");
        }
    }
}
