//! Conversion of named columns of a file to a CSV table.

use crate::column_map::ColumnMap;
use crate::csv_header::{ColumnRole, map_columns};
use crate::error::RecordError;
use std::fmt::Write as _;
use std::path::Path;

/// A file with named columns of numbers.
pub(super) trait NumericColumns {
    /// All names, in the order of the file.
    fn column_names(&self) -> Vec<String>;

    /// Some of the columns, with equal lengths; where columns have different rows, those of `main` are used.
    fn read_columns(&self, wanted: &[&str], main: &str) -> Result<Vec<Vec<f64>>, String>;
}

/// The required columns as CSV.
pub(super) fn columns_to_csv(
    source: &dyn NumericColumns,
    path: &Path,
    map: Option<&ColumnMap>,
    foreign: impl Fn(String) -> RecordError,
) -> Result<Vec<u8>, RecordError> {
    let names = source.column_names();
    if names.is_empty() {
        return Err(foreign("it has no column of numbers".to_owned()));
    }
    let sources = map_columns(&names, path, 1, map)?;
    let wanted: Vec<&str> = sources.iter().map(|s| s.column.name.trim()).collect();
    let main = sources.iter().find(|s| s.role == ColumnRole::Force).map_or("", |s| s.column.name.trim());
    let columns = source.read_columns(&wanted, main).map_err(&foreign)?;
    let rows = columns.first().map_or(0, Vec::len);
    if let Some((name, other)) = wanted.iter().zip(&columns).find(|(_, c)| c.len() != rows) {
        return Err(foreign(format!(
            "\"{}\" has {rows} values and \"{name}\" has {}; the columns of a recording have equal lengths",
            wanted[0],
            other.len()
        )));
    }
    let mut text = String::with_capacity(rows * wanted.len() * 20);
    let quoted: Vec<String> = wanted.iter().map(|n| format!("\"{}\"", n.replace('"', "\"\""))).collect();
    text.push_str(&quoted.join(","));
    for row in 0..rows {
        text.push('\n');
        for (k, column) in columns.iter().enumerate() {
            if k > 0 {
                text.push(',');
            }
            let _ = write!(text, "{}", column[row]);
        }
    }
    text.push('\n');
    Ok(text.into_bytes())
}
