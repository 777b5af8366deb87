//! Reader of recordings: text tables and files of other programs, or an error with file, line, column and remedy.

use std::path::Path;

use crate::assemble::assemble;
use crate::error::RecordError;
use crate::inspect::{InspectOptions, inspect_bytes};
use crate::quality::{QualityNote, assess};
use crate::recording::Recording;
use crate::table_source::{ReadOptions, Select, read_bytes, with_table};

/// Reads a recording from a file.
///
/// Text tables in UTF-8, UTF-16 or a Windows code page, separated by comma, semicolon, tab, `|` or blanks; with or without
/// preamble, line of names and row of units; decimal comma and thousands where they are unmistakable; comments from `#` or
/// `%`. The columns are `time_s`, `position_m`, `force_n`, optionally `velocity_mps`, `force_virtual_n` and
/// `joint_torque_1_nm` to `joint_torque_7_nm` (all or none), or those of the column map, or those whose names and units are
/// unmistakable. Other columns are ignored. Rows without a value are holes, which a note reports. Without a velocity column the
/// position is differentiated ([`mod@crate::differentiate`]). Other formats are recognised by their first bytes
/// ([`mod@crate::file_formats`]).
///
/// The notes are those of [`assess`], preceded by what was repaired, left out or converted.
///
/// # Errors
/// Every variant of [`RecordError`] with a `path`, and those of the column map. The error names every obstacle that
/// [`inspect`](crate::inspect::inspect) finds, and that command.
pub fn read_csv(
    path: impl AsRef<Path>,
    options: &ReadOptions,
) -> Result<(Recording, Vec<QualityNote>), RecordError> {
    let path = path.as_ref();
    let bytes = read_bytes(path)?;
    read_csv_bytes(&bytes, path, options).map_err(|error| {
        let inspection = || inspect_bytes(&bytes, path, &InspectOptions { columns: options.columns.clone() });
        error.with_obstacles(inspection, path)
    })
}

/// Reads a recording from the bytes of a file. `path` appears in messages, and other files that a column map names are searched
/// in its folder.
///
/// # Errors
/// As [`read_csv`]; only the first obstacle.
pub fn read_csv_bytes(
    bytes: &[u8],
    path: &Path,
    options: &ReadOptions,
) -> Result<(Recording, Vec<QualityNote>), RecordError> {
    if let Some(map) = &options.columns {
        map.check()?;
    }
    let (recording, mut notes) =
        with_table(bytes, path, options.columns.as_ref(), Select::Recording, |file, table| {
            assemble(file, table, options)
        })?;
    notes.extend(assess(&recording));
    Ok((recording, notes))
}
