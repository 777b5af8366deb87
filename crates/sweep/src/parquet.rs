//! `trials.parquet`: the table of `trials.csv`, with nulls for missing values.

use crate::trial_row::Columns;
use crate::trial_table::TrialTable;
use parquet::basic::Repetition;
use parquet::basic::Type as Physical;
use parquet::column::writer::ColumnWriter;
use parquet::data_type::Int64Type;
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;
use std::io::{self, Write};
use std::sync::Arc;

/// Writes the table as a Parquet file, the same bytes for the same rows.
///
/// # Errors
/// An I/O error of the destination or of the rows.
pub fn write_parquet<T: TrialTable + ?Sized>(
    columns: &Columns,
    rows: &T,
    output: impl Write + Send,
) -> io::Result<()> {
    written(columns, rows, output).map_err(|why| match why {
        ParquetError::External(why) => match why.downcast::<io::Error>() {
            Ok(why) => *why,
            Err(why) => io::Error::other(why),
        },
        why => io::Error::other(why),
    })
}

fn written<T: TrialTable + ?Sized>(
    columns: &Columns,
    rows: &T,
    output: impl Write + Send,
) -> Result<(), ParquetError> {
    let mut fields = Vec::new();
    for (index, name) in columns.names().enumerate() {
        let (physical, repetition) = if index < 3 {
            (Physical::INT64, Repetition::REQUIRED)
        } else {
            (Physical::DOUBLE, Repetition::OPTIONAL)
        };
        fields.push(Arc::new(
            Type::primitive_type_builder(name, physical).with_repetition(repetition).build()?,
        ));
    }
    let schema = Arc::new(Type::group_type_builder("trials").with_fields(fields).build()?);
    let properties = Arc::new(WriterProperties::builder().set_created_by("stylet".to_owned()).build());
    let read = |why: T::Error| ParquetError::from(T::into_io_error(why));
    let mut writer = SerializedFileWriter::new(output, schema, properties)?;
    let mut group = writer.next_row_group()?;
    let mut index = 0;
    while let Some(mut column) = group.next_column()? {
        if index < 3 {
            // Seeds keep their 64 bits; those beyond the signed range are stored as negative numbers.
            let mut whole: Vec<i64> = Vec::with_capacity(rows.count());
            rows.for_each_row(|r| whole.push([r.trial, r.seed, r.redrawn][index] as i64)).map_err(read)?;
            column.typed::<Int64Type>().write_batch(&whole, None, None)?;
        } else if let ColumnWriter::DoubleColumnWriter(typed) = column.untyped() {
            let mut values = rows.column(index - 3).map_err(read)?;
            let there: Vec<i16> = values.iter().map(|x| i16::from(!x.is_nan())).collect();
            values.retain(|x| !x.is_nan());
            typed.write_batch(&values, Some(&there), None)?;
        }
        column.close()?;
        index += 1;
    }
    group.close()?;
    writer.close()?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parallel_trials::run_trials_with_threads;
    use crate::sweep_file::{Overrides, Sweep};
    use parquet::file::reader::SerializedFileReader;
    use parquet::record::Field;
    use std::path::Path;

    /// What is written is read back by the library's reader: names, whole numbers, values to the bit, nulls.
    #[test]
    fn the_table_that_is_written_is_the_one_that_is_read() {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/sweeps/noise.ron");
        let sweep =
            Sweep::load(&file, Overrides { trials: Some(12), seed: None }).expect("the shipped sweep");
        let columns = Columns::new(&sweep);
        let rows = run_trials_with_threads(&sweep, &columns, 0..12, 1, &|_| {}).expect("it runs");
        let written = || {
            let mut bytes = Vec::new();
            write_parquet(&columns, &rows[..], &mut bytes).expect("it is written");
            bytes
        };
        let bytes = written();
        assert_eq!(bytes, written(), "the same bytes");

        let place = std::env::temp_dir().join(format!("stylet-{}.parquet", std::process::id()));
        std::fs::write(&place, &bytes).expect("a scratch file");
        let reader = SerializedFileReader::new(std::fs::File::open(&place).expect("it is there"));
        let read: Vec<_> =
            reader.expect("it is Parquet").into_iter().map(|row| row.expect("a row")).collect();
        std::fs::remove_file(&place).expect("it goes");

        assert_eq!(read.len(), rows.len());
        let (mut numbers, mut nulls) = (0, 0);
        for (read, row) in read.iter().zip(&rows) {
            let names: Vec<&str> = read.get_column_iter().map(|(name, _)| name.as_str()).collect();
            assert_eq!(names, columns.names().collect::<Vec<_>>());
            let whole = [row.trial, row.seed, row.redrawn].map(|x| Field::Long(x as i64));
            for (k, (_, field)) in read.get_column_iter().enumerate() {
                match field {
                    Field::Double(x) => {
                        assert_eq!(x.to_bits(), row.values[k - 3].to_bits());
                        numbers += 1;
                    }
                    Field::Null => {
                        assert!(row.values[k - 3].is_nan());
                        nulls += 1;
                    }
                    other => assert_eq!(*other, whole[k]),
                }
            }
        }
        assert!(numbers > 100 && nulls > 0, "both kinds were there: {numbers} numbers, {nulls} nulls");
    }
}
