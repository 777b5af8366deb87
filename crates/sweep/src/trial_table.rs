//! The rows of a sweep in memory, or column by column on disk for sweeps that do not fit into memory.

use crate::trial_row::{Columns, TrialRow};
use std::convert::Infallible;
use std::io;
use std::path::Path;
use stylet_record::disk_table::{DiskTable, DiskTableWriter};

/// Rows in the order of their trials.
pub trait TrialTable {
    /// Error of reading the rows.
    type Error;

    /// Number of rows.
    fn count(&self) -> usize;

    /// One value (`Row::values`) of every row.
    ///
    /// # Errors
    /// Error of reading the rows.
    fn column(&self, value: usize) -> Result<Vec<f64>, Self::Error>;

    /// One row, by its index.
    ///
    /// # Errors
    /// Error of reading the rows.
    fn row(&self, place: usize) -> Result<TrialRow, Self::Error>;

    /// Calls `each` with every row in order.
    ///
    /// # Errors
    /// Error of reading the rows.
    fn for_each_row(&self, each: impl FnMut(&TrialRow)) -> Result<(), Self::Error>;

    /// The error as an I/O error.
    fn into_io_error(error: Self::Error) -> io::Error;
}

impl TrialTable for [TrialRow] {
    type Error = Infallible;

    fn count(&self) -> usize {
        self.len()
    }

    fn column(&self, value: usize) -> Result<Vec<f64>, Infallible> {
        Ok(self.iter().map(|row| row.values.get(value).copied().unwrap_or(f64::NAN)).collect())
    }

    fn row(&self, place: usize) -> Result<TrialRow, Infallible> {
        Ok(self[place].clone())
    }

    fn for_each_row(&self, each: impl FnMut(&TrialRow)) -> Result<(), Infallible> {
        self.iter().for_each(each);
        Ok(())
    }

    fn into_io_error(error: Infallible) -> io::Error {
        match error {}
    }
}

/// Number of columns before the values: trial, seed and redrawn as two 32-bit halves each, which are exact as `f64`.
const INTEGER_COLUMNS: usize = 6;

/// Writes rows to disk.
#[derive(Debug)]
pub struct TrialTableWriter {
    table: DiskTableWriter,
    numbers: Vec<f64>,
}

impl TrialTableWriter {
    /// An empty table in `folder`, in a temporary file that is removed with the table.
    ///
    /// # Errors
    /// An I/O error.
    pub fn new(folder: &Path, columns: &Columns) -> io::Result<Self> {
        Ok(Self {
            table: DiskTableWriter::new(folder, INTEGER_COLUMNS + columns.width())?,
            numbers: Vec::new(),
        })
    }

    /// Adds a row.
    ///
    /// # Errors
    /// An I/O error.
    pub fn push(&mut self, row: &TrialRow) -> io::Result<()> {
        self.numbers.clear();
        for whole in [row.trial, row.seed, row.redrawn] {
            self.numbers.extend([(whole >> 32) as f64, (whole & 0xFFFF_FFFF) as f64]);
        }
        self.numbers.extend(&row.values);
        self.table.push(&self.numbers)
    }

    /// Ends writing and opens the rows for reading.
    ///
    /// # Errors
    /// An I/O error.
    pub fn finish(self) -> io::Result<DiskTrialTable> {
        Ok(DiskTrialTable { table: self.table.finish()? })
    }
}

/// Rows on disk.
#[derive(Debug)]
pub struct DiskTrialTable {
    table: DiskTable,
}

fn row_of(numbers: &[f64], row: &mut TrialRow) {
    let whole = |at: usize| {
        let half = |at: usize| numbers.get(at).copied().unwrap_or_default() as u64;
        half(2 * at) << 32 | half(2 * at + 1)
    };
    (row.trial, row.seed, row.redrawn) = (whole(0), whole(1), whole(2));
    row.values.clear();
    row.values.extend(numbers.iter().skip(INTEGER_COLUMNS));
}

impl TrialTable for DiskTrialTable {
    type Error = io::Error;

    fn count(&self) -> usize {
        self.table.rows()
    }

    fn column(&self, value: usize) -> io::Result<Vec<f64>> {
        let mut all = Vec::with_capacity(self.table.rows());
        let (mut block, mut bytes) = (Vec::new(), Vec::new());
        for number in 0..self.table.block_count() {
            self.table.read_block(number, INTEGER_COLUMNS + value, &mut block, &mut bytes)?;
            all.extend_from_slice(&block);
        }
        Ok(all)
    }

    fn row(&self, place: usize) -> io::Result<TrialRow> {
        let numbers: io::Result<Vec<f64>> =
            (0..self.table.columns()).map(|column| self.table.value(column, place)).collect();
        let mut row = TrialRow::default();
        row_of(&numbers?, &mut row);
        Ok(row)
    }

    fn for_each_row(&self, mut each: impl FnMut(&TrialRow)) -> io::Result<()> {
        let mut row = TrialRow::default();
        self.table.for_each_row(|numbers| {
            row_of(numbers, &mut row);
            each(&row);
            Ok(())
        })
    }

    fn into_io_error(error: io::Error) -> io::Error {
        error
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parallel_trials::run_trials_with_threads;
    use crate::summary::summarise;
    use crate::sweep_file::{Overrides, Sweep};
    use crate::trial_csv::write_csv;

    /// CSV and summary are the same for rows in memory and on disk, 64-bit seeds included.
    #[test]
    fn rows_on_disk_are_those_in_memory() -> io::Result<()> {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/sweeps/noise.ron");
        let sweep =
            Sweep::load(&file, Overrides { trials: Some(300), seed: None }).expect("the shipped sweep");
        let columns = Columns::new(&sweep);
        let mut rows = run_trials_with_threads(&sweep, &columns, 0..300, 1, &|_| {}).expect("it runs");
        // Values that rarely occur.
        rows[7].seed = u64::MAX;
        rows[8].redrawn = 3;
        rows[9].values.fill(f64::NAN);
        let mut writer = TrialTableWriter::new(&std::env::temp_dir(), &columns)?;
        rows.iter().try_for_each(|row| writer.push(row))?;
        let on_disk = writer.finish()?;
        let mut place = 0;
        on_disk.for_each_row(|row| {
            assert_eq!(format!("{row:?}"), format!("{:?}", rows[place]));
            place += 1;
        })?;
        assert_eq!((place, format!("{:?}", on_disk.row(7)?)), (300, format!("{:?}", rows[7])));
        let Ok(expected) = summarise(&sweep, &columns, &rows[..], "DIR");
        assert_eq!(
            serde_json::to_string(&summarise(&sweep, &columns, &on_disk, "DIR")?)?,
            serde_json::to_string(&expected)?
        );
        let (mut here, mut there) = (Vec::new(), Vec::new());
        write_csv(&columns, &rows[..], &mut here)?;
        write_csv(&columns, &on_disk, &mut there)?;
        assert!(here == there && here.len() > 10_000);
        Ok(())
    }
}
