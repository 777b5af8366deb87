//! Data quality of a recording.
//!
//! [`assess`] runs all checks for `enhance`, `diagnose`, repeats and data sets. A note is not an error, and nothing is
//! corrected; but [`check_usable`] rejects recordings with a *blocking* note ([`QualityNote::blocking`]), with the remedy.
//! Each kind of note is described at [`QualityKind`]; its thresholds are constants of the module of the check.

mod constant_runs;
mod copies;
mod direction;
mod extent;
mod note;
mod outlier_recordings;
mod plausibility;
mod quantisation;
mod saturation;
pub mod sensor_artefacts;
mod spikes;
mod timestamps;
mod unit_mismatch;

pub use copies::check_distinct;
pub(crate) use note::repaired_rows;
pub use note::{QualityKind, QualityNote};
pub use outlier_recordings::find_outlier_recordings;
pub use plausibility::MIN_SAMPLES;

use crate::error::RecordError;
use crate::recording::Recording;
use crate::sample_stream::{Quantity, SampleStream};
use extent::Extent;

/// All quality notes of a recording, sorted by kind, then by message.
///
/// Expects a recording that passes [`Recording::check`]; takes `O(n log n)`.
pub fn assess(recording: &Recording) -> Vec<QualityNote> {
    let Ok(notes) = assess_stream(recording);
    notes
}

/// [`assess`] for samples in memory or on disk.
///
/// # Errors
/// When the samples cannot be read.
pub(crate) fn assess_stream<A: SampleStream>(recording: &A) -> Result<Vec<QualityNote>, A::Error> {
    let mut notes: Vec<QualityNote> = plausibility::too_short(recording.len()).into_iter().collect();
    if recording.len() < 2 {
        return Ok(notes);
    }
    if let Some(note) = plausibility::implausible_value(recording)? {
        // Other checks would overflow.
        notes.push(note);
        return Ok(notes);
    }
    let extent = Extent {
        force_n: recording.extremes(Quantity::Force)?,
        position_m: recording.extremes(Quantity::Position)?,
        median_interval_s: recording.median_interval_s()?,
    };
    notes.extend(unit_mismatch::unit_mix_ups(recording, &extent)?);
    let dead = plausibility::dead_sensor(recording.len(), &extent);
    if dead.is_none() && notes.is_empty() {
        notes.extend(plausibility::reversed_force(recording)?);
        notes.extend(plausibility::only_in_air_note(recording, &extent)?);
        if notes.is_empty() && plausibility::no_motion(&extent).is_none() {
            notes.extend(direction::no_insertion_note(recording, &extent)?);
        }
    }
    notes.extend(dead);
    notes.extend(plausibility::no_motion(&extent));
    notes.extend(timestamps::gaps(recording, &extent)?);
    notes.extend(timestamps::jitter(recording, &extent)?);
    notes.extend(saturation::saturation(recording, &extent)?);
    for (what, unit, which) in [("force_n", "N", Quantity::Force), ("position_m", "m", Quantity::Position)] {
        notes.extend(spikes::spikes(recording, what, unit, which)?);
        let sorted = recording.sorted_values(|keep| recording.for_each_value(which, keep))?;
        notes.extend(quantisation::quantisation(&sorted, what, unit)?);
        if which == Quantity::Force {
            notes.extend(plausibility::stuck_force(recording, &sorted, &extent)?);
        }
    }
    notes.sort_by(|a, b| a.kind.cmp(&b.kind).then_with(|| a.message.cmp(&b.message)));
    Ok(notes)
}

/// Rejects recordings with a blocking note.
///
/// # Errors
/// [`RecordError::Unusable`] with every such recording, its message and remedy.
pub fn check_usable<'a>(
    recordings: impl IntoIterator<Item = (&'a str, &'a [QualityNote])>,
) -> Result<(), RecordError> {
    let (mut of, mut wrong, mut refused) = (0, 0, Vec::new());
    for (name, notes) in recordings {
        of += 1;
        refused.extend(
            notes.iter().filter(|note| note.blocking).map(|note| format!("{name}: {}", note.message)),
        );
        wrong += usize::from(notes.iter().any(|note| note.blocking));
    }
    if refused.is_empty() {
        Ok(())
    } else {
        Err(RecordError::Unusable { of, recordings: wrong, wrong: refused })
    }
}

#[cfg(test)]
mod tests;
