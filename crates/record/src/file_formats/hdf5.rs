//! MATLAB v7.3 and other HDF5 files.

use super::columns_to_csv::NumericColumns;
use hdf5_pure::Group;

/// Most levels of nested groups.
const MAX_DEPTH: usize = 6;

/// An open file.
pub(super) struct File {
    file: hdf5_pure::File,
    columns: Vec<Column>,
}

/// A column: a dataset, or a part of one.
struct Column {
    name: String,
    path: String,
    /// Index and number of parts of equal length: a column of a matrix, which MATLAB stores by columns.
    part: Option<(usize, usize)>,
}

impl File {
    pub(super) fn open(bytes: &[u8]) -> Result<Self, String> {
        let file = hdf5_pure::File::from_bytes(bytes.to_vec()).map_err(damaged)?;
        let mut columns = Vec::new();
        list_columns(&file.root(), "", MAX_DEPTH, &mut columns)?;
        Ok(Self { file, columns })
    }
}

fn damaged(why: impl std::fmt::Display) -> String {
    format!("it cannot be read ({why}); is it complete?")
}

/// Lists every vector and every column of a matrix.
fn list_columns(group: &Group, at: &str, left: usize, columns: &mut Vec<Column>) -> Result<(), String> {
    let below = |name: &str| if at.is_empty() { name.to_owned() } else { format!("{at}/{name}") };
    for name in group.datasets().map_err(damaged)? {
        let Ok(shape) = group.dataset(&name).and_then(|d| d.shape()) else { continue };
        let path = below(&name);
        let plain = path.replace('/', ".");
        // MATLAB's rows and columns are exchanged in HDF5.
        match shape.as_slice() {
            [_] | [1, _] | [_, 1] => columns.push(Column { name: plain, path, part: None }),
            [parts, _] if *parts <= 64 => {
                columns.extend((0..*parts as usize).map(|k| Column {
                    name: format!("{plain}.{}", k + 1),
                    path: path.clone(),
                    part: Some((k, *parts as usize)),
                }));
            }
            _ => {}
        }
    }
    if left > 0 {
        for name in group.groups().map_err(damaged)? {
            // `#refs#` and `#subsystem#` are internal to MATLAB.
            if !name.starts_with('#') {
                let inner = group.group(&name).map_err(damaged)?;
                list_columns(&inner, &below(&name), left - 1, columns)?;
            }
        }
    }
    Ok(())
}

impl NumericColumns for File {
    fn column_names(&self) -> Vec<String> {
        self.columns.iter().map(|c| c.name.clone()).collect()
    }

    fn read_columns(&self, wanted: &[&str], _main: &str) -> Result<Vec<Vec<f64>>, String> {
        let one = |name: &&str| {
            let column =
                self.columns.iter().find(|c| c.name == *name).ok_or_else(|| format!("no \"{name}\""))?;
            let dataset = self.file.dataset(&column.path).map_err(damaged)?;
            let values =
                dataset.read_f64().map_err(|e| format!("\"{name}\" is not a column of numbers ({e})"))?;
            Ok(match column.part {
                None => values,
                Some((k, parts)) => {
                    let rows = values.len() / parts.max(1);
                    values.get(k * rows..(k + 1) * rows).unwrap_or_default().to_vec()
                }
            })
        };
        wanted.iter().map(one).collect()
    }
}
