//! Raw columns of a file that a recording or a series needs.

use std::borrow::Cow;
use std::path::Path;

use encoding_rs::{Encoding, UTF_8};

use crate::column_map::{Column, ColumnMap};
use crate::columns::{ColumnRole, MappedColumns, map_columns, map_series};
use crate::error::RecordError;
use crate::file_formats::{FileFormat, OpenFile};
use crate::memory_limit::{self, read_limited};
use crate::text::encoding;
use crate::text::find::find_table;
use crate::text::layout::{ColumnKind, LayoutHints, TextLayout, find_layout};
use crate::text::rows::{RowsRead, Tolerance, WantedField, read_rows};
use crate::text::source::{SourceFile, TextSource, header_start};

/// How to read a recording.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ReadOptions {
    /// Names and units of another program's log; `None`: Stylet's names, or names and units that are unmistakable.
    pub columns: Option<ColumnMap>,
    /// Repair time stamps that run backward or repeat, with a [`QualityNote`](crate::QualityNote), instead of refusing them: equal stamps are spread
    /// evenly, and up to 1 % of the rows are dropped.
    pub repair: bool,
}

/// Raw columns of a file: parts of the mapped columns one after another, NaN for missing values.
#[derive(Debug, Default)]
pub(crate) struct RawTable {
    pub columns: Vec<Vec<f64>>,
    /// Where each row begins.
    pub offsets: Vec<usize>,
    pub mapped: MappedColumns,
    pub read: RowsRead,
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

/// Selection of the columns to read.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Select<'a> {
    /// All columns of a recording.
    Recording,
    /// The time and one other column.
    Series(ColumnRole, &'a Column),
}

impl Select<'_> {
    /// The map for a series in another file.
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
        Some(kind) => match OpenFile::open(kind, bytes, path, map)? {
            OpenFile::Text(text) => with_text(&text, path, map, select, then),
            OpenFile::Columns(source) => {
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

pub(crate) fn with_text<T>(
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
            let layout = find_layout(head, header, line, LayoutHints::default())
                .ok_or_else(|| RecordError::NoTable { path: path.to_owned(), line })?;
            let mapped = map_series(layout.head(path), map, role, column)?;
            (layout, mapped)
        }
        _ => find_table(head, header, line, path, map, &file.spread_lines()?)?,
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
