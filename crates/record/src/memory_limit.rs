//! Limit on the memory that reading a file may take, for the whole process.
//!
//! A file declares its size (rows of a column, cells of a sheet, bytes of a page), and a small damaged or malicious one may declare any
//! number. Readers compare the declared size, or the bytes received from a pipe, with the limit before they allocate.

use crate::error::RecordError;
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

/// No limit.
const UNLIMITED: u64 = u64::MAX;
/// The limit in bytes.
static LIMIT_BYTES: AtomicU64 = AtomicU64::new(UNLIMITED);

/// Bytes of a value read into a column, with the copy that the recording takes.
#[cfg_attr(not(feature = "formats"), allow(dead_code))]
pub(crate) const VALUE_BYTES: u64 = 16;
/// Bytes of a line of text once it is read: its columns, and the place of the line.
const LINE_BYTES: u64 = 64;
/// Memory of a text that grows while it is read, in units of its length.
const GROWTH: u64 = 2;

/// Sets the limit in bytes for all files that this process reads from now on.
pub fn set_memory_limit(bytes: u64) {
    LIMIT_BYTES.store(bytes, Ordering::Relaxed);
}

/// The limit in bytes.
pub(crate) fn limit_bytes() -> u64 {
    LIMIT_BYTES.load(Ordering::Relaxed)
}

/// Rejects an allocation above the limit; `what` is the subject of the message.
pub(crate) fn check(what: &str, bytes: u64) -> Result<(), String> {
    let limit = limit_bytes();
    if bytes <= limit {
        return Ok(());
    }
    let shown = |bytes: u64| match bytes {
        1_000_000_000.. => format!("{} GB", bytes as f64 / 1e9),
        _ => format!("{} MB", bytes as f64 / 1e6),
    };
    let needed = (bytes as f64 / 1e5).ceil() * 1e5;
    Err(format!(
        "{what} needs about {} of memory, and the limit is {}: cut the recording to the insertion, or raise --limit-memory",
        shown(needed as u64),
        shown(limit)
    ))
}

/// The bytes of a file, or of a pipe until it ends or the limit is reached.
pub(crate) fn read_limited(path: &Path) -> Result<Vec<u8>, RecordError> {
    let unreadable = |source: io::Error| match source.kind() {
        io::ErrorKind::NotFound => RecordError::NoSuchFile { path: path.to_owned() },
        _ => RecordError::Unreadable { path: path.to_owned(), source },
    };
    let too_large = |what: String| RecordError::Foreign { path: path.to_owned(), kind: "too large", what };
    let file = File::open(path).map_err(unreadable)?;
    let declared = file.metadata().map_err(unreadable)?.len();
    check("the file", declared).map_err(too_large)?;
    let limit = limit_bytes();
    let most = limit / GROWTH;
    let mut bytes = Vec::with_capacity(usize::try_from(declared).unwrap_or(0));
    file.take(declared.max(most).saturating_add(1)).read_to_end(&mut bytes).map_err(unreadable)?;
    if bytes.len() as u64 > declared.max(most) {
        check("what the pipe delivers", limit.saturating_add(1)).map_err(too_large)?;
    }
    Ok(bytes)
}

/// Rejects a text whose numbers would take more than the limit.
pub(crate) fn check_text(bytes: &[u8], path: &Path) -> Result<(), RecordError> {
    let lines = bytes.iter().filter(|byte| **byte == b'\n').count() as u64;
    let needed = (bytes.len() as u64).saturating_add(lines.saturating_mul(LINE_BYTES));
    check(&format!("the file with its {lines} lines"), needed).map_err(|what| RecordError::Foreign {
        path: path.to_owned(),
        kind: "too large",
        what,
    })
}
