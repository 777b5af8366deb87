//! Errors of reading, checking and writing recordings.

use std::io;
use std::path::PathBuf;

/// Why a recording cannot be read, built or written.
///
/// Each message names the file, the line (1-based, as an editor counts) and the column where these exist, and ends with
/// the remedy. All variants but [`RecordError::Write`] and [`RecordError::TemporaryFile`] mean that the input is wrong.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the message is the documentation of its fields
pub enum RecordError {
    /// The path does not exist.
    #[error("{}: no such file; check the path (it is relative to the current directory)", path.display())]
    NoSuchFile { path: PathBuf },

    /// The path is a folder.
    #[error("{}: is a directory, not a recording; name one CSV file inside it", path.display())]
    IsDirectory { path: PathBuf },

    /// The operating system refuses to read the file.
    #[error("{}: cannot be read ({source}); check that the file is readable by this user", path.display())]
    Unreadable { path: PathBuf, source: io::Error },

    /// The file is empty.
    #[error("{}: the file is empty; a recording has a header line and at least 2 rows of numbers", path.display())]
    EmptyFile { path: PathBuf },

    /// A header without rows.
    #[error("{}: line {line} is a header and no row follows; a recording has at least 2 rows of numbers", path.display())]
    HeaderOnly { path: PathBuf, line: u64 },

    /// Neither text nor a known format.
    #[error("{}: not a text file and of no known format: {what} at byte {byte} (line {line}); export the data as CSV text", path.display())]
    NotText { path: PathBuf, byte: usize, line: u64, what: &'static str },

    /// A file of another program cannot be read.
    #[error("{}: {kind}: {what}", path.display())]
    Foreign { path: PathBuf, kind: &'static str, what: String },

    /// A required column is missing in the header.
    #[error(
        "{}: line {line}: the header has no column \"{column}\" ({what}); it has {}{}; rename the column or give a column map",
        path.display(), list(available), did_you_mean(suggestion.as_deref())
    )]
    MissingColumn {
        path: PathBuf,
        line: u64,
        column: String,
        what: &'static str,
        available: Vec<String>,
        suggestion: Option<String>,
    },

    /// Numbers without column names.
    #[error(
        "{}: line {line}: the header is missing: there is no line of names above the {columns} columns of numbers; give the columns by \
         number in a column map, such as time: (column: 1), or begin the file with a line of names such as time_s,position_m,force_n",
        path.display()
    )]
    NoHeader { path: PathBuf, line: u64, columns: usize },

    /// No rows of numbers.
    #[error("{}: no table: from line {line} on there are no rows of numbers; export the samples as a table, one row per sample", path.display())]
    NoTable { path: PathBuf, line: u64 },

    /// A comma that may be a decimal sign or a separator of thousands.
    #[error(
        "{}: line {line}: nothing decides whether the comma in {text:?} is a decimal sign or separates thousands; give it in a column map, \
         decimal: ',' or decimal: '.'",
        path.display()
    )]
    OpenDecimal { path: PathBuf, line: u64, text: String },

    /// A column number that the file lacks.
    #[error("{}: line {line}: there is no column {number}; the file has {columns} columns", path.display())]
    NoSuchColumn { path: PathBuf, line: u64, number: usize, columns: usize },

    /// Several columns may hold a quantity.
    #[error(
        "{}: line {line}: several columns may hold the {what}: {}; name one in a column map, {field}: (name: ...), or three components \
         with names: [...]",
        path.display(), list(columns)
    )]
    SeveralColumns { path: PathBuf, line: u64, what: &'static str, field: &'static str, columns: Vec<String> },

    /// Position and force were sampled with different clocks.
    #[error(
        "{}: line {line}: the force has the time \"{force}\", the position the time \"{position}\", and they differ; save the position with \
         its time in a file of its own, and join it by a column map: position: (file: \"position.csv\")",
        path.display()
    )]
    TwoClocks { path: PathBuf, line: u64, force: String, position: String },

    /// The name of a required column occurs more than once.
    #[error("{}: line {line}: the header names the column \"{column}\" twice; rename the one that is not meant", path.display())]
    AmbiguousColumn { path: PathBuf, line: u64, column: String },

    /// A field is not a number.
    #[error(
        "{}: line {line}, column \"{column}\": {} is not a number; {remedy}",
        path.display(), excerpt(text)
    )]
    NotANumber { path: PathBuf, line: u64, column: String, text: String, remedy: &'static str },

    /// NaN, infinity, or a number that overflows once scaled.
    #[error(
        "{}: line {line}, column \"{column}\": {} is not a finite number; remove the row or correct the value (and the column map's scale, if any)",
        path.display(), excerpt(text)
    )]
    NotFinite { path: PathBuf, line: u64, column: String, text: String },

    /// A row with more or fewer fields than the header.
    #[error(
        "{}: line {line}: the row has {found} fields, the header has {expected}; {remedy}",
        path.display()
    )]
    RaggedRow { path: PathBuf, line: u64, found: usize, expected: usize, remedy: &'static str },

    /// The differentiated velocity is not finite.
    #[error(
        "{}: line {line}: the velocity, which is the slope of the position, is not finite here: positions are too large or time stamps too close; correct the row, or the scales of time and position in the column map",
        path.display()
    )]
    VelocityNotFinite { path: PathBuf, line: u64 },

    /// Time runs backward.
    #[error(
        "{}: line {line}: time runs backward, {time_s} s after {previous_s} s on line {previous_line}; time must increase from row to \
         row: repair single stamps with --repair",
        path.display()
    )]
    BackwardTime { path: PathBuf, line: u64, time_s: f64, previous_s: f64, previous_line: u64 },

    /// Two rows with the same time.
    #[error(
        "{}: line {line}: the time stamp {time_s} s repeats that of line {previous_line}; time must increase from row to row: repair \
         single stamps with --repair",
        path.display()
    )]
    RepeatedTime { path: PathBuf, line: u64, time_s: f64, previous_line: u64 },

    /// Many rows with the same time.
    #[error(
        "{}: line {line}: the samples arrive in bursts, {rows} rows with {stamps} different time stamps; --repair spreads them evenly, or \
         give the sampling rate in a column map, rate_hz",
        path.display()
    )]
    Bursts { path: PathBuf, line: u64, rows: usize, stamps: usize },

    /// A second recording in the same file.
    #[error(
        "{}: line {line}: a second recording begins here, time falls from {previous_s} s to {time_s} s; put the lines from {line} on into \
         a file of their own",
        path.display()
    )]
    SecondRun { path: PathBuf, line: u64, time_s: f64, previous_s: f64 },

    /// A repair would drop too many rows.
    #[error(
        "{}: line {line}: --repair would drop {dropped} of {rows} rows whose time stamps run backward or repeat, from this line on, and drops at \
         most 1 %; correct the time stamps, cut the file there, or give the sampling rate in a column map, rate_hz",
        path.display()
    )]
    RepairTooMuch { path: PathBuf, line: u64, dropped: usize, rows: usize },

    /// The time is a sample number.
    #[error(
        "{}: line {line}: the time \"{column}\" counts the samples, 1 per row; give the sampling rate in a column map, rate_hz: 200, or \
         time: (name: ..., scale: 1) if it is really one sample per second",
        path.display()
    )]
    SampleNumber { path: PathBuf, line: u64, column: String },

    /// A time that no clock in this unit shows.
    #[error(
        "{}: line {line}: the time \"{column}\" begins at {value:e}: these are {unit} since 1970, not seconds; give a column map with \
         time: (name: ..., scale: {scale:e})",
        path.display()
    )]
    TimeUnit { path: PathBuf, line: u64, column: String, value: f64, unit: &'static str, scale: f64 },

    /// Two files without common time.
    #[error(
        "{}: its time, {} s to {} s, has no part in common with that of {}, {} s to {} s; record both with the same clock, or shift one \
         by time.offset",
        path.display(), own.0, own.1, other_path.display(), other.0, other.1
    )]
    NoOverlap { path: PathBuf, own: (f64, f64), other_path: PathBuf, other: (f64, f64) },

    /// A field of a column map is wrong.
    #[error("column map: {field} must be {must_be}")]
    BadMapField { field: &'static str, must_be: &'static str },

    /// An error with further obstacles and the command that helps.
    #[error("{first}{}\nlook at the file with: stylet inspect {} --write-map map.ron", further_obstacles(others), path.display())]
    Refused { first: Box<RecordError>, others: Vec<String>, path: PathBuf },

    /// Too short to have a velocity.
    #[error("{}: {samples} sample(s) by line {line}; a recording needs at least 2 samples with different time stamps", path.display())]
    TooFewSamples { path: PathBuf, line: u64, samples: usize },

    /// The CSV syntax is invalid.
    #[error("{}: line {line}: {message}; correct the row (a quotation mark left open?)", path.display())]
    BadTable { path: PathBuf, line: u64, message: String },

    /// A value in a column map is out of range.
    #[error("column map: {field} = {value} for the column \"{column}\"; it must be {must_be}")]
    BadColumnMap { field: &'static str, column: String, value: f64, must_be: &'static str },

    /// A name in a column map is empty.
    #[error("column map: {field} is empty; it must be a name in the header of the file")]
    EmptyColumnName { field: &'static str },

    /// Columns in memory have different lengths.
    #[error(
        "column {column} has {found} values and the recording {expected} samples; each column needs one value per sample"
    )]
    LengthMismatch { column: String, found: usize, expected: usize },

    /// A value in memory is NaN or infinite.
    #[error("column {column}: the value at index {index} is {value}; every value must be finite")]
    NotFiniteAt { column: String, index: usize, value: f64 },

    /// Time in memory does not increase.
    #[error(
        "column time_s: {time_s} s at index {index} follows {previous_s} s; time must increase from sample to sample"
    )]
    TimeNotIncreasing { index: usize, time_s: f64, previous_s: f64 },

    /// Fewer than two samples in memory.
    #[error("{samples} sample(s) given; a recording needs at least 2")]
    TooShort { samples: usize },

    /// Recordings with blocking quality notes.
    #[error(
        "{}{}\nlook at a file with: stylet inspect FILE --write-map map.ron",
        refused_heading(*of, *recordings), wrong.join("\n")
    )]
    Unusable { of: usize, recordings: usize, wrong: Vec<String> },

    /// The same recording under several names.
    #[error(
        "the same recording was given more than once, and would be fitted and held out at once: {}; name each recording once",
        copies.join(", ")
    )]
    Copies { copies: Vec<String> },

    /// An extra column has an invalid name.
    #[error("the extra column \"{name}\" cannot be written: {why}; choose another name")]
    BadColumnName { name: String, why: &'static str },

    /// The temporary files of a long log cannot be written.
    #[error(
        "{}: the temporary files of this log cannot be written ({source}); free about 150 bytes per sample, or choose a folder on \
         another disk with --out",
        path.display()
    )]
    TemporaryFile { path: PathBuf, source: io::Error },

    /// More rows out of time order than can be repaired together.
    #[error(
        "{}: from line {line} on the time stamps of more than {rows} rows are out of order together; cut the log there (was the \
         clock set?) and enhance the parts",
        path.display()
    )]
    DisorderTooLong { path: PathBuf, line: u64, rows: usize },

    /// The destination cannot be written.
    #[error("the recording cannot be written ({0}); check that the destination exists and has room")]
    Write(#[from] io::Error),
}

/// Further obstacles, one per line.
fn further_obstacles(others: &[String]) -> String {
    let mut text = String::new();
    for (at, other) in others.iter().enumerate() {
        text.push_str(if at == 0 { "\nfurther obstacles:" } else { "" });
        text.push_str("\n  ");
        text.push_str(other);
    }
    text
}

/// Introduction to the list of refused recordings; empty for a single one.
fn refused_heading(of: usize, wrong: usize) -> String {
    if of == 1 {
        String::new()
    } else {
        format!("{wrong} of {of} recordings cannot be used; no diagnosis was made:\n")
    }
}

fn excerpt(text: &str) -> String {
    const LONGEST: usize = 40;
    if text.is_empty() {
        return "an empty field".to_owned();
    }
    if text.chars().count() <= LONGEST {
        return format!("{text:?}");
    }
    let head: String = text.chars().take(LONGEST).collect();
    format!("{head:?}...")
}

fn list(names: &[String]) -> String {
    const MOST: usize = 12;
    let mut text = names.iter().take(MOST).map(|name| format!("\"{name}\"")).collect::<Vec<_>>().join(", ");
    if names.len() > MOST {
        text.push_str(&format!(" and {} more", names.len() - MOST));
    }
    text
}

fn did_you_mean(suggestion: Option<&str>) -> String {
    suggestion.map(|name| format!("; the closest is \"{name}\"")).unwrap_or_default()
}
