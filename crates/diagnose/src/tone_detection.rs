//! Lines of the residual's spectrum, at the recordings' own rate.

use stylet_identify::fit::Fit;
use stylet_identify::likelihood::FitData;
use stylet_identify::noise::NoiseSource;
use stylet_stats::spectrum::{PADDING, PowerSpectrum, SampledSignal, subtract_sinusoid};

/// Power of the residual of a fit at the recordings' own rate, in N²/Hz.
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

/// Spectrum of the residual of a fit for drawing: frequencies in Hz, and amplitudes in N/sqrt(Hz), smoothed.
#[must_use]
pub fn residual_spectrum(fit: &Fit, data: &FitData) -> (Vec<f64>, Vec<f64>) {
    power(fit, data, 1).for_plot()
}

/// Residuals (N) of a fit less the lines at these frequencies (Hz), each with an amplitude and a phase of every
/// recording's own.
#[must_use]
pub fn remove_tones(fit: &Fit, data: &FitData, lines: &[f64]) -> Vec<Vec<f64>> {
    let mut e = fit.residuals.residual_n.clone();
    for (b, e) in data.recordings.iter().zip(&mut e) {
        for hz in lines {
            subtract_sinusoid(e, |k| 0.5 * (b.start_s[k] + b.end_s[k]), |k| b.used[k], *hz);
        }
    }
    e
}

/// The data judged by the noise that a fit leaves beside the lines at these frequencies (Hz): a line is no noise, though an
/// autoregression would take it for its own colour.
#[must_use]
pub fn with_noise_without_tones(fit: &Fit, data: &FitData, lines: &[f64]) -> FitData {
    data.with_estimated_noise(&remove_tones(fit, data, lines), NoiseSource::Detrended)
}

/// Frequencies (Hz) at which the residual of a fit has lines, strongest first.
#[must_use]
pub fn detect_tones(fit: &Fit, data: &FitData) -> Vec<f64> {
    if data.recordings.iter().all(|b| b.sample_force_n.len() < 64) {
        return Vec::new();
    }
    power(fit, data, PADDING).detect_tones()
}

#[cfg(test)]
mod tests {
    use super::{detect_tones, remove_tones, residual_spectrum, with_noise_without_tones};
    use crate::test_fixtures::assumed_layers;
    use std::sync::Arc;
    use stylet_identify::block_averages::{BLOCK_S, BlockAverages};
    use stylet_identify::fit::Fit;
    use stylet_identify::likelihood::{FitData, residuals};
    use stylet_identify::model::Model;
    use stylet_identify::noise::Noise;
    use stylet_record::Recording;

    const HZ: f64 = 100.0;

    /// Recordings in air: the law has no force there, so that the force is what is left.
    fn in_air(forces: &[&dyn Fn(f64) -> f64], seconds: f64, keep: impl Fn(usize) -> bool) -> (Fit, FitData) {
        let blocks: Vec<BlockAverages> = forces
            .iter()
            .map(|f| {
                let kept: Vec<usize> = (0..(seconds * HZ) as usize).filter(|k| keep(*k)).collect();
                let t: Vec<f64> = kept.iter().map(|k| 7.0 + *k as f64 / HZ).collect();
                let z = t.iter().map(|t| -0.1 + 1e-4 * t).collect();
                let f = t.iter().map(|t| f(*t)).collect();
                BlockAverages::new(&Recording::new(t, z, f).expect("a recording"), &[], BLOCK_S)
            })
            .collect();
        let belief = assumed_layers(&[[0.02, 100.0, 1000.0]]);
        let model = Model::base(belief, blocks.len());
        let data = FitData::new(Arc::new(blocks), Noise::white(0.02), 0.0);
        let residuals = residuals(&model, &data).expect("a replay");
        (Fit { model, residuals }, data)
    }

    fn wave(a: f64, hz: f64, phase: f64) -> impl Fn(f64) -> f64 {
        move |t| a * (std::f64::consts::TAU * hz * t + phase).sin()
    }

    /// A tone stands where it is; a few samples tell none.
    #[test]
    fn a_residual_of_a_few_samples_has_no_lines() {
        // Evenly within 0.01 of nothing, by a scramble of the instant (SplitMix64).
        let noise = |t: f64| {
            let mut z = ((t * 1e4).round() as u64).wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            0.02 * (((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64 - 0.5)
        };
        let tone = |t: f64| noise(t) + wave(0.2, 20.0, 0.2)(t);
        let (fit, data) = in_air(&[&tone], 20.0, |_| true);
        assert!((detect_tones(&fit, &data)[0] - 20.0).abs() < 0.01, "{:?}", detect_tones(&fit, &data));
        for (samples, any) in [(63, false), (64, true)] {
            let (fit, data) = in_air(&[&tone], 5.0, move |k| k < samples);
            assert_eq!(!detect_tones(&fit, &data).is_empty(), any, "{samples}");
        }
    }

    /// The residual of a law without a force is the force: its spectrum is drawn as that of the column.
    #[test]
    fn the_spectrum_is_that_of_the_residual_at_the_recordings_own_rate() {
        let tone = wave(0.3, 11.3, 0.4);
        let (fit, data) = in_air(&[&tone], 20.0, |_| true);
        let (hz, amplitude) = residual_spectrum(&fit, &data);
        assert_eq!(hz.len(), 512);
        let peak = (0..512).max_by(|a, b| amplitude[*a].total_cmp(&amplitude[*b])).expect("a peak");
        assert!((hz[peak] - 11.3).abs() < 0.1, "{}", hz[peak]);
    }

    #[test]
    fn a_residual_without_its_lines_has_their_best_sinusoids_taken_away_recording_by_recording() {
        let (one, two) = (wave(0.3, 5.1, 0.4), |t: f64| wave(0.7, 5.1, 2.0)(t) + wave(0.2, 12.6, 0.1)(t));
        let (fit, data) = in_air(&[&one, &two], 20.0, |_| true);
        let left = remove_tones(&fit, &data, &[5.1, 12.6]);
        let most = |e: &[f64]| e.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        // Blocks of two samples see a tone as it is.
        assert!(most(&left[0]) < 2e-3 && most(&left[1]) < 2e-3, "{} {}", most(&left[0]), most(&left[1]));
        let left = remove_tones(&fit, &data, &[5.1]);
        assert!((most(&left[1]) - 0.19).abs() < 0.02, "{}", most(&left[1]));
        assert_eq!(remove_tones(&fit, &data, &[]), fit.residuals.residual_n);
        // What is left stands at right angles to the line, over the blocks compared.
        let mut blocks = data.recordings.to_vec();
        blocks[1].used[100..300].fill(false);
        let some = data.with_recordings(blocks);
        let left = remove_tones(&fit, &some, &[7.3]);
        let b = &some.recordings[1];
        for phase in [0.0, 0.5 * std::f64::consts::PI] {
            let dot: f64 = (0..b.len())
                .filter(|k| b.used[*k])
                .map(|k| {
                    left[1][k]
                        * (std::f64::consts::TAU * 7.3 * 0.5 * (b.start_s[k] + b.end_s[k]) + phase).sin()
                })
                .sum();
            assert!(dot.abs() < 1e-8, "{dot}");
        }
        let judged = with_noise_without_tones(&fit, &data, &[5.1, 12.6]);
        assert!(judged.noise.sd_n() < 2e-3, "{}", judged.noise.sd_n());
    }
}
