//! One recording among its repeats: is it like the others?

use super::{QualityKind, QualityNote};
use crate::recording::Recording;
use stylet_stats::median_of;

/// Fewest recordings among which one can be unlike the others.
const FEWEST: usize = 3;
/// Depths at which the forces are compared.
const DEPTHS: usize = 24;
/// Scatter of repeats, as a share of the force, that is taken for granted.
const USUAL: f64 = 0.15;
/// Distance (root mean square of the deviations, each in robust standard deviations) from which a recording is unlike the others.
const FAR: f64 = 5.0;

/// Per recording of a set of repeats a note when its force over depth is unlike the others'.
///
/// The way in is cut into depths that most of the recordings reach; at each the median over the recordings and the scatter about it
/// (median absolute deviation, at least 15 % of the force) say how far away each one is: up to half of them may be wrong.
#[must_use]
pub fn find_outlier_recordings(recordings: &[&Recording]) -> Vec<Option<QualityNote>> {
    if recordings.len() < FEWEST {
        return vec![None; recordings.len()];
    }
    let ways: Vec<(f64, f64)> = recordings.iter().map(|r| way_in(r)).collect();
    let from_m = median_of(ways.iter().map(|way| way.0));
    let to_m = median_of(ways.iter().map(|way| way.1));
    let profiles: Vec<Vec<Option<f64>>> = recordings.iter().map(|r| profile(r, from_m, to_m)).collect();
    let size_n = median_of(profiles.iter().flatten().flatten().map(|f| f.abs()));
    let mut squares = vec![(0.0, 0.0); recordings.len()];
    for k in 0..DEPTHS {
        let here: Vec<f64> = profiles.iter().filter_map(|p| p[k]).collect();
        if here.len() < FEWEST {
            continue;
        }
        let middle = median_of(here.iter().copied());
        let scatter = stylet_stats::MAD_TO_SD * median_of(here.iter().map(|f| (f - middle).abs()));
        let scale = scatter.max(USUAL * middle.abs()).max(USUAL * size_n).max(f64::MIN_POSITIVE);
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
            (distance > FAR).then(|| {
                let others =
                    median_of(profiles.iter().enumerate().filter(|(j, _)| *j != i).map(|(_, p)| typical(p)).filter(|f| f.is_finite()));
                let message = format!(
                    "it is not like the others: {:.2} N at a typical depth where the others have {others:.2} N ({distance:.0} times the \
                     scatter among repeats); is it filed under the right tissue, needle and units? leave it out or put it right",
                    typical(own)
                );
                let numbers = [("distance", distance), ("typical_n", typical(own)), ("others_n", others)];
                QualityNote::new(QualityKind::OutlierRecording, message, numbers)
            })
        })
        .collect()
}

/// Where the needle comes from and how deep it goes (m).
fn way_in(r: &Recording) -> (f64, f64) {
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

/// Mean force between neighbouring depths on the way in; none where the needle does not come.
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

    /// An insertion at `speed` m/s of a tissue `gain` times as strong, with a wavering of 2 %.
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

    fn told(all: &[Recording]) -> Vec<bool> {
        find_outlier_recordings(&all.iter().collect::<Vec<_>>()).iter().map(Option::is_some).collect()
    }

    #[test]
    fn repeats_at_three_speeds_that_vary_by_a_fifth_are_like_each_other() -> Result<(), RecordError> {
        let mut all = Vec::new();
        for (k, gain) in [0.8, 0.9, 1.0, 1.1, 1.2].into_iter().enumerate() {
            for speed in [0.002, 0.004, 0.008] {
                all.push(insertion(speed, gain, k as f64)?);
            }
        }
        assert_eq!(told(&all), vec![false; 15]);
        Ok(())
    }

    #[test]
    fn one_recording_filed_wrongly_is_told_among_three_and_among_ten() -> Result<(), RecordError> {
        for others in [2, 3, 9] {
            let mut all = vec![insertion(0.004, 3.0, 0.0)?];
            for k in 0..others {
                all.push(insertion(0.004, 1.0 + 0.03 * f64::from(k % 3), f64::from(k))?);
            }
            let told = told(&all);
            assert!(told[0] && !told[1..].contains(&true), "among {others} others: {told:?}");
        }
        Ok(())
    }

    #[test]
    fn the_note_says_what_the_others_have() -> Result<(), RecordError> {
        let all = [
            insertion(0.004, 1.0, 0.0)?,
            insertion(0.004, 1.05, 1.0)?,
            insertion(0.004, 3.0, 2.0)?,
            insertion(0.004, 0.95, 3.0)?,
        ];
        let notes = find_outlier_recordings(&all.iter().collect::<Vec<_>>());
        let note = notes[2].as_ref().expect("three times as strong");
        let ratio = note.numbers["typical_n"] / note.numbers["others_n"];
        assert!(
            (2.7..3.3).contains(&ratio) && note.message.contains("not like the others"),
            "{}",
            note.message
        );
        Ok(())
    }
}
