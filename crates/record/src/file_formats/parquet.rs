//! Parquet files.

use super::numeric_columns::{NamedColumn, NumericColumns};
use crate::memory_limit::{self, VALUE_BYTES};
use crate::units::{Unit, parse_unit};
use bytes::Bytes;
use parquet::basic::{ConvertedType, LogicalType, TimeUnit};
use parquet::column::page::Page;
use parquet::column::reader::ColumnReader;
use parquet::data_type::DataType;
use parquet::file::reader::{FileReader, RowGroupReader, SerializedFileReader};
use parquet::schema::types::ColumnDescriptor;

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

impl File {
    /// Compares what the file declares with the limit on memory; the declared number of rows.
    fn check_memory(&self, columns: usize) -> Result<u64, String> {
        let groups = self.reader.metadata().row_groups();
        let count = |x: i64| u64::try_from(x).unwrap_or(0);
        let rows = groups.iter().fold(0_u64, |all, group| all.saturating_add(count(group.num_rows())));
        let values = rows.saturating_mul(columns as u64).saturating_mul(VALUE_BYTES);
        memory_limit::check(&format!("a table of {rows} declared rows"), values)?;
        // A page is decompressed as a whole.
        let chunks = groups.iter().flat_map(|group| group.columns());
        let largest = chunks.map(|chunk| count(chunk.uncompressed_size())).max().unwrap_or(0);
        memory_limit::check("a decompressed column", largest)?;
        Ok(rows)
    }
}

fn damaged(why: impl std::fmt::Display) -> String {
    format!("it cannot be read ({why}); is it complete?")
}

/// Rejects a dictionary, the first page of a column, with more values than bytes: the library allocates them before it reads them.
fn check_dictionary(group: &dyn RowGroupReader, column: usize) -> Result<(), String> {
    let mut pages = group.get_column_page_reader(column).map_err(damaged)?;
    // Other pages are decompressed only once, to be read.
    if !pages.peek_next_page().map_err(damaged)?.is_some_and(|page| page.is_dict) {
        return Ok(());
    }
    match pages.get_next_page().map_err(damaged)? {
        Some(Page::DictionaryPage { buf, num_values, .. }) if num_values as usize > buf.len() => {
            Err(damaged(format!("a dictionary of {num_values} values in {} bytes", buf.len())))
        }
        _ => Ok(()),
    }
}

/// Rows per read.
const BATCH_ROWS: usize = 1 << 16;

/// All values of a column of one row group; NaN for nulls.
fn read<T: DataType>(
    reader: &mut parquet::column::reader::ColumnReaderImpl<T>,
    optional: bool,
    (out, most): (&mut Vec<f64>, u64),
    to: impl Fn(&T::T) -> f64,
) -> Result<(), String> {
    let (mut values, mut levels_read) = (Vec::new(), Vec::new());
    loop {
        values.clear();
        levels_read.clear();
        let levels = if optional { Some(&mut levels_read) } else { None };
        let (rows, _, _) = reader.read_records(BATCH_ROWS, levels, None, &mut values).map_err(damaged)?;
        // A damaged file holds more rows than it declares.
        if rows == 0 || out.len() as u64 > most {
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

/// Meaning of the stored integers of a column: fractions of a second, or decimals.
struct StoredAs {
    /// Values per unit.
    divisor: f64,
    unit: Option<Unit>,
    unsigned: bool,
}

impl StoredAs {
    /// The number for a stored integer of `bits` bits; unsigned ones are stored in a signed type.
    fn number(&self, stored: i64, bits: u32) -> f64 {
        let value =
            if self.unsigned && stored < 0 { stored as f64 + 2_f64.powi(bits as i32) } else { stored as f64 };
        value / self.divisor
    }

    fn of(column: &ColumnDescriptor) -> Self {
        let ticks = match (column.logical_type_ref(), column.converted_type()) {
            (Some(LogicalType::Timestamp(kind) | LogicalType::Time(kind)), _) => Some(match kind.unit {
                TimeUnit::MILLIS => 1e3,
                TimeUnit::MICROS => 1e6,
                TimeUnit::NANOS => 1e9,
            }),
            (_, ConvertedType::TIMESTAMP_MILLIS | ConvertedType::TIME_MILLIS) => Some(1e3),
            (_, ConvertedType::TIMESTAMP_MICROS | ConvertedType::TIME_MICROS) => Some(1e6),
            _ => None,
        };
        let unsigned = match (column.logical_type_ref(), column.converted_type()) {
            (Some(LogicalType::Integer(kind)), _) => !kind.is_signed,
            (_, kind) => matches!(kind, ConvertedType::UINT_32 | ConvertedType::UINT_64),
        };
        match (ticks, column.converted_type()) {
            (Some(divisor), _) => Self { divisor, unit: parse_unit("s"), unsigned },
            (None, ConvertedType::DECIMAL) => {
                Self { divisor: 10_f64.powi(column.type_scale().clamp(0, 300)), unit: None, unsigned }
            }
            _ => Self { divisor: 1.0, unit: None, unsigned },
        }
    }
}

/// Days from the first of the Julian calendar to 1970.
const JULIAN_DAY_OF_1970: f64 = 2_440_588.0;

impl NumericColumns for File {
    fn columns(&self) -> Vec<NamedColumn> {
        use parquet::basic::Type as Physical;
        let schema = self.reader.metadata().file_metadata().schema_descr();
        let numbers = schema.columns().iter().filter(|c| {
            !matches!(c.physical_type(), Physical::BYTE_ARRAY | Physical::FIXED_LEN_BYTE_ARRAY)
                && c.max_rep_level() == 0
        });
        let column = |c: &std::sync::Arc<ColumnDescriptor>| NamedColumn {
            name: c.path().string(),
            unit: if c.physical_type() == Physical::INT96 { parse_unit("s") } else { StoredAs::of(c).unit },
        };
        numbers.map(column).collect()
    }

    fn read_columns(&self, wanted: &[&str], _main: &str) -> Result<Vec<Vec<f64>>, String> {
        let schema = self.reader.metadata().file_metadata().schema_descr_ptr();
        let rows = self.check_memory(wanted.len())?;
        let one = |name: &&str| {
            let index = schema
                .columns()
                .iter()
                .position(|c| c.path().string() == *name)
                .ok_or_else(|| format!("no \"{name}\""))?;
            let optional = schema.column(index).max_def_level() > 0;
            if schema.column(index).max_rep_level() > 0 {
                return Err(format!("\"{name}\" has lists; a column of a recording has one number per row"));
            }
            let stored = StoredAs::of(&schema.column(index));
            let mut out = Vec::new();
            for group in 0..self.reader.num_row_groups() {
                let group = self.reader.get_row_group(group).map_err(damaged)?;
                check_dictionary(group.as_ref(), index)?;
                match group.get_column_reader(index).map_err(damaged)? {
                    ColumnReader::DoubleColumnReader(mut r) => {
                        read(&mut r, optional, (&mut out, rows), |x| *x)?
                    }
                    ColumnReader::FloatColumnReader(mut r) => {
                        read(&mut r, optional, (&mut out, rows), |x| f64::from(*x))?
                    }
                    ColumnReader::Int32ColumnReader(mut r) => {
                        read(&mut r, optional, (&mut out, rows), |x| stored.number(i64::from(*x), 32))?
                    }
                    ColumnReader::Int64ColumnReader(mut r) => {
                        read(&mut r, optional, (&mut out, rows), |x| stored.number(*x, 64))?
                    }
                    ColumnReader::BoolColumnReader(mut r) => {
                        read(&mut r, optional, (&mut out, rows), |x| f64::from(u8::from(*x)))?;
                    }
                    // Nanoseconds of the day and the Julian day, as older pandas and Spark write.
                    ColumnReader::Int96ColumnReader(mut r) => {
                        read(&mut r, optional, (&mut out, rows), |x| {
                            let [low, high, day] = *x.data() else { return f64::NAN };
                            let of_day = f64::from(low) + f64::from(high) * 4_294_967_296.0;
                            (f64::from(day) - JULIAN_DAY_OF_1970) * 86_400.0 + of_day / 1e9
                        })?
                    }
                    _ => return Err(format!("\"{name}\" is not a column of numbers")),
                }
            }
            if out.len() as u64 > rows {
                return Err(damaged(format!("\"{name}\" has more than its {rows} rows")));
            }
            Ok(out)
        };
        wanted.iter().map(one).collect()
    }
}
