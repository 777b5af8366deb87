//! Rows of a text table as numbers.

use std::io::{BufRead, BufReader, Read};

use super::delimiter::{Delimiter, split};
use super::layout::{ColumnKind, TextLayout};
use super::number::{FieldKind, classify, is_missing, parse_date_ns, parse_number};
use super::source::{CHUNK_BYTES, SourceFile};
use crate::error::RecordError;

/// A field of a row that is read.
#[derive(Debug, Clone)]
pub(crate) struct WantedField {
    /// Place in a row.
    pub index: usize,
    /// Name for messages.
    pub name: String,
    pub kind: ColumnKind,
    /// Whether large integers are counted from the first one, so that nanoseconds since 1970 keep their digits.
    pub from_first: bool,
}

/// A field without a value.
#[derive(Debug, Clone)]
pub(crate) struct MissingValue {
    pub offset: usize,
    /// Which of the wanted fields.
    pub field: usize,
    pub text: String,
}

/// Findings while reading rows.
#[derive(Debug, Clone, Default)]
pub(crate) struct RowsRead {
    pub rows: usize,
    pub first_missing: Option<MissingValue>,
    /// Lines at the end that are left out.
    pub left_out: Option<TrailingLines>,
    /// Fields that are not numbers, by column; only with [`Tolerance::Lenient`].
    pub bad_values: Vec<BadValues>,
    /// Rows with another number of fields: how many, the line and the error of the first; only with [`Tolerance::Lenient`].
    pub ragged: Option<(usize, u64, std::sync::Arc<RecordError>)>,
    /// First values, of dates (ns since 1970) and large integers, from which others are counted.
    pub origins: Vec<Option<i64>>,
}

/// Lines at the end of a file that are no rows: a last row that is cut short, or text such as the statistics of a testing machine.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TrailingLines {
    /// Offset of the first.
    pub offset: usize,
    pub lines: usize,
    pub is_text: bool,
}

impl TrailingLines {
    /// What was left out, from this line on.
    pub(crate) fn message(self, line: u64) -> String {
        match self.is_text {
            true => format!("{} line(s) of text at the end, from line {line} on, are left out", self.lines),
            false => format!("the last row, on line {line}, is cut short and is left out"),
        }
    }
}

/// Fields of a column that are not numbers.
#[derive(Debug, Clone)]
pub(crate) struct BadValues {
    /// Which of the wanted fields.
    pub field: usize,
    pub count: usize,
    /// Line and error of the first.
    pub line: u64,
    pub first: std::sync::Arc<RecordError>,
}

/// Handling of invalid rows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Tolerance {
    /// They are errors.
    Strict,
    /// They are counted; a field that is not a number is missing, a row with another number of fields is left out.
    Lenient,
}

/// Digits from which an integer is not exact as an `f64`.
const LARGE_DIGITS: usize = 16;
/// Fewest rows before a truncated last row for leaving it out.
const MIN_ROWS_BEFORE_CUT: usize = 3;
/// Most lines of text at the end of a file.
const MAX_TEXT_LINES: usize = 50;

/// Records with one delimiter.
enum Records<'a> {
    Csv(csv::Reader<Box<dyn Read + 'a>>),
    Blanks { from: BufReader<Box<dyn Read + 'a>>, line: Vec<u8>, offset: u64 },
}

impl Records<'_> {
    fn offset(&self) -> u64 {
        match self {
            Self::Csv(reader) => reader.position().byte(),
            Self::Blanks { offset, .. } => *offset,
        }
    }

    fn read(&mut self, row: &mut csv::ByteRecord, comment: Option<u8>) -> Result<bool, csv::Error> {
        match self {
            Self::Csv(reader) => reader.read_byte_record(row),
            Self::Blanks { from, line, offset } => loop {
                row.clear();
                line.clear();
                let count = from.read_until(b'\n', line).map_err(csv::Error::from)?;
                if count == 0 {
                    return Ok(false);
                }
                *offset += count as u64;
                let text = line.trim_ascii();
                if text.is_empty() || text.first().copied() == comment {
                    continue;
                }
                if text.contains(&b'"') {
                    split(&String::from_utf8_lossy(text), Delimiter::Blanks)
                        .iter()
                        .for_each(|f| row.push_field(f.as_bytes()));
                } else {
                    text.split(|b| matches!(b, b' ' | b'\t'))
                        .filter(|f| !f.is_empty())
                        .for_each(|f| row.push_field(f));
                }
                return Ok(true);
            },
        }
    }
}

/// Calls `each` with every row: its byte offset, and its values in the order of `wanted`; NaN for missing ones.
///
/// # Errors
/// [`RecordError::NotANumber`], [`RecordError::RaggedRow`], [`RecordError::BadTable`], [`RecordError::HeaderOnly`], and that
/// of `each`.
pub(crate) fn read_rows(
    file: &SourceFile<'_>,
    layout: &TextLayout,
    wanted: &[WantedField],
    tolerance: Tolerance,
    mut each: impl FnMut(usize, &[f64]) -> Result<(), RecordError>,
) -> Result<RowsRead, RecordError> {
    let text = file.text.reader_at(layout.data_start).map_err(|source| file.unreadable(source))?;
    let mut records = match layout.delimiter {
        Delimiter::Byte(delimiter) => Records::Csv(
            csv::ReaderBuilder::new()
                .has_headers(false)
                .flexible(true)
                .delimiter(delimiter)
                .comment(layout.comment)
                .buffer_capacity(CHUNK_BYTES)
                .from_reader(text),
        ),
        Delimiter::Blanks => {
            Records::Blanks { from: BufReader::with_capacity(CHUNK_BYTES, text), line: Vec::new(), offset: 0 }
        }
    };
    let width = layout.width();
    let mut row = csv::ByteRecord::new();
    let mut numbers = vec![0.0; wanted.len()];
    let mut read = RowsRead { origins: vec![None; wanted.len()], ..RowsRead::default() };
    // Errors about skipped lines are created at the end, because finding a line number reads the file from its beginning.
    let mut tail: Option<(TrailingLines, Skipped)> = None;
    let mut ragged: Option<(usize, RowLengthMismatch)> = None;
    let mut bad: BadFields = Vec::new();
    loop {
        let offset = layout.data_start + usize::try_from(records.offset()).unwrap_or(usize::MAX / 2);
        match records.read(&mut row, layout.comment) {
            Ok(true) => {}
            Ok(false) => break,
            Err(error) => {
                return Err(RecordError::BadTable {
                    path: file.path(),
                    line: file.line_of_row(offset)?,
                    message: error.to_string(),
                });
            }
        }
        if row.iter().all(|field| field.trim_ascii().is_empty()) {
            continue;
        }
        let empty_end =
            row.len() == width + 1 && row.get(width).is_some_and(|field| field.trim_ascii().is_empty());
        let is_ragged = !(layout.least_width..=width).contains(&row.len()) && !empty_end;
        let mut failed = None;
        if !is_ragged {
            for (at, field) in wanted.iter().enumerate() {
                let bytes = row.get(field.index).unwrap_or_default();
                match value(layout, field, bytes, &mut read.origins[at]) {
                    Some(value) => numbers[at] = value,
                    None => {
                        failed = Some(at);
                        break;
                    }
                }
            }
        }
        let open_quote = || row.iter().any(|field| field.contains(&b'\n') || field.contains(&b'\r'));
        let may_end = (is_ragged || failed.is_some()) && read.rows >= MIN_ROWS_BEFORE_CUT && !open_quote();
        let is_text = may_end && begins_with_text(&row, layout);
        if let Some((left_out, _)) = &mut tail
            && is_text
            && left_out.is_text
            && left_out.lines < MAX_TEXT_LINES
        {
            left_out.lines += 1;
            continue;
        }
        if let Some((_, skipped)) = tail.take() {
            match (skipped, tolerance) {
                (skipped, Tolerance::Strict) => return Err(skipped.error(file, layout, wanted)?),
                (Skipped::RowLengthMismatch(this), _) => ragged.get_or_insert((0, this)).0 += 1,
                (Skipped::Value(this), _) => count_bad(&mut bad, this),
            }
        }
        if let (Some(at), true) = (failed, is_text) {
            let skipped =
                Skipped::Value(MissingValue { offset, field: at, text: field_text(&row, &wanted[at]) });
            tail = Some((TrailingLines { offset, lines: 1, is_text }, skipped));
            continue;
        }
        if is_ragged {
            let this = RowLengthMismatch { offset, found: row.len(), remedy: remedy_for_row(&row, layout) };
            if is_text || (row.len() < layout.least_width && may_end) {
                tail = Some((TrailingLines { offset, lines: 1, is_text }, Skipped::RowLengthMismatch(this)));
                continue;
            }
            match tolerance {
                Tolerance::Strict => return Err(this.error(file, layout)?),
                Tolerance::Lenient => ragged.get_or_insert((0, this)).0 += 1,
            }
            continue;
        }
        for (at, field) in wanted.iter().enumerate() {
            if failed.is_some_and(|first| at >= first) {
                let bytes = row.get(field.index).unwrap_or_default();
                let text = || field_text(&row, field);
                numbers[at] = match value(layout, field, bytes, &mut read.origins[at]) {
                    Some(value) => value,
                    None if tolerance == Tolerance::Strict => {
                        return Err(not_a_number(file, layout, offset, field, text())?);
                    }
                    None => {
                        count_bad(&mut bad, MissingValue { offset, field: at, text: text() });
                        f64::NAN
                    }
                };
            }
            if !numbers[at].is_finite() {
                numbers[at] = f64::NAN;
                read.first_missing.get_or_insert_with(|| MissingValue {
                    offset,
                    field: at,
                    text: field_text(&row, field),
                });
            }
        }
        read.rows += 1;
        each(offset, &numbers)?;
    }
    read.left_out = tail.map(|(left_out, _)| left_out);
    if let Some((count, first)) = ragged {
        let line = file.line_of_row(first.offset)?;
        read.ragged = Some((count, line, first.error(file, layout)?.into()));
    }
    for (field, count, first) in bad {
        let line = file.line_of_row(first.offset)?;
        let error = not_a_number(file, layout, first.offset, &wanted[field], first.text)?;
        read.bad_values.push(BadValues { field, count, line, first: error.into() });
    }
    if read.rows == 0 && tolerance == Tolerance::Strict {
        let line = layout.names_line.unwrap_or(layout.data_line);
        return Err(RecordError::HeaderOnly { path: file.path(), line });
    }
    Ok(read)
}

/// Fields that are not numbers: the wanted field, how many, and the first of them.
type BadFields = Vec<(usize, usize, MissingValue)>;

fn count_bad(bad: &mut BadFields, value: MissingValue) {
    match bad.iter_mut().find(|(field, ..)| *field == value.field) {
        Some((_, count, _)) => *count += 1,
        None => bad.push((value.field, 1, value)),
    }
}

fn field_text(row: &csv::ByteRecord, field: &WantedField) -> String {
    String::from_utf8_lossy(row.get(field.index).unwrap_or_default()).trim().to_owned()
}

/// Whether the first field that is not empty is text in a column of numbers.
fn begins_with_text(row: &csv::ByteRecord, layout: &TextLayout) -> bool {
    let fields = row.iter().zip(&layout.kinds).filter(|(field, _)| !field.trim_ascii().is_empty());
    let first = fields.map(|(field, kind)| (String::from_utf8_lossy(field), kind)).next();
    first.is_some_and(|(field, kind)| {
        matches!(kind, ColumnKind::Number | ColumnKind::Date) && classify(&field) == FieldKind::Text
    })
}

/// A line that is no row, which is an error unless it is at the end.
enum Skipped {
    RowLengthMismatch(RowLengthMismatch),
    Value(MissingValue),
}

impl Skipped {
    fn error(
        self,
        file: &SourceFile<'_>,
        layout: &TextLayout,
        wanted: &[WantedField],
    ) -> Result<RecordError, RecordError> {
        match self {
            Self::RowLengthMismatch(this) => this.error(file, layout),
            Self::Value(this) => not_a_number(file, layout, this.offset, &wanted[this.field], this.text),
        }
    }
}

/// A row with another number of fields than the header.
struct RowLengthMismatch {
    offset: usize,
    found: usize,
    remedy: &'static str,
}

impl RowLengthMismatch {
    fn error(&self, file: &SourceFile<'_>, layout: &TextLayout) -> Result<RecordError, RecordError> {
        Ok(RecordError::RaggedRow {
            path: file.path(),
            line: file.line_of_row(self.offset)?,
            found: self.found,
            expected: layout.width(),
            remedy: self.remedy,
        })
    }
}

/// Nanoseconds from `origin` to `ns`. Of times of day, without a date, the one that is more than half a day before the first is of the next day.
fn nanoseconds_since(origin: i64, ns: i64) -> Option<i64> {
    const DAY_NS: i64 = 86_400_000_000_000;
    let elapsed = ns.checked_sub(origin)?;
    let is_next_day = (0..DAY_NS).contains(&origin) && (0..DAY_NS).contains(&ns) && elapsed < -DAY_NS / 2;
    Some(if is_next_day { elapsed + DAY_NS } else { elapsed })
}

/// The value of a field, NaN when it is missing, `None` when it is not a number.
#[inline]
fn value(layout: &TextLayout, field: &WantedField, bytes: &[u8], origin: &mut Option<i64>) -> Option<f64> {
    // The whole text is UTF-8; a delimiter cannot split a character.
    let text = std::str::from_utf8(bytes).unwrap_or_default();
    if field.kind == ColumnKind::Date {
        return match parse_date_ns(text) {
            // Division rounds correctly, multiplication by 1e-9 does not.
            Some(ns) => nanoseconds_since(*origin.get_or_insert(ns), ns).map(|ns| ns as f64 / 1e9),
            None => is_missing(text.trim()).then_some(f64::NAN),
        };
    }
    if field.from_first && (origin.is_some() || text.len() >= LARGE_DIGITS) {
        let text = text.trim();
        if text.len() >= LARGE_DIGITS
            && let Ok(whole) = text.parse::<i64>()
        {
            return Some(whole.checked_sub(*origin.get_or_insert(whole))? as f64);
        }
        if let (Some(origin), Some(x)) = (*origin, parse_number(text, layout.decimal_comma)) {
            return Some(x - origin as f64);
        }
    }
    parse_number(text, layout.decimal_comma).or_else(|| is_missing(text.trim()).then_some(f64::NAN))
}

fn not_a_number(
    file: &SourceFile<'_>,
    layout: &TextLayout,
    offset: usize,
    field: &WantedField,
    text: String,
) -> Result<RecordError, RecordError> {
    let repeated = layout.names.get(field.index).is_some_and(|name| *name == text);
    Ok(RecordError::NotANumber {
        path: file.path(),
        line: file.line_of_row(offset)?,
        column: field.name.clone(),
        remedy: if repeated {
            "the names are repeated here: a second recording begins; put it into a file of its own"
        } else {
            remedy(&text, layout.decimal_comma)
        },
        text,
    })
}

/// Remedy for a row with another number of fields than the header.
fn remedy_for_row(row: &csv::ByteRecord, layout: &TextLayout) -> &'static str {
    let integer = |field: &[u8]| !field.is_empty() && field.iter().all(|b| b.is_ascii_digit() || *b == b'-');
    if row.iter().any(|field| field.contains(&b'\n') || field.contains(&b'\r')) {
        "a quotation mark that is left open includes the following lines: close or remove it, or complete or remove the row"
    } else if layout.delimiter == Delimiter::Byte(b',')
        && row.len() > layout.width()
        && row.iter().skip(1).any(integer)
    {
        "write decimal points instead of decimal commas, or put semicolons between the columns"
    } else {
        "complete or remove the row (the last line of an interrupted log is often cut short)"
    }
}

fn remedy(text: &str, decimal_comma: bool) -> &'static str {
    if text.contains(['\n', '\r']) {
        "a quotation mark that is left open includes the following lines: close or remove it"
    } else if parse_number(text, !decimal_comma).is_some() {
        "decimal point and comma are mixed: write one of them, or give `decimal` in the column map"
    } else {
        "write a decimal number such as 0.0125 or 1.25e-2, leave the field empty, or remove the row"
    }
}
