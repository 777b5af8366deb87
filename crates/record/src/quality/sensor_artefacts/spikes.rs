//! Isolated samples that stand out of both neighbours, all by about the same.

use crate::Recording;
use stylet_stats::order_statistics::median;

/// A spike stands out of its neighbours by so many robust standard deviations.
const SPIKE_SD: f64 = 6.5;

/// Half width in samples of the window in which the scatter around a sample is judged: noise may grow with the force.
const AROUND: usize = 60;
/// Samples that tell a scatter.
const ENOUGH: usize = 20;
/// Spikes have one size: the relative spread of their sizes. Tails of a distribution have many.
const ONE_SIZE: f64 = 0.35;
/// ... and hardly any outlying sample is smaller: at most this share of their number between a third and two thirds.
const BETWEEN: f64 = 0.35;

/// Spikes of one size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spikes {
    /// How many.
    pub count: usize,
    /// Mean size in N.
    pub size_n: f64,
    /// Standard deviation of the sizes in N: what the noise makes of them.
    pub size_sd_n: f64,
    /// Seconds in which a spike would have been seen.
    pub observed_s: f64,
}

impl Spikes {
    /// Spikes per second.
    #[must_use]
    pub fn rate_hz(&self) -> f64 {
        self.count as f64 / self.observed_s.max(1e-9)
    }

    /// 95 % interval of the rate in Hz: the score interval of a Poisson number, `n + z^2/2 -+ z sqrt(n + z^2/4)`.
    #[must_use]
    pub fn rate_interval_hz(&self) -> (f64, f64) {
        let (n, z) = (self.count as f64, stylet_stats::Z95);
        let (middle, half) = (n + 0.5 * z * z, z * (n + 0.25 * z * z).sqrt());
        ((middle - half) / self.observed_s.max(1e-9), (middle + half) / self.observed_s.max(1e-9))
    }

    /// 95 % interval of the mean size in N.
    #[must_use]
    pub fn size_interval_n(&self) -> (f64, f64) {
        let n = self.count as f64;
        let half = stylet_stats::student_t::quantile(0.975, (n - 1.0).max(1.0)) * self.size_sd_n / n.sqrt();
        (self.size_n - half, self.size_n + half)
    }
}

/// Isolated samples that stand out of both neighbours, all by about the same.
pub(super) fn find_spikes(recordings: &[&Recording], exclude: &mut [Vec<bool>], step: f64) -> Option<Spikes> {
    let mut seen_s = 0.0;
    let mut found: Vec<(usize, usize, f64)> = Vec::new();
    let mut smaller: Vec<f64> = Vec::new();
    for (r, recording) in recordings.iter().enumerate() {
        let f = &recording.force_n;
        if f.len() < 12 {
            continue;
        }
        let interval_s = median(&mut recording.time_s.windows(2).map(|w| w[1] - w[0]).collect::<Vec<_>>());
        let away = |i: usize| {
            let mut around = [f[i - 2], f[i - 1], f[i + 1], f[i + 2]];
            around.sort_unstable_by(f64::total_cmp);
            f[i] - 0.5 * (around[1] + around[2])
        };
        // What stands at a limit does not scatter; beside it everything stands out.
        let clear: Vec<bool> = exclude[r].windows(5).map(|w| w.iter().all(|x| !x)).collect();
        let sizes: Vec<f64> = (2..f.len() - 2).map(|i| away(i).abs()).collect();
        let scatter = |lo: usize, hi: usize| {
            let mut of: Vec<f64> = (lo..hi).filter(|k| clear[*k]).map(|k| sizes[k]).collect();
            (of.len() >= ENOUGH || hi - lo == sizes.len())
                .then(|| (median(&mut of) * stylet_stats::MAD_TO_SD).max(step).max(1e-12))
        };
        let overall = scatter(0, sizes.len());
        let local: Vec<f64> = (0..sizes.len().div_ceil(AROUND))
            .map(|k| {
                let (lo, hi) = ((k * AROUND).saturating_sub(AROUND), ((k + 2) * AROUND).min(sizes.len()));
                scatter(lo, hi).or(overall).unwrap_or(f64::NAN)
            })
            .collect();
        for i in 2..f.len() - 2 {
            let s = away(i);
            let sd = local[(i - 2) / AROUND];
            let (before, after) = (f[i] - f[i - 1], f[i] - f[i + 1]);
            let isolated = before * after > 0.0 && (f[i - 1] - f[i + 1]).abs() < 0.5 * s.abs();
            let v = &recording.velocity_mps;
            let moves = (v[i + 1] - v[i - 1]).abs()
                > 1e-4 + 3.0 * (v[i + 2] - v[i + 1]).abs().max((v[i - 1] - v[i - 2]).abs());
            if moves || !clear[i - 2] {
                continue;
            }
            // Only here would one have been seen; what is missing from a recording has none.
            seen_s += interval_s;
            if !isolated {
                continue;
            }
            let both = before.abs().min(after.abs()) > 0.7 * SPIKE_SD * sd;
            if s.abs() > SPIKE_SD * sd && both {
                found.push((r, i, s.abs()));
            } else if s.abs() > 0.5 * SPIKE_SD * sd {
                smaller.push(s.abs());
            }
        }
    }
    keep_one_size(&mut found, smaller);
    if found.len() < 2 {
        return None;
    }
    for (r, i, _) in &found {
        exclude[*r][*i] = true;
    }
    let sizes: Vec<f64> = found.iter().map(|f| f.2).collect();
    let (size_n, size_sd_n) = (stylet_stats::moments::mean(&sizes), stylet_stats::moments::sd(&sizes));
    Some(Spikes { count: found.len(), size_n, size_sd_n, observed_s: seen_s })
}

/// Keeps as many of the largest as have one size and hardly anything between them and the noise: what heavy tails let stand out beside them
/// is no spike. `smaller` are the sizes of samples that do not stand out far enough. Nothing is kept where no two are alike.
fn keep_one_size(found: &mut Vec<(usize, usize, f64)>, smaller: Vec<f64>) {
    let mut sizes: Vec<f64> = found.iter().map(|f| f.2).collect();
    sizes.sort_unstable_by(|a, b| b.total_cmp(a));
    let mut all: Vec<f64> = sizes.iter().copied().chain(smaller).collect();
    all.sort_unstable_by(f64::total_cmp);
    let one_size = |n: usize| {
        let size = 0.5 * (sizes[(n - 1) / 2] + sizes[n / 2]);
        let below = |x: f64| all.partition_point(|s| *s < x);
        let above_a_third = all.partition_point(|s| *s <= size / 3.0);
        let between = below(2.0 * size / 3.0).saturating_sub(above_a_third);
        let spread =
            || stylet_stats::order_statistics::median_of(sizes[..n].iter().map(|s| (s - size).abs()));
        sizes[n - 1] > size / 3.0
            && between as f64 <= BETWEEN * n as f64
            && stylet_stats::MAD_TO_SD * spread() < ONE_SIZE * size
    };
    let kept = (2..=sizes.len()).rev().find(|n| one_size(*n));
    let least = kept.map_or(f64::INFINITY, |n| sizes[n - 1]);
    found.retain(|f| f.2 >= least);
}

#[cfg(test)]
mod tests {
    use super::super::find_sensor_artefacts;
    use super::super::tests::{alternating, quantised, recording};
    use super::*;
    use rand::rngs::ChaCha8Rng;
    use rand::{RngExt, SeedableRng};

    #[test]
    fn noise_between_samples_that_stand_at_the_sensors_limit_is_no_spike() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let t: Vec<f64> = (0..8000).map(|k| f64::from(k) / 200.0).collect();
        // Noise of 0.015 N; then a force so far beyond the limit that only now and then a sample shows below it.
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
        let raw = find_sensor_artefacts(&[&r], &[Vec::new()]);
        assert_eq!(raw.limit_n, Some(2.0));
        assert_eq!(raw.spikes, None);
    }

    /// Half of the samples are missing: the rate is that of the samples that are there. The size is as sure as the spikes agree.
    #[test]
    fn spikes_are_counted_over_the_samples_that_are_there_and_their_size_is_as_sure_as_they_agree() {
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
        // A hundred of a Poisson number, by the score interval.
        assert!((low - 0.8223).abs() < 1e-3 && (high - 1.2161).abs() < 1e-3, "{low} {high}");
        let (low, high) = spikes.size_interval_n();
        assert!(low < 3.0 && high > 3.0 && high - low > 0.05 && high - low < 0.13, "{low} {high}");
    }

    const D: f64 = 0.01;

    /// What a spike has to stand out by: six and a half of these scatters.
    const LEAST: f64 = 6.5 * stylet_stats::MAD_TO_SD * D;

    #[test]
    fn a_spike_stands_out_by_six_and_a_half_times_the_scatter_around_it() {
        for (size, seen) in [(0.99 * LEAST, false), (1.01 * LEAST, true)] {
            for sign in [1.0, -1.0] {
                let mut f = alternating(1000, D);
                for k in [200, 430, 777] {
                    f[k] = sign * size;
                }
                let raw = find_sensor_artefacts(&[&recording(f)], &[Vec::new()]);
                assert_eq!(raw.spikes.is_some(), seen, "{size}");
                let marked: Vec<usize> = (0..1000).filter(|k| raw.exclude[0][*k]).collect();
                assert_eq!(marked, if seen { vec![200, 430, 777] } else { vec![] });
                if let Some(s) = raw.spikes {
                    assert_eq!(s.count, 3);
                    assert!((s.size_n - size).abs() < 1e-12 && s.size_sd_n < 1e-12, "{s:?}");
                    // Two samples at either end could not show one.
                    assert!((s.observed_s - 9.96).abs() < 1e-9, "{s:?}");
                }
            }
        }
        // One alone is none, nor are there any in a few samples.
        let mut f = alternating(1000, D);
        f[200] = 2.0 * LEAST;
        assert_eq!(find_sensor_artefacts(&[&recording(f)], &[Vec::new()]).spikes, None);
        for (n, seen) in [(11, false), (12, true)] {
            let mut f = alternating(n, 0.0);
            (f[3], f[8]) = (1.0, 1.0);
            assert_eq!(find_sensor_artefacts(&[&recording(f)], &[Vec::new()]).spikes.is_some(), seen, "{n}");
        }
    }

    /// The noise may grow with the force: in the loud half a sample is none that is one in the quiet half.
    #[test]
    fn the_scatter_is_that_of_the_neighbourhood() {
        let mut f = alternating(600, D);
        f.extend(alternating(600, 3.0 * D));
        for (places, count) in [([100, 300, 450], 3), ([750, 900, 1100], 0), ([100, 300, 900], 2)] {
            let mut f = f.clone();
            for k in places {
                f[k] = 1.5 * LEAST;
            }
            let raw = find_sensor_artefacts(&[&recording(f)], &[Vec::new()]);
            assert_eq!(raw.spikes.map_or(0, |s| s.count), count, "{places:?}");
        }
        // A force on a grid scatters by a step at least.
        let mut f = alternating(1000, D);
        for k in [200, 430, 777] {
            f[k] = 1.5 * LEAST;
        }
        let notes = [vec![quantised(0.03)]];
        assert_eq!(find_sensor_artefacts(&[&recording(f.clone())], &notes).spikes, None);
        let notes = [vec![quantised(0.02)]];
        assert!(find_sensor_artefacts(&[&recording(f)], &notes).spikes.is_some());
    }

    #[test]
    fn steps_and_ramps_and_what_moves_are_no_spikes() {
        let spiky = |change: &dyn Fn(&mut [f64], usize)| {
            let mut f = alternating(1000, D);
            for k in [200, 430, 776] {
                change(&mut f, k);
            }
            find_sensor_artefacts(&[&recording(f)], &[Vec::new()]).spikes.map(|s| s.count)
        };
        let size = 3.0 * LEAST;
        assert_eq!(spiky(&|f, k| f[k] = size), Some(3));
        // A neighbour that is nearly as high: it does not stand out of both by seven tenths of the least.
        assert_eq!(spiky(&|f, k| (f[k], f[k + 1]) = (size, size - 0.6 * LEAST)), None);
        // A level that changes there by more than half of it.
        assert_eq!(spiky(&|f, k| f[k..].iter_mut().for_each(|f| *f += size)), None);
        // Spikes of every size are the tail of a distribution.
        let several = |sizes: [f64; 6]| {
            let mut f = alternating(1400, D);
            for (k, s) in sizes.iter().enumerate() {
                f[100 + 200 * k] = s * LEAST;
            }
            find_sensor_artefacts(&[&recording(f)], &[Vec::new()]).spikes.map(|s| s.count)
        };
        assert_eq!(several([3.0, 3.1, 2.9, 3.2, 3.0, 2.8]), Some(6));
        assert_eq!(several([1.1, 2.0, 3.0, 4.5, 6.0, 9.0]), None);
        // At most 35 % of their number may lie between a third and two thirds: one beside three, not two, found or nearly found.
        assert_eq!(several([3.0, 3.1, 2.9, 1.5, 0.0, 0.0]), Some(4));
        assert_eq!(several([3.0, 3.1, 2.9, 1.5, 1.4, 0.0]), None);
        assert_eq!(several([1.8, 1.8, 1.8, 0.9, 0.0, 0.0]), Some(3));
        assert_eq!(several([1.8, 1.8, 1.8, 0.9, 0.9, 0.0]), None);
        // Where the speed jumps nothing is said, and these samples could not have shown one.
        let mut r = recording(alternating(1000, D));
        for k in [200, 430, 776] {
            r.force_n[k] = size;
        }
        r.velocity_mps[431..].iter_mut().for_each(|v| *v = 5e-4);
        let raw = find_sensor_artefacts(&[&r], &[Vec::new()]);
        let s = raw.spikes.expect("two are left");
        assert_eq!(s.count, 2);
        assert!((s.observed_s - 9.94).abs() < 1e-9, "{s:?}");
        // A speed that changes steadily, and one that changes by less than a tenth of a mm/s, does not matter.
        let mut slow = r.clone();
        slow.velocity_mps = (0..1000).map(|k| 2e-4 * k as f64).collect();
        assert_eq!(find_sensor_artefacts(&[&slow], &[Vec::new()]).spikes.map(|s| s.count), Some(3));
        slow.velocity_mps = (0..1000).map(|k| if k > 430 { 9e-5 } else { 0.0 }).collect();
        assert_eq!(find_sensor_artefacts(&[&slow], &[Vec::new()]).spikes.map(|s| s.count), Some(3));
        slow.velocity_mps = (0..1000).map(|k| if k > 430 { 1.1e-4 } else { 0.0 }).collect();
        assert_eq!(find_sensor_artefacts(&[&slow], &[Vec::new()]).spikes.map(|s| s.count), Some(2));
    }

    /// The neighbours stand at nothing but for one, on either side: a spike stands out of it by seven tenths of the least, and both
    /// neighbours agree to half of it.
    #[test]
    fn a_spike_stands_out_of_both_its_neighbours_and_they_agree() {
        let beside = |size: f64, neighbour: f64, before: bool| {
            let mut f = alternating(1000, D);
            for k in [200, 430, 776] {
                f[k - 2..k + 3].fill(0.0);
                f[k] = size * LEAST;
                f[if before { k - 1 } else { k + 1 }] = neighbour * LEAST;
            }
            find_sensor_artefacts(&[&recording(f)], &[Vec::new()]).spikes.map(|s| s.count)
        };
        for before in [true, false] {
            assert_eq!((beside(1.1, 0.35, before), beside(1.1, 0.45, before)), (Some(3), None));
            assert_eq!((beside(3.0, 1.4, before), beside(3.0, 1.6, before)), (Some(3), None));
            assert_eq!((beside(3.0, -1.4, before), beside(3.0, -1.6, before)), (Some(3), None));
        }
    }

    /// On a level far from nothing, and beside samples at a limit or where the speed changed long before, spikes are spikes all the same.
    #[test]
    fn what_lies_far_from_a_spike_does_not_matter() {
        let size = 3.0 * LEAST;
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
        // The needle slows down at 300 and stops at 600: there a spike could be anything.
        let mut slowed = recording(spiky(0.0));
        slowed.velocity_mps = (0..1000)
            .map(|k| match k {
                0..300 => 1e-2,
                300..601 => 5e-3,
                _ => 0.0,
            })
            .collect();
        assert_eq!(count(&slowed), Some(2));
        // Outlying samples below half of what makes a spike are noise, wherever the spikes' size puts them.
        for (small, seen) in [(0.45, Some(3)), (0.55, None)] {
            let mut f = alternating(1000, D);
            for (k, s) in [(100, 1.15), (250, 1.15), (400, 1.15), (550, small), (700, small)] {
                f[k] = s * LEAST;
            }
            assert_eq!(count(&recording(f)), seen, "{small}");
        }
    }

    /// The first sixty samples are judged by the first hundred and twenty, mostly quiet, the next by the first hundred and eighty, mostly
    /// loud; the two at either end do not count.
    #[test]
    fn sixty_samples_share_a_scatter() {
        for (place, count) in [(60, 2), (61, 2), (62, 0)] {
            let mut f = alternating(75, D);
            f.extend(alternating(925, 3.0 * D).iter().map(|f| -f));
            (f[30], f[place]) = (1.5 * LEAST, 1.5 * LEAST);
            assert_eq!(
                find_sensor_artefacts(&[&recording(f)], &[Vec::new()]).spikes.map_or(0, |s| s.count),
                count,
                "{place}"
            );
        }
    }

    #[test]
    fn intervals_of_spikes_are_those_of_a_poisson_number_and_of_a_mean() {
        let s = Spikes { count: 9, size_n: 1.7, size_sd_n: 0.3, observed_s: 45.0 };
        assert!((s.rate_hz() - 0.2).abs() < 1e-15);
        let (z, (low, high)) = (stylet_stats::Z95, s.rate_interval_hz());
        // The rates from which nine are as far as 1.96 standard deviations: (n - m)^2 = z^2 m.
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

    /// Noise with three degrees of freedom lets a sample in a few hundred stand out; spikes of one size are told from it, and it has none.
    #[test]
    fn spikes_are_found_beside_the_outliers_of_heavy_tails() {
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
        let raw = find_sensor_artefacts(&[&recording(f)], &[Vec::new()]);
        let told = raw.spikes.expect("spikes");
        assert!((44..=48).contains(&told.count) && (told.size_n - 0.9).abs() < 0.04, "{told:?}");
        let found = places.iter().filter(|k| raw.exclude[0][**k]).count();
        assert!(found >= 44, "{found}");
    }
}
