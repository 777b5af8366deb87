//! Check of a proposed column map: the file is read with it.

use std::path::Path;

use crate::column_map::ColumnMap;
use crate::csv_reader::read_csv;
use crate::error::RecordError;
use crate::inspect::{Finding, InspectOptions, Inspection, Role};
use crate::quality::{QualityKind, QualityNote, assess};
use crate::recording::Recording;
use crate::table_source::ReadOptions;

/// Largest file that is read as a whole for the check.
const MAX_BYTES: u64 = 32 << 20;
/// Largest force at the start, as a share of its range, of a recording that begins in air.
const MAX_START_SHARE: f64 = 0.2;
/// Samples of the start.
const START_SAMPLES: usize = 20;

/// [`inspect`](crate::inspect::inspect), and then the recording is read as a command would read it: with the map of `options`, or the proposed
/// one if the file needs one. What the reader or the quality checks refuse becomes an obstacle. Where position or force have the opposite sign, the proposed
/// map reverses their signs. Files above 32 MB are not read; a remark says so.
///
/// # Errors
/// As [`inspect`](crate::inspect::inspect).
pub fn inspect_and_read(path: impl AsRef<Path>, options: &InspectOptions) -> Result<Inspection, RecordError> {
    let path = path.as_ref();
    let mut inspection = crate::inspect::inspect(path, options)?;
    if inspection.bytes > MAX_BYTES {
        let message = "the file is larger than 32 MB: what a command checks of its samples (signs, units, pauses) was not checked";
        inspection.findings.push(Finding {
            kind: "large_file",
            message: message.to_owned(),
            line: None,
            obstacle: false,
        });
        return Ok(inspection);
    }
    let columns = match inspection.map_needed {
        true => Some(inspection.map.clone()),
        false => options.columns.clone(),
    };
    let obstacle = |message: String| Finding { kind: "quality", message, line: None, obstacle: true };
    let read = |columns: Option<ColumnMap>| read_csv(path, &ReadOptions { columns, repair: false });
    let blocking =
        |notes: Vec<QualityNote>| notes.into_iter().filter(|note| note.blocking).collect::<Vec<_>>();
    let (recording, refused) = match read(columns.clone()) {
        Ok((recording, notes)) => (recording, blocking(notes)),
        Err(error) => {
            if inspection.is_readable() {
                inspection.findings.insert(0, obstacle(error.to_string()));
            }
            return Ok(inspection);
        }
    };
    if refused.is_empty() {
        return Ok(inspection);
    }
    let is_accepted =
        |map: &ColumnMap| read(Some(map.clone())).is_ok_and(|(_, notes)| blocking(notes).is_empty());
    if columns.is_none() && is_accepted(&inspection.map) {
        // The map has another unit than the file states.
        inspection.map_needed = true;
    } else {
        let signs = reversed(&recording, &refused);
        let mut other = inspection.clone();
        for (role, sign) in [Role::Position, Role::Force].into_iter().zip(signs) {
            if sign {
                other.reverse(role, columns.is_none().then(|| inspection.stated_scale(role)));
            }
        }
        if signs.contains(&true) && is_accepted(&other.map) {
            inspection = other;
        }
    }
    inspection.findings.splice(0..0, refused.into_iter().map(|note| obstacle(note.message)));
    Ok(inspection)
}

/// Whether the force begins at zero. That of a retraction from inside the tissue does not.
fn begins_unloaded(recording: &Recording) -> bool {
    let force = &recording.force_n;
    let low = force.iter().copied().fold(0.0, f64::min);
    let high = force.iter().copied().fold(0.0, f64::max);
    let start = stylet_stats::mean(&force[..force.len().min(START_SAMPLES)]);
    start.abs() <= MAX_START_SHARE * (high - low)
}

/// Whether position and force must be reversed for the recording to be accepted.
fn reversed(recording: &Recording, refused: &[QualityNote]) -> [bool; 2] {
    let trials: &[[bool; 2]] = match refused {
        [note] => match note.kind {
            QualityKind::Reversed => &[[false, true]],
            QualityKind::ReversedPosition => &[[true, false], [true, true]],
            // A retraction with both signs reversed would look like an insertion.
            QualityKind::OnlyRetraction if begins_unloaded(recording) => &[[true, false]],
            _ => &[],
        },
        _ => &[],
    };
    let is_accepted = |[position, force]: &&[bool; 2]| {
        let mut trial = recording.clone();
        let reverse = |values: &mut [f64]| values.iter_mut().for_each(|x| *x = -*x);
        if *position {
            reverse(&mut trial.position_m);
            reverse(&mut trial.velocity_mps);
        }
        if *force {
            reverse(&mut trial.force_n);
        }
        assess(&trial).iter().all(|note| !note.blocking)
    };
    trials.iter().find(is_accepted).copied().unwrap_or_default()
}
