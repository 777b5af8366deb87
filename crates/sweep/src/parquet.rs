//! `trials.parquet`: the same table as `trials.csv`, one column per name, nulls for what does not exist.

use crate::row::{Columns, Row};
use parquet::basic::Repetition;
use parquet::basic::Type as Physical;
use parquet::column::writer::ColumnWriter;
use parquet::data_type::Int64Type;
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;
use std::sync::Arc;

/// The table as the bytes of a Parquet file, the same for the same rows.
///
/// # Errors
/// What the Parquet library says; no table of a sweep makes it say anything.
pub fn parquet(columns: &Columns, rows: &[Row]) -> Result<Vec<u8>, ParquetError> {
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
    let mut bytes = Vec::new();
    let mut writer = SerializedFileWriter::new(&mut bytes, schema, properties)?;
    let mut group = writer.next_row_group()?;
    let mut index = 0;
    while let Some(mut column) = group.next_column()? {
        if index < 3 {
            // Seeds keep their 64 bits: those beyond the signed range come out negative.
            let whole: Vec<i64> = rows.iter().map(|r| [r.trial, r.seed, r.redrawn][index] as i64).collect();
            column.typed::<Int64Type>().write_batch(&whole, None, None)?;
        } else if let ColumnWriter::DoubleColumnWriter(typed) = column.untyped() {
            let all = || rows.iter().map(|r| r.values.get(index - 3).copied().unwrap_or(f64::NAN));
            let there: Vec<i16> = all().map(|x| i16::from(!x.is_nan())).collect();
            let values: Vec<f64> = all().filter(|x| !x.is_nan()).collect();
            typed.write_batch(&values, Some(&there), None)?;
        }
        column.close()?;
        index += 1;
    }
    group.close()?;
    writer.close()?;
    Ok(bytes)
}
