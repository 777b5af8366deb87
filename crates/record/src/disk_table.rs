//! Tables of numbers in temporary files, and sorting on disk.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::fs::{self, File};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// Prefix of the names of temporary files.
pub const TEMP_FILE_PREFIX: &str = ".stylet-scratch-";
/// Rows per block.
pub const BLOCK_ROWS: usize = 1 << 14;
/// Values per sorted run.
const RUN_LENGTH: usize = 1 << 20;
/// Buffered values per run while merging.
const MERGE_BUFFER: usize = 1 << 11;

/// A temporary file. On Unix it is unlinked at once, so that it disappears even when the process is killed.
#[derive(Debug)]
struct TempFile {
    file: File,
    path: PathBuf,
}

impl TempFile {
    fn new(folder: &Path) -> io::Result<Self> {
        static NUMBER: AtomicU64 = AtomicU64::new(0);
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        let path = folder.join(format!("{TEMP_FILE_PREFIX}{}-{number}", std::process::id()));
        let file = File::options().read(true).write(true).create_new(true).open(&path)?;
        if cfg!(unix) {
            fs::remove_file(&path)?;
        }
        Ok(Self { file, path })
    }

    fn write(&mut self, numbers: &[f64], bytes: &mut Vec<u8>) -> io::Result<()> {
        bytes.clear();
        numbers.iter().for_each(|x| bytes.extend_from_slice(&x.to_le_bytes()));
        self.file.write_all(bytes)
    }

    fn read(&self, from: u64, into: &mut [f64], bytes: &mut Vec<u8>) -> io::Result<()> {
        bytes.resize(into.len() * 8, 0);
        let mut file = &self.file;
        file.seek(SeekFrom::Start(from * 8))?;
        file.read_exact(bytes)?;
        for (number, bytes) in into.iter_mut().zip(bytes.chunks_exact(8)) {
            *number = f64::from_le_bytes(bytes.try_into().unwrap_or_default());
        }
        Ok(())
    }
}

impl Drop for TempFile {
    fn drop(&mut self) {
        if !cfg!(unix) {
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// Writer of a [`DiskTable`].
#[derive(Debug)]
pub struct DiskTableWriter {
    file: TempFile,
    /// Columns of the current block.
    block: Vec<Vec<f64>>,
    rows: usize,
    bytes: Vec<u8>,
}

impl DiskTableWriter {
    /// An empty table in a temporary file in the folder, which is deleted with the table.
    ///
    /// # Errors
    /// The error of the system.
    pub fn new(folder: &Path, columns: usize) -> io::Result<Self> {
        let block = vec![Vec::with_capacity(BLOCK_ROWS); columns];
        Ok(Self { file: TempFile::new(folder)?, block, rows: 0, bytes: Vec::new() })
    }

    /// Adds a row; missing values are NaN, surplus values are ignored.
    ///
    /// # Errors
    /// The error of the system.
    #[inline]
    pub fn push(&mut self, row: &[f64]) -> io::Result<()> {
        for (at, column) in self.block.iter_mut().enumerate() {
            column.push(row.get(at).copied().unwrap_or(f64::NAN));
        }
        self.rows += 1;
        if self.rows.is_multiple_of(BLOCK_ROWS) { self.flush() } else { Ok(()) }
    }

    fn flush(&mut self) -> io::Result<()> {
        for column in &mut self.block {
            // Blocks have equal length, so that offsets follow from block numbers.
            column.resize(BLOCK_ROWS, f64::NAN);
            self.file.write(column, &mut self.bytes)?;
            column.clear();
        }
        Ok(())
    }

    /// Finishes the table for reading.
    ///
    /// # Errors
    /// The error of the system.
    pub fn finish(mut self) -> io::Result<DiskTable> {
        if !self.rows.is_multiple_of(BLOCK_ROWS) {
            self.flush()?;
        }
        Ok(DiskTable { file: self.file, columns: self.block.len(), rows: self.rows })
    }
}

/// A table of numbers on disk, column by column in blocks of [`BLOCK_ROWS`] rows.
#[derive(Debug)]
pub struct DiskTable {
    file: TempFile,
    columns: usize,
    rows: usize,
}

impl DiskTable {
    /// Number of rows.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Calls `each` with every row.
    ///
    /// # Errors
    /// The system's or that of `each`.
    pub fn for_each_row<E: From<io::Error>>(
        &self,
        mut each: impl FnMut(&[f64]) -> Result<(), E>,
    ) -> Result<(), E> {
        let mut buffer = vec![Vec::new(); self.columns];
        let (mut bytes, mut row) = (Vec::new(), vec![0.0; self.columns]);
        for block in 0..self.block_count() {
            for (column, buffer) in buffer.iter_mut().enumerate() {
                self.read_block(block, column, buffer, &mut bytes)?;
            }
            for at in 0..buffer.first().map_or(0, Vec::len) {
                row.iter_mut().zip(&buffer).for_each(|(x, buffer)| *x = buffer[at]);
                each(&row)?;
            }
        }
        Ok(())
    }

    /// Number of columns.
    #[must_use]
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Number of blocks.
    #[must_use]
    pub fn block_count(&self) -> usize {
        self.rows.div_ceil(BLOCK_ROWS)
    }

    /// Reads one column of one block.
    ///
    /// # Errors
    /// The error of the system.
    pub fn read_block(
        &self,
        block: usize,
        column: usize,
        into: &mut Vec<f64>,
        bytes: &mut Vec<u8>,
    ) -> io::Result<()> {
        into.resize(BLOCK_ROWS.min(self.rows.saturating_sub(block * BLOCK_ROWS)), 0.0);
        self.file.read(((block * self.columns + column) * BLOCK_ROWS) as u64, into, bytes)
    }

    /// One value.
    ///
    /// # Errors
    /// The error of the system.
    pub fn value(&self, column: usize, row: usize) -> io::Result<f64> {
        let mut found = [f64::NAN];
        let place = (row / BLOCK_ROWS * self.columns + column) * BLOCK_ROWS + row % BLOCK_ROWS;
        self.file.read(place as u64, &mut found, &mut Vec::new())?;
        Ok(found[0])
    }
}

/// External merge sort: runs sorted in memory, then one merge.
#[derive(Debug)]
pub(crate) struct ExternalSort {
    folder: PathBuf,
    runs: TempFile,
    lengths: Vec<usize>,
    current: Vec<f64>,
    bytes: Vec<u8>,
}

impl ExternalSort {
    pub(crate) fn new(folder: &Path) -> io::Result<Self> {
        let runs = TempFile::new(folder)?;
        Ok(Self {
            folder: folder.to_owned(),
            runs,
            lengths: Vec::new(),
            current: Vec::new(),
            bytes: Vec::new(),
        })
    }

    pub(crate) fn push(&mut self, x: f64) -> io::Result<()> {
        self.current.push(x);
        if self.current.len() < RUN_LENGTH { Ok(()) } else { self.write_run() }
    }

    fn write_run(&mut self) -> io::Result<()> {
        self.current.sort_unstable_by(f64::total_cmp);
        for part in self.current.chunks(BLOCK_ROWS) {
            self.runs.write(part, &mut self.bytes)?;
        }
        self.lengths.push(self.current.len());
        self.current.clear();
        Ok(())
    }

    /// All values in ascending order, as a table of one column.
    pub(crate) fn finish(mut self) -> io::Result<DiskTable> {
        self.write_run()?;
        self.current = Vec::new();
        let mut sorted = DiskTableWriter::new(&self.folder, 1)?;
        let mut from = 0;
        let mut runs: Vec<SortedRun> = Vec::with_capacity(self.lengths.len());
        for length in &self.lengths {
            runs.push(SortedRun { next: from, end: from + *length as u64, at: 0, buffer: Vec::new() });
            from += *length as u64;
        }
        let mut heads = BinaryHeap::new();
        for (number, run) in runs.iter_mut().enumerate() {
            if let Some(x) = run.take(&self.runs, &mut self.bytes)? {
                heads.push(Reverse((Ordered(x), number)));
            }
        }
        while let Some(mut head) = heads.peek_mut() {
            let Reverse((Ordered(x), number)) = *head;
            sorted.push(&[x])?;
            match runs[number].take(&self.runs, &mut self.bytes)? {
                Some(next) => *head = Reverse((Ordered(next), number)),
                None => {
                    std::collections::binary_heap::PeekMut::pop(head);
                }
            }
        }
        sorted.finish()
    }
}

/// A sorted run during the merge.
struct SortedRun {
    next: u64,
    end: u64,
    at: usize,
    buffer: Vec<f64>,
}

impl SortedRun {
    fn take(&mut self, from: &TempFile, bytes: &mut Vec<u8>) -> io::Result<Option<f64>> {
        if self.at == self.buffer.len() {
            let count = (self.end - self.next).min(MERGE_BUFFER as u64);
            self.buffer.resize(count as usize, 0.0);
            from.read(self.next, &mut self.buffer, bytes)?;
            self.next += count;
            self.at = 0;
        }
        let x = self.buffer.get(self.at).copied();
        self.at += 1;
        if x.is_none() {
            self.at = self.buffer.len();
        }
        Ok(x)
    }
}

/// A value ordered by [`f64::total_cmp`].
struct Ordered(f64);

impl PartialEq for Ordered {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Ordered {}

impl PartialOrd for Ordered {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Ordered {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder() -> PathBuf {
        std::env::temp_dir()
    }

    fn scatter(count: usize) -> impl Iterator<Item = f64> {
        let mut state = 5_u64;
        (0..count).map(move |_| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f64 - 8e6
        })
    }

    #[test]
    fn a_table_round_trips_over_several_blocks() -> io::Result<()> {
        let rows = 2 * BLOCK_ROWS + 77;
        let mut table = DiskTableWriter::new(&folder(), 2)?;
        for x in scatter(rows) {
            table.push(&[x, -x])?;
        }
        let table = table.finish()?;
        let (mut first, mut second) = (Vec::new(), Vec::new());
        table.for_each_row(|row| {
            first.push(row[0]);
            second.push(row[1]);
            io::Result::Ok(())
        })?;
        assert!(
            first.iter().copied().eq(scatter(rows)) && second.iter().copied().eq(scatter(rows).map(|x| -x))
        );
        for row in [0, BLOCK_ROWS - 1, BLOCK_ROWS, rows - 1] {
            assert_eq!(Some(table.value(0, row)?), scatter(rows).nth(row));
        }
        Ok(())
    }

    #[test]
    fn sorting_on_disk_equals_sorting_in_memory() -> io::Result<()> {
        for count in [0, 1, 1000, 2 * RUN_LENGTH, 2 * RUN_LENGTH + 12_345] {
            let mut sorting = ExternalSort::new(&folder())?;
            scatter(count).try_for_each(|x| sorting.push(x))?;
            let mut sorted = Vec::new();
            sorting.finish()?.for_each_row(|row| {
                sorted.push(row[0]);
                io::Result::Ok(())
            })?;
            let mut expected: Vec<f64> = scatter(count).collect();
            expected.sort_unstable_by(f64::total_cmp);
            assert_eq!(sorted, expected, "{count}");
        }
        Ok(())
    }
}
