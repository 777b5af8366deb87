//! Detects tones in the residual spectrum at the sampling rate, and removes them from the noise estimate.

use stylet_identify::fit::Fit;
use stylet_identify::likelihood::FitData;
use stylet_identify::noise::NoiseSource;
use stylet_stats::spectrum::{PADDING, PowerSpectrum, SampledSignal, subtract_sinusoid};

/// Power spectrum of the residual of a fit at the sampling rate, in N²/Hz.
fn power(fit: &Fit, data: &FitData, padding: usize) -> PowerSpectrum {
    let columns: Vec<SampledSignal> = data
        .recordings
        .iter()
        .zip(&fit.residuals.residual_n)
        .map(|(b, e)| SampledSignal {
            time_s: &b.sample_time_s,
            values: b.sample_residuals(e),
            step_s: b.sample_step_s,
        })
        .collect();
    PowerSpectrum::estimate(&columns, padding)
}

/// Smoothed amplitude spectrum of the residual for plotting: frequencies in Hz, amplitudes in N/sqrt(Hz).
#[must_use]
pub fn residual_spectrum(fit: &Fit, data: &FitData) -> (Vec<f64>, Vec<f64>) {
    power(fit, data, 1).for_plot()
}

/// Block residuals (N) of a fit without tones at the frequencies `tones_hz`, whose amplitude and phase are fitted per recording.
pub(crate) fn remove_tones(fit: &Fit, data: &FitData, tones_hz: &[f64]) -> Vec<Vec<f64>> {
    let mut e = fit.residuals.residual_n.clone();
    for (b, e) in data.recordings.iter().zip(&mut e) {
        for hz in tones_hz {
            subtract_sinusoid(e, |k| b.mid_s(k), |k| b.used[k], *hz);
        }
    }
    e
}

/// The data with the noise estimated from the residual without these tones (Hz), which an autoregression would absorb as coloured noise.
pub(crate) fn with_noise_without_tones(fit: &Fit, data: &FitData, tones_hz: &[f64]) -> FitData {
    data.with_estimated_noise(&remove_tones(fit, data, tones_hz), NoiseSource::Detrended)
}

/// Frequencies (Hz) of the tones in the residual of a fit, strongest first.
#[must_use]
pub fn detect_tones(fit: &Fit, data: &FitData) -> Vec<f64> {
    if data.recordings.iter().all(|b| b.sample_force_n.len() < 64) {
        return Vec::new();
    }
    power(fit, data, PADDING).detect_tones()
}

#[cfg(test)]
mod tests;
