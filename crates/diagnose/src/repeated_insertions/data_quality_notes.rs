//! Data-quality notes of repeated recordings.

use super::segmented_recording::{SegmentedRecording, mean_speeds};
use crate::diagnosis_json::DataQualityNote;
use stylet_record::{DEFAULT_HALF_WIDTH_S, QualityKind, QualityNote, Recording};

/// Data-quality notes: one per speed for what its recordings share, then those of each recording.
pub fn data_quality(recordings: &[&SegmentedRecording]) -> Vec<DataQualityNote> {
    let mut out = Vec::new();
    let mean = |values: &mut dyn Iterator<Item = f64>| stylet_stats::mean(&values.collect::<Vec<_>>());
    for (v, members) in mean_speeds(recordings) {
        let some: Vec<&SegmentedRecording> = members.iter().map(|i| recordings[*i]).collect();
        let rate = mean(&mut some.iter().map(|r| (r.recording.len() - 1) as f64 / r.recording.duration_s()));
        let gap =
            |r: &&SegmentedRecording| r.recording.time_s.windows(2).map(|p| p[1] - p[0]).fold(0.0, f64::max);
        let end = mean(&mut some.iter().map(|r| {
            let z = &r.recording.position_m;
            z[r.phases.deepest..].iter().copied().fold(f64::NEG_INFINITY, f64::max) - z[0]
        }));
        let largest = some.iter().map(gap).fold(0.0, f64::max);
        let message = format!(
            "{} recording(s) at {:.2} mm/s: mean sampling rate {rate:.1} Hz, largest gap {:.0} ms, stroke {:.1} mm",
            members.len(),
            1e3 * v,
            1e3 * largest,
            1e3 * end
        );
        let numbers = [("speed_mps", v), ("sample_hz", rate), ("largest_gap_s", largest), ("stroke_m", end)];
        out.push(DataQualityNote {
            recording: format!("all at {:.2} mm/s", 1e3 * v),
            note: QualityNote::new(QualityKind::Jitter, message, numbers),
        });
    }
    for run in recordings {
        let quality = |note: QualityNote| DataQualityNote { recording: run.name.clone(), note };
        out.extend(run.notes.iter().cloned().map(quality));
        out.push(quality(QualityNote::new(QualityKind::Jitter, sampling_summary(&run.recording), [])));
    }
    out
}

/// Sampling and stroke of a recording in words, for the data-quality section.
pub fn sampling_summary(recording: &Recording) -> String {
    let n = recording.len();
    let mean_hz = (n - 1) as f64 / recording.duration_s();
    let largest = recording.time_s.windows(2).map(|p| p[1] - p[0]).fold(0.0, f64::max);
    let deepest = recording.position_m.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let first = recording.position_m[0];
    format!(
        "{n} samples at their own time stamps: mean rate {mean_hz:.1} Hz (median interval {:.2} ms), largest gap {:.1} ms; stroke {:.1} mm; \
         velocity is the slope of the position within {:.0} ms",
        1e3 * recording.median_interval_s(),
        1e3 * largest,
        1e3 * (deepest - first),
        1e3 * DEFAULT_HALF_WIDTH_S
    )
}

#[cfg(test)]
mod tests {
    use super::sampling_summary;
    use stylet_record::Recording;

    #[test]
    fn the_sampling_summary_states_rate_gap_and_stroke() {
        let t = vec![0.0, 0.01, 0.02, 0.035, 0.05];
        let z = vec![0.002, 0.003, 0.0075, 0.006, 0.005];
        let text = sampling_summary(&Recording::new(t, z, vec![0.0; 5]).expect("clean columns"));
        for part in ["5 samples", "80.0 Hz", "largest gap 15.0 ms", "stroke 5.5 mm"] {
            assert!(text.contains(part), "{part}: {text}");
        }
    }
}
