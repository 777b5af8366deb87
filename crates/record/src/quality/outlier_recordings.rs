//! Outlying recordings among repeats, by their force over depth.

use super::note::{QualityKind, QualityNote};
use crate::recording::Recording;
use stylet_stats::median_of;

/// Least number of recordings.
const MIN_RECORDINGS: usize = 3;
/// Depths at which the forces are compared.
const DEPTHS: usize = 24;
/// Floor of the scatter between repeats, as a share of the force.
const MIN_SCATTER_SHARE: f64 = 0.15;
/// Distance of an outlier: RMS of its deviations in robust standard deviations.
const MIN_DISTANCE_SD: f64 = 5.0;

/// For each recording of a set of repeats, a note when its force over depth is an outlier.
///
/// The advance is divided into depths that most of the recordings reach. At each depth the median over the recordings and
/// the scatter about it (median absolute deviation, at least 15 % of the force) give the deviation of each recording; up to
/// half of them may be outliers.
#[must_use]
pub fn find_outlier_recordings(recordings: &[&Recording]) -> Vec<Option<QualityNote>> {
    if recordings.len() < MIN_RECORDINGS {
        return vec![None; recordings.len()];
    }
    let ranges: Vec<(f64, f64)> = recordings.iter().map(|r| depth_range(r)).collect();
    let from_m = median_of(ranges.iter().map(|range| range.0));
    let to_m = median_of(ranges.iter().map(|range| range.1));
    let profiles: Vec<Vec<Option<f64>>> = recordings.iter().map(|r| profile(r, from_m, to_m)).collect();
    let size_n = median_of(profiles.iter().flatten().flatten().map(|f| f.abs()));
    let mut squares = vec![(0.0, 0.0); recordings.len()];
    for k in 0..DEPTHS {
        let here: Vec<f64> = profiles.iter().filter_map(|p| p[k]).collect();
        if here.len() < MIN_RECORDINGS {
            continue;
        }
        let middle = median_of(here.iter().copied());
        let scatter = stylet_stats::MAD_TO_SD * median_of(here.iter().map(|f| (f - middle).abs()));
        let scale = scatter
            .max(MIN_SCATTER_SHARE * middle.abs())
            .max(MIN_SCATTER_SHARE * size_n)
            .max(f64::MIN_POSITIVE);
        for (sum, profile) in squares.iter_mut().zip(&profiles) {
            if let Some(f) = profile[k] {
                sum.0 += ((f - middle) / scale).powi(2);
                sum.1 += 1.0;
            }
        }
    }
    let typical = |p: &[Option<f64>]| median_of(p.iter().flatten().copied());
    squares
        .iter()
        .zip(&profiles)
        .enumerate()
        .map(|(i, ((sum, count), own))| {
            let distance = f64::sqrt(sum / f64::max(*count, 1.0));
            (distance > MIN_DISTANCE_SD).then(|| {
                let others =
                    median_of(profiles.iter().enumerate().filter(|(j, _)| *j != i).map(|(_, p)| typical(p)).filter(|f| f.is_finite()));
                let message = format!(
                    "it is an outlier among its repeats: {:.2} N at a typical depth where the others have {others:.2} N ({distance:.0} times the \
                     scatter among repeats); is it filed under the right tissue, needle and units? correct it or leave it out",
                    typical(own)
                );
                let numbers = [("distance", distance), ("typical_n", typical(own)), ("others_n", others)];
                QualityNote::new(QualityKind::OutlierRecording, message, numbers)
            })
        })
        .collect()
}

/// Smallest position before the deepest one, and the deepest one (m).
fn depth_range(r: &Recording) -> (f64, f64) {
    let (deepest, _) = deepest(r);
    (r.position_m[..=deepest].iter().copied().fold(f64::INFINITY, f64::min), r.position_m[deepest])
}

fn deepest(r: &Recording) -> (usize, f64) {
    let mut best = (0, f64::NEG_INFINITY);
    for (i, z) in r.position_m.iter().enumerate() {
        if *z > best.1 {
            best = (i, *z);
        }
    }
    best
}

/// Mean force per depth bin while advancing; `None` in bins without samples.
fn profile(r: &Recording, from_m: f64, to_m: f64) -> Vec<Option<f64>> {
    let mut sums = vec![(0.0, 0_u32); DEPTHS];
    let (last, _) = deepest(r);
    for (z, f) in r.position_m[..=last].iter().zip(&r.force_n) {
        let at = (z - from_m) / (to_m - from_m) * DEPTHS as f64;
        if at >= 0.0 && at < DEPTHS as f64 {
            let sum = &mut sums[at as usize];
            *sum = (sum.0 + f, sum.1 + 1);
        }
    }
    sums.into_iter().map(|(sum, count)| (count > 0).then(|| sum / f64::from(count))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::RecordError;

    /// An insertion at `speed` m/s into a tissue with forces times `gain`, with a ripple of 2 %.
    fn insertion(speed: f64, gain: f64, phase: f64) -> Result<Recording, RecordError> {
        let n = (0.02 / speed * 100.0) as u32;
        let time_s: Vec<f64> = (0..n).map(|i| f64::from(i) * 0.01).collect();
        let position_m: Vec<f64> = time_s.iter().map(|t| speed * t - 0.002).collect();
        let force_n = position_m
            .iter()
            .map(|z| gain * z.max(0.0) * (60.0 + 4000.0 * speed) * (1.0 + 0.02 * (700.0 * z + phase).sin()))
            .collect();
        Recording::new(time_s, position_m, force_n)
    }

    fn is_outlier(all: &[Recording]) -> Vec<bool> {
        find_outlier_recordings(&all.iter().collect::<Vec<_>>()).iter().map(Option::is_some).collect()
    }

    #[test]
    fn repeats_at_three_speeds_with_twenty_percent_scatter_have_no_outlier() -> Result<(), RecordError> {
        let mut all = Vec::new();
        for (k, gain) in [0.8, 0.9, 1.0, 1.1, 1.2].into_iter().enumerate() {
            for speed in [0.002, 0.004, 0.008] {
                all.push(insertion(speed, gain, k as f64)?);
            }
        }
        assert_eq!(is_outlier(&all), vec![false; 15]);
        Ok(())
    }

    #[test]
    fn one_outlier_is_found_among_three_and_among_ten_recordings() -> Result<(), RecordError> {
        for others in [2, 3, 9] {
            let mut all = vec![insertion(0.004, 3.0, 0.0)?];
            for k in 0..others {
                all.push(insertion(0.004, 1.0 + 0.03 * f64::from(k % 3), f64::from(k))?);
            }
            let is_outlier = is_outlier(&all);
            assert!(
                is_outlier[0] && !is_outlier[1..].contains(&true),
                "among {others} others: {is_outlier:?}"
            );
        }
        Ok(())
    }

    #[test]
    fn the_note_compares_with_the_others() -> Result<(), RecordError> {
        let all = [
            insertion(0.004, 1.0, 0.0)?,
            insertion(0.004, 1.05, 1.0)?,
            insertion(0.004, 3.0, 2.0)?,
            insertion(0.004, 0.95, 3.0)?,
        ];
        let notes = find_outlier_recordings(&all.iter().collect::<Vec<_>>());
        let note = notes[2].as_ref().expect("three times the force");
        let ratio = note.numbers["typical_n"] / note.numbers["others_n"];
        assert!(
            (2.7..3.3).contains(&ratio) && note.message.contains("an outlier among its repeats"),
            "{}",
            note.message
        );
        Ok(())
    }
}
