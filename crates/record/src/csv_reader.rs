//! CSV reader: a recording, or an error with file, line, column and remedy.

use std::fs::{self, File};
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use crate::column_map::{Column, ColumnMap};
use crate::csv_header::{ColumnRole, CsvLayout, MappedColumn, read_layout};
use crate::differentiate::{DEFAULT_HALF_WIDTH_S, differentiate};
use crate::error::RecordError;
use crate::file_formats::{FileFormat, to_csv};
use crate::quality::{QualityNote, assess, repaired_rows};
use crate::recording::{JOINTS, Recording};
use crate::timestamp_repair::{retain_rows, rows_to_keep};

/// How to read a CSV file.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ReadOptions {
    /// Names and units of another program's log; `None`: Stylet's names, SI units.
    pub columns: Option<ColumnMap>,
    /// Drop the fewest rows that leave time increasing, with a [`QualityNote`], instead of refusing time stamps that run
    /// backward or repeat.
    pub repair: bool,
}

/// Reads a recording from a CSV file.
///
/// The header (the first line that is not blank) names the columns: `time_s`, `position_m`, `force_n`, optionally `velocity_mps`,
/// `force_virtual_n` and `joint_torque_1_nm` to `joint_torque_7_nm` (all or none), or the names of the column map. Other columns are
/// ignored. The delimiter is a comma, a semicolon, a tab or a `|`; a byte order mark, CRLF line ends, quotation marks, spaces
/// around names and numbers, blank lines and a last line without its end are accepted. Without a velocity column the
/// position is differentiated ([`mod@crate::differentiate`]). MCAP, MATLAB v7.3 and Parquet files are recognised by their first
/// bytes ([`mod@crate::file_formats`]).
///
/// The notes are those of [`assess`], preceded by the repaired rows.
///
/// # Errors
/// Every variant of [`RecordError`] with a `path`, and [`RecordError::BadColumnMap`].
pub fn read_csv(
    path: impl AsRef<Path>,
    options: &ReadOptions,
) -> Result<(Recording, Vec<QualityNote>), RecordError> {
    let path = path.as_ref();
    if path.is_dir() {
        return Err(RecordError::IsDirectory { path: path.to_owned() });
    }
    let bytes = fs::read(path).map_err(|source| match source.kind() {
        io::ErrorKind::NotFound => RecordError::NoSuchFile { path: path.to_owned() },
        _ => RecordError::Unreadable { path: path.to_owned(), source },
    })?;
    read_csv_bytes(&bytes, path, options)
}

/// Reads a recording from the bytes of a CSV file; `path` only appears in messages.
///
/// # Errors
/// As [`read_csv`].
pub fn read_csv_bytes(
    bytes: &[u8],
    path: &Path,
    options: &ReadOptions,
) -> Result<(Recording, Vec<QualityNote>), RecordError> {
    if let Some(map) = &options.columns {
        map.check()?;
    }
    if let Some(kind) = FileFormat::detect(bytes) {
        let text = to_csv(kind, bytes, path, options.columns.as_ref())?;
        return read_csv_bytes(&text, path, options);
    }
    check_text(bytes, path)?;
    let header = header_start(bytes).ok_or_else(|| RecordError::EmptyFile { path: path.to_owned() })?;
    let file = SourceFile { text: TextSource::Bytes(bytes), path, header };
    let layout = read_layout(&bytes[header..], path, file.line_of_row(header)?, options.columns.as_ref())?;
    let mut rows = Rows { columns: vec![Vec::new(); layout.columns.len()], offsets: Vec::new() };
    read_rows(&file, &layout, !options.repair, |offset, row| {
        rows.columns.iter_mut().zip(row).for_each(|(column, x)| column.push(*x));
        rows.offsets.push(offset);
        Ok(())
    })?;
    let dropped_lines = rows.repair(&file)?;
    let offsets = rows.offsets.clone();
    let mut recording = rows.into_recording(&file, &layout)?;
    if !recording.velocity_measured {
        recording.velocity_mps =
            differentiate(&recording.time_s, &recording.position_m, DEFAULT_HALF_WIDTH_S);
        if let Some(row) = recording.velocity_mps.iter().position(|v| !v.is_finite()) {
            let line = file.line_of_row(offsets.get(row).copied().unwrap_or(header))?;
            return Err(RecordError::VelocityNotFinite { path: path.to_owned(), line });
        }
    }
    let mut notes = assess(&recording);
    if !dropped_lines.is_empty() {
        notes.insert(0, repaired_rows(dropped_lines, recording.len()));
    }
    Ok((recording, notes))
}

/// Offset of the header line: the first line that is not blank, after a byte order mark.
pub(crate) fn header_start(bytes: &[u8]) -> Option<usize> {
    let start = if bytes.starts_with(b"\xEF\xBB\xBF") { 3 } else { 0 };
    let header = start + bytes[start..].iter().position(|byte| !byte.is_ascii_whitespace())?;
    // Tabs and spaces before the first name belong to the header line.
    let line = bytes[..header].iter().rposition(|byte| matches!(byte, b'\n' | b'\r'));
    Some(line.map_or(start, |end| end + 1))
}

/// A text that is read in several passes.
pub(crate) enum TextSource<'a> {
    Bytes(&'a [u8]),
    File(&'a File),
}

impl TextSource<'_> {
    /// A reader from a byte offset on.
    pub(crate) fn reader_at(&self, byte: usize) -> io::Result<Box<dyn Read + '_>> {
        match self {
            Self::Bytes(bytes) => Ok(Box::new(bytes.get(byte..).unwrap_or_default())),
            Self::File(file) => {
                let mut file: &File = file;
                file.seek(SeekFrom::Start(byte as u64))?;
                Ok(Box::new(file))
            }
        }
    }
}

/// A file and the offset of its header; converts byte offsets to line numbers for error messages.
pub(crate) struct SourceFile<'a> {
    pub(crate) text: TextSource<'a>,
    pub(crate) path: &'a Path,
    pub(crate) header: usize,
}

impl SourceFile<'_> {
    /// Line (1-based) of the row that begins at the offset or after the blank lines there.
    pub(crate) fn line_of_row(&self, byte: usize) -> Result<u64, RecordError> {
        Ok(self.lines_of_offsets(std::iter::once(byte))?.first().copied().unwrap_or(1))
    }

    /// Line of a byte, which may be a line end.
    fn line_of(&self, byte: usize) -> Result<u64, RecordError> {
        let unreadable = |source| self.unreadable(source);
        let mut before = self.text.reader_at(0).map_err(unreadable)?.take(byte as u64 + 1);
        let (mut line, mut left, mut after_return) = (1, byte, false);
        let mut piece = vec![0; CHUNK_BYTES];
        loop {
            let count = before.read(&mut piece).map_err(unreadable)?;
            for &byte in &piece[..count] {
                line += u64::from(after_return && byte != b'\n');
                if left == 0 {
                    return Ok(line);
                }
                left -= 1;
                line += u64::from(byte == b'\n');
                after_return = byte == b'\r';
            }
            if count == 0 {
                return Ok(line);
            }
        }
    }

    /// [`SourceFile::line_of_row`] for ascending offsets, in one pass.
    pub(crate) fn lines_of_offsets(
        &self,
        offsets: impl Iterator<Item = usize>,
    ) -> Result<Vec<u64>, RecordError> {
        let from = self.text.reader_at(0).map_err(|source| self.unreadable(source))?;
        let mut text = Bytes { from, held: Vec::new(), at: 0 };
        let (mut line, mut passed, mut lines) = (1, 0, Vec::new());
        let mut failed = None;
        let mut next = |text: &mut Bytes<'_>| {
            text.next().unwrap_or_else(|why| {
                failed.get_or_insert(why);
                None
            })
        };
        let mut now = next(&mut text);
        for offset in offsets {
            while let Some(byte) = now
                && (passed < offset || matches!(byte, b'\n' | b'\r'))
            {
                let following = next(&mut text);
                // Line ends: LF, CRLF, or a CR alone.
                line += u64::from(byte == b'\n' || (byte == b'\r' && following != Some(b'\n')));
                passed += 1;
                now = following;
            }
            lines.push(line);
        }
        match failed {
            Some(why) => Err(self.unreadable(why)),
            None => Ok(lines),
        }
    }

    pub(crate) fn path(&self) -> PathBuf {
        self.path.to_owned()
    }

    pub(crate) fn unreadable(&self, source: io::Error) -> RecordError {
        RecordError::Unreadable { path: self.path(), source }
    }
}

/// Buffered reading of single bytes.
struct Bytes<'a> {
    from: Box<dyn Read + 'a>,
    held: Vec<u8>,
    at: usize,
}

impl Bytes<'_> {
    #[inline]
    fn next(&mut self) -> io::Result<Option<u8>> {
        if self.at == self.held.len() {
            self.held.resize(CHUNK_BYTES, 0);
            let count = self.from.read(&mut self.held)?;
            self.held.truncate(count);
            self.at = 0;
        }
        let byte = self.held.get(self.at).copied();
        self.at += usize::from(byte.is_some());
        Ok(byte)
    }
}

/// Line ends in `bytes[from..to]`: LF, CRLF, or a CR alone. A range that begins at the start of a row is exact.
fn line_ends(bytes: &[u8], from: usize, to: usize) -> u64 {
    let alone = |index: usize| bytes.get(index + 1) != Some(&b'\n');
    (from..to).filter(|&index| bytes[index] == b'\n' || (bytes[index] == b'\r' && alone(index))).count()
        as u64
}

fn check_text(bytes: &[u8], path: &Path) -> Result<(), RecordError> {
    let mut check = Utf8Check::default();
    let checked = check.push(bytes).and_then(|()| check.finish());
    checked.map_err(|NotText { byte, what }| RecordError::NotText {
        path: path.to_owned(),
        byte,
        line: 1 + line_ends(bytes, 0, byte),
        what,
    })
}

/// Why and where a file is no text in UTF-8.
#[derive(Debug)]
pub(crate) struct NotText {
    byte: usize,
    what: &'static str,
}

impl NotText {
    pub(crate) fn into_error(self, file: &SourceFile<'_>) -> RecordError {
        match file.line_of(self.byte) {
            Ok(line) => RecordError::NotText { path: file.path(), byte: self.byte, line, what: self.what },
            Err(error) => error,
        }
    }
}

/// Check of a text in UTF-8, piece by piece.
#[derive(Debug, Default)]
pub(crate) struct Utf8Check {
    /// Number of valid bytes so far.
    passed: usize,
    /// The beginning of a character that continues in the next piece.
    open: Vec<u8>,
    begun: bool,
}

impl Utf8Check {
    pub(crate) fn push(&mut self, piece: &[u8]) -> Result<(), NotText> {
        if !std::mem::replace(&mut self.begun, true) {
            let head = |what| Err(NotText { byte: 0, what });
            if piece.starts_with(b"\xFF\xFE") || piece.starts_with(b"\xFE\xFF") {
                return head("a UTF-16 byte order mark");
            }
            if piece.starts_with(b"PK\x03\x04") {
                return head("the head of a ZIP archive (a spreadsheet?)");
            }
        }
        let joined;
        let bytes = if self.open.is_empty() {
            piece
        } else {
            self.open.extend_from_slice(piece);
            joined = std::mem::take(&mut self.open);
            &joined
        };
        // Zero bytes are valid UTF-8; the first problem is reported.
        let zero = if bytes.contains(&0) { bytes.iter().position(|byte| *byte == 0) } else { None };
        match std::str::from_utf8(&bytes[..zero.unwrap_or(bytes.len())]) {
            Err(error) if zero.is_some() || error.error_len().is_some() => {
                Err(NotText { byte: self.passed + error.valid_up_to(), what: "an invalid UTF-8 sequence" })
            }
            Err(error) => {
                self.passed += error.valid_up_to();
                self.open = bytes[error.valid_up_to()..].to_vec();
                Ok(())
            }
            Ok(_) => match zero {
                Some(zero) => Err(NotText { byte: self.passed + zero, what: "a zero byte" }),
                None => {
                    self.passed += bytes.len();
                    Ok(())
                }
            },
        }
    }

    pub(crate) fn finish(&self) -> Result<(), NotText> {
        match self.open.is_empty() {
            true => Ok(()),
            false => Err(NotText { byte: self.passed, what: "an invalid UTF-8 sequence" }),
        }
    }
}

/// Size of a read in bytes.
const CHUNK_BYTES: usize = 1 << 16;

/// Calls `each` with every row: its byte offset, and its values in the order of the header columns (time first). With
/// `in_order`, time stamps that do not increase are errors.
pub(crate) fn read_rows(
    file: &SourceFile<'_>,
    layout: &CsvLayout,
    in_order: bool,
    mut each: impl FnMut(usize, &[f64]) -> Result<(), RecordError>,
) -> Result<(), RecordError> {
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .delimiter(layout.delimiter)
        .buffer_capacity(CHUNK_BYTES)
        .from_reader(file.text.reader_at(file.header).map_err(|source| file.unreadable(source))?);
    let mut row = csv::ByteRecord::new();
    let mut numbers = vec![0.0; layout.columns.len()];
    let (mut rows, mut previous_s, mut previous_offset) = (0_u64, f64::NEG_INFINITY, 0);
    let mut header_passed = false;
    loop {
        let offset =
            file.header + usize::try_from(reader.position().byte()).unwrap_or(usize::MAX - file.header);
        let more = reader.read_byte_record(&mut row);
        let more = match more {
            Ok(more) => more,
            Err(error) => {
                return Err(RecordError::BadTable {
                    path: file.path(),
                    line: file.line_of_row(offset)?,
                    message: error.to_string(),
                });
            }
        };
        if !more {
            break;
        }
        if !header_passed {
            header_passed = true;
            continue;
        }
        if row.iter().all(|field| field.trim_ascii().is_empty()) {
            continue;
        }
        if row.len() != layout.width {
            return Err(RecordError::RaggedRow {
                path: file.path(),
                line: file.line_of_row(offset)?,
                found: row.len(),
                expected: layout.width,
                remedy: remedy_for_row(&row, layout),
            });
        }
        for (value, source) in numbers.iter_mut().zip(&layout.columns) {
            *value = number(file, offset, source, row.get(source.index).unwrap_or_default())?;
        }
        let time_s = numbers.first().copied().unwrap_or(f64::NAN);
        if in_order && rows > 0 && time_s <= previous_s {
            let column = &layout.columns[0].column;
            return Err(out_of_order(file, column, (offset, time_s), (previous_offset, previous_s)));
        }
        (previous_s, previous_offset) = (time_s, offset);
        rows += 1;
        each(offset, &numbers)?;
    }
    if rows == 0 {
        return Err(RecordError::HeaderOnly { path: file.path(), line: file.line_of_row(file.header)? });
    }
    Ok(())
}

/// Refuses fewer than two samples.
pub(crate) fn check_sample_count(
    file: &SourceFile<'_>,
    samples: usize,
    last_offset: Option<usize>,
) -> Result<(), RecordError> {
    if samples >= 2 {
        return Ok(());
    }
    let line = file.line_of_row(last_offset.unwrap_or(file.header))?;
    Err(RecordError::TooFewSamples { path: file.path(), line, samples })
}

/// The values of a file, one column per header column (time first), and the byte offset of each row.
struct Rows {
    columns: Vec<Vec<f64>>,
    offsets: Vec<usize>,
}

impl Rows {
    /// Drops the rows whose time stamps do not increase; returns their lines.
    fn repair(&mut self, file: &SourceFile<'_>) -> Result<Vec<u64>, RecordError> {
        let Some(keep) = rows_to_keep(&self.columns[0]) else {
            return Ok(Vec::new());
        };
        let dropped: Vec<bool> = keep.iter().map(|keep| !keep).collect();
        let lines = file.lines_of_offsets(retain_rows(&self.offsets, &dropped).into_iter())?;
        for column in &mut self.columns {
            *column = retain_rows(column, &keep);
        }
        self.offsets = retain_rows(&self.offsets, &keep);
        Ok(lines)
    }

    /// The columns under their names; the velocity stays empty when the file has none.
    fn into_recording(self, file: &SourceFile<'_>, layout: &CsvLayout) -> Result<Recording, RecordError> {
        let samples = self.offsets.len();
        check_sample_count(file, samples, self.offsets.last().copied())?;
        let mut recording = Recording::default();
        for (source, values) in layout.columns.iter().zip(self.columns) {
            match source.role {
                ColumnRole::Time => recording.time_s = values,
                ColumnRole::Position => recording.position_m = values,
                ColumnRole::Force => recording.force_n = values,
                ColumnRole::Velocity => {
                    recording.velocity_mps = values;
                    recording.velocity_measured = true;
                }
                ColumnRole::ForceVirtual => recording.force_virtual_n = Some(values),
                ColumnRole::JointTorque(joint) => {
                    recording.joint_torque_nm.resize(samples, [0.0; JOINTS]);
                    for (torques, value) in recording.joint_torque_nm.iter_mut().zip(values) {
                        torques[joint] = value;
                    }
                }
            }
        }
        Ok(recording)
    }
}

fn number(
    file: &SourceFile<'_>,
    offset: usize,
    source: &MappedColumn,
    field: &[u8],
) -> Result<f64, RecordError> {
    // The whole file was checked to be UTF-8; a delimiter cannot split a character.
    let text = std::str::from_utf8(field).unwrap_or_default();
    let Ok(raw) = text.parse::<f64>().or_else(|_| text.trim().parse()) else {
        let text = text.trim();
        return Err(RecordError::NotANumber {
            path: file.path(),
            line: file.line_of_row(offset)?,
            column: source.column.name.clone(),
            text: text.to_owned(),
            remedy: remedy(text),
        });
    };
    let value = source.column.apply(raw);
    if value.is_finite() {
        return Ok(value);
    }
    Err(RecordError::NotFinite {
        path: file.path(),
        line: file.line_of_row(offset)?,
        column: source.column.name.clone(),
        text: text.trim().to_owned(),
    })
}

/// Remedy for a row with another number of fields than the header.
fn remedy_for_row(row: &csv::ByteRecord, layout: &CsvLayout) -> &'static str {
    let integer = |field: &[u8]| !field.is_empty() && field.iter().all(|b| b.is_ascii_digit() || *b == b'-');
    if row.iter().any(|field| field.contains(&b'\n') || field.contains(&b'\r')) {
        "a quotation mark that is left open includes the following lines: close or remove it, or complete or remove the row"
    } else if layout.delimiter == b',' && row.len() > layout.width && row.iter().skip(1).any(integer) {
        "write decimal points instead of decimal commas, or put semicolons between the columns"
    } else {
        "complete or remove the row (the last line of an interrupted log is often cut short)"
    }
}

fn remedy(text: &str) -> &'static str {
    if text.is_empty() {
        "fill in the value or remove the row"
    } else if text.contains(['\n', '\r']) {
        "a quotation mark that is left open includes the following lines: close or remove it"
    } else if text.replace(',', ".").parse::<f64>().is_ok() {
        "write a decimal point instead of the decimal comma"
    } else {
        "write a decimal number such as 0.0125 or 1.25e-2, or remove the row"
    }
}

/// Error of a time stamp that is not later than the previous one, each with the offset of its row.
fn out_of_order(
    file: &SourceFile<'_>,
    column: &Column,
    (offset, time_s): (usize, f64),
    (previous_offset, previous_s): (usize, f64),
) -> RecordError {
    let (path, column) = (file.path(), column.name.clone());
    let (previous_line, line) = match file.lines_of_offsets([previous_offset, offset].into_iter()) {
        Ok(lines) => (lines.first().copied().unwrap_or(1), lines.last().copied().unwrap_or(1)),
        Err(error) => return error,
    };
    if time_s == previous_s {
        return RecordError::RepeatedTime { path, line, column, time_s, previous_line };
    }
    RecordError::BackwardTime { path, line, column, time_s, previous_s, previous_line }
}
