//! The rows of a sweep wherever they are: in memory, or column by column on disk, where millions of trials take no memory.

use crate::trial_row::{Columns, TrialRow};
use std::convert::Infallible;
use std::io;
use std::path::Path;
use stylet_record::disk_table::{DiskTable, DiskTableWriter};

/// Rows in the order of their trials.
pub trait TrialTable {
    /// What can go wrong on the way.
    type Error;

    /// How many.
    fn count(&self) -> usize;

    /// One of the values (`Row::values`) of every row.
    ///
    /// # Errors
    /// What can go wrong on the way.
    fn column(&self, value: usize) -> Result<Vec<f64>, Self::Error>;

    /// One row, by its place.
    ///
    /// # Errors
    /// What can go wrong on the way.
    fn row(&self, place: usize) -> Result<TrialRow, Self::Error>;

    /// Hands over all rows.
    ///
    /// # Errors
    /// What can go wrong on the way.
    fn for_each_row(&self, each: impl FnMut(&TrialRow)) -> Result<(), Self::Error>;

    /// What went wrong, as the system would say it.
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

/// Numbers of a row before its values: trial, seed and redrawn in halves, of which every one is exact.
const WHOLE: usize = 6;

/// Rows that go to the disk.
#[derive(Debug)]
pub struct TrialTableWriter {
    table: DiskTableWriter,
    numbers: Vec<f64>,
}

impl TrialTableWriter {
    /// No rows yet; they will lie in the folder, in a file that is gone with them.
    ///
    /// # Errors
    /// What the system says.
    pub fn new(folder: &Path, columns: &Columns) -> io::Result<Self> {
        Ok(Self { table: DiskTableWriter::new(folder, WHOLE + columns.width())?, numbers: Vec::new() })
    }

    /// Adds a row.
    ///
    /// # Errors
    /// What the system says.
    pub fn push(&mut self, row: &TrialRow) -> io::Result<()> {
        self.numbers.clear();
        for whole in [row.trial, row.seed, row.redrawn] {
            self.numbers.extend([(whole >> 32) as f64, (whole & 0xFFFF_FFFF) as f64]);
        }
        self.numbers.extend(&row.values);
        self.table.push(&self.numbers)
    }

    /// The rows, to be read.
    ///
    /// # Errors
    /// What the system says.
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
    row.values.extend(numbers.iter().skip(WHOLE));
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
            self.table.read_block(number, WHOLE + value, &mut block, &mut bytes)?;
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
    use crate::{Overrides, Sweep, run_trials_with_threads, summarise, write_csv};

    /// Tables and summary are the same wherever the rows are, seeds of 64 bits included.
    #[test]
    fn rows_on_disk_are_those_in_memory() -> io::Result<()> {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/sweeps/noise.ron");
        let sweep =
            Sweep::load(&file, Overrides { trials: Some(300), seed: None }).expect("the shipped sweep");
        let columns = Columns::new(&sweep);
        let mut rows = run_trials_with_threads(&sweep, &columns, 0..300, 1, &|_| {}).expect("it runs");
        // Some that are rare.
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
