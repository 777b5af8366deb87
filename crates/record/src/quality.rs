//! Remarks on the quality of a recording: what the reader of a result should know about its data.
//!
//! One list for every way in: `enhance`, `diagnose`, repeats and data sets ask [`assess`] and nothing else. A note is no error: the
//! recording is used as it is, nothing is corrected. But from a recording with a *grave* note ([`QualityNote::grave`]) no cause may be
//! named; [`usable`] turns it into an error that says what to do. The thresholds stand in [`QualityKind`].

mod constant_runs;
mod outlier_recordings;
mod plausibility;
pub mod sensor_artefacts;
mod timestamps;
mod unit_mismatch;
mod values;

pub use outlier_recordings::find_outlier_recordings;
pub use plausibility::MIN_SAMPLES;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::error::RecordError;
use crate::recording::Recording;
use crate::sample_stream::{Quantity, SampleStream};

/// What a [`QualityNote`] is about, most consequential first. Serialises in snake case.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum QualityKind {
    /// The force is one number in all samples: the sensor is dead. Grave. Numbers: `value`.
    Dead,
    /// The force falls while the needle goes in, by 8 times its noise and 3 times what it rises, and is negative there. Grave.
    /// Numbers: `wrong_n`, `right_n`.
    Reversed,
    /// Means over 0.1 s and more follow each other like noise: the needle touches nothing. Grave. Numbers: `low_n`, `high_n`.
    InAir,
    /// Fewer than 50 samples. Grave. Numbers: `samples`, `least`.
    TooShort,
    /// The position never moves by a micrometre (grave), or the force stands still for over 20 samples while the needle moves.
    /// Numbers: `value` and `travel_m`, or `runs`, `longest`, `at_s`, `value`.
    Stuck,
    /// Among repeats: the force over depth is over 5 robust standard deviations (root mean square over 24 depths) from the others'.
    /// Numbers: `distance`, `typical_n`, `others_n`.
    OutlierRecording,
    /// Rows were dropped because their time stamps ran backward or repeated.
    /// Numbers: `dropped`, `kept`; `lines` names them.
    RepairedRows,
    /// A quantity looks as if it came in another unit: position over more than 2 m, speed above 1 m/s (99th percentile),
    /// force beyond 500 N, a median interval above 1 s, or a measured velocity that is not the slope of the position. Grave, but for
    /// the interval (there are slow logs) and a velocity within 20 times the slope.
    /// Numbers: `value` (what was found) and `limit`.
    UnitMixUp,
    /// Intervals over five median intervals. Numbers: `count`, `largest_s`, `at_s` (start of the largest),
    /// `median_interval_s`.
    Gaps,
    /// The force stands still at its extreme: at least two runs of 5 or more equal samples there, holding most of the
    /// samples at that value, or one run of 20 or more while the needle moves by over 1 % of its range. A force of exactly zero
    /// (needle in the air, simulated) does not count. Numbers: `value`, `runs`, `samples`, `longest`, `at_s`.
    Saturation,
    /// Isolated samples (one or two) of force or position more than 8 robust standard deviations from the median of
    /// the 11 around them and from the samples on both sides; the first and last 5 samples are not judged. Numbers: `count`, `largest` (distance from the median, SI unit), `at_s`, `robust_sd`.
    Spikes,
    /// The intervals, gaps left out, scatter by more than 5 % (standard deviation over median). Numbers: `sd_s`,
    /// `shortest_s`, `longest_s`, `median_interval_s`.
    Jitter,
    /// Force or position takes few values on a grid: fewer than 20 % of the samples are distinct and the steps between the
    /// values are multiples of the smallest one. Numbers: `smallest_step` (SI unit), `distinct`, `distinct_ratio`.
    Quantisation,
    /// A recording was thinned before it was used ([`mod@crate::thin`]). Numbers: `from`, `to`, `together`.
    Downsampled,
}

/// One remark on the quality of a recording.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct QualityNote {
    /// What it is about.
    pub kind: QualityKind,
    /// The remark in plain words, with its numbers and what to do about it.
    pub message: String,
    /// The numbers by name; names carry their unit, or [`QualityKind`] tells it.
    pub numbers: BTreeMap<String, f64>,
    /// Lines of the file (1-based) that the remark is about; only for [`QualityKind::RepairedRows`].
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub lines: Vec<u64>,
    /// No cause may be named from such a recording.
    #[serde(default, skip_serializing_if = "is_false")]
    pub blocking: bool,
}

fn is_false(b: &bool) -> bool {
    !b
}

impl QualityNote {
    /// A remark that forbids conclusions.
    fn blocking_note<const N: usize>(kind: QualityKind, message: String, numbers: [(&str, f64); N]) -> Self {
        Self { blocking: true, ..Self::new(kind, message, numbers) }
    }

    pub(crate) fn new<const N: usize>(kind: QualityKind, message: String, numbers: [(&str, f64); N]) -> Self {
        let numbers = numbers.into_iter().map(|(name, value)| (name.to_owned(), value)).collect();
        Self { kind, message, numbers, lines: Vec::new(), blocking: false }
    }
}

/// Looks a recording over; the notes are sorted by kind, then by message. No note: nothing was noticed.
///
/// Expects what [`Recording::check`] promises; takes `O(n log n)`.
pub fn assess(recording: &Recording) -> Vec<QualityNote> {
    let Ok(notes) = assess_stream(recording);
    notes
}

/// What several checks ask for.
struct Extent {
    force_n: (f64, f64),
    position_m: (f64, f64),
    median_interval_s: f64,
}

/// [`assess`] wherever the samples are.
///
/// # Errors
/// When the samples cannot be gone through.
pub(crate) fn assess_stream<A: SampleStream>(recording: &A) -> Result<Vec<QualityNote>, A::Error> {
    let mut notes: Vec<QualityNote> = plausibility::too_short(recording.len()).into_iter().collect();
    if recording.len() < 2 {
        return Ok(notes);
    }
    if let Some(note) = plausibility::implausible_value(recording)? {
        // Nothing else can be computed from it.
        notes.push(note);
        return Ok(notes);
    }
    let facts = Extent {
        force_n: recording.extremes(Quantity::Force)?,
        position_m: recording.extremes(Quantity::Position)?,
        median_interval_s: recording.median_interval_s()?,
    };
    notes.extend(unit_mismatch::unit_mix_ups(recording, &facts)?);
    let dead = plausibility::dead_sensor(recording.len(), &facts);
    if dead.is_none() && notes.is_empty() {
        notes.extend(plausibility::reversed_force(recording)?);
        notes.extend(plausibility::only_in_air(recording, &facts)?);
    }
    notes.extend(dead);
    notes.extend(plausibility::no_motion(&facts));
    notes.extend(timestamps::gaps(recording, &facts)?);
    notes.extend(timestamps::jitter(recording, &facts)?);
    notes.extend(values::saturation(recording, &facts)?);
    for (what, unit, which) in [("force_n", "N", Quantity::Force), ("position_m", "m", Quantity::Position)] {
        notes.extend(values::spikes(recording, what, unit, which)?);
        let sorted = recording.sorted_values(|keep| recording.for_each_value(which, keep))?;
        notes.extend(values::quantisation(&sorted, what, unit)?);
        if which == Quantity::Force {
            notes.extend(plausibility::stuck_force(recording, &sorted, &facts)?);
        }
    }
    notes.sort_by(|a, b| a.kind.cmp(&b.kind).then_with(|| a.message.cmp(&b.message)));
    Ok(notes)
}

/// Whether conclusions may be drawn from recordings.
///
/// # Errors
/// [`RecordError::Unusable`] with every recording that has a grave note, what is wrong with it and what to do.
pub fn check_usable<'a>(
    recordings: impl IntoIterator<Item = (&'a str, &'a [QualityNote])>,
) -> Result<(), RecordError> {
    let (mut of, mut wrong) = (0, Vec::new());
    for (name, notes) in recordings {
        of += 1;
        if let Some(note) = notes.iter().find(|note| note.blocking) {
            wrong.push(format!("{name}: {}", note.message));
        }
    }
    if wrong.is_empty() { Ok(()) } else { Err(RecordError::Unusable { of, wrong }) }
}

/// The note on rows that were dropped; `lines` in the order of the file.
pub(crate) fn repaired_rows(lines: Vec<u64>, kept: usize) -> QualityNote {
    const NAMED: usize = 12;
    let mut named = lines.iter().take(NAMED).map(u64::to_string).collect::<Vec<_>>().join(", ");
    if lines.len() > NAMED {
        named.push_str(&format!(" and {} more", lines.len() - NAMED));
    }
    let message = format!(
        "{} row(s) dropped because their time stamps run backward or repeat, {kept} kept: line(s) {named}",
        lines.len()
    );
    let numbers = [("dropped", lines.len() as f64), ("kept", kept as f64)];
    QualityNote { lines, ..QualityNote::new(QualityKind::RepairedRows, message, numbers) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn notes_serialise_with_kinds_in_snake_case() -> Result<(), serde_json::Error> {
        let note = repaired_rows(vec![4, 9], 100);
        let text = serde_json::to_string(&note)?;
        assert!(text.contains(r#""kind":"repaired_rows""#) && text.contains(r#""lines":[4,9]"#), "{text}");
        assert_eq!(serde_json::from_str::<QualityNote>(&text)?, note);
        assert!(note.message.contains("line(s) 4, 9"), "{}", note.message);
        Ok(())
    }

    #[test]
    fn notes_come_in_the_order_of_their_weight() -> Result<(), crate::RecordError> {
        // In millimetres, with a gap, irregular.
        let time_s: Vec<f64> = (0..400)
            .map(|i| 0.01 * (f64::from(i) + 0.3 * f64::from(i % 3)) + if i > 200 { 1.0 } else { 0.0 })
            .collect();
        let position_m: Vec<f64> = time_s.iter().map(|t| 2.3 * t).collect();
        let force_n = time_s.iter().map(|t| t * 0.1).collect();
        let kinds: Vec<QualityKind> =
            assess(&Recording::new(time_s, position_m, force_n)?).iter().map(|note| note.kind).collect();
        use QualityKind::{Gaps, Jitter, UnitMixUp};
        assert_eq!(kinds, [UnitMixUp, UnitMixUp, Gaps, Jitter]);
        Ok(())
    }
}
