//! Gaps and jitter of the time stamps.

use super::{QualityKind, QualityNote};
use crate::recording::Recording;
use stylet_stats::extremes;

/// An interval over so many median intervals is a gap.
const GAP_INTERVALS: f64 = 5.0;
/// Scatter of the intervals (standard deviation over median) from which it is worth a note.
const JITTER: f64 = 0.05;

pub(super) fn gaps(recording: &Recording) -> Option<QualityNote> {
    let median_s = recording.median_interval_s();
    let starts = recording.time_s.windows(2).filter(|pair| pair[1] - pair[0] > GAP_INTERVALS * median_s);
    let (mut count, mut largest_s, mut at_s) = (0_u32, 0.0, 0.0);
    for pair in starts {
        count += 1;
        if pair[1] - pair[0] > largest_s {
            (largest_s, at_s) = (pair[1] - pair[0], pair[0]);
        }
    }
    (count > 0).then(|| {
        let message = format!(
            "{count} gap(s) of over five sampling intervals, the largest of {largest_s:.4} s after t = {at_s:.4} s \
             (typical interval {median_s:.6} s); ruptures inside a gap cannot be seen"
        );
        let numbers = [
            ("count", f64::from(count)),
            ("largest_s", largest_s),
            ("at_s", at_s),
            ("median_interval_s", median_s),
        ];
        QualityNote::new(QualityKind::Gaps, message, numbers)
    })
}

pub(super) fn jitter(recording: &Recording) -> Option<QualityNote> {
    let median_s = recording.median_interval_s();
    let intervals: Vec<f64> = recording
        .time_s
        .windows(2)
        .map(|pair| pair[1] - pair[0])
        .filter(|interval| *interval <= GAP_INTERVALS * median_s)
        .collect();
    let count = intervals.len() as f64;
    let mean_s = intervals.iter().sum::<f64>() / count;
    let sd_s = (intervals.iter().map(|interval| (interval - mean_s).powi(2)).sum::<f64>() / count).sqrt();
    let (shortest_s, longest_s) = extremes(&intervals);
    (sd_s > JITTER * median_s).then(|| {
        let message = format!(
            "the sampling is irregular: intervals scatter by {:.1} % ({shortest_s:.6} s to {longest_s:.6} s, typically \
             {median_s:.6} s); filters tuned for a fixed rate see a wandering one",
            100.0 * sd_s / median_s
        );
        let numbers = [
            ("sd_s", sd_s),
            ("shortest_s", shortest_s),
            ("longest_s", longest_s),
            ("median_interval_s", median_s),
        ];
        QualityNote::new(QualityKind::Jitter, message, numbers)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::RecordError;

    fn sampled_at(time_s: Vec<f64>) -> Result<Recording, RecordError> {
        let still = vec![0.0; time_s.len()];
        Recording::new(time_s, still.clone(), still)
    }

    #[test]
    fn an_even_sampling_has_neither_gaps_nor_jitter() -> Result<(), RecordError> {
        let recording = sampled_at((0..1000).map(|i| f64::from(i) * 0.005).collect())?;
        assert_eq!((gaps(&recording), jitter(&recording)), (None, None));
        Ok(())
    }

    #[test]
    fn the_largest_of_two_gaps_is_named_with_its_place() -> Result<(), RecordError> {
        let late = |i: u32| if i > 60 { 0.4 } else { 0.0 } + if i > 30 { 0.1 } else { 0.0 };
        let recording = sampled_at((0..100).map(|i| f64::from(i) * 0.01 + late(i)).collect())?;
        let note = gaps(&recording).expect("two gaps");
        assert_eq!(note.numbers["count"], 2.0);
        assert!(
            (note.numbers["largest_s"] - 0.41).abs() < 1e-9 && (note.numbers["at_s"] - 0.70).abs() < 1e-9
        );
        assert!(note.message.contains("2 gap(s)"), "{}", note.message);
        assert_eq!(jitter(&recording), None, "gaps are not jitter");
        Ok(())
    }

    #[test]
    fn scattered_intervals_are_noted_from_five_percent() -> Result<(), RecordError> {
        let scattered =
            |share: f64| (0..300).map(|i| 0.01 * (f64::from(i) + share * f64::from(i % 2))).collect();
        // Alternating intervals 0.01 (1 +- share): the standard deviation is the share, over a median of 1 - share or more.
        assert_eq!(jitter(&sampled_at(scattered(0.03))?), None);
        let note = jitter(&sampled_at(scattered(0.2))?).expect("20 %");
        assert!((note.numbers["sd_s"] - 0.002).abs() < 1e-4, "{}", note.message);
        Ok(())
    }
}
