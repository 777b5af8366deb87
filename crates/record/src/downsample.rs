//! Downsampling of recordings that are too long for a diagnosis, by averaging.

use crate::quality::{QualityKind, QualityNote};
use crate::recording::Recording;
use crate::time_order::GAP_INTERVALS;

/// Most samples of a diagnosis: eight minutes at 200 Hz.
pub const MAX_SAMPLES: usize = 100_000;
/// Block length of a diagnosis in seconds.
const BLOCK_S: f64 = 0.02;
/// Most blocks of a diagnosis, for a computing time of minutes.
const MAX_BLOCKS: f64 = 20_000.0;

/// The recording with consecutive samples averaged (time, position, velocity and force), and a note on it; `None` when it is
/// short enough. Averaging reduces noise; changes within the new interval are lost.
#[must_use]
pub fn downsample(recording: &Recording) -> Option<(Recording, QualityNote)> {
    let n = recording.len();
    if n < 2 {
        return None;
    }
    let step_s = recording.median_interval_s();
    let blocks = n as f64 * (step_s / BLOCK_S).min(1.0);
    // Further samples per block add little computing time.
    let left = if blocks > MAX_BLOCKS { MAX_BLOCKS } else { MAX_SAMPLES as f64 };
    let together = (n as f64 / left).ceil() as usize;
    if together < 2 {
        return None;
    }
    let mut out = Recording { velocity_measured: recording.velocity_measured, ..Recording::default() };
    let mut start = 0;
    while start < n {
        // Samples on both sides of a gap are not averaged.
        let mut end = start + 1;
        while end < n
            && end - start < together
            && recording.time_s[end] - recording.time_s[end - 1] <= GAP_INTERVALS * step_s
        {
            end += 1;
        }
        let mean =
            |x: &[f64]| x.get(start..end).map_or(0.0, |x| x.iter().sum::<f64>() / x.len().max(1) as f64);
        out.time_s.push(mean(&recording.time_s));
        out.position_m.push(mean(&recording.position_m));
        out.velocity_mps.push(mean(&recording.velocity_mps));
        out.force_n.push(mean(&recording.force_n));
        start = end;
    }
    let message = format!(
        "{n} samples are too many for a diagnosis: each {together} were averaged to one, {} remain, {:.4} s apart; faster changes are \
         lost: cut the recording to the insertion to keep them",
        out.len(),
        together as f64 * step_s
    );
    let numbers = [("from", n as f64), ("to", out.len() as f64), ("together", together as f64)];
    Some((out, QualityNote::new(QualityKind::Downsampled, message, numbers)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::RecordError;

    fn recorded(n: u32, hz: f64) -> Result<Recording, RecordError> {
        let time_s: Vec<f64> = (0..n).map(|i| f64::from(i) / hz).collect();
        let position_m = time_s.iter().map(|t| 1e-5 * t).collect();
        let force_n = time_s.iter().map(|t| 0.01 * t).collect();
        Recording::with_velocity(time_s.clone(), position_m, vec![1e-5; n as usize], force_n)
    }

    #[test]
    fn a_minute_is_unchanged_at_any_rate_and_hours_become_a_few_ten_thousand_samples()
    -> Result<(), RecordError> {
        for hz in [50.0, 200.0, 1000.0] {
            assert!(downsample(&recorded((60.0 * hz) as u32, hz)?).is_none(), "{hz} Hz");
        }
        for (n, hz) in [(2_000_000, 200.0), (400_000, 20.0), (500_000, 10_000.0)] {
            let (downsampled, note) = downsample(&recorded(n, hz)?).expect("too long");
            assert!(
                downsampled.check().is_ok() && downsampled.len() <= MAX_SAMPLES,
                "{} at {hz} Hz",
                downsampled.len()
            );
            let blocks = downsampled.duration_s() / downsampled.median_interval_s().max(BLOCK_S);
            assert!(blocks <= 1.01 * MAX_BLOCKS, "{blocks} blocks at {hz} Hz");
            assert!(note.message.contains(&format!("{n} samples")), "{}", note.message);
        }
        Ok(())
    }

    #[test]
    fn the_mean_force_and_gaps_are_preserved() -> Result<(), RecordError> {
        let mut recording = recorded(300_000, 1000.0)?;
        recording.time_s[150_000..].iter_mut().for_each(|t| *t += 60.0);
        let (downsampled, _) = downsample(&recording).expect("too long");
        let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len() as f64;
        assert!((mean(&downsampled.force_n) / mean(&recording.force_n) - 1.0).abs() < 1e-3);
        let widest = downsampled.time_s.windows(2).map(|p| p[1] - p[0]).fold(0.0, f64::max);
        assert!((59.9..60.1).contains(&widest), "{widest} s");
        Ok(())
    }
}
