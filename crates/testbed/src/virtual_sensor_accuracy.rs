//! How far a virtual sensor is off, and how late.

use stylet_record::{Recording, Truth};

/// A virtual sensor against the tissue's true force, from the instant at which it is zeroed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VirtualSensorAccuracy {
    /// Time constant of the first-order lag that explains the sensor best, s: `1/G` for an observer
    /// with an exact model.
    pub lag_s: f64,
    /// RMS of sensor minus true force, N. Contains the lag: a drop `D` alone leaves
    /// `D sqrt(lag/(2 T))` over a run of length `T`.
    pub rms_n: f64,
    /// RMS of sensor minus the true force behind that lag, N: friction, model errors, noise.
    pub lag_corrected_rms_n: f64,
}

impl VirtualSensorAccuracy {
    /// Compares; `None` without a virtual sensor or with fewer than two samples. `from_s` is when the
    /// sensor is zeroed.
    #[must_use]
    pub fn compare(recording: &Recording, truth: &Truth, from_s: f64) -> Option<Self> {
        let felt = recording.force_virtual_n.as_ref()?;
        let first = recording.time_s.iter().position(|t| *t >= from_s - 1e-9)?;
        let dt_s = recording.median_interval_s();
        let (felt, real) = (felt.get(first..)?, truth.tissue_force_n.get(first..)?);
        if felt.len() < 2 || dt_s.is_nan() {
            return None;
        }
        let off = |lag_s: f64| lagged_rms(felt, real, dt_s, lag_s);
        // Golden section over the logarithm of the lag, from a hundredth of a sample to a minute.
        let (mut low, mut high) = (libm::log(0.01 * dt_s), libm::log(60.0));
        let golden = 0.618_033_988_749_894_9;
        let inner = |low: f64, high: f64| (high - golden * (high - low), low + golden * (high - low));
        let (mut a, mut b) = inner(low, high);
        let (mut off_a, mut off_b) = (off(libm::exp(a)), off(libm::exp(b)));
        for _ in 0..60 {
            if off_a < off_b {
                high = b;
                (b, off_b) = (a, off_a);
                a = inner(low, high).0;
                off_a = off(libm::exp(a));
            } else {
                low = a;
                (a, off_a) = (b, off_b);
                b = inner(low, high).1;
                off_b = off(libm::exp(b));
            }
        }
        let lag_s = libm::exp((low + high) / 2.0);
        Some(Self { lag_s, rms_n: off(0.0), lag_corrected_rms_n: off(lag_s) })
    }
}

/// RMS of `felt` minus `real` behind a first-order lag, which takes `real` as linear between samples.
fn lagged_rms(felt: &[f64], real: &[f64], dt_s: f64, lag_s: f64) -> f64 {
    let (keep, ramp) = if lag_s > 0.0 {
        let keep = libm::exp(-dt_s / lag_s);
        (keep, 1.0 - (1.0 - keep) * lag_s / dt_s)
    } else {
        (0.0, 1.0)
    };
    let mut before = real[0];
    let mut y = real[0];
    let mut sum = 0.0;
    for (felt, real) in felt.iter().zip(real) {
        y = keep * y + (1.0 - keep) * before + ramp * (real - before);
        before = *real;
        sum += (felt - y) * (felt - y);
    }
    libm::sqrt(sum / felt.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_known_lag_and_a_known_error_beside_it_are_found() {
        let time_s: Vec<f64> = (0..4000).map(|k| f64::from(k) * 0.005).collect();
        let real: Vec<f64> = time_s.iter().map(|t| 2.0 * (t % 5.0)).collect();
        let mut y = 0.0;
        let mut before = 0.0;
        let (keep, lag) = (libm::exp(-0.005 / 0.2), 0.2);
        let felt: Vec<f64> = real
            .iter()
            .enumerate()
            .map(|(k, f)| {
                y = keep * y + (1.0 - keep) * before + (1.0 - (1.0 - keep) * lag / 0.005) * (f - before);
                before = *f;
                y + if k % 2 == 0 { 0.01 } else { -0.01 }
            })
            .collect();
        let recording = Recording { time_s, force_virtual_n: Some(felt), ..Recording::default() };
        let truth = Truth { tissue_force_n: real, ..Truth::default() };
        let error = VirtualSensorAccuracy::compare(&recording, &truth, 0.0).expect("a virtual sensor");
        assert!((error.lag_s - 0.2).abs() < 1e-3, "{error:?}");
        assert!((error.lag_corrected_rms_n - 0.01).abs() < 1e-4, "{error:?}");
        assert!(error.rms_n > 0.1, "{error:?}");
    }
}
