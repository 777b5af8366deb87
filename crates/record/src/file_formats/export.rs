//! Export of recordings: Parquet for notebooks, MCAP for viewers of robot logs.

use crate::error::RecordError;
use crate::recording::Recording;
use mcap::records::MessageHeader;
use parquet::basic::{Repetition, Type as Physical};
use parquet::column::writer::ColumnWriter;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;
use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::Path;
use std::sync::Arc;

/// The topic of a recording in an MCAP file.
const TOPIC: &str = "/insertion";

/// The columns of a recording with Stylet's names.
fn columns(r: &Recording) -> Vec<(String, Vec<f64>)> {
    let mut out = vec![
        ("time_s".to_owned(), r.time_s.clone()),
        ("position_m".to_owned(), r.position_m.clone()),
        ("velocity_mps".to_owned(), r.velocity_mps.clone()),
        ("force_n".to_owned(), r.force_n.clone()),
    ];
    out.extend(r.force_virtual_n.clone().map(|f| ("force_virtual_n".to_owned(), f)));
    if let Some(joints) = r.joint_torque_nm.first().map(|t| t.len()) {
        out.extend((0..joints).map(|j| {
            (format!("joint_torque_{}_nm", j + 1), r.joint_torque_nm.iter().map(|t| t[j]).collect())
        }));
    }
    out
}

fn failed(path: &Path, why: impl std::fmt::Display) -> RecordError {
    RecordError::Foreign {
        path: path.to_owned(),
        kind: "a recording",
        what: format!("it cannot be written ({why})"),
    }
}

/// The recording as a Parquet file, one column of doubles per quantity; the same bytes for the same recording. `path` only
/// appears in messages.
///
/// # Errors
/// [`RecordError::Foreign`] with the error of the Parquet library.
pub fn to_parquet(recording: &Recording, path: &Path) -> Result<Vec<u8>, RecordError> {
    columns_to_parquet(&columns(recording), path)
}

/// Named columns of equal length as a Parquet file; see [`to_parquet`].
///
/// # Errors
/// [`RecordError::Foreign`] with the error of the Parquet library.
pub fn columns_to_parquet(columns: &[(String, Vec<f64>)], path: &Path) -> Result<Vec<u8>, RecordError> {
    parquet_bytes(columns).map_err(|e| failed(path, e))
}

fn parquet_bytes(columns: &[(String, Vec<f64>)]) -> Result<Vec<u8>, parquet::errors::ParquetError> {
    let mut fields = Vec::new();
    for (name, _) in columns {
        let field =
            Type::primitive_type_builder(name, Physical::DOUBLE).with_repetition(Repetition::REQUIRED);
        fields.push(Arc::new(field.build()?));
    }
    let schema = Arc::new(Type::group_type_builder("recording").with_fields(fields).build()?);
    let properties = Arc::new(WriterProperties::builder().set_created_by("stylet".to_owned()).build());
    let mut bytes = Vec::new();
    let mut writer = SerializedFileWriter::new(&mut bytes, schema, properties)?;
    let mut group = writer.next_row_group()?;
    let mut values = columns.iter();
    while let (Some(mut column), Some((_, values))) = (group.next_column()?, values.next()) {
        if let ColumnWriter::DoubleColumnWriter(typed) = column.untyped() {
            typed.write_batch(values, None, None)?;
        }
        column.close()?;
    }
    group.close()?;
    writer.close()?;
    Ok(bytes)
}

/// The recording as an MCAP file: JSON messages on the topic `/insertion`, logged at its time stamps. `path` only appears in
/// messages.
///
/// # Errors
/// [`RecordError::Foreign`] with the error of the MCAP library.
pub fn to_mcap(recording: &Recording, path: &Path) -> Result<Vec<u8>, RecordError> {
    let columns = columns(recording);
    let mut bytes = Vec::new();
    mcap_bytes(&columns, &mut bytes).map_err(|e| failed(path, e))?;
    Ok(bytes)
}

fn mcap_bytes(columns: &[(String, Vec<f64>)], bytes: &mut Vec<u8>) -> mcap::McapResult<()> {
    let names: Vec<String> =
        columns.iter().map(|(n, _)| format!("\"{n}\": {{\"type\": \"number\"}}")).collect();
    let schema = format!("{{\"type\": \"object\", \"properties\": {{{}}}}}", names.join(", "));
    let mut writer = mcap::WriteOptions::new().library("stylet").create(Cursor::new(bytes))?;
    let schema = writer.add_schema("stylet.Recording", "jsonschema", schema.as_bytes())?;
    let channel = writer.add_channel(schema, TOPIC, "json", &BTreeMap::new())?;
    let rows = columns.first().map_or(0, |(_, c)| c.len());
    // Log times are unsigned.
    let zero_s = columns.first().and_then(|(_, t)| t.first()).map_or(0.0, |t| t.min(0.0));
    for row in 0..rows {
        let fields: Vec<String> = columns.iter().map(|(n, c)| format!("\"{n}\":{}", c[row])).collect();
        let at = ((columns[0].1[row] - zero_s) * 1e9).round() as u64;
        let header =
            MessageHeader { channel_id: channel, sequence: row as u32, log_time: at, publish_time: at };
        writer.write_to_known_channel(&header, format!("{{{}}}", fields.join(",")).as_bytes())?;
    }
    writer.finish()?;
    Ok(())
}
