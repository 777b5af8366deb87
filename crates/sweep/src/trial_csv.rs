//! `trials.csv`.

use crate::trial_row::{Columns, TrialRow};
use crate::trial_table::TrialTable;
use std::io::{self, BufWriter, Write};

/// Writes `trials.csv`: a header, then one line per trial; a missing value is an empty field. Numbers are written in the shortest
/// form that reads back as the same bits.
///
/// # Errors
/// An I/O error of the destination or of the rows.
pub fn write_csv<T: TrialTable + ?Sized>(columns: &Columns, rows: &T, output: impl Write) -> io::Result<()> {
    let mut output = BufWriter::new(output);
    writeln!(output, "{}", columns.names().collect::<Vec<_>>().join(","))?;
    let mut written = Ok(());
    let read = rows.for_each_row(|row| {
        if written.is_ok() {
            written = write_row(row, &mut output);
        }
    });
    read.map_err(T::into_io_error)?;
    written?;
    output.flush()
}

fn write_row(row: &TrialRow, output: &mut impl Write) -> io::Result<()> {
    write!(output, "{},{},{}", row.trial, row.seed, row.redrawn)?;
    for value in &row.values {
        match value.is_nan() {
            true => output.write_all(b",")?,
            false => write!(output, ",{value}")?,
        }
    }
    output.write_all(b"\n")
}
