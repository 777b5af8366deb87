//! Falls of the measured force: the reference for punctures in recordings, whose true punctures are unknown.

use stylet_record::Recording;

/// Smallest fall in N that counts as a puncture: above the scatter of repeated insertions (0.23 to 0.28 N RMS in the phantoms of
/// `docs/explanation/measured.md`).
const FALL_N: f64 = 0.3;
/// Smallest fall as a share of the largest force so far: fluctuations of the friction grow with the force.
const FALL_SHARE: f64 = 0.08;
/// Longest duration of a fall in s. Relaxation in a hold takes seconds, a puncture at 1 mm/s at most some 0.05 s.
const FALL_S: f64 = 0.1;
/// Ratio of a fall to the smallest one from which it is a reference, so that none depends on a borderline measurement.
pub const CLEAR_FALL_RATIO: f64 = 1.25;
/// Ratio from which a fall may be a small puncture: an event there is neither a hit nor a false alarm.
pub const MINOR_FALL_RATIO: f64 = 0.4;
/// Distance in m from the greatest depth at which the needle is still there; above the noise of encoders.
const DEEPEST_WITHIN_M: f64 = 5e-5;

/// A fall of the force within 0.1 s. Fields are indices of samples where not stated otherwise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForceFall {
    /// First sample with a sufficient fall ahead.
    pub from: usize,
    /// Sample at which the force has fallen by the required amount.
    pub at: usize,
    /// Lowest force.
    pub lowest: usize,
    /// Fall in N from its highest to its lowest force.
    pub size_n: f64,
    /// Size over that of the smallest fall that counts as a puncture.
    pub ratio: f64,
}

/// Falls of at least `ratio` times 0.3 N (times `force_scale`) and 8 % of the largest force so far, within 0.1 s.
#[must_use]
pub fn force_falls(recording: &Recording, ratio: f64, force_scale: f64) -> Vec<ForceFall> {
    let (t, f) = (&recording.time_s, &recording.force_n);
    let lowest = |k: usize| {
        let near = (k..t.len()).take_while(|&j| t[j] <= t[k] + FALL_S);
        near.min_by(|&a, &b| f[a].total_cmp(&f[b])).unwrap_or(k)
    };
    let mut out = Vec::new();
    let (mut k, mut peak_n) = (0, 0.0_f64);
    while k < t.len() {
        peak_n = peak_n.max(f[k]);
        let low = lowest(k);
        let smallest_n = (FALL_N * force_scale).max(FALL_SHARE * peak_n);
        if f[k] - f[low] < ratio * smallest_n {
            k += 1;
            continue;
        }
        let at = (k..=low).find(|&i| f[k] - f[i] >= ratio * smallest_n).unwrap_or(low);
        // The largest fall that begins in this one.
        let (mut size_n, mut end) = (f[k] - f[low], low);
        for i in k..low {
            let j = lowest(i);
            if f[i] - f[j] > size_n {
                (size_n, end) = (f[i] - f[j], j);
            }
        }
        out.push(ForceFall { from: k, at, lowest: end, size_n, ratio: size_n / smallest_n });
        k = end + 1;
    }
    out
}

/// The first and the last sample at the greatest depth; `None` without samples.
#[must_use]
pub fn deepest_samples(position_m: &[f64]) -> Option<(usize, usize)> {
    let deepest_m = position_m.iter().fold(f64::NEG_INFINITY, |deepest, z| deepest.max(*z));
    let there = |z: &f64| *z >= deepest_m - DEEPEST_WITHIN_M;
    Some((position_m.iter().position(there)?, position_m.iter().rposition(there)?))
}

/// Reference punctures of a measured insertion.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReferenceFalls {
    /// Falls of at least [`CLEAR_FALL_RATIO`].
    pub clear: Vec<ForceFall>,
    /// Smaller ones of at least [`MINOR_FALL_RATIO`].
    pub minor: Vec<ForceFall>,
}

/// The falls that end before the needle is pulled back, where the friction changes its sign.
#[must_use]
pub fn reference_falls(recording: &Recording) -> ReferenceFalls {
    let turn = deepest_samples(&recording.position_m).map_or(0, |(_, last)| last);
    let of = |ratio| force_falls(recording, ratio, 1.0).into_iter().filter(|fall| fall.lowest < turn);
    let clear: Vec<ForceFall> = of(1.0).filter(|fall| fall.ratio >= CLEAR_FALL_RATIO).collect();
    let apart = |fall: &ForceFall| clear.iter().all(|c| fall.lowest < c.from || c.lowest < fall.from);
    let minor = of(MINOR_FALL_RATIO).filter(apart).collect();
    ReferenceFalls { clear, minor }
}

/// How [`reference_falls`] defines a puncture.
#[must_use]
pub fn describe_reference_falls() -> String {
    format!(
        "A puncture is a fall of the force by at least {CLEAR_FALL_RATIO} times the larger of {FALL_N} N and {:.0} % of the largest force so \
         far, within {FALL_S} s and before the needle is pulled back; its time is the sample at which the force has fallen by the larger of \
         these two. One event at a smaller fall, from {MINOR_FALL_RATIO} times it, is neither a hit nor a false alarm.",
        100.0 * FALL_SHARE
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 2 mm/s for 5 s at 100 Hz, then back; the force rises by 0.5 N/s and falls at 2 s, 3 s and 4 s by 1, 0.2 and 0.05 N.
    fn recording() -> Recording {
        let time_s: Vec<f64> = (0..1000).map(|k| 0.01 * f64::from(k)).collect();
        let position_m = time_s.iter().map(|t| 2e-3 * t.min(10.0 - t)).collect();
        let force_n = time_s
            .iter()
            .map(|t| {
                let fallen = [(2.0, 1.0), (3.0, 0.2), (4.0, 0.05)].iter().filter(|(at, _)| t >= at);
                // Pulled back, the friction changes its sign over 1 mm.
                let turned = 4.0 * (t - 5.0).clamp(0.0, 0.5);
                0.5 * t - fallen.map(|(_, size)| size).sum::<f64>() - turned
            })
            .collect();
        Recording::new(time_s, position_m, force_n).unwrap_or_default()
    }

    #[test]
    fn a_clear_and_a_minor_fall_are_found_and_neither_the_slow_nor_the_turn() {
        let recording = recording();
        let falls = reference_falls(&recording);
        let times = |falls: &[ForceFall]| falls.iter().map(|f| recording.time_s[f.at]).collect::<Vec<_>>();
        assert_eq!(times(&falls.clear), [2.0]);
        assert_eq!(times(&falls.minor), [3.0]);
        assert!((falls.clear[0].size_n - 0.995).abs() < 1e-9, "{falls:?}");
    }

    #[test]
    fn the_deepest_samples_are_those_of_the_hold() {
        assert_eq!(deepest_samples(&[0.0, 0.01, 0.02, 0.019_99, 0.02, 0.01]), Some((2, 4)));
        assert_eq!(deepest_samples(&[]), None);
    }
}
