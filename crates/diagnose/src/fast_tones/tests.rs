use super::*;
use crate::test_fixtures::uniform_sequence;
use stylet_identify::block_averages::BLOCK_S;

const NOISE_N: f64 = 0.02;

/// Recordings of 38 s with the force of a slow insertion with a rupture, normal noise, and an added force of the recording
/// and the time.
fn recordings(count: usize, hz: f64, added_n: impl Fn(usize, f64) -> f64) -> Vec<Recording> {
    (0..count)
        .map(|r| {
            let mut uniform = uniform_sequence(71 + 1000 * r as u64);
            let mut normal = move || (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
            let t: Vec<f64> = (0..(38.0 * hz) as usize).map(|k| k as f64 / hz).collect();
            let z = t.iter().map(|t| 0.002 * t).collect();
            let load = |t: f64| if t < 17.0 { 0.06 * t } else { 0.4 + 0.05 * (t - 17.0) };
            let f = t.iter().map(|t| load(*t) + NOISE_N * normal() + added_n(r, *t)).collect();
            Recording::new(t, z, f).expect("clean columns")
        })
        .collect()
}

fn removed(recordings: &mut [Recording]) -> Vec<FastTone> {
    let none = vec![Vec::new(); recordings.len()];
    remove_fast_tones(recordings, &none, BLOCK_S)
}

/// 50 Hz at 200 Hz is a quarter of the sampling rate: the mean of a block of four samples is zero.
#[test]
fn hum_at_a_null_of_the_block_means_is_found_and_removed_whatever_its_phase() {
    for (hz, sample_hz) in [(50.0, 200.0), (49.0, 200.0), (60.0, 200.0), (50.0, 1000.0), (99.7, 200.0)] {
        for count in [1, 4] {
            let phase = |r: usize| 0.4 + 1.7 * r as f64;
            let mut with = recordings(count, sample_hz, |r, t| libm::sin(TAU * hz * t + phase(r)));
            let without = recordings(count, sample_hz, |_, _| 0.0);
            let tones = removed(&mut with);
            assert_eq!(tones.len(), 1, "{hz} Hz at {sample_hz} Hz: {tones:?}");
            let tone = &tones[0];
            assert!((tone.frequency_hz.0 - hz).abs() < 4.0 * tone.frequency_hz.1 + 1e-4, "{tone:?}");
            assert!((tone.amplitude_n.0 - 1.0).abs() < 0.02, "{tone:?}");
            assert_eq!(tone.phase_rad.1.is_finite(), count == 1, "{tone:?}");
            for (a, b) in with.iter().zip(&without) {
                let square: f64 = a.force_n.iter().zip(&b.force_n).map(|(a, b)| (a - b).powi(2)).sum();
                assert!((square / a.len() as f64).sqrt() < 0.25 * NOISE_N, "{hz} Hz: {square}");
            }
        }
    }
}

/// The Cramér-Rao bounds hold over independent noise.
#[test]
fn amplitude_frequency_and_phase_lie_within_their_deviations() {
    let (amplitude_n, hz, phase) = (0.03, 37.3, 0.8);
    let mut squares = [0.0_f64; 3];
    for k in 0..12 {
        let mut all = recordings(4 * (k + 1), 200.0, |_, t| amplitude_n * libm::sin(TAU * hz * t + phase));
        let mut mine: Vec<Recording> = all.split_off(4 * k);
        let tones = removed(&mut mine);
        assert_eq!(tones.len(), 1, "{tones:?}");
        let off = |(value, sd): WithSd, there: f64| ((value - there) / sd).powi(2);
        let tone = &tones[0];
        squares[0] += off(tone.amplitude_n, amplitude_n);
        squares[1] += off(tone.frequency_hz, hz);
        squares[2] += off(tone.phase_rad, phase);
    }
    for square in squares {
        assert!((0.3..2.5).contains(&(square / 12.0)), "{squares:?}");
    }
}

/// Near half the sampling rate, one of the two columns is nearly zero and its coefficient is large.
#[test]
fn noise_has_no_tone_beside_half_the_sampling_rate() {
    let all = recordings(1, 200.0, |_, _| 0.0);
    let samples = Samples::new(&all[0], &[], 9);
    let present: f64 = samples.fast_n.iter().map(|f| f * f).sum();
    for k in 0..2000 {
        let hz = 99.9 + 0.1 * k as f64 / 2000.0;
        let explained = power(core::slice::from_ref(&samples), hz) * samples.response(hz).powi(2);
        assert!((0.0..0.01 * present).contains(&explained), "{hz} Hz: {explained} of {present}");
    }
}

#[test]
fn noise_ruptures_and_slow_tones_are_no_fast_tones() {
    for count in [1, 4] {
        for seed in 0..8 {
            let mut all = recordings(count * (seed + 1), 200.0, |_, t| 0.2 * libm::sin(TAU * 5.0 * t));
            let mut mine = all.split_off(count * seed);
            let before: Vec<Vec<f64>> = mine.iter().map(|r| r.force_n.clone()).collect();
            assert!(removed(&mut mine).is_empty());
            assert!(mine.iter().zip(&before).all(|(r, f)| r.force_n == *f));
        }
    }
}

#[test]
fn hum_of_drifting_frequency_is_removed_with_its_harmonic() {
    let drift = |t: f64| TAU * (50.0 * t + 0.1 * libm::sin(0.3 * t) / 0.3);
    let mut all =
        recordings(3, 200.0, |_, t| 0.1 * libm::sin(drift(t)) + 0.05 * libm::sin(2.0 * drift(t) + 1.0));
    let tones = removed(&mut all);
    assert!(tones.len() >= 2, "{tones:?}");
    assert!(
        (tones[0].frequency_hz.0 - 50.0).abs() < 0.2 && (tones[0].amplitude_n.0 - 0.1).abs() < 0.02,
        "{tones:?}"
    );
    assert!(tones[0].phase_rad.1.is_infinite());
}

#[test]
fn samples_slower_than_two_per_block_have_no_fast_tone() {
    let mut all = recordings(2, 50.0, |_, t| libm::sin(TAU * 20.0 * t));
    assert!(removed(&mut all).is_empty());
}
