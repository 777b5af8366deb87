use super::super::find_sensor_artefacts;
use super::super::tests::{alternating, quantised, recording};
use super::*;
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};

#[test]
fn noise_between_samples_at_the_sensor_limit_is_no_spike() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let t: Vec<f64> = (0..8000).map(|k| f64::from(k) / 200.0).collect();
    // Noise of 0.015 N; then a force beyond the limit with a few samples below it.
    let mut noisy = |k: i32| {
        let normal = (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
        match k {
            0..4000 => 1.0 + 0.015 * normal,
            _ if k % 23 == 0 => 1.99,
            _ => 2.0,
        }
    };
    let f: Vec<f64> = (0..8000).map(&mut noisy).collect();
    let r = Recording::new(t.clone(), vec![0.0; t.len()], f).expect("a recording");
    let artefacts = find_sensor_artefacts(&[&r], &[Vec::new()]);
    assert_eq!(artefacts.limit_n, Some(2.0));
    assert_eq!(artefacts.spikes, None);
}

/// Half of the samples are missing.
#[test]
fn the_spike_rate_is_per_recorded_time_and_the_size_interval_follows_the_scatter() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let (mut t, mut f, mut count) = (Vec::new(), Vec::new(), 0);
    for k in 0..40_000 {
        let spike = if k % 400 == 7 { 3.0 + 0.8 * (rng.random::<f64>() - 0.5) } else { 0.0 };
        let noise = 0.05 * (rng.random::<f64>() - 0.5);
        if (k / 200) % 2 == 0 {
            t.push(f64::from(k) / 200.0);
            f.push(noise + spike);
            count += usize::from(spike > 0.0);
        }
    }
    let r = Recording::new(t.clone(), vec![0.0; t.len()], f).expect("a recording");
    let spikes = find_sensor_artefacts(&[&r], &[Vec::new()]).spikes.expect("spikes");
    assert_eq!(spikes.count, count);
    assert!((spikes.rate_hz() - count as f64 / 100.0).abs() < 0.01, "{spikes:?}");
    let (low, high) = spikes.rate_interval_hz();
    // Score interval of a Poisson count of a hundred.
    assert!((low - 0.8223).abs() < 1e-3 && (high - 1.2161).abs() < 1e-3, "{low} {high}");
    let (low, high) = spikes.size_interval_n();
    assert!(low < 3.0 && high > 3.0 && high - low > 0.05 && high - low < 0.13, "{low} {high}");
}

const D: f64 = 0.01;

/// Least size: six and a half times the scatter.
const THRESHOLD_N: f64 = 6.5 * MAD_TO_SD * D;

#[test]
fn a_spike_exceeds_six_and_a_half_times_the_local_scatter() {
    for (size, expected) in [(0.99 * THRESHOLD_N, false), (1.01 * THRESHOLD_N, true)] {
        for sign in [1.0, -1.0] {
            let mut f = alternating(1000, D);
            for k in [200, 430, 777] {
                f[k] = sign * size;
            }
            let artefacts = find_sensor_artefacts(&[&recording(f)], &[Vec::new()]);
            assert_eq!(artefacts.spikes.is_some(), expected, "{size}");
            let marked: Vec<usize> = (0..1000).filter(|k| artefacts.exclude[0][*k]).collect();
            assert_eq!(marked, if expected { vec![200, 430, 777] } else { vec![] });
            if let Some(s) = artefacts.spikes {
                assert_eq!(s.count, 3);
                assert!((s.size_n - size).abs() < 1e-12 && s.size_sd_n < 1e-12, "{s:?}");
                // Two samples at either end cannot be tested.
                assert!((s.observed_s - 9.96).abs() < 1e-9, "{s:?}");
            }
        }
    }
    // A single one is not reported, nor any in less than twelve samples.
    let mut f = alternating(1000, D);
    f[200] = 2.0 * THRESHOLD_N;
    assert_eq!(find_sensor_artefacts(&[&recording(f)], &[Vec::new()]).spikes, None);
    for (n, expected) in [(11, false), (12, true)] {
        let mut f = alternating(n, 0.0);
        (f[3], f[8]) = (1.0, 1.0);
        assert_eq!(find_sensor_artefacts(&[&recording(f)], &[Vec::new()]).spikes.is_some(), expected, "{n}");
    }
}

/// A sample that is a spike in the half with low noise is none in the half with high noise.
#[test]
fn the_scatter_is_local() {
    let mut f = alternating(600, D);
    f.extend(alternating(600, 3.0 * D));
    for (places, count) in [([100, 300, 450], 3), ([750, 900, 1100], 0), ([100, 300, 900], 2)] {
        let mut f = f.clone();
        for k in places {
            f[k] = 1.5 * THRESHOLD_N;
        }
        let artefacts = find_sensor_artefacts(&[&recording(f)], &[Vec::new()]);
        assert_eq!(artefacts.spikes.map_or(0, |s| s.count), count, "{places:?}");
    }
    // The scatter of a quantised force is at least one step.
    let mut f = alternating(1000, D);
    for k in [200, 430, 777] {
        f[k] = 1.5 * THRESHOLD_N;
    }
    let notes = [vec![quantised(0.03)]];
    assert_eq!(find_sensor_artefacts(&[&recording(f.clone())], &notes).spikes, None);
    let notes = [vec![quantised(0.02)]];
    assert!(find_sensor_artefacts(&[&recording(f)], &notes).spikes.is_some());
}

#[test]
fn steps_ramps_and_jumps_of_speed_are_no_spikes() {
    let spiky = |change: &dyn Fn(&mut [f64], usize)| {
        let mut f = alternating(1000, D);
        for k in [200, 430, 776] {
            change(&mut f, k);
        }
        find_sensor_artefacts(&[&recording(f)], &[Vec::new()]).spikes.map(|s| s.count)
    };
    let size = 3.0 * THRESHOLD_N;
    assert_eq!(spiky(&|f, k| f[k] = size), Some(3));
    // A neighbour that is nearly as large.
    assert_eq!(spiky(&|f, k| (f[k], f[k + 1]) = (size, size - 0.6 * THRESHOLD_N)), None);
    // A change of level by more than half of the size.
    assert_eq!(spiky(&|f, k| f[k..].iter_mut().for_each(|f| *f += size)), None);
    // Outliers of every size are the tail of a distribution.
    let several = |sizes: [f64; 6]| {
        let mut f = alternating(1400, D);
        for (k, s) in sizes.iter().enumerate() {
            f[100 + 200 * k] = s * THRESHOLD_N;
        }
        find_sensor_artefacts(&[&recording(f)], &[Vec::new()]).spikes.map(|s| s.count)
    };
    assert_eq!(several([3.0, 3.1, 2.9, 3.2, 3.0, 2.8]), Some(6));
    assert_eq!(several([1.1, 2.0, 3.0, 4.5, 6.0, 9.0]), None);
    // At most 35 % may lie between a third and two thirds of the size: one for three spikes, not two.
    assert_eq!(several([3.0, 3.1, 2.9, 1.5, 0.0, 0.0]), Some(4));
    assert_eq!(several([3.0, 3.1, 2.9, 1.5, 1.4, 0.0]), None);
    assert_eq!(several([1.8, 1.8, 1.8, 0.9, 0.0, 0.0]), Some(3));
    assert_eq!(several([1.8, 1.8, 1.8, 0.9, 0.9, 0.0]), None);
    // Samples at a jump of the speed are not tested.
    let mut r = recording(alternating(1000, D));
    for k in [200, 430, 776] {
        r.force_n[k] = size;
    }
    r.velocity_mps[431..].iter_mut().for_each(|v| *v = 5e-4);
    let artefacts = find_sensor_artefacts(&[&r], &[Vec::new()]);
    let s = artefacts.spikes.expect("two spikes");
    assert_eq!(s.count, 2);
    assert!((s.observed_s - 9.94).abs() < 1e-9, "{s:?}");
    // A steady change of speed, and one by less than 0.1 mm/s, are tested.
    let mut slow = r.clone();
    slow.velocity_mps = (0..1000).map(|k| 2e-4 * k as f64).collect();
    assert_eq!(find_sensor_artefacts(&[&slow], &[Vec::new()]).spikes.map(|s| s.count), Some(3));
    slow.velocity_mps = (0..1000).map(|k| if k > 430 { 9e-5 } else { 0.0 }).collect();
    assert_eq!(find_sensor_artefacts(&[&slow], &[Vec::new()]).spikes.map(|s| s.count), Some(3));
    slow.velocity_mps = (0..1000).map(|k| if k > 430 { 1.1e-4 } else { 0.0 }).collect();
    assert_eq!(find_sensor_artefacts(&[&slow], &[Vec::new()]).spikes.map(|s| s.count), Some(2));
}

/// A spike exceeds either neighbour by seven tenths of the threshold, and the neighbours differ by less than half of its size.
#[test]
fn a_spike_exceeds_both_neighbours_which_agree() {
    let with_neighbour = |size: f64, neighbour: f64, before: bool| {
        let mut f = alternating(1000, D);
        for k in [200, 430, 776] {
            f[k - 2..k + 3].fill(0.0);
            f[k] = size * THRESHOLD_N;
            f[if before { k - 1 } else { k + 1 }] = neighbour * THRESHOLD_N;
        }
        find_sensor_artefacts(&[&recording(f)], &[Vec::new()]).spikes.map(|s| s.count)
    };
    for before in [true, false] {
        assert_eq!((with_neighbour(1.1, 0.35, before), with_neighbour(1.1, 0.45, before)), (Some(3), None));
        assert_eq!((with_neighbour(3.0, 1.4, before), with_neighbour(3.0, 1.6, before)), (Some(3), None));
        assert_eq!((with_neighbour(3.0, -1.4, before), with_neighbour(3.0, -1.6, before)), (Some(3), None));
    }
}

/// A constant level, distant samples at a limit and distant changes of speed.
#[test]
fn distant_samples_do_not_affect_the_detection() {
    let size = 3.0 * THRESHOLD_N;
    let spiky = |level: f64| {
        let mut f: Vec<f64> = alternating(1000, D).iter().map(|f| level + f).collect();
        for k in [200, 600, 800] {
            f[k] += size;
        }
        f
    };
    let count = |r: &Recording| find_sensor_artefacts(&[r], &[Vec::new()]).spikes.map(|s| s.count);
    assert_eq!(count(&recording(spiky(5.0))), Some(3));
    let mut limited = spiky(0.0);
    limited[400..411].fill(2.0);
    assert_eq!(count(&recording(limited)), Some(3));
    // The needle slows down at 300 and stops at 600, which is not tested.
    let mut slowed = recording(spiky(0.0));
    slowed.velocity_mps = (0..1000)
        .map(|k| match k {
            0..300 => 1e-2,
            300..601 => 5e-3,
            _ => 0.0,
        })
        .collect();
    assert_eq!(count(&slowed), Some(2));
    // Outliers below half of the threshold are noise.
    for (small, expected) in [(0.45, Some(3)), (0.55, None)] {
        let mut f = alternating(1000, D);
        for (k, s) in [(100, 1.15), (250, 1.15), (400, 1.15), (550, small), (700, small)] {
            f[k] = s * THRESHOLD_N;
        }
        assert_eq!(count(&recording(f)), expected, "{small}");
    }
}

/// The scatter of the first sixty tested samples is that of the first hundred and twenty, mostly with low noise; that of the next
/// sixty is that of the first hundred and eighty, mostly with high noise.
#[test]
fn sixty_samples_share_a_scatter() {
    for (place, count) in [(60, 2), (61, 2), (62, 0)] {
        let mut f = alternating(75, D);
        f.extend(alternating(925, 3.0 * D).iter().map(|f| -f));
        (f[30], f[place]) = (1.5 * THRESHOLD_N, 1.5 * THRESHOLD_N);
        assert_eq!(
            find_sensor_artefacts(&[&recording(f)], &[Vec::new()]).spikes.map_or(0, |s| s.count),
            count,
            "{place}"
        );
    }
}

#[test]
fn the_intervals_are_those_of_a_poisson_count_and_of_a_mean() {
    let s = Spikes { count: 9, size_n: 1.7, size_sd_n: 0.3, observed_s: 45.0 };
    assert!((s.rate_hz() - 0.2).abs() < 1e-15);
    let (z, (low, high)) = (stylet_stats::Z95, s.rate_interval_hz());
    // The rates at which nine are 1.96 standard deviations off: (n - m)^2 = z^2 m.
    for m in [45.0 * low, 45.0 * high] {
        assert!(((9.0 - m).powi(2) / m - z * z).abs() < 1e-9, "{m}");
    }
    assert!(low < 0.2 && high > 0.2);
    let (low, high) = s.size_interval_n();
    let half = stylet_stats::student_t::quantile(0.975, 8.0) * 0.3 / 3.0;
    assert!((low - 1.7 + half).abs() < 1e-12 && (high - 1.7 - half).abs() < 1e-12);
    let one = Spikes { count: 1, ..s };
    let half = stylet_stats::student_t::quantile(0.975, 1.0) * 0.3;
    assert!((one.size_interval_n().1 - 1.7 - half).abs() < 1e-9);
}

/// Noise with three degrees of freedom has outliers; spikes of one size are distinguished from them.
#[test]
fn spikes_are_found_among_the_outliers_of_heavy_tailed_noise() {
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    let mut normal = move || (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
    let noise: Vec<f64> = (0..20_000)
        .map(|_| 0.0115 * normal() / ((0..3).map(|_| normal().powi(2)).sum::<f64>() / 3.0).sqrt())
        .collect();
    assert_eq!(find_sensor_artefacts(&[&recording(noise.clone())], &[Vec::new()]).spikes, None);
    let mut f = noise;
    let places: Vec<usize> = (0..45).map(|k| 100 + 431 * k).collect();
    for (n, k) in places.iter().enumerate() {
        f[*k] += if n % 2 == 0 { 0.9 } else { -0.9 };
    }
    let artefacts = find_sensor_artefacts(&[&recording(f)], &[Vec::new()]);
    let found_spikes = artefacts.spikes.expect("spikes");
    assert!(
        (44..=48).contains(&found_spikes.count) && (found_spikes.size_n - 0.9).abs() < 0.04,
        "{found_spikes:?}"
    );
    let found = places.iter().filter(|k| artefacts.exclude[0][**k]).count();
    assert!(found >= 44, "{found}");
}
