//! Texts that are read in several passes, and their line numbers.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use encoding_rs::Encoding;

use super::encoding::DecodingReader;
use crate::error::RecordError;

/// Size of a read in bytes.
pub(crate) const CHUNK_BYTES: usize = 1 << 16;
/// Fewest lines of [`SourceFile::spread_lines`] of a long text.
const SPREAD_LINES: usize = 256;

/// Offset of the header line: the first line that is not blank, after a byte order mark.
pub(crate) fn header_start(bytes: &[u8]) -> Option<usize> {
    let start = if bytes.starts_with(b"\xEF\xBB\xBF") { 3 } else { 0 };
    let header = start + bytes[start..].iter().position(|byte| !byte.is_ascii_whitespace())?;
    // Tabs and spaces before the first name belong to the header line.
    let line = bytes[..header].iter().rposition(|byte| matches!(byte, b'\n' | b'\r'));
    Some(line.map_or(start, |end| end + 1))
}

/// A text that is read in several passes.
#[derive(Clone, Copy)]
pub(crate) enum TextSource<'a> {
    /// In UTF-8.
    Bytes(&'a [u8]),
    /// In UTF-8.
    File(&'a File),
    /// Rows of a table; an offset is the number of a row, whose line follows that of the names.
    Rows,
    /// In another encoding; offsets are those of the text in UTF-8.
    Encoded(&'a File, &'static Encoding),
}

impl TextSource<'_> {
    /// A reader from a byte offset on.
    pub(crate) fn reader_at(&self, byte: usize) -> io::Result<Box<dyn Read + '_>> {
        match self {
            Self::Bytes(bytes) => Ok(Box::new(bytes.get(byte..).unwrap_or_default())),
            Self::Rows => Ok(Box::new(io::empty())),
            Self::File(file) => {
                let mut file: &File = file;
                file.seek(SeekFrom::Start(byte as u64))?;
                Ok(Box::new(file))
            }
            Self::Encoded(file, encoding) => {
                let mut file: &File = file;
                file.seek(SeekFrom::Start(0))?;
                let mut text = DecodingReader::new(file, encoding);
                io::copy(&mut (&mut text).take(byte as u64), &mut io::sink())?;
                Ok(Box::new(text))
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

    /// [`SourceFile::line_of_row`] for ascending offsets, in one pass.
    pub(crate) fn lines_of_offsets(
        &self,
        offsets: impl Iterator<Item = usize>,
    ) -> Result<Vec<u64>, RecordError> {
        if matches!(self.text, TextSource::Rows) {
            return Ok(offsets.map(|row| row as u64 + 2).collect());
        }
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

    /// Lines spread evenly over the text from the header on: every line, every second one, every fourth one, ..., up to twice [`SPREAD_LINES`].
    pub(crate) fn spread_lines(&self) -> Result<Vec<String>, RecordError> {
        let from = self.text.reader_at(self.header).map_err(|source| self.unreadable(source))?;
        let mut text = BufReader::with_capacity(CHUNK_BYTES, from);
        let (mut lines, mut line, mut is_blank) = (Vec::new(), Vec::new(), true);
        let (mut number, mut stride) = (0_usize, 1);
        loop {
            let chunk = text.fill_buf().map_err(|source| self.unreadable(source))?;
            let end = chunk.iter().position(|byte| matches!(byte, b'\n' | b'\r'));
            let (count, is_last) = (end.unwrap_or(chunk.len()), chunk.is_empty());
            let is_kept = number.is_multiple_of(stride);
            if is_kept && line.len() < CHUNK_BYTES {
                line.extend_from_slice(&chunk[..count]);
            }
            is_blank &= count == 0;
            text.consume(count + usize::from(end.is_some()));
            if end.is_none() && !is_last {
                continue;
            }
            if is_kept && !is_blank {
                lines.push(String::from_utf8_lossy(&line).into_owned());
            }
            // A line end of two characters gives an empty line, which is not counted.
            number += usize::from(!is_blank);
            line.clear();
            is_blank = true;
            if lines.len() == 2 * SPREAD_LINES {
                lines = lines.into_iter().step_by(2).collect();
                stride *= 2;
            }
            if is_last {
                return Ok(lines);
            }
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

/// Check of a text in UTF-8 without zero bytes, piece by piece.
#[derive(Debug, Default)]
pub(crate) struct Utf8Check {
    /// The beginning of a character that continues in the next piece.
    open: Vec<u8>,
}

impl Utf8Check {
    /// Whether the text is valid so far.
    pub(crate) fn push(&mut self, piece: &[u8]) -> bool {
        let joined;
        let bytes = if self.open.is_empty() {
            piece
        } else {
            self.open.extend_from_slice(piece);
            joined = std::mem::take(&mut self.open);
            &joined
        };
        if bytes.contains(&0) {
            return false;
        }
        match std::str::from_utf8(bytes) {
            Ok(_) => true,
            Err(error) if error.error_len().is_some() => false,
            Err(error) => {
                self.open = bytes[error.valid_up_to()..].to_vec();
                true
            }
        }
    }

    /// Whether the text ends with a whole character.
    pub(crate) fn finish(&self) -> bool {
        self.open.is_empty()
    }
}
