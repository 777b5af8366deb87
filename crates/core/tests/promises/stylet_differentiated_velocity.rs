//! Promise of `algorithm: Stylet` for velocities differentiated from positions over a tenth of a second, which smear speed changes
//! and damp ripples while friction follows the true velocity.

use crate::support::{Insertion, detections, enhance, gels, insertion, stylet};

const HZ: f64 = 200.0;
/// Half width of the differentiation window in samples: 50 ms.
const HALF: usize = 10;

/// Replaces the velocity by the slope of the positions.
fn differentiated(mut data: Insertion) -> Insertion {
    let at: Vec<(f64, f64)> = data.samples.iter().map(|s| (s.time_s, s.position_m)).collect();
    for (k, sample) in data.samples.iter_mut().enumerate() {
        let window = &at[k.saturating_sub(HALF)..(k + HALF + 1).min(at.len())];
        let n = window.len() as f64;
        let (t0, z0) =
            (window.iter().map(|w| w.0).sum::<f64>() / n, window.iter().map(|w| w.1).sum::<f64>() / n);
        let (up, down) = window
            .iter()
            .fold((0.0, 0.0), |(up, down), (t, z)| (up + (t - t0) * (z - z0), down + (t - t0) * (t - t0)));
        sample.velocity_mps = up / down;
    }
    data
}

/// Speed steps every three seconds, with holds.
fn steps(t: f64) -> f64 {
    [0.0023, 0.004, 0.001, 0.0, 0.003, 0.0015, 0.0055, 0.002][(t / 3.0) as usize % 8]
}

/// Ripple of 1 Hz with half of the speed as amplitude.
fn ripple(t: f64) -> f64 {
    0.0023 * (1.0 + 0.5 * (std::f64::consts::TAU * t).sin())
}

/// Three speed steps per second, so that some ruptures come just before one.
fn stutter(t: f64) -> f64 {
    [0.0023, 0.003, 0.0018, 0.0026, 0.0015, 0.0034, 0.002][(t / 0.31) as usize % 7]
}

#[test]
fn with_differentiated_velocity_all_ruptures_are_detected_without_false_alarms() {
    for (name, speed) in [("steps", steps as fn(f64) -> f64), ("ripple", ripple), ("stutter", stutter)] {
        for seed in 0..10 {
            let data = differentiated(insertion(&gels(), -0.005, 55.0, HZ, 0.01, seed, speed));
            let outputs = enhance(&stylet(), &data.samples);
            let (found, truth) = (detections(&outputs), &data.ruptures);
            assert_eq!(found.len(), truth.len(), "{name}, seed {seed}: {found:?}");
            for (found_s, truth) in found.iter().zip(truth) {
                // A sample later than with the true velocity.
                let delay_s = found_s - truth.time_s;
                assert!((0.0..=2.1 / HZ).contains(&delay_s), "{name}, seed {seed}: {delay_s} s");
            }
        }
    }
}

#[test]
fn with_differentiated_velocity_the_enhanced_force_is_as_accurate() {
    for (name, speed) in [("steps", steps as fn(f64) -> f64), ("ripple", ripple)] {
        for seed in 0..10 {
            let data = insertion(&gels(), -0.005, 55.0, HZ, 0.01, seed, speed);
            let off_n = |data: &Insertion| {
                let outputs = enhance(&stylet(), &data.samples);
                let first_s = data.ruptures[0].time_s + 1.0;
                let (mut sum, mut count) = (0.0, 0.0);
                for ((out, truth), sample) in outputs.iter().zip(&data.truth).zip(&data.samples) {
                    // Except samples next to a speed step, and the deferred one of a rupture.
                    let near_step = name == "steps" && (sample.time_s + 0.01).rem_euclid(3.0) < 0.03;
                    let deferred =
                        data.ruptures.iter().any(|r| (0.0..1.5 / HZ).contains(&(sample.time_s - r.time_s)));
                    if sample.time_s > first_s && !near_step && !deferred {
                        let off = out.enhanced_n - (sample.force_n - truth.total_n) - truth.tip_n;
                        (sum, count) = (sum + off * off, count + 1.0);
                    }
                }
                f64::sqrt(sum / count)
            };
            let (measured, slope) = (off_n(&data), off_n(&differentiated(data)));
            assert!(slope < 1.5 * measured + 0.002, "{name}, seed {seed}: {slope} N for {measured} N");
        }
    }
}
