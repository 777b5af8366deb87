//! Columns of numbers on disk, for what memory should not hold: written once, gone through often, gone with their owner.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::fs::{self, File};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// How the names of files begin that only live while they are written.
pub const TEMP_FILE_PREFIX: &str = ".stylet-scratch-";
/// Rows that are read and written together.
pub const BLOCK_ROWS: usize = 1 << 14;
/// Numbers that are sorted in memory.
const SORTED_AT_ONCE: usize = 1 << 20;
/// Numbers of each sorted stretch at hand while stretches are merged.
const MERGED_AT_ONCE: usize = 1 << 11;

/// A file that nobody else sees: where the system allows it has no name, so that not even a kill leaves it behind.
#[derive(Debug)]
struct Hidden {
    file: File,
    path: PathBuf,
}

impl Hidden {
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

impl Drop for Hidden {
    fn drop(&mut self) {
        if !cfg!(unix) {
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// A table of numbers on its way to the disk.
#[derive(Debug)]
pub struct DiskTableWriter {
    hidden: Hidden,
    /// The columns of the block that is filled.
    block: Vec<Vec<f64>>,
    rows: usize,
    bytes: Vec<u8>,
}

impl DiskTableWriter {
    /// An empty table with so many columns, in a file within the folder that is gone with the table.
    ///
    /// # Errors
    /// What the system says.
    pub fn new(folder: &Path, columns: usize) -> io::Result<Self> {
        let block = vec![Vec::with_capacity(BLOCK_ROWS); columns];
        Ok(Self { hidden: Hidden::new(folder)?, block, rows: 0, bytes: Vec::new() })
    }

    /// Adds a row; what is missing in it is not a number, what is too much is left out.
    ///
    /// # Errors
    /// What the system says.
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
            // All blocks are as long, so that each is found by its number.
            column.resize(BLOCK_ROWS, f64::NAN);
            self.hidden.write(column, &mut self.bytes)?;
            column.clear();
        }
        Ok(())
    }

    /// The table, to be read.
    ///
    /// # Errors
    /// What the system says.
    pub fn finish(mut self) -> io::Result<DiskTable> {
        if !self.rows.is_multiple_of(BLOCK_ROWS) {
            self.flush()?;
        }
        Ok(DiskTable { hidden: self.hidden, columns: self.block.len(), rows: self.rows })
    }
}

/// A table of numbers on disk, column by column in blocks of [`BLOCK`] rows.
#[derive(Debug)]
pub struct DiskTable {
    hidden: Hidden,
    columns: usize,
    rows: usize,
}

impl DiskTable {
    /// Number of rows.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Hands over the rows, one by one.
    ///
    /// # Errors
    /// What the system or `each` says.
    pub fn for_each_row<E: From<io::Error>>(
        &self,
        mut each: impl FnMut(&[f64]) -> Result<(), E>,
    ) -> Result<(), E> {
        let mut held = vec![Vec::new(); self.columns];
        let (mut bytes, mut row) = (Vec::new(), vec![0.0; self.columns]);
        for block in 0..self.block_count() {
            for (column, held) in held.iter_mut().enumerate() {
                self.read_block(block, column, held, &mut bytes)?;
            }
            for at in 0..held.first().map_or(0, Vec::len) {
                row.iter_mut().zip(&held).for_each(|(x, held)| *x = held[at]);
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
    /// What the system says.
    pub fn read_block(
        &self,
        block: usize,
        column: usize,
        into: &mut Vec<f64>,
        bytes: &mut Vec<u8>,
    ) -> io::Result<()> {
        into.resize(BLOCK_ROWS.min(self.rows.saturating_sub(block * BLOCK_ROWS)), 0.0);
        self.hidden.read(((block * self.columns + column) * BLOCK_ROWS) as u64, into, bytes)
    }

    /// One number.
    ///
    /// # Errors
    /// What the system says.
    pub fn value(&self, column: usize, row: usize) -> io::Result<f64> {
        let mut found = [f64::NAN];
        let place = (row / BLOCK_ROWS * self.columns + column) * BLOCK_ROWS + row % BLOCK_ROWS;
        self.hidden.read(place as u64, &mut found, &mut Vec::new())?;
        Ok(found[0])
    }
}

/// Numbers that are being sorted on disk: stretches in memory, then one merge.
#[derive(Debug)]
pub(crate) struct ExternalSort {
    folder: PathBuf,
    stretches: Hidden,
    lengths: Vec<usize>,
    now: Vec<f64>,
    bytes: Vec<u8>,
}

impl ExternalSort {
    pub(crate) fn new(folder: &Path) -> io::Result<Self> {
        let stretches = Hidden::new(folder)?;
        Ok(Self {
            folder: folder.to_owned(),
            stretches,
            lengths: Vec::new(),
            now: Vec::new(),
            bytes: Vec::new(),
        })
    }

    pub(crate) fn push(&mut self, x: f64) -> io::Result<()> {
        self.now.push(x);
        if self.now.len() < SORTED_AT_ONCE { Ok(()) } else { self.stretch() }
    }

    fn stretch(&mut self) -> io::Result<()> {
        self.now.sort_unstable_by(f64::total_cmp);
        for part in self.now.chunks(BLOCK_ROWS) {
            self.stretches.write(part, &mut self.bytes)?;
        }
        self.lengths.push(self.now.len());
        self.now.clear();
        Ok(())
    }

    /// All numbers in ascending order, as a table of one column.
    pub(crate) fn finish(mut self) -> io::Result<DiskTable> {
        self.stretch()?;
        self.now = Vec::new();
        let mut sorted = DiskTableWriter::new(&self.folder, 1)?;
        let mut from = 0;
        let mut stretches: Vec<Stretch> = Vec::with_capacity(self.lengths.len());
        for length in &self.lengths {
            stretches.push(Stretch { next: from, end: from + *length as u64, at: 0, held: Vec::new() });
            from += *length as u64;
        }
        let mut heads = BinaryHeap::new();
        for (number, stretch) in stretches.iter_mut().enumerate() {
            if let Some(x) = stretch.take(&self.stretches, &mut self.bytes)? {
                heads.push(Reverse((Ordered(x), number)));
            }
        }
        while let Some(mut head) = heads.peek_mut() {
            let Reverse((Ordered(x), number)) = *head;
            sorted.push(&[x])?;
            match stretches[number].take(&self.stretches, &mut self.bytes)? {
                Some(next) => *head = Reverse((Ordered(next), number)),
                None => {
                    std::collections::binary_heap::PeekMut::pop(head);
                }
            }
        }
        sorted.finish()
    }
}

/// A sorted stretch that is being merged.
struct Stretch {
    next: u64,
    end: u64,
    at: usize,
    held: Vec<f64>,
}

impl Stretch {
    fn take(&mut self, from: &Hidden, bytes: &mut Vec<u8>) -> io::Result<Option<f64>> {
        if self.at == self.held.len() {
            let count = (self.end - self.next).min(MERGED_AT_ONCE as u64);
            self.held.resize(count as usize, 0.0);
            from.read(self.next, &mut self.held, bytes)?;
            self.next += count;
            self.at = 0;
        }
        let x = self.held.get(self.at).copied();
        self.at += 1;
        if x.is_none() {
            self.at = self.held.len();
        }
        Ok(x)
    }
}

/// A number ordered by [`f64::total_cmp`].
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
    fn a_table_gives_back_its_rows_over_several_blocks() -> io::Result<()> {
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
    fn numbers_sorted_on_disk_are_those_sorted_in_memory() -> io::Result<()> {
        for count in [0, 1, 1000, 2 * SORTED_AT_ONCE, 2 * SORTED_AT_ONCE + 12_345] {
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
