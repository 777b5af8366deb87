//! Parquet files.

use super::columns_to_csv::NumericColumns;
use bytes::Bytes;
use parquet::column::reader::ColumnReader;
use parquet::data_type::DataType;
use parquet::file::reader::{FileReader, SerializedFileReader};

/// An open file.
pub(super) struct File {
    reader: SerializedFileReader<Bytes>,
}

impl File {
    pub(super) fn open(bytes: &[u8]) -> Result<Self, String> {
        let reader = SerializedFileReader::new(Bytes::copy_from_slice(bytes)).map_err(damaged)?;
        Ok(Self { reader })
    }
}

fn damaged(why: impl std::fmt::Display) -> String {
    format!("it cannot be read ({why}); is it complete?")
}

/// Rows per read.
const BATCH_ROWS: usize = 1 << 16;

/// All values of a column of one row group; NaN for nulls.
fn read<T: DataType>(
    reader: &mut parquet::column::reader::ColumnReaderImpl<T>,
    optional: bool,
    out: &mut Vec<f64>,
    to: impl Fn(&T::T) -> f64,
) -> Result<(), String> {
    let (mut values, mut levels_read) = (Vec::new(), Vec::new());
    loop {
        values.clear();
        levels_read.clear();
        let levels = if optional { Some(&mut levels_read) } else { None };
        let (rows, _, _) = reader.read_records(BATCH_ROWS, levels, None, &mut values).map_err(damaged)?;
        if rows == 0 {
            return Ok(());
        }
        if optional {
            let most = levels_read.iter().copied().max().unwrap_or(0).max(1);
            let mut next = values.iter();
            for level in &levels_read {
                let value = if *level == most { next.next() } else { None };
                out.push(value.map_or(f64::NAN, &to));
            }
        } else {
            out.extend(values.iter().map(&to));
        }
    }
}

impl NumericColumns for File {
    fn column_names(&self) -> Vec<String> {
        let schema = self.reader.metadata().file_metadata().schema_descr();
        schema.columns().iter().map(|c| c.path().string()).collect()
    }

    fn read_columns(&self, wanted: &[&str], _main: &str) -> Result<Vec<Vec<f64>>, String> {
        let names = self.column_names();
        let schema = self.reader.metadata().file_metadata().schema_descr_ptr();
        let one = |name: &&str| {
            let index = names.iter().position(|n| n == name).ok_or_else(|| format!("no \"{name}\""))?;
            let optional = schema.column(index).max_def_level() > 0;
            if schema.column(index).max_rep_level() > 0 {
                return Err(format!("\"{name}\" has lists; a column of a recording has one number per row"));
            }
            let mut out = Vec::new();
            for group in 0..self.reader.num_row_groups() {
                let group = self.reader.get_row_group(group).map_err(damaged)?;
                match group.get_column_reader(index).map_err(damaged)? {
                    ColumnReader::DoubleColumnReader(mut r) => read(&mut r, optional, &mut out, |x| *x)?,
                    ColumnReader::FloatColumnReader(mut r) => {
                        read(&mut r, optional, &mut out, |x| f64::from(*x))?
                    }
                    ColumnReader::Int32ColumnReader(mut r) => {
                        read(&mut r, optional, &mut out, |x| f64::from(*x))?
                    }
                    ColumnReader::Int64ColumnReader(mut r) => {
                        read(&mut r, optional, &mut out, |x| *x as f64)?
                    }
                    ColumnReader::BoolColumnReader(mut r) => {
                        read(&mut r, optional, &mut out, |x| f64::from(u8::from(*x)))?;
                    }
                    _ => return Err(format!("\"{name}\" is not a column of numbers")),
                }
            }
            Ok(out)
        };
        wanted.iter().map(one).collect()
    }
}
