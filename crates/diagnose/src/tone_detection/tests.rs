use super::*;
use crate::test_fixtures::{assumed_layers, blocks_of, data_of};
use stylet_identify::block_averages::BlockAverages;
use stylet_identify::likelihood::residuals;
use stylet_identify::model::Model;

const HZ: f64 = 100.0;

/// Recordings in air: the model force is zero, so that the residual is the force.
fn in_air(forces: &[&dyn Fn(f64) -> f64], seconds: f64, keep: impl Fn(usize) -> bool) -> (Fit, FitData) {
    let blocks: Vec<BlockAverages> = forces
        .iter()
        .map(|f| {
            let kept: Vec<usize> = (0..(seconds * HZ) as usize).filter(|k| keep(*k)).collect();
            let t: Vec<f64> = kept.iter().map(|k| 7.0 + *k as f64 / HZ).collect();
            let z = t.iter().map(|t| -0.1 + 1e-4 * t).collect();
            let f = t.iter().map(|t| f(*t)).collect();
            blocks_of(t, z, f)
        })
        .collect();
    let assumed = assumed_layers(&[[0.02, 100.0, 1000.0]]);
    let model = Model::base(assumed, blocks.len());
    let data = data_of(blocks, 0.02);
    let residuals = residuals(&model, &data).expect("a replay");
    (Fit { model, residuals }, data)
}

fn wave(a: f64, hz: f64, phase: f64) -> impl Fn(f64) -> f64 {
    move |t| a * (std::f64::consts::TAU * hz * t + phase).sin()
}

/// A tone is found at its frequency, but not in a few samples.
#[test]
fn a_few_samples_show_no_tone() {
    // Uniform noise of ±0.01 by a hash of the time (SplitMix64).
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

/// In air the residual is the force, so the spectrum is that of the force column.
#[test]
fn spectrum_is_that_of_the_residual_at_the_sampling_rate() {
    let tone = wave(0.3, 11.3, 0.4);
    let (fit, data) = in_air(&[&tone], 20.0, |_| true);
    let (hz, amplitude) = residual_spectrum(&fit, &data);
    assert_eq!(hz.len(), 512);
    let peak = (0..512).max_by(|a, b| amplitude[*a].total_cmp(&amplitude[*b])).expect("a peak");
    assert!((hz[peak] - 11.3).abs() < 0.1, "{}", hz[peak]);
}

#[test]
fn tones_are_removed_by_least_squares_in_each_recording() {
    let (one, two) = (wave(0.3, 5.1, 0.4), |t: f64| wave(0.7, 5.1, 2.0)(t) + wave(0.2, 12.6, 0.1)(t));
    let (fit, data) = in_air(&[&one, &two], 20.0, |_| true);
    let residual = remove_tones(&fit, &data, &[5.1, 12.6]);
    let most = |e: &[f64]| e.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    // Blocks of two samples reproduce a tone.
    assert!(
        most(&residual[0]) < 2e-3 && most(&residual[1]) < 2e-3,
        "{} {}",
        most(&residual[0]),
        most(&residual[1])
    );
    let residual = remove_tones(&fit, &data, &[5.1]);
    assert!((most(&residual[1]) - 0.19).abs() < 0.02, "{}", most(&residual[1]));
    assert_eq!(remove_tones(&fit, &data, &[]), fit.residuals.residual_n);
    // The remainder is orthogonal to the tone over the compared blocks.
    let mut blocks = data.recordings.to_vec();
    blocks[1].used[100..300].fill(false);
    let some = data.with_recordings(blocks);
    let residual = remove_tones(&fit, &some, &[7.3]);
    let b = &some.recordings[1];
    for phase in [0.0, 0.5 * std::f64::consts::PI] {
        let dot: f64 = (0..b.len())
            .filter(|k| b.used[*k])
            .map(|k| {
                residual[1][k]
                    * (std::f64::consts::TAU * 7.3 * 0.5 * (b.start_s[k] + b.end_s[k]) + phase).sin()
            })
            .sum();
        assert!(dot.abs() < 1e-8, "{dot}");
    }
    let judged = with_noise_without_tones(&fit, &data, &[5.1, 12.6]);
    assert!(judged.noise.sd_n() < 2e-3, "{}", judged.noise.sd_n());
}
