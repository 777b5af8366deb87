use super::*;
use alloc::vec::Vec;

const SPEED_MPS: f64 = 0.0023;

/// Samples at `hz` from 3 mm before to 3 mm after a rupture at zero, and the index of the first after it.
fn rupture(hz: f64, force_n: impl Fn(f64) -> f64) -> (SampleRing<Vec<Sample>>, u64) {
    let step_m = SPEED_MPS / hz;
    let before = (0.003 / step_m) as u64;
    let mut history = SampleRing::new(alloc::vec![Sample::default(); 2 * before as usize + 2]);
    for number in 0..=2 * before {
        let position_m = (number as f64 - before as f64) * step_m;
        history.push(Sample {
            time_s: number as f64 / hz,
            position_m,
            velocity_mps: SPEED_MPS,
            force_n: force_n(position_m),
        });
    }
    (history, before + 1)
}

/// Curved on both sides: `1 + 3e5 z²` N before, `0.2 - 6e5 z²` N after.
fn curved(z: f64) -> f64 {
    if z <= 0.0 { 1.0 + 3e5 * z * z } else { 0.2 - 6e5 * z * z }
}

#[test]
fn the_drop_is_the_gap_between_lines_over_a_millimetre_at_every_sampling_rate() {
    // The least-squares line through z² over 0..h is h z - h²/6.
    for hz in [100.0, 200.0, 1000.0, 5000.0, 20_000.0] {
        let (history, after) = rupture(hz, curved);
        let config = DropConfig::default();
        let (drop_n, share) = ForceDrop::begin(&history, 0, after).drop_and_elastic_share(&config, 0.0);
        let (top_n, bottom_n) = (1.0 - 3e5 * 1e-6 / 6.0, 0.2 + 6e5 * 1e-6 / 6.0);
        assert!((drop_n - (top_n - bottom_n)).abs() < 0.008, "{hz} Hz: {drop_n} N");
        assert!((share - (top_n - bottom_n) / top_n).abs() < 0.01, "{hz} Hz: {share}");
    }
}

#[test]
fn samples_before_the_layer_do_not_affect_the_drop() {
    for hz in [200.0, 5000.0] {
        let (history, after) = rupture(hz, curved);
        let first = after - (0.0005 / (SPEED_MPS / hz)) as u64;
        let (drop_n, _) =
            ForceDrop::begin(&history, first, after).drop_and_elastic_share(&DropConfig::default(), 0.0);
        let expected = 1.0 - 3e5 * 0.25e-6 / 6.0 - (0.2 + 6e5 * 1e-6 / 6.0);
        assert!((drop_n - expected).abs() < 0.006, "{hz} Hz: {drop_n} N");
    }
}

#[test]
fn by_extremes_the_drop_is_the_maximum_of_the_last_millimetre_less_the_minimum_after() {
    let (history, after) = rupture(1000.0, curved);
    let config = DropConfig { estimator: DropEstimator::Extremes, ..DropConfig::default() };
    let (drop_n, _) = ForceDrop::begin(&history, 0, after).drop_and_elastic_share(&config, 0.0);
    let expected = (1.0 + 3e5 * 1e-6) - (0.2 - 6e5 * 9e-6);
    assert!((drop_n - expected).abs() < 0.02, "{drop_n} N for {expected} N");
}

#[test]
fn samples_after_the_declaration_count_as_those_before() {
    let (history, after) = rupture(200.0, curved);
    let mut short = SampleRing::new(alloc::vec![Sample::default(); 1000]);
    for number in 0..after {
        short.push(*history.get(number).expect("held"));
    }
    let mut drop = ForceDrop::begin(&short, 0, after);
    for number in after..history.next_index() {
        drop.add(history.get(number).expect("held"));
    }
    let at_once = ForceDrop::begin(&history, 0, after);
    for estimator in [DropEstimator::Lines, DropEstimator::Extremes] {
        let config = DropConfig { estimator, ..DropConfig::default() };
        assert_eq!(drop.drop_and_elastic_share(&config, 10.0), at_once.drop_and_elastic_share(&config, 10.0));
    }
}

#[test]
fn the_elastic_share_refers_to_the_layer_force_and_is_limited() {
    let (history, after) = rupture(200.0, |z| if z <= 0.0 { 1.0 } else { 0.5 });
    let drop = ForceDrop::begin(&history, 0, after);
    let config = DropConfig { share_limits: [0.1, 0.9], ..DropConfig::default() };
    // 0.5 N of 0.8 N for D = 0.2 N/v; of less than itself; of zero; of a negative force.
    for (friction_n, expected) in [(0.2, 0.625), (0.45, 0.9), (1.0, 0.9), (1.5, 0.9)] {
        let (drop_n, share) = drop.drop_and_elastic_share(&config, friction_n / SPEED_MPS);
        assert!((drop_n - 0.5).abs() < 1e-9 && (share - expected).abs() < 1e-9, "{drop_n} N, {share}");
    }
    let (history, after) = rupture(200.0, |z| if z <= 0.0 { 1.0 } else { 1.3 });
    let (drop_n, share) = ForceDrop::begin(&history, 0, after).drop_and_elastic_share(&config, 0.0);
    assert!((drop_n + 0.3).abs() < 1e-9, "a rise of 0.3 N : {drop_n}");
    assert_eq!(share, 0.1, "a rise has the least share");
}

fn forces(forces_n: impl IntoIterator<Item = f64>) -> SampleRing<Vec<Sample>> {
    let mut history = SampleRing::new(alloc::vec![Sample::default(); 3000]);
    for (number, force_n) in forces_n.into_iter().enumerate() {
        history.push(Sample { time_s: 0.005 * number as f64, force_n, ..Sample::default() });
    }
    history
}

/// Loading with noise, and a fall of 0.5 N from sample `at` on.
fn falling(count: usize, at: usize) -> impl Iterator<Item = f64> {
    (0..count).map(move |k| {
        let noise_n = 0.02 * ((k * 7919 % 101) as f64 / 50.0 - 1.0);
        1.0 + 1e-4 * k as f64 + noise_n - if k >= at { 0.5 } else { 0.0 }
    })
}

#[test]
fn a_rupture_is_located_at_the_first_sample_after_its_drop() {
    for at in [3, 4, 50, 120, 195, 198, 199] {
        assert_eq!(locate_drop(&forces(falling(200, at)), 0), at as u64);
    }
}

#[test]
fn with_many_samples_a_rupture_is_located_to_within_the_stride() {
    for (count, at) in [(600, 401), (2000, 1501), (2500, 77)] {
        let found = locate_drop(&forces(falling(count, at)), 0) as usize;
        assert!((at..=at + count / 256).contains(&found), "{at} of {count}: {found}");
    }
}

#[test]
fn a_drop_before_the_layer_and_a_low_sample_at_the_end_are_not_the_drop() {
    let early = falling(200, 120).enumerate().map(|(k, f)| if k >= 40 { f - 2.0 } else { f });
    assert_eq!(locate_drop(&forces(early), 60), 120);
    let late = falling(200, 120).enumerate().map(|(k, f)| if k == 199 { f - 0.7 } else { f });
    assert_eq!(locate_drop(&forces(late), 0), 120);
}

/// Place of the largest fall from the mean of three samples before to that of up to three after, weighted by the root of their
/// number.
fn steepest(forces_n: &[f64], first: usize, stride: usize) -> usize {
    let mean = |at: &dyn Fn(usize) -> usize, count: usize| {
        (0..count).map(|k| forces_n[at(k)]).sum::<f64>() / count as f64
    };
    let places = (first + 3 * stride..forces_n.len()).step_by(stride);
    let fall = |place: usize| {
        let count = ((forces_n.len() - 1 - place) / stride + 1).min(3);
        let after_n = mean(&|k| place + k * stride, count);
        (after_n - mean(&|k| place - (k + 1) * stride, 3)) * (count as f64 / 3.0).sqrt()
    };
    places.min_by(|a, b| fall(*a).total_cmp(&fall(*b))).unwrap_or(forces_n.len() - 1)
}

#[test]
fn the_located_rupture_maximises_the_difference_of_three_sample_means() {
    // Random walks, whose steepest place may be anywhere.
    for seed in 1..60_usize {
        for (count, first, stride) in
            [(20, 0, 1), (20, 9, 1), (7, 3, 1), (4, 0, 1), (3, 0, 1), (300, 5, 1), (600, 10, 2), (900, 30, 3)]
        {
            let forces_n: Vec<f64> = (0..count)
                .map(|k| 1.0 + ((k * k * 31 + k * seed * 7919 + seed * seed) % 1009) as f64 / 1009.0)
                .collect();
            let expected = steepest(&forces_n, first, stride);
            assert_eq!(locate_drop(&forces(forces_n), first as u64), expected as u64, "{count} from {first}");
        }
    }
    // Overwritten samples are not inspected.
    let mut short = SampleRing::new(alloc::vec![Sample::default(); 40]);
    let forces_n: Vec<f64> = falling(100, 50).collect();
    for force_n in &forces_n {
        short.push(Sample { force_n: *force_n, ..Sample::default() });
    }
    assert_eq!(locate_drop(&short, 0), 60 + steepest(&forces_n[60..], 0, 1) as u64);
}

#[test]
fn the_lines_use_evenly_thinned_samples_of_a_millimetre_on_either_side() {
    for hz in [100.0, 200.0, 1000.0, 20_000.0] {
        let (history, after) = rupture(hz, curved);
        let step_m = SPEED_MPS / hz;
        // At most 256 places are inspected.
        let stride = (0.001 / step_m / 256.0) as u64 + 1;
        for first in [0, after - 40.min(after / 2)] {
            let drop = ForceDrop::begin(&history, first, after);
            let mut numbers: Vec<u64> = alloc::vec![after - 1];
            while let Some(number) = numbers.last().and_then(|n| n.checked_sub(stride)) {
                numbers.push(number);
            }
            let (mut before, mut highest_n) = (LineFit::default(), f64::NEG_INFINITY);
            let edge = history.get(after - 1).expect("held").position_m;
            for number in numbers.into_iter().take(256).filter(|n| *n >= first) {
                let s = history.get(number).expect("held");
                if s.position_m >= edge - 0.001 {
                    before.add(s.position_m, s.force_n);
                    highest_n = highest_n.max(s.force_n);
                }
            }
            assert_eq!((drop.before, drop.max_before_n), (before, highest_n), "{hz} Hz");
            let (mut after_fit, mut lowest_n) = (LineFit::default(), f64::INFINITY);
            for s in (after..history.next_index()).filter_map(|n| history.get(n)) {
                lowest_n = lowest_n.min(s.force_n);
                if s.position_m <= edge + 0.001 {
                    after_fit.add(s.position_m, s.force_n);
                }
            }
            assert_eq!((drop.after, drop.min_after_n), (after_fit, lowest_n), "{hz} Hz");
            assert_eq!((drop.rupture_m, drop.velocity_mps), (edge, SPEED_MPS));
        }
    }
}

#[test]
fn a_drop_at_the_first_sample_or_at_standstill_uses_the_available_samples() {
    let history = forces([1.0, 0.7, 0.4]);
    let none = ForceDrop::begin(&history, 0, 0);
    assert_eq!((none.before.count, none.after.count), (0.0, 0.0));
    let one = ForceDrop::begin(&history, 0, 1);
    assert_eq!((one.before.count, one.after.count), (1.0, 2.0));
    assert_eq!((one.max_before_n, one.min_after_n), (1.0, 0.4));
    let (drop_n, share) = one.drop_and_elastic_share(&DropConfig::default(), 0.0);
    assert!((drop_n - 0.45).abs() < 1e-12 && (share - 0.45).abs() < 1e-12, "{drop_n} N, {share}");
    assert_eq!(ForceDrop::begin(&history, 0, 2).before.count, 2.0);
    assert_eq!(ForceDrop::begin(&history, 1, 2).before.count, 1.0);
}

#[test]
fn without_samples_on_one_side_no_drop_is_measured() {
    // Storage for one sample: none before the rupture is kept.
    let mut history = SampleRing::new(alloc::vec![Sample::default(); 1]);
    for number in 0..4 {
        let t = f64::from(number);
        history.push(Sample { time_s: t, position_m: 0.001 * t, velocity_mps: 0.001, force_n: 2.0 - t });
    }
    let drop = ForceDrop::begin(&history, 0, 3);
    for estimator in [DropEstimator::Lines, DropEstimator::Extremes] {
        let config = DropConfig { estimator, ..DropConfig::default() };
        assert_eq!(drop.drop_and_elastic_share(&config, 0.0), (0.0, config.share_limits[0]), "{estimator:?}");
    }
}
