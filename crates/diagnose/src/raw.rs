//! What the raw numbers say before any law: saturation, quantisation, spikes.

use stylet_record::{QualityKind, QualityNote, Recording};
use stylet_stats::order::median;

/// What was found in the raw force.
#[derive(Clone, Debug, Default)]
pub struct Raw {
    /// Samples per recording that cannot be compared: saturated or spikes.
    pub exclude: Vec<Vec<bool>>,
    /// Range of the sensor in N, if it was reached.
    pub limit_n: Option<f64>,
    /// Step of the recorded force in N.
    pub step_n: Option<f64>,
    /// Spikes.
    pub spikes: Option<Spikes>,
}

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
    pub seen_s: f64,
}

impl Spikes {
    /// Spikes per second.
    #[must_use]
    pub fn rate_hz(&self) -> f64 {
        self.count as f64 / self.seen_s.max(1e-9)
    }

    /// 95 % interval of the rate in Hz: the score interval of a Poisson number, `n + z^2/2 -+ z sqrt(n + z^2/4)`.
    #[must_use]
    pub fn rate_interval_hz(&self) -> (f64, f64) {
        let (n, z) = (self.count as f64, stylet_stats::Z95);
        let (middle, half) = (n + 0.5 * z * z, z * (n + 0.25 * z * z).sqrt());
        ((middle - half) / self.seen_s.max(1e-9), (middle + half) / self.seen_s.max(1e-9))
    }

    /// 95 % interval of the mean size in N.
    #[must_use]
    pub fn size_interval_n(&self) -> (f64, f64) {
        let n = self.count as f64;
        let half = stylet_stats::student::quantile(0.975, (n - 1.0).max(1.0)) * self.size_sd_n / n.sqrt();
        (self.size_n - half, self.size_n + half)
    }
}

/// Fewest equal extremes that make a saturation.
const EXTREMES: usize = 6;
/// With fewer levels than this up to the largest force, a limit must hold far more samples.
const COARSE_LEVELS: f64 = 20.0;
/// A spike stands out of its neighbours by so many robust standard deviations.
const SPIKE_SD: f64 = 6.5;

/// Looks the raw forces over.
#[must_use]
pub fn look(recordings: &[&Recording], notes: &[Vec<QualityNote>]) -> Raw {
    let mut raw =
        Raw { exclude: recordings.iter().map(|r| vec![false; r.len()]).collect(), ..Raw::default() };
    raw.step_n = step(recordings, notes);
    raw.limit_n = limit(recordings, raw.step_n);
    if let Some(limit) = raw.limit_n {
        for (exclude, recording) in raw.exclude.iter_mut().zip(recordings) {
            for (x, f) in exclude.iter_mut().zip(&recording.force_n) {
                *x |= f.abs() >= limit * (1.0 - 1e-9);
            }
        }
    }
    raw.spikes = spikes(recordings, &mut raw.exclude, raw.step_n.unwrap_or(0.0));
    raw
}

/// The step on which all forces lie.
fn step(recordings: &[&Recording], notes: &[Vec<QualityNote>]) -> Option<f64> {
    let mut steps: Vec<f64> = notes
        .iter()
        .flatten()
        .filter(|n| n.kind == QualityKind::Quantisation && n.message.starts_with("force_n"))
        .filter_map(|n| n.numbers.get("smallest_step").copied())
        .filter(|s| *s > 0.0)
        .collect();
    if 2 * steps.len() < recordings.len().max(1) {
        return None;
    }
    let rough = median(&mut steps);
    // The step from all levels at once: level number against value, by least squares through zero.
    let (mut nf, mut nn) = (0.0, 0.0);
    for f in recordings.iter().flat_map(|r| &r.force_n) {
        let n = (f / rough).round();
        nf += n * f;
        nn += n * n;
    }
    let fine = if nn > 0.0 { nf / nn } else { rough };
    Some(if (fine / rough - 1.0).abs() < 0.02 { fine } else { rough })
}

/// The level at which the force stops.
fn limit(recordings: &[&Recording], step: Option<f64>) -> Option<f64> {
    let all = || recordings.iter().flat_map(|r| &r.force_n);
    let most = all().fold(0.0_f64, |m, f| m.max(f.abs()));
    if most <= 0.0 {
        return None;
    }
    let at = all().filter(|f| f.abs() >= most * (1.0 - 1e-9)).count();
    let expected = match step {
        None => 0,
        // On a grid several samples share the last level; below the limit they thin out.
        Some(step) => {
            let level = |k: f64| all().filter(|f| (f.abs() - (most - k * step)).abs() < 0.25 * step).count();
            // A force that is held within one of few levels looks like a limit.
            let factor = if COARSE_LEVELS * step > most { 12 } else { 3 };
            factor * level(1.0).max(level(2.0)).max(2)
        }
    };
    (at >= EXTREMES && at > expected).then_some(most)
}

/// Half width in samples of the window in which the scatter around a sample is judged: noise may grow with the force.
const AROUND: usize = 60;
/// Samples that tell a scatter.
const ENOUGH: usize = 20;
/// Spikes have one size: the relative spread of their sizes. Tails of a distribution have many.
const ONE_SIZE: f64 = 0.35;
/// ... and hardly any outlying sample is smaller: at most this share of their number between a third and two thirds.
const BETWEEN: f64 = 0.35;

/// Isolated samples that stand out of both neighbours, all by about the same.
fn spikes(recordings: &[&Recording], exclude: &mut [Vec<bool>], step: f64) -> Option<Spikes> {
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
    let size = stylet_stats::order::median_of(found.iter().map(|f| f.2));
    let spread =
        stylet_stats::MAD_TO_SD * stylet_stats::order::median_of(found.iter().map(|f| (f.2 - size).abs()));
    let all = found.iter().map(|f| f.2).chain(smaller);
    let between = all.filter(|s| *s > size / 3.0 && *s < 2.0 * size / 3.0).count();
    let of_one_size = spread < ONE_SIZE * size && (between as f64) <= BETWEEN * found.len() as f64;
    if found.len() < 2 || !of_one_size {
        return None;
    }
    for (r, i, _) in &found {
        exclude[*r][*i] = true;
    }
    let sizes: Vec<f64> = found.iter().map(|f| f.2).collect();
    let (size_n, size_sd_n) = (stylet_stats::moments::mean(&sizes), stylet_stats::moments::sd(&sizes));
    Some(Spikes { count: found.len(), size_n, size_sd_n, seen_s })
}

#[cfg(test)]
mod tests {
    use super::look;
    use rand::rngs::ChaCha8Rng;
    use rand::{RngExt, SeedableRng};
    use stylet_record::Recording;

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
        let raw = look(&[&r], &[Vec::new()]);
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
        let spikes = look(&[&r], &[Vec::new()]).spikes.expect("spikes");
        assert_eq!(spikes.count, count);
        assert!((spikes.rate_hz() - count as f64 / 100.0).abs() < 0.01, "{spikes:?}");
        let (low, high) = spikes.rate_interval_hz();
        // A hundred of a Poisson number, by the score interval.
        assert!((low - 0.8223).abs() < 1e-3 && (high - 1.2161).abs() < 1e-3, "{low} {high}");
        let (low, high) = spikes.size_interval_n();
        assert!(low < 3.0 && high > 3.0 && high - low > 0.05 && high - low < 0.13, "{low} {high}");
    }
}
