//! What `algorithm: Stylet` promises where the log's velocity is the slope of its positions over a tenth of a second: it goes up before the needle
//! does and down behind it, and is too low in a ripple. Friction knows the speed as it is.

use crate::support::{Insertion, detections, enhance, gels, insertion, stylet};

const HZ: f64 = 200.0;
/// Samples on either side that a velocity is the slope of: 50 ms.
const HALF: usize = 10;

/// With the velocity that the positions of ten samples on both sides have as their slope.
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

/// Every three seconds at another speed, from one sample to the next, with a hold now and then.
fn steps(t: f64) -> f64 {
    [0.0023, 0.004, 0.001, 0.0, 0.003, 0.0015, 0.0055, 0.002][(t / 3.0) as usize % 8]
}

/// 1 Hz of ripple, half of the speed.
fn ripple(t: f64) -> f64 {
    0.0023 * (1.0 + 0.5 * (std::f64::consts::TAU * t).sin())
}

/// Another speed three times a second, so that some ruptures come just before one.
fn stutter(t: f64) -> f64 {
    [0.0023, 0.003, 0.0018, 0.0026, 0.0015, 0.0034, 0.002][(t / 0.31) as usize % 7]
}

#[test]
fn a_differentiated_velocity_hides_no_rupture_and_makes_none() {
    for (name, speed) in [("steps", steps as fn(f64) -> f64), ("ripple", ripple), ("stutter", stutter)] {
        for seed in 0..10 {
            let data = differentiated(insertion(&gels(), -0.005, 55.0, HZ, 0.01, seed, speed));
            let outputs = enhance(&stylet(), &data.samples);
            let (found, truth) = (detections(&outputs), &data.ruptures);
            assert_eq!(found.len(), truth.len(), "{name}, seed {seed}: {found:?}");
            for (found_s, truth) in found.iter().zip(truth) {
                // A sample later than with the velocity as it is.
                let delay_s = found_s - truth.time_s;
                assert!((0.0..=2.1 / HZ).contains(&delay_s), "{name}, seed {seed}: {delay_s} s");
            }
        }
    }
}

#[test]
fn what_the_tip_feels_is_known_with_a_differentiated_velocity_too() {
    for (name, speed) in [("steps", steps as fn(f64) -> f64), ("ripple", ripple)] {
        for seed in 0..10 {
            let data = insertion(&gels(), -0.005, 55.0, HZ, 0.01, seed, speed);
            let off_n = |data: &Insertion| {
                let outputs = enhance(&stylet(), &data.samples);
                let first_s = data.ruptures[0].time_s + 1.0;
                let (mut sum, mut count) = (0.0, 0.0);
                for ((out, truth), sample) in outputs.iter().zip(&data.truth).zip(&data.samples) {
                    // But for the samples beside a change of speed, which nobody can know in time, and that of a rupture, which is waited for.
                    let beside = name == "steps" && (sample.time_s + 0.01).rem_euclid(3.0) < 0.03;
                    let waits =
                        data.ruptures.iter().any(|r| (0.0..1.5 / HZ).contains(&(sample.time_s - r.time_s)));
                    if sample.time_s > first_s && !beside && !waits {
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
