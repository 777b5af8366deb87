//! Spikes of the force: isolated outlying samples of one size.

use crate::recording::Recording;
use stylet_stats::{MAD_TO_SD, mean, median, median_of, sd};

/// Least size of a spike in local robust standard deviations.
const MIN_SIZE_SD: f64 = 6.5;

/// Half width in samples of the window of the local scatter, since noise may grow with the force.
const SCATTER_WINDOW: usize = 60;
/// Least number of samples for a local scatter.
const MIN_SCATTER_SAMPLES: usize = 20;
/// Most relative scatter of the sizes: spikes have one size, the tails of a noise distribution have many.
const MAX_SIZE_SCATTER: f64 = 0.35;
/// Most outlying samples between a third and two thirds of the size, relative to the number of spikes.
const MAX_SMALLER_SHARE: f64 = 0.35;

/// Spikes of one size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spikes {
    /// Number of spikes.
    pub count: usize,
    /// Mean size in N.
    pub size_n: f64,
    /// Standard deviation of the sizes in N.
    pub size_sd_n: f64,
    /// Time in s in which a spike would have been detected.
    pub observed_s: f64,
}

impl Spikes {
    /// Spikes per second.
    #[must_use]
    pub fn rate_hz(&self) -> f64 {
        self.count as f64 / self.observed_s.max(1e-9)
    }

    /// 95 % interval of the rate in Hz: the score interval of a Poisson count, `n + z^2/2 -+ z sqrt(n + z^2/4)`.
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

/// Finds the spikes of the recordings and excludes their samples. `step` is the resolution of the force in N.
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
        let deviation = |i: usize| {
            let mut around = [f[i - 2], f[i - 1], f[i + 1], f[i + 2]];
            around.sort_unstable_by(f64::total_cmp);
            f[i] - 0.5 * (around[1] + around[2])
        };
        // Samples at a limit do not scatter, and their neighbours would look like spikes.
        let clear: Vec<bool> = exclude[r].windows(5).map(|w| w.iter().all(|x| !x)).collect();
        let sizes: Vec<f64> = (2..f.len() - 2).map(|i| deviation(i).abs()).collect();
        let scatter = |lo: usize, hi: usize| {
            let mut of: Vec<f64> = (lo..hi).filter(|k| clear[*k]).map(|k| sizes[k]).collect();
            (of.len() >= MIN_SCATTER_SAMPLES || hi - lo == sizes.len())
                .then(|| (median(&mut of) * MAD_TO_SD).max(step).max(1e-12))
        };
        let overall = scatter(0, sizes.len());
        let local: Vec<f64> = (0..sizes.len().div_ceil(SCATTER_WINDOW))
            .map(|k| {
                let (lo, hi) = (
                    (k * SCATTER_WINDOW).saturating_sub(SCATTER_WINDOW),
                    ((k + 2) * SCATTER_WINDOW).min(sizes.len()),
                );
                scatter(lo, hi).or(overall).unwrap_or(f64::NAN)
            })
            .collect();
        for i in 2..f.len() - 2 {
            let s = deviation(i);
            let sd = local[(i - 2) / SCATTER_WINDOW];
            let (before, after) = (f[i] - f[i - 1], f[i] - f[i + 1]);
            let isolated = before * after > 0.0 && (f[i - 1] - f[i + 1]).abs() < 0.5 * s.abs();
            let v = &recording.velocity_mps;
            let moves = (v[i + 1] - v[i - 1]).abs()
                > 1e-4 + 3.0 * (v[i + 2] - v[i + 1]).abs().max((v[i - 1] - v[i - 2]).abs());
            if moves || !clear[i - 2] {
                continue;
            }
            // A spike would have been detected here.
            seen_s += interval_s;
            if !isolated {
                continue;
            }
            let both = before.abs().min(after.abs()) > 0.7 * MIN_SIZE_SD * sd;
            if s.abs() > MIN_SIZE_SD * sd && both {
                found.push((r, i, s.abs()));
            } else if s.abs() > 0.5 * MIN_SIZE_SD * sd {
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
    let (size_n, size_sd_n) = (mean(&sizes), sd(&sizes));
    Some(Spikes { count: found.len(), size_n, size_sd_n, observed_s: seen_s })
}

/// Keeps as many of the largest outliers as have one size and hardly any smaller ones between them and the noise; the outliers
/// of heavy tails do not count as spikes. `smaller` are the sizes of samples below the threshold. Keeps none if no two have
/// one size.
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
        let spread = || median_of(sizes[..n].iter().map(|s| (s - size).abs()));
        sizes[n - 1] > size / 3.0
            && between as f64 <= MAX_SMALLER_SHARE * n as f64
            && MAD_TO_SD * spread() < MAX_SIZE_SCATTER * size
    };
    let kept = (2..=sizes.len()).rev().find(|n| one_size(*n));
    let least = kept.map_or(f64::INFINITY, |n| sizes[n - 1]);
    found.retain(|f| f.2 >= least);
}

#[cfg(test)]
mod tests;
