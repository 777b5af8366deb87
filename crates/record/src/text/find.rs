//! Finding the table in a text and its columns.

use std::path::Path;

use super::delimiter::{DELIMITERS, Delimiter, split};
use super::layout::{LayoutHints, TextLayout, find_layout, is_row_of_units};
use crate::column_map::ColumnMap;
use crate::columns::{MappedColumns, TableHead, map_columns};
use crate::error::RecordError;
use crate::units::parse_unit;

impl LayoutHints {
    /// The layout settings that a column map gives.
    pub(crate) fn new(map: Option<&ColumnMap>) -> Self {
        Self {
            header_line: map.and_then(|map| map.header_line),
            decimal_comma: map.and_then(|map| map.decimal).map(|sign| sign == ','),
        }
    }
}

impl TextLayout {
    /// The columns for [`map_columns`].
    pub(crate) fn head<'a>(&'a self, path: &'a Path) -> TableHead<'a> {
        TableHead {
            path,
            line: self.names_line.unwrap_or(self.data_line),
            names: &self.names,
            named: self.names_line.is_some(),
            units: &self.units,
            kinds: &self.kinds,
            samples: &self.samples,
        }
    }
}

/// The layout of a text from its head, in which the first line that is not blank begins at `start`, on `line`.
///
/// The first line is the header when it has the columns that are wanted; otherwise the rows of numbers decide. `spread` are lines spread over the
/// text ([`SourceFile::spread_lines`](super::source::SourceFile::spread_lines)), which show how much each column varies.
///
/// # Errors
/// Those of [`map_columns`]; [`RecordError::NoTable`] without rows of numbers.
pub(crate) fn find_table(
    head: &str,
    start: usize,
    line: u64,
    path: &Path,
    map: Option<&ColumnMap>,
    spread: &[String],
) -> Result<(TextLayout, MappedColumns), RecordError> {
    let by_number = map.is_some_and(|map| {
        [&map.time, &map.position, &map.force].iter().any(|c| c.column.is_some() || !c.columns.is_empty())
    });
    let hints = LayoutHints::new(map);
    let mut first_error = None;
    if hints.header_line.is_none() && !by_number {
        for delimiter in by_frequency(&head[start..]) {
            let layout = header_first(head, start, line, delimiter, path, hints)?;
            if layout.names.iter().all(|name| name.parse::<f64>().is_ok()) {
                continue;
            }
            match map_columns(layout.head(path), map) {
                Ok(_) => {
                    // The values may identify a column that its name does not.
                    let layout = layout.with_samples(head, spread);
                    let columns = map_columns(layout.head(path), map)?;
                    return Ok((layout, columns));
                }
                Err(error) => first_error = first_error.or(Some(error)),
            }
        }
    }
    match find_layout(head, start, line, hints) {
        Some(layout) => {
            let layout = layout.with_samples(head, spread);
            let columns = map_columns(layout.head(path), map)?;
            if let Some(text) = &layout.open_decimal {
                return Err(RecordError::OpenDecimal {
                    path: path.to_owned(),
                    line: layout.data_line,
                    text: text.clone(),
                });
            }
            Ok((layout, columns))
        }
        // The error of the most frequent delimiter, which was tried first.
        None => Err(first_error.unwrap_or_else(|| RecordError::NoTable { path: path.to_owned(), line })),
    }
}

/// The layout for an inspection: that of [`find_table`] when it finds the columns, else that of the rows of numbers.
///
/// # Errors
/// [`RecordError::NoTable`] without rows of numbers.
pub(crate) fn inspect_layout(
    head: &str,
    start: usize,
    line: u64,
    path: &Path,
    map: Option<&ColumnMap>,
    spread: &[String],
) -> Result<TextLayout, RecordError> {
    match find_table(head, start, line, path, map, spread) {
        Ok((layout, _)) => Ok(layout),
        Err(error) => match find_layout(head, start, line, LayoutHints::new(map)) {
            Some(layout) => Ok(layout.with_samples(head, spread)),
            None => Err(error),
        },
    }
}

/// The delimiters by how often they occur in the first line.
fn by_frequency(text: &str) -> Vec<Delimiter> {
    let first_line = text.split(['\n', '\r']).next().unwrap_or_default();
    let mut candidates: Vec<(usize, Delimiter)> = [b',', b';', b'\t', b'|']
        .into_iter()
        .map(|delimiter| {
            (first_line.bytes().filter(|byte| *byte == delimiter).count(), Delimiter::Byte(delimiter))
        })
        .collect();
    candidates.sort_by_key(|(count, _)| std::cmp::Reverse(*count));
    debug_assert!(candidates.iter().all(|(_, delimiter)| DELIMITERS.contains(delimiter)));
    candidates.into_iter().map(|(_, delimiter)| delimiter).collect()
}

/// The layout when the first line holds the names.
fn header_first(
    head: &str,
    start: usize,
    line: u64,
    delimiter: Delimiter,
    path: &Path,
    hints: LayoutHints,
) -> Result<TextLayout, RecordError> {
    let Delimiter::Byte(byte) = delimiter else {
        return Err(RecordError::NoTable { path: path.to_owned(), line });
    };
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .delimiter(byte)
        .from_reader(&head.as_bytes()[start..]);
    let mut header = csv::StringRecord::new();
    reader.read_record(&mut header).map_err(|error| RecordError::BadTable {
        path: path.to_owned(),
        line,
        message: error.to_string(),
    })?;
    let names: Vec<String> = header.iter().map(|name| name.trim().to_owned()).collect();
    let end = start + usize::try_from(reader.position().byte()).unwrap_or(0);
    let width = names.len();
    let mut layout = TextLayout {
        delimiter,
        decimal_comma: false,
        open_decimal: None,
        comment: Some(b'#'),
        units: vec![None; width],
        names,
        names_line: Some(line),
        units_line: None,
        kinds: Vec::new(),
        least_width: width,
        samples: Vec::new(),
        data_start: end.min(head.len()),
        data_line: line + 1,
        preamble: Vec::new(),
    };
    let next = head[layout.data_start..].split(['\n', '\r']).next().unwrap_or_default();
    let fields = split(next, delimiter);
    if fields.len() == width && is_row_of_units(&fields) {
        layout.units = fields.iter().map(|field| parse_unit(field)).collect();
        layout.units_line = Some(line + 1);
        layout.data_start += next.len();
        layout.data_line = line + 2;
    }
    layout.look_at_rows(head, hints);
    Ok(layout)
}
