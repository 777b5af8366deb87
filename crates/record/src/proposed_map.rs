//! Check of a proposed column map: the file is read with it.

use std::path::Path;

use crate::csv_reader::read_csv;
use crate::error::RecordError;
use crate::inspect::{Finding, InspectOptions, Inspection, Role};
use crate::quality::{QualityKind, QualityNote, assess};
use crate::recording::Recording;
use crate::table_source::ReadOptions;

/// Largest file that is read as a whole for the check.
const MAX_BYTES: u64 = 32 << 20;

/// [`inspect`](crate::inspect::inspect), and then the recording is read as a command would read it: with the map of `options`, or the proposed
/// one if the file needs one. What the quality checks refuse becomes an obstacle. Where position or force run the other way, the proposed
/// map reverses their signs. Files above 32 MB are not read.
///
/// # Errors
/// As [`inspect`](crate::inspect::inspect).
pub fn inspect_and_read(path: impl AsRef<Path>, options: &InspectOptions) -> Result<Inspection, RecordError> {
    let path = path.as_ref();
    let mut inspection = crate::inspect::inspect(path, options)?;
    if inspection.bytes > MAX_BYTES {
        return Ok(inspection);
    }
    let columns = match inspection.map_needed {
        true => Some(inspection.map.clone()),
        false => options.columns.clone(),
    };
    // What cannot be read is an obstacle already, or needs a repair.
    let Ok((recording, notes)) = read_csv(path, &ReadOptions { columns, repair: false }) else {
        return Ok(inspection);
    };
    let refused: Vec<QualityNote> = notes.into_iter().filter(|note| note.blocking).collect();
    for (role, sign) in [Role::Position, Role::Force].into_iter().zip(reversed(&recording, &refused)) {
        if sign {
            inspection.reverse(role);
        }
    }
    let obstacle =
        |note: QualityNote| Finding { kind: "quality", message: note.message, line: None, obstacle: true };
    inspection.findings.splice(0..0, refused.into_iter().map(obstacle));
    Ok(inspection)
}

/// Whether position and force must be reversed for the recording to be accepted.
fn reversed(recording: &Recording, refused: &[QualityNote]) -> [bool; 2] {
    let trials: &[[bool; 2]] = match refused {
        [note] => match note.kind {
            QualityKind::Reversed => &[[false, true]],
            QualityKind::ReversedPosition => &[[true, false], [true, true]],
            // A retraction with both signs reversed would look like an insertion.
            QualityKind::OnlyRetraction => &[[true, false]],
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
