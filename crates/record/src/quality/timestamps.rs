//! Gaps and jitter of the time stamps.

use super::extent::Extent;
use super::note::{QualityKind, QualityNote};
use crate::sample_stream::{Quantity, SampleStream};
use crate::time_order::GAP_INTERVALS;

/// Least scatter of the intervals (standard deviation over median) for a note.
const MIN_JITTER: f64 = 0.05;

pub(super) fn gaps<A: SampleStream>(recording: &A, extent: &Extent) -> Result<Option<QualityNote>, A::Error> {
    let median_s = extent.median_interval_s;
    let (mut count, mut largest_s, mut at_s) = (0_u32, 0.0, 0.0);
    recording.for_each_pair(Quantity::Time, |before, now| {
        if now - before > GAP_INTERVALS * median_s {
            count += 1;
            if now - before > largest_s {
                (largest_s, at_s) = (now - before, before);
            }
        }
    })?;
    Ok((count > 0).then(|| {
        let message = format!(
            "{count} gap(s) of over five sampling intervals, the largest of {largest_s:.4} s after t = {at_s:.4} s \
             (typical interval {median_s:.6} s); ruptures inside a gap are not recorded"
        );
        let numbers = [
            ("count", f64::from(count)),
            ("largest_s", largest_s),
            ("at_s", at_s),
            ("median_interval_s", median_s),
        ];
        QualityNote::new(QualityKind::Gaps, message, numbers)
    }))
}

pub(super) fn jitter<A: SampleStream>(
    recording: &A,
    extent: &Extent,
) -> Result<Option<QualityNote>, A::Error> {
    let median_s = extent.median_interval_s;
    let intervals = |each: &mut dyn FnMut(f64)| {
        recording.for_each_pair(Quantity::Time, |before, now| {
            let interval = now - before;
            if interval <= GAP_INTERVALS * median_s {
                each(interval);
            }
        })
    };
    let (mut count, mut sum, mut shortest_s, mut longest_s) = (0_usize, 0.0, f64::NAN, f64::NAN);
    intervals(&mut |interval| {
        count += 1;
        sum += interval;
        (shortest_s, longest_s) = (interval.min(shortest_s), interval.max(longest_s));
    })?;
    let (count, mut squares) = (count as f64, 0.0);
    let mean_s = sum / count;
    intervals(&mut |interval| squares += (interval - mean_s).powi(2))?;
    let sd_s = (squares / count).sqrt();
    Ok((sd_s > MIN_JITTER * median_s).then(|| {
        let message = format!(
            "the sampling is irregular: intervals scatter by {:.1} % ({shortest_s:.6} s to {longest_s:.6} s, typically \
             {median_s:.6} s); filters for a fixed rate are inaccurate",
            100.0 * sd_s / median_s
        );
        let numbers = [
            ("sd_s", sd_s),
            ("shortest_s", shortest_s),
            ("longest_s", longest_s),
            ("median_interval_s", median_s),
        ];
        QualityNote::new(QualityKind::Jitter, message, numbers)
    }))
}

#[cfg(test)]
mod tests {
    use super::super::assess;
    use super::*;
    use crate::error::RecordError;
    use crate::recording::Recording;

    fn timing(recording: &Recording) -> (Option<QualityNote>, Option<QualityNote>) {
        let find = |kind| assess(recording).into_iter().find(|note| note.kind == kind);
        (find(QualityKind::Gaps), find(QualityKind::Jitter))
    }

    fn sampled_at(time_s: Vec<f64>) -> Result<Recording, RecordError> {
        let still = vec![0.0; time_s.len()];
        Recording::new(time_s, still.clone(), still)
    }

    #[test]
    fn an_even_sampling_has_neither_gaps_nor_jitter() -> Result<(), RecordError> {
        let recording = sampled_at((0..1000).map(|i| f64::from(i) * 0.005).collect())?;
        assert_eq!(timing(&recording), (None, None));
        Ok(())
    }

    #[test]
    fn the_largest_of_two_gaps_is_reported_with_its_time() -> Result<(), RecordError> {
        let late = |i: u32| if i > 60 { 0.4 } else { 0.0 } + if i > 30 { 0.1 } else { 0.0 };
        let recording = sampled_at((0..100).map(|i| f64::from(i) * 0.01 + late(i)).collect())?;
        let note = timing(&recording).0.expect("two gaps");
        assert_eq!(note.numbers["count"], 2.0);
        assert!(
            (note.numbers["largest_s"] - 0.41).abs() < 1e-9 && (note.numbers["at_s"] - 0.70).abs() < 1e-9
        );
        assert!(note.message.contains("2 gap(s)"), "{}", note.message);
        assert_eq!(timing(&recording).1, None, "gaps are not jitter");
        Ok(())
    }

    #[test]
    fn irregular_intervals_are_reported_from_five_percent() -> Result<(), RecordError> {
        let scattered =
            |share: f64| (0..300).map(|i| 0.01 * (f64::from(i) + share * f64::from(i % 2))).collect();
        // Alternating intervals 0.01 (1 +- share): the standard deviation is the share, over a median of 1 - share or more.
        assert_eq!(timing(&sampled_at(scattered(0.03))?).1, None);
        let note = timing(&sampled_at(scattered(0.2))?).1.expect("20 %");
        assert!((note.numbers["sd_s"] - 0.002).abs() < 1e-4, "{}", note.message);
        Ok(())
    }
}
