use super::*;

const HZ: f64 = 100.0;

/// Columns of 100 Hz from the seventh second on.
fn in_air(
    of: &[&dyn Fn(f64) -> f64],
    seconds: f64,
    keep: impl Fn(usize) -> bool,
) -> Vec<SampledSignal<'static>> {
    let kept: Vec<f64> =
        (0..(seconds * HZ) as usize).filter(|k| keep(*k)).map(|k| 7.0 + k as f64 / HZ).collect();
    let t: &'static [f64] = kept.leak();
    of.iter()
        .map(|f| SampledSignal { time_s: t, values: t.iter().map(|t| f(*t)).collect(), step_s: 1.0 / HZ })
        .collect()
}

fn wave(a: f64, hz: f64, phase: f64) -> impl Fn(f64) -> f64 {
    move |t| a * (std::f64::consts::TAU * hz * t + phase).sin()
}

fn noise(t: f64) -> f64 {
    nth(0, t)
}

/// Noise of one of several recordings: evenly within 0.01 of nothing (SplitMix64).
fn nth(r: u64, t: f64) -> f64 {
    let seed = (t * 1e4).round() as u64 + 10_000_000 * r;
    let mut z = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    0.02 * (((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64 - 0.5)
}

/// Tones of four signals with independent noise and a common part.
fn of_four(f: &dyn Fn(f64) -> f64) -> Vec<f64> {
    let [a, b, c, d] = [0, 1, 2, 3].map(|r| move |t: f64| nth(r, t) + f(t));
    let data = in_air(&[&a, &b, &c, &d], 20.0, |_| true);
    PowerSpectrum::estimate(&data, PADDING).detect_tones()
}

/// Parseval: the one-sided density over all frequencies is the mean square, for a tone and for noise, also where the mean is over
/// recordings of different power.
#[test]
fn the_power_density_integrates_to_the_mean_square() {
    let (tone, hiss, quiet) = (wave(0.3, 11.3, 0.4), |t: f64| 20.0 * noise(t), |_: f64| 0.0);
    let square =
        |f: &dyn Fn(f64) -> f64| (0..2000).map(|k| f(7.0 + f64::from(k) / HZ).powi(2)).sum::<f64>() / 2000.0;
    let total = |forces: &[&dyn Fn(f64) -> f64], padding: usize| {
        let data = in_air(forces, 20.0, |_| true);
        let PowerSpectrum { bin_hz, density: p, .. } = PowerSpectrum::estimate(&data, padding);
        assert_eq!(p.len(), 1024 * padding);
        assert!((bin_hz * (2048 * padding) as f64 / HZ - 1.0).abs() < 1e-9);
        p.iter().sum::<f64>() * bin_hz
    };
    for padding in [1, 4] {
        assert!((total(&[&tone], padding) / square(&tone) - 1.0).abs() < 0.01);
        assert!((total(&[&hiss], padding) / square(&hiss) - 1.0).abs() < 0.15);
        assert!((total(&[&tone, &quiet], padding) / square(&tone) - 0.5).abs() < 0.01);
    }
    // A tone of which every fifth sample is missing has less, and a recording of another rate does not count.
    let data = in_air(&[&tone], 20.0, |k| k % 5 != 0);
    let PowerSpectrum { bin_hz, density: p, .. } = PowerSpectrum::estimate(&data, 1);
    let peak = (0..p.len()).max_by(|a, b| p[*a].total_cmp(&p[*b])).expect("a peak");
    assert!((peak as f64 * bin_hz - 11.3).abs() < bin_hz, "{}", peak as f64 * bin_hz);
}

/// A spectrum has room for the time from the first sample to the last, but no more than for twice the samples and one.
#[test]
fn long_gaps_do_not_enlarge_the_spectrum() {
    let tone = wave(0.3, 11.3, 0.4);
    let bins = |seconds: f64, keep: &dyn Fn(usize) -> bool| {
        let data = in_air(&[&tone], seconds, keep);
        PowerSpectrum::estimate(&data, 1).density.len()
    };
    assert_eq!((bins(10.23, &|_| true), bins(10.26, &|_| true)), (512, 1024));
    // 512 samples around a gap of a minute: 1025 places; 511 have 1023.
    assert_eq!(bins(70.0, &|k| !(256..7000 - 256).contains(&k)), 1024);
    assert_eq!(bins(70.0, &|k| !(256..7000 - 255).contains(&k)), 512);
}

#[test]
fn a_signal_of_another_rate_is_left_out() {
    let (tone, other) = (wave(0.3, 11.3, 0.4), wave(0.9, 31.0, 0.4));
    let data = in_air(&[&tone, &other], 20.0, |_| true);
    let alone_data = in_air(&[&tone], 20.0, |_| true);
    let one = PowerSpectrum::estimate(&alone_data, 1).density;
    for (by, counts) in [(1.009, true), (1.011, false)] {
        let mut columns = data.clone();
        columns[1].step_s *= by;
        let p = PowerSpectrum::estimate(&columns, 1).density;
        let same = p.iter().zip(&one).all(|(p, one)| (p - one).abs() <= 1e-9 * one);
        assert_eq!(!same, counts, "{by}");
    }
}

#[test]
fn outliers_are_clipped_at_six_times_the_median() {
    let spike = |t: f64| if (t - 12.0).abs() < 0.004 { 900.0 } else { wave(0.3, 11.3, 0.4)(t) };
    let data = in_air(&[&spike], 20.0, |_| true);
    let PowerSpectrum { bin_hz, density: p, .. } = PowerSpectrum::estimate(&data, 1);
    let total = p.iter().sum::<f64>() * bin_hz;
    // One of 2000 samples of at most 6 * 0.22 adds little to a mean square of 0.045.
    assert!(total > 0.044 && total < 0.05, "{total}");
}

#[test]
fn the_plotted_spectrum_is_the_root_of_the_bin_means() {
    let tone = wave(0.3, 11.3, 0.4);
    let data = in_air(&[&tone], 20.0, |_| true);
    let PowerSpectrum { bin_hz, density: p, .. } = PowerSpectrum::estimate(&data, 1);
    let (hz, amplitude) = PowerSpectrum::estimate(&data, 1).for_plot();
    // 1024 bins, two by two.
    assert_eq!(hz.len(), 512);
    for k in [0, 1, 57, 115, 116, 511] {
        assert!((hz[k] - (2.0 * k as f64 + 1.0) * bin_hz).abs() < 1e-9, "{k}: {}", hz[k]);
        assert!((amplitude[k] - (0.5 * (p[2 * k] + p[2 * k + 1])).sqrt()).abs() < 1e-12);
    }
    // A short one is drawn bin by bin.
    let data = in_air(&[&tone], 4.0, |_| true);
    assert_eq!(PowerSpectrum::estimate(&data, 1).for_plot().0.len(), 256);
}

#[test]
fn tones_are_detected_at_their_frequencies_strongest_first() {
    let found = of_four(&|t| wave(0.02, 7.77, 0.3)(t) + wave(0.05, 23.41, 1.0)(t));
    assert_eq!(found.len(), 2, "{found:?}");
    assert!((found[0] - 23.41).abs() < 0.003 && (found[1] - 7.77).abs() < 0.003, "{found:?}");
    // Three at most.
    let found =
        of_four(&|t| [3.1, 9.2, 17.3, 31.7, 44.0].map(|hz| wave(0.05 + 1e-3 * hz, hz, 0.2)(t)).iter().sum());
    assert_eq!(found.iter().map(|hz| (10.0 * hz).round() / 10.0).collect::<Vec<_>>(), [44.0, 31.7, 17.3]);
    // Within eight bins before padding (0.39 Hz) a weaker one is the strong one's flank.
    for (apart, count) in [(0.36, 1), (0.44, 2)] {
        let found = of_four(&move |t| wave(0.05, 20.0, 0.2)(t) + wave(0.03, 20.0 + apart, 0.2)(t));
        assert_eq!(found.len(), count, "{apart}: {found:?}");
    }
    // Noise has none, nor has what is slower than the slowest line.
    assert!(of_four(&|_| 0.0).is_empty());
    let found = of_four(&wave(0.05, 0.5 * MIN_TONE_HZ, 0.2));
    assert!(found.is_empty(), "{found:?}");
}

#[test]
fn the_remainder_is_orthogonal_to_the_subtracted_sinusoid() {
    let t = |k: usize| 0.013 * k as f64;
    let used = |k: usize| !(40..90).contains(&k);
    let whole: Vec<f64> = (0..300).map(|k| wave(0.3, 5.1, 0.4)(t(k)) + noise(t(k))).collect();
    let mut x = whole.clone();
    subtract_sinusoid(&mut x, t, used, 5.1);
    assert!(x.iter().all(|x| x.abs() < 0.013));
    for phase in [0.0, 0.5 * std::f64::consts::PI] {
        let dot: f64 = (0..300).filter(|k| used(*k)).map(|k| x[k] * (TAU * 5.1 * t(k) + phase).sin()).sum();
        assert!(dot.abs() < 1e-9, "{dot}");
    }
}
