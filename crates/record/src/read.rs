//! CSV in: numbers or a message that says what, where and what would be right.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use crate::columns::{Column, ColumnMap};
use crate::differentiate::{DEFAULT_HALF_WIDTH_S, differentiate};
use crate::error::RecordError;
use crate::foreign::{Kind, as_csv};
use crate::layout::{Layout, Role, Source, read_layout};
use crate::quality::{QualityNote, assess, repaired_rows};
use crate::recording::{JOINTS, Recording};
use crate::repair::{kept, rows_to_keep};

/// How to read a CSV file.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ReadOptions {
    /// Names and units of somebody else's log; `None`: Stylet's own names, SI units.
    pub columns: Option<ColumnMap>,
    /// Drop rows whose time stamps run backward or repeat (the fewest that leave time increasing), and say so in a
    /// [`QualityNote`], instead of failing.
    pub repair: bool,
}

/// Reads a recording from a CSV file.
///
/// The header (the first line that is not blank) names the columns: `time_s`, `position_m`, `force_n`, optionally `velocity_mps`,
/// `force_virtual_n` and `joint_torque_1_nm` to `joint_torque_7_nm` (all or none), or the names of the column map. Other columns are
/// ignored. The delimiter is a comma, a semicolon, a tab or a `|`; a byte order mark, CRLF line ends, quotation marks, spaces
/// around names and numbers, blank lines and a last line without its end are accepted. Without a velocity column the
/// position is differentiated ([`mod@crate::differentiate`]). MCAP, MATLAB v7.3 and Parquet files are known by their first
/// bytes ([`mod@crate::foreign`]).
///
/// The notes are those of [`assess`], preceded by the repaired rows.
///
/// # Errors
/// Everything in [`RecordError`] that has a `path`, and [`RecordError::BadColumnMap`]: an error never passes as data.
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
    if let Some(kind) = Kind::of(bytes) {
        let text = as_csv(kind, bytes, path, options.columns.as_ref())?;
        return read_csv_bytes(&text, path, options);
    }
    check_text(bytes, path)?;
    let start = if bytes.starts_with(b"\xEF\xBB\xBF") { 3 } else { 0 };
    let Some(header) = bytes[start..].iter().position(|byte| !byte.is_ascii_whitespace()) else {
        return Err(RecordError::EmptyFile { path: path.to_owned() });
    };
    // Tabs and spaces before the first name belong to the header line.
    let header = start + header;
    let header =
        bytes[..header].iter().rposition(|byte| matches!(byte, b'\n' | b'\r')).map_or(start, |end| end + 1);
    let place = Place { bytes, path, header };
    let layout = read_layout(&bytes[header..], path, place.line(header), options.columns.as_ref())?;
    let mut rows = Rows::read(&place, &layout, options.repair)?;
    let dropped_lines = rows.repair(&place);
    let offsets = rows.offsets.clone();
    let mut recording = rows.into_recording(&place, &layout)?;
    if !recording.velocity_measured {
        recording.velocity_mps =
            differentiate(&recording.time_s, &recording.position_m, DEFAULT_HALF_WIDTH_S);
        if let Some(row) = recording.velocity_mps.iter().position(|v| !v.is_finite()) {
            let line = place.line(offsets.get(row).copied().unwrap_or(header));
            return Err(RecordError::NoSlope { path: path.to_owned(), line });
        }
    }
    let mut notes = assess(&recording);
    if !dropped_lines.is_empty() {
        notes.insert(0, repaired_rows(dropped_lines, recording.len()));
    }
    Ok((recording, notes))
}

/// A file and where its header begins; turns byte offsets into line numbers when somebody asks.
struct Place<'a> {
    bytes: &'a [u8],
    path: &'a Path,
    header: usize,
}

impl Place<'_> {
    /// Line (1-based) of the row that begins at or, after blank lines, behind the byte.
    fn line(&self, byte: usize) -> u64 {
        let byte = byte + self.bytes[byte..].iter().take_while(|byte| matches!(byte, b'\n' | b'\r')).count();
        1 + line_ends(self.bytes, 0, byte)
    }

    /// The same for ascending offsets, in one pass.
    fn lines(&self, offsets: impl Iterator<Item = usize>) -> Vec<u64> {
        let (mut line, mut from) = (1, 0);
        let next = |byte: usize| {
            let byte =
                byte + self.bytes[byte..].iter().take_while(|byte| matches!(byte, b'\n' | b'\r')).count();
            line += line_ends(self.bytes, from, byte);
            from = byte;
            line
        };
        offsets.map(next).collect()
    }

    fn path(&self) -> PathBuf {
        self.path.to_owned()
    }
}

/// Line ends in `bytes[from..to]`: LF, CRLF, or a CR alone. A range that begins at the start of a row is exact.
fn line_ends(bytes: &[u8], from: usize, to: usize) -> u64 {
    let alone = |index: usize| bytes.get(index + 1) != Some(&b'\n');
    (from..to).filter(|&index| bytes[index] == b'\n' || (bytes[index] == b'\r' && alone(index))).count()
        as u64
}

fn check_text(bytes: &[u8], path: &Path) -> Result<(), RecordError> {
    let bad = |byte: usize, what| {
        Err(RecordError::NotText { path: path.to_owned(), byte, line: 1 + line_ends(bytes, 0, byte), what })
    };
    if bytes.starts_with(b"\xFF\xFE") || bytes.starts_with(b"\xFE\xFF") {
        return bad(0, "a UTF-16 byte order mark");
    }
    if bytes.starts_with(b"PK\x03\x04") {
        return bad(0, "the head of a ZIP archive (a spreadsheet?)");
    }
    // Zero bytes are valid UTF-8; whichever trouble comes first is named.
    let zero = bytes.iter().position(|&byte| byte == 0).unwrap_or(bytes.len());
    match std::str::from_utf8(&bytes[..zero]) {
        Err(error) => bad(error.valid_up_to(), "an invalid UTF-8 sequence"),
        Ok(_) if zero < bytes.len() => bad(zero, "a zero byte"),
        Ok(_) => Ok(()),
    }
}

/// The numbers of a file, one column per source of the layout (time first), and where each row begins.
struct Rows {
    columns: Vec<Vec<f64>>,
    offsets: Vec<usize>,
}

impl Rows {
    /// Reads all rows; unless they may be repaired, time stamps that do not increase are errors.
    fn read(place: &Place<'_>, layout: &Layout, repair: bool) -> Result<Self, RecordError> {
        let mut reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .delimiter(layout.delimiter)
            .from_reader(&place.bytes[place.header..]);
        let mut row = csv::ByteRecord::new();
        let mut columns: Vec<Vec<f64>> = vec![Vec::new(); layout.sources.len()];
        let mut offsets: Vec<usize> = Vec::new();
        let mut header_passed = false;
        loop {
            let offset =
                place.header + usize::try_from(reader.position().byte()).unwrap_or(usize::MAX - place.header);
            let more = reader.read_byte_record(&mut row).map_err(|error| RecordError::BadTable {
                path: place.path(),
                line: place.line(offset),
                message: error.to_string(),
            })?;
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
                    path: place.path(),
                    line: place.line(offset),
                    found: row.len(),
                    expected: layout.width,
                    remedy: remedy_for_row(&row, layout),
                });
            }
            for (column, source) in columns.iter_mut().zip(&layout.sources) {
                column.push(number(place, offset, source, row.get(source.index).unwrap_or_default())?);
            }
            if !repair {
                let previous_offset = offsets.last().copied().unwrap_or_default();
                check_time(place, &layout.sources[0].column, &columns[0], offset, previous_offset)?;
            }
            offsets.push(offset);
        }
        if offsets.is_empty() {
            return Err(RecordError::HeaderOnly { path: place.path(), line: place.line(place.header) });
        }
        Ok(Self { columns, offsets })
    }

    /// Drops the rows whose time stamps do not increase; returns their lines.
    fn repair(&mut self, place: &Place<'_>) -> Vec<u64> {
        let Some(keep) = rows_to_keep(&self.columns[0]) else {
            return Vec::new();
        };
        let dropped: Vec<bool> = keep.iter().map(|keep| !keep).collect();
        let lines = place.lines(kept(&self.offsets, &dropped).into_iter());
        for column in &mut self.columns {
            *column = kept(column, &keep);
        }
        self.offsets = kept(&self.offsets, &keep);
        lines
    }

    /// The columns under their names; the velocity stays empty when the file has none.
    fn into_recording(self, place: &Place<'_>, layout: &Layout) -> Result<Recording, RecordError> {
        let samples = self.offsets.len();
        if samples < 2 {
            let line = place.line(self.offsets.last().copied().unwrap_or(place.header));
            return Err(RecordError::TooFewSamples { path: place.path(), line, samples });
        }
        let mut recording = Recording::default();
        for (source, values) in layout.sources.iter().zip(self.columns) {
            match source.role {
                Role::Time => recording.time_s = values,
                Role::Position => recording.position_m = values,
                Role::Force => recording.force_n = values,
                Role::Velocity => {
                    recording.velocity_mps = values;
                    recording.velocity_measured = true;
                }
                Role::ForceVirtual => recording.force_virtual_n = Some(values),
                Role::JointTorque(joint) => {
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

fn number(place: &Place<'_>, offset: usize, source: &Source, field: &[u8]) -> Result<f64, RecordError> {
    // The whole file was checked to be UTF-8; a delimiter cannot split a character.
    let text = std::str::from_utf8(field).unwrap_or_default().trim();
    let Ok(raw) = text.parse::<f64>() else {
        return Err(RecordError::NotANumber {
            path: place.path(),
            line: place.line(offset),
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
        path: place.path(),
        line: place.line(offset),
        column: source.column.name.clone(),
        text: text.to_owned(),
    })
}

/// Why a row may have another number of fields than the header.
fn remedy_for_row(row: &csv::ByteRecord, layout: &Layout) -> &'static str {
    let integer = |field: &[u8]| !field.is_empty() && field.iter().all(|b| b.is_ascii_digit() || *b == b'-');
    if row.iter().any(|field| field.contains(&b'\n') || field.contains(&b'\r')) {
        "a quotation mark that is left open takes the following lines along: close or remove it, or complete or remove the row"
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
        "a quotation mark that is left open takes the following lines along: close or remove it"
    } else if text.replace(',', ".").parse::<f64>().is_ok() {
        "write a decimal point instead of the decimal comma"
    } else {
        "write a decimal number such as 0.0125 or 1.25e-2, or remove the row"
    }
}

/// Checks that the newest time stamp is later than the one before.
fn check_time(
    place: &Place<'_>,
    column: &Column,
    time_s: &[f64],
    offset: usize,
    previous_offset: usize,
) -> Result<(), RecordError> {
    let [.., previous_s, time_s] = *time_s else {
        return Ok(());
    };
    if time_s > previous_s {
        return Ok(());
    }
    let (path, column) = (place.path(), column.name.clone());
    let (line, previous_line) = (place.line(offset), place.line(previous_offset));
    if time_s == previous_s {
        return Err(RecordError::RepeatedTime { path, line, column, time_s, previous_line });
    }
    Err(RecordError::BackwardTime { path, line, column, time_s, previous_s, previous_line })
}
