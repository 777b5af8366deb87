//! Reader of recordings: text tables and files of other programs, or an error with file, line, column and remedy.

use std::borrow::Cow;
use std::path::Path;

use encoding_rs::{Encoding, UTF_8};

use crate::assemble::{RawTable, assemble};
use crate::column_map::{Column, ColumnMap};
use crate::columns::{ColumnRole, MappedColumns, map_columns, map_series};
use crate::error::RecordError;
use crate::file_formats::{FileFormat, Foreign};
use crate::inspect::{InspectOptions, inspect_bytes};
use crate::memory_limit::{self, read_limited};
use crate::quality::{QualityNote, assess};
use crate::recording::Recording;
use crate::text::encoding;
use crate::text::find::find_table;
use crate::text::layout::{ColumnKind, TextLayout};
use crate::text::rows::{Tolerance, WantedField, read_rows};
use crate::text::source::{SourceFile, TextSource, header_start};

/// How to read a recording.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ReadOptions {
    /// Names and units of another program's log; `None`: Stylet's names, or names and units that are unmistakable.
    pub columns: Option<ColumnMap>,
    /// Repair time stamps that run backward or repeat, with a [`QualityNote`], instead of refusing them: equal stamps are spread
    /// evenly, and up to 1 % of the rows are dropped.
    pub repair: bool,
}

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

/// The bytes of a file.
pub(crate) fn read_bytes(path: &Path) -> Result<Vec<u8>, RecordError> {
    if path.is_dir() {
        return Err(RecordError::IsDirectory { path: path.to_owned() });
    }
    let bytes = read_limited(path)?;
    if FileFormat::detect(&bytes).is_none() {
        memory_limit::check_text(&bytes, path)?;
    }
    Ok(bytes)
}

/// Reads a recording from the bytes of a file. `path` appears in messages, and other files that a column map names are looked
/// for beside it.
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

/// What is read from a file.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Select<'a> {
    /// All columns of a recording.
    Recording,
    /// The time and one other column.
    Series(ColumnRole, &'a Column),
}

impl Select<'_> {
    /// The map with which a series is looked for in its file.
    fn series_map(self, map: Option<&ColumnMap>) -> Option<ColumnMap> {
        let Self::Series(..) = self else { return None };
        // Layout and encoding of the first file are not those of the second one.
        let map = map.cloned().unwrap_or_else(ColumnMap::open);
        Some(ColumnMap { header_line: None, decimal: None, encoding: None, sheet: None, ..map })
    }
}

/// Calls `then` with the file and its columns.
pub(crate) fn with_table<T>(
    bytes: &[u8],
    path: &Path,
    map: Option<&ColumnMap>,
    select: Select<'_>,
    then: impl FnOnce(&SourceFile<'_>, RawTable) -> Result<T, RecordError>,
) -> Result<T, RecordError> {
    let series_map = select.series_map(map);
    let map = series_map.as_ref().or(map);
    match FileFormat::detect(bytes) {
        Some(kind) => match Foreign::open(kind, bytes, path, map)? {
            Foreign::Text(text) => with_text(&text, path, map, select, then),
            Foreign::Columns(source) => {
                let (mapped, columns) = source.read(path, |head| match (select, map) {
                    (Select::Series(role, column), Some(map)) => map_series(head, map, role, column),
                    _ => map_columns(head, map),
                })?;
                let rows = columns.first().map_or(0, Vec::len);
                let file = SourceFile { text: TextSource::Rows, path, header: 0 };
                then(&file, RawTable { columns, offsets: (0..rows).collect(), mapped, ..RawTable::default() })
            }
        },
        None => {
            let (text, _) = decoded(bytes, path, map)?;
            with_text(&text, path, map, select, then)
        }
    }
}

/// The text of a file in UTF-8, and its encoding.
pub(crate) fn decoded<'a>(
    bytes: &'a [u8],
    path: &Path,
    map: Option<&ColumnMap>,
) -> Result<(Cow<'a, [u8]>, &'static Encoding), RecordError> {
    let given = map.and_then(|map| Encoding::for_label(map.encoding.as_ref()?.as_bytes()));
    let found = given.map_or_else(|| encoding::detect(bytes), Ok);
    let encoding = found.map_err(|byte| RecordError::NotText {
        path: path.to_owned(),
        byte,
        line: 1 + bytes[..byte].iter().filter(|b| **b == b'\n').count() as u64,
        what: "a zero byte",
    })?;
    if encoding != UTF_8 || std::str::from_utf8(bytes).is_err() {
        return Ok((Cow::Owned(encoding::decode(bytes, encoding)), encoding));
    }
    match bytes.iter().position(|byte| *byte == 0) {
        None => Ok((Cow::Borrowed(bytes), encoding)),
        Some(byte) => Err(RecordError::NotText {
            path: path.to_owned(),
            byte,
            line: 1 + bytes[..byte].iter().filter(|b| **b == b'\n').count() as u64,
            what: "a zero byte",
        }),
    }
}

fn with_text<T>(
    text: &[u8],
    path: &Path,
    map: Option<&ColumnMap>,
    select: Select<'_>,
    then: impl FnOnce(&SourceFile<'_>, RawTable) -> Result<T, RecordError>,
) -> Result<T, RecordError> {
    let header = header_start(text).ok_or_else(|| RecordError::EmptyFile { path: path.to_owned() })?;
    let file = SourceFile { text: TextSource::Bytes(text), path, header };
    let head = std::str::from_utf8(text).unwrap_or_default();
    let line = file.line_of_row(header)?;
    let (layout, mapped) = match (select, map) {
        (Select::Series(role, column), Some(map)) => {
            // The first line of the second file need not have the columns of a recording.
            let layout = crate::text::layout::find_layout(head, header, line, Default::default())
                .ok_or_else(|| RecordError::NoTable { path: path.to_owned(), line })?;
            let mapped = map_series(layout.head(path), map, role, column)?;
            (layout, mapped)
        }
        _ => find_table(head, header, line, path, map)?,
    };
    let fields = wanted_fields(&layout, &mapped);
    let mut table = RawTable { columns: vec![Vec::new(); fields.len()], mapped, ..RawTable::default() };
    table.read = read_rows(&file, &layout, &fields, Tolerance::Strict, |offset, row| {
        table.columns.iter_mut().zip(row).for_each(|(column, x)| column.push(*x));
        table.offsets.push(offset);
        Ok(())
    })?;
    then(&file, table)
}

/// The fields of a row that the columns need.
pub(crate) fn wanted_fields(layout: &TextLayout, mapped: &MappedColumns) -> Vec<WantedField> {
    let fields = mapped.columns.iter().flat_map(|column| {
        column.indices.iter().map(move |index| WantedField {
            index: *index,
            name: column.name.clone(),
            kind: match layout.kinds.get(*index) {
                Some(ColumnKind::Date) => ColumnKind::Date,
                _ => ColumnKind::Number,
            },
            from_first: column.role == ColumnRole::Time && column.indices.len() == 1,
        })
    });
    fields.collect()
}
