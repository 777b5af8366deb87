//! MATLAB v7.3 and other HDF5 files.

use super::numeric_columns::{NamedColumn, NumericColumns};
use crate::memory_limit::{self, VALUE_BYTES};
use crate::units::{Unit, parse_unit};
use hdf5_pure::{AttrValue, Dataset, Group};

/// Most columns of a matrix that are listed.
const MAX_MATRIX_COLUMNS: u64 = 64;
/// Most levels of nested groups.
const MAX_DEPTH: usize = 6;

/// An open file.
pub(super) struct File {
    file: hdf5_pure::File,
    columns: Vec<Column>,
    unreadable: Vec<String>,
}

/// Place of a column in a matrix.
#[derive(Clone, Copy)]
struct Part {
    at: usize,
    of: usize,
    /// Whether columns are contiguous, as in MATLAB, or rows, as in Python.
    by_column: bool,
}

/// A column: a dataset, or a part of one.
struct Column {
    name: String,
    path: String,
    part: Option<Part>,
    unit: Option<Unit>,
}

impl File {
    pub(super) fn open(bytes: &[u8]) -> Result<Self, String> {
        let file = hdf5_pure::File::from_bytes(bytes.to_vec()).map_err(damaged)?;
        let mut found = Self { file, columns: Vec::new(), unreadable: Vec::new() };
        let root = found.file.root();
        found.list(&root, "", MAX_DEPTH)?;
        Ok(found)
    }
}

fn damaged(why: impl std::fmt::Display) -> String {
    format!("it cannot be read ({why}); is it complete?")
}

/// The text of an attribute.
fn text_attribute(dataset: &Dataset, names: &[&str]) -> Option<String> {
    let attributes = dataset.attrs().ok()?;
    names.iter().find_map(|name| match attributes.get(*name) {
        Some(
            AttrValue::String(text)
            | AttrValue::AsciiString(text)
            | AttrValue::VarLenString(text)
            | AttrValue::VarLenAsciiString(text),
        ) => Some(text.clone()),
        _ => None,
    })
}

impl File {
    /// Lists every vector and every column of a matrix.
    fn list(&mut self, group: &Group, at: &str, left: usize) -> Result<(), String> {
        let below = |name: &str| if at.is_empty() { name.to_owned() } else { format!("{at}/{name}") };
        for name in group.datasets().map_err(damaged)? {
            let Ok(dataset) = group.dataset(&name) else { continue };
            let path = below(&name);
            let plain = path.replace('/', ".");
            let is_object = dataset.attrs().is_ok_and(|all| all.contains_key("MATLAB_object_decode"));
            match text_attribute(&dataset, &["MATLAB_class"]) {
                Some(class) if is_object => {
                    self.unreadable.push(format!(
                        "\"{plain}\" is a MATLAB object ({class}): save its columns, such as t = {plain}.t, or use writetable"
                    ));
                    continue;
                }
                Some(class) if matches!(class.as_str(), "char" | "cell" | "string" | "function_handle") => {
                    continue;
                }
                _ => {}
            }
            let Ok(shape) = dataset.shape() else { continue };
            let unit = text_attribute(&dataset, &["unit", "units", "Unit", "Units"])
                .and_then(|text| parse_unit(&text));
            let mut add =
                |name: String, part| self.columns.push(Column { name, path: path.clone(), part, unit });
            match shape.as_slice() {
                [_] | [1, _] | [_, 1] => add(plain, None),
                [rows, columns] => {
                    let by_column = rows < columns;
                    let of = *rows.min(columns);
                    if of <= MAX_MATRIX_COLUMNS {
                        for at in 0..of as usize {
                            add(format!("{plain}.{}", at + 1), Some(Part { at, of: of as usize, by_column }));
                        }
                    }
                }
                _ => {}
            }
        }
        if left > 0 {
            for name in group.groups().map_err(damaged)? {
                // `#refs#` and `#subsystem#` are internal to MATLAB.
                if !name.starts_with('#') {
                    let inner = group.group(&name).map_err(damaged)?;
                    self.list(&inner, &below(&name), left - 1)?;
                }
            }
        }
        Ok(())
    }
}

impl NumericColumns for File {
    fn columns(&self) -> Vec<NamedColumn> {
        self.columns.iter().map(|c| NamedColumn { name: c.name.clone(), unit: c.unit }).collect()
    }

    fn unreadable(&self) -> Vec<String> {
        self.unreadable.clone()
    }

    fn read_columns(&self, wanted: &[&str], _main: &str) -> Result<Vec<Vec<f64>>, String> {
        let one = |name: &&str| {
            let column =
                self.columns.iter().find(|c| c.name == *name).ok_or_else(|| format!("no \"{name}\""))?;
            let dataset = self.file.dataset(&column.path).map_err(damaged)?;
            let shape = dataset.shape().map_err(damaged)?;
            let values = shape.iter().fold(1_u64, |all, n| all.saturating_mul(*n));
            // Columns that were read before take their memory too.
            let all = values.saturating_mul(wanted.len() as u64).saturating_mul(VALUE_BYTES);
            memory_limit::check(&format!("\"{name}\" with {values} declared values"), all)?;
            let values =
                dataset.read_f64().map_err(|e| format!("\"{name}\" is not a column of numbers ({e})"))?;
            Ok(match column.part {
                None => values,
                Some(Part { at, of, by_column: true }) => {
                    let rows = values.len() / of.max(1);
                    values.get(at * rows..(at + 1) * rows).unwrap_or_default().to_vec()
                }
                Some(Part { at, of, by_column: false }) => {
                    values.into_iter().skip(at).step_by(of.max(1)).collect()
                }
            })
        };
        wanted.iter().map(one).collect()
    }
}
