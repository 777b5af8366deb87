//! Error and lag of a virtual sensor.

use stylet_record::{Recording, Truth};

/// A virtual sensor compared with the true tissue force, from the time at which it is zeroed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VirtualSensorAccuracy {
    /// Time constant of the first-order lag that fits the sensor best, s: `1/G` for an observer with an exact model.
    pub lag_s: f64,
    /// RMS of sensor minus true force, N, lag included: a drop `D` contributes `D sqrt(lag/(2 T))` over a duration `T`.
    pub rms_n: f64,
    /// RMS of sensor minus lagged true force, N: friction, model errors, noise.
    pub lag_corrected_rms_n: f64,
}

impl VirtualSensorAccuracy {
    /// `None` without a virtual sensor or with fewer than two samples. The sensor is zeroed at `from_s`.
    #[must_use]
    pub fn compare(recording: &Recording, truth: &Truth, from_s: f64) -> Option<Self> {
        let sensed = recording.force_virtual_n.as_ref()?;
        let first = recording.time_s.iter().position(|t| *t >= from_s - 1e-9)?;
        let dt_s = recording.median_interval_s();
        let (sensed, real) = (sensed.get(first..)?, truth.tissue_force_n.get(first..)?);
        if sensed.len() < 2 || dt_s.is_nan() {
            return None;
        }
        let rms = |lag_s: f64| lagged_rms(sensed, real, dt_s, lag_s);
        // Golden-section search over the logarithm of the lag, from a hundredth of a sample to a minute.
        let of_ln_lag = |ln_lag: f64| rms(libm::exp(ln_lag));
        let lag_s =
            libm::exp(stylet_stats::golden_section(of_ln_lag, (libm::log(0.01 * dt_s), libm::log(60.0)), 60));
        Some(Self { lag_s, rms_n: rms(0.0), lag_corrected_rms_n: rms(lag_s) })
    }
}

/// RMS of `sensed` minus low-pass filtered `real`, exact for a `real` that is linear between samples.
fn lagged_rms(sensed: &[f64], real: &[f64], dt_s: f64, lag_s: f64) -> f64 {
    let (keep, ramp) = if lag_s > 0.0 {
        let keep = libm::exp(-dt_s / lag_s);
        (keep, 1.0 - (1.0 - keep) * lag_s / dt_s)
    } else {
        (0.0, 1.0)
    };
    let mut before = real[0];
    let mut y = real[0];
    let mut sum = 0.0;
    for (sensed, real) in sensed.iter().zip(real) {
        y = keep * y + (1.0 - keep) * before + ramp * (real - before);
        before = *real;
        sum += (sensed - y) * (sensed - y);
    }
    libm::sqrt(sum / sensed.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_known_lag_and_error_are_estimated() {
        let time_s: Vec<f64> = (0..4000).map(|k| f64::from(k) * 0.005).collect();
        let real: Vec<f64> = time_s.iter().map(|t| 2.0 * (t % 5.0)).collect();
        let mut y = 0.0;
        let mut before = 0.0;
        let (keep, lag) = (libm::exp(-0.005 / 0.2), 0.2);
        let sensed: Vec<f64> = real
            .iter()
            .enumerate()
            .map(|(k, f)| {
                y = keep * y + (1.0 - keep) * before + (1.0 - (1.0 - keep) * lag / 0.005) * (f - before);
                before = *f;
                y + if k % 2 == 0 { 0.01 } else { -0.01 }
            })
            .collect();
        let recording = Recording { time_s, force_virtual_n: Some(sensed), ..Recording::default() };
        let truth = Truth { tissue_force_n: real, ..Truth::default() };
        let error = VirtualSensorAccuracy::compare(&recording, &truth, 0.0).expect("a virtual sensor");
        assert!((error.lag_s - 0.2).abs() < 1e-3, "{error:?}");
        assert!((error.lag_corrected_rms_n - 0.01).abs() < 1e-4, "{error:?}");
        assert!(error.rms_n > 0.1, "{error:?}");
    }
}
