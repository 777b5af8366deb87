//! MATLAB files of the versions 5 to 7 (`save` without `-v7.3`): numeric arrays and structs of them.

use super::numeric_columns::{NamedColumn, NumericColumns};
use crate::memory_limit;
use flate2::read::ZlibDecoder;
use std::io::Read;

/// Bytes of the header of a file.
const HEADER_BYTES: usize = 128;
/// Most bytes of a decompressed variable; more is a damaged length.
const MAX_VARIABLE_BYTES: u64 = 1 << 30;
/// Memory of a variable with its numbers, in units of its decompressed size: single bytes become 64-bit numbers, which are copied.
const NUMBER_SHARE: u64 = 17;
/// Most levels of nested structs.
const MAX_DEPTH: usize = 6;
/// Most columns of a matrix that are listed.
const MAX_MATRIX_COLUMNS: usize = 64;
/// Most dimensions of an array.
const MAX_DIMENSIONS: usize = 8;

/// Types of elements.
const MI_UTF8: u32 = 16;
const MI_MATRIX: u32 = 14;
const MI_COMPRESSED: u32 = 15;

/// An open file.
pub(super) struct File {
    columns: Vec<(String, Vec<f64>)>,
    unreadable: Vec<String>,
}

impl File {
    pub(super) fn open(bytes: &[u8]) -> Result<Self, String> {
        let little = match bytes.get(126..HEADER_BYTES) {
            Some(b"IM") => true,
            Some(b"MI") => false,
            _ => return Err(damaged("its header is incomplete")),
        };
        let mut file = Self { columns: Vec::new(), unreadable: Vec::new() };
        let mut rest = Elements { bytes: &bytes[HEADER_BYTES..], little };
        while let Some((kind, data)) = rest.next()? {
            match kind {
                MI_COMPRESSED => {
                    let mut inflated = Vec::new();
                    ZlibDecoder::new(data)
                        .take(MAX_VARIABLE_BYTES.min(memory_limit::limit_bytes() / NUMBER_SHARE + 1))
                        .read_to_end(&mut inflated)
                        .map_err(|e| damaged(&format!("a variable cannot be decompressed, {e}")))?;
                    let needed = (inflated.len() as u64).saturating_mul(NUMBER_SHARE);
                    memory_limit::check("a decompressed variable", needed)?;
                    let mut inner = Elements { bytes: &inflated, little };
                    while let Some((kind, data)) = inner.next()? {
                        if kind == MI_MATRIX {
                            file.add(data, little, "", MAX_DEPTH)?;
                        }
                    }
                }
                MI_MATRIX => file.add(data, little, "", MAX_DEPTH)?,
                _ => {}
            }
        }
        Ok(file)
    }

    /// Adds the columns of an array; `at` is its place in structs.
    fn add(&mut self, data: &[u8], little: bool, at: &str, left: usize) -> Result<(), String> {
        let mut parts = Elements { bytes: data, little };
        let flags = parts.take("flags of an array")?.1;
        let class = u32_at(flags, 0, little).map_or(0, |flags| flags & 0xff);
        // Opaque objects (tables, timetables) have no dimensions.
        if class == 17 {
            let name =
                parts.next()?.map(|(_, name)| String::from_utf8_lossy(name).into_owned()).unwrap_or_default();
            self.unreadable.push(format!(
                "\"{name}\" is a MATLAB object (a table or timetable): save its columns, such as t = {name}.t, or use writetable"
            ));
            return Ok(());
        }
        let (kind, sizes) = parts.take("dimensions of an array")?;
        let sizes: Vec<usize> = numbers(kind, sizes, little)?.iter().map(|x| x.max(0.0) as usize).collect();
        if sizes.is_empty() || sizes.len() > MAX_DIMENSIONS {
            return Err(damaged("an array has no valid dimensions"));
        }
        let own = String::from_utf8_lossy(parts.take("name of an array")?.1).into_owned();
        let name = match (at, own.as_str()) {
            ("", own) => own.to_owned(),
            (at, _) => at.to_owned(),
        };
        match class {
            2 => self.add_struct(&mut parts, &sizes, &name, little, left),
            6..=15 => {
                let (kind, data) = parts.take("values of an array")?;
                self.add_matrix(&name, &sizes, numbers(kind, data, little)?)
            }
            // Cells, text, sparse matrices, functions.
            1 | 3 | 5 | 16 => {
                let what = match class {
                    1 => "a cell array",
                    3 => "an object",
                    5 => "a sparse matrix",
                    _ => "a function",
                };
                self.unreadable.push(format!("\"{name}\" is {what}"));
                Ok(())
            }
            _ => Ok(()),
        }
    }

    fn add_struct(
        &mut self,
        parts: &mut Elements<'_>,
        sizes: &[usize],
        name: &str,
        little: bool,
        left: usize,
    ) -> Result<(), String> {
        let (kind, length) = parts.take("field names of a struct")?;
        let length = numbers(kind, length, little)?.first().map_or(0, |x| x.max(0.0) as usize);
        let names = parts.take("field names of a struct")?.1;
        if length == 0 || sizes.iter().try_fold(1_usize, |all, n| all.checked_mul(*n)) != Some(1) || left == 0
        {
            self.unreadable.push(format!("\"{name}\" is an array of structs"));
            return Ok(());
        }
        for field in names.chunks(length) {
            let field: String = field.iter().take_while(|b| **b != 0).map(|b| char::from(*b)).collect();
            let Some((kind, data)) = parts.next()? else { break };
            if kind == MI_MATRIX && !data.is_empty() {
                self.add(data, little, &format!("{name}.{field}"), left - 1)?;
            }
        }
        Ok(())
    }

    /// Adds a vector, or the columns of a matrix.
    fn add_matrix(&mut self, name: &str, sizes: &[usize], values: Vec<f64>) -> Result<(), String> {
        let count = sizes.iter().try_fold(1_usize, |all, n| all.checked_mul(*n));
        if count != Some(values.len()) {
            return Err(damaged(&format!("\"{name}\" has {} values for its size {sizes:?}", values.len())));
        }
        let (rows, columns) = match sizes {
            [1, n] | [n, 1] => (*n, 1),
            [rows, columns] => (*rows, *columns),
            _ => return Ok(()),
        };
        if rows < 2 || columns == 0 {
            return Ok(());
        }
        if columns == 1 {
            self.columns.push((name.to_owned(), values));
        } else if columns <= MAX_MATRIX_COLUMNS && columns <= rows {
            for (at, column) in values.chunks(rows).enumerate() {
                self.columns.push((format!("{name}.{}", at + 1), column.to_vec()));
            }
        } else if rows <= MAX_MATRIX_COLUMNS {
            // One sample per column.
            for row in 0..rows {
                self.columns.push((
                    format!("{name}.{}", row + 1),
                    values.iter().skip(row).step_by(rows).copied().collect(),
                ));
            }
        }
        Ok(())
    }
}

fn damaged(why: &str) -> String {
    format!("it cannot be read ({why}); is it complete?")
}

fn u32_at(bytes: &[u8], at: usize, little: bool) -> Option<u32> {
    let bytes: [u8; 4] = bytes.get(at..at + 4)?.try_into().ok()?;
    Some(if little { u32::from_le_bytes(bytes) } else { u32::from_be_bytes(bytes) })
}

/// Elements one after another.
struct Elements<'a> {
    bytes: &'a [u8],
    little: bool,
}

impl<'a> Elements<'a> {
    /// The next element: its type and data.
    fn next(&mut self) -> Result<Option<(u32, &'a [u8])>, String> {
        if self.bytes.is_empty() {
            return Ok(None);
        }
        let cut = || damaged("it ends within an element");
        let tag = u32_at(self.bytes, 0, self.little).ok_or_else(cut)?;
        // Up to four bytes of data are stored in the tag.
        if tag >> 16 != 0 {
            let length = (tag >> 16) as usize;
            let data = self.bytes.get(4..4 + length).filter(|_| length <= 4).ok_or_else(cut)?;
            self.bytes = self.bytes.get(8..).unwrap_or_default();
            return Ok(Some((tag & 0xffff, data)));
        }
        let length = u32_at(self.bytes, 4, self.little).ok_or_else(cut)? as usize;
        let data = self.bytes.get(8..).and_then(|rest| rest.get(..length)).ok_or_else(cut)?;
        // Elements are padded to eight bytes, but compressed ones.
        let padded = if tag == MI_COMPRESSED { length } else { length.div_ceil(8) * 8 };
        self.bytes = self.bytes.get(8 + padded..).unwrap_or_default();
        Ok(Some((tag, data)))
    }

    fn take(&mut self, what: &str) -> Result<(u32, &'a [u8]), String> {
        self.next()?.ok_or_else(|| damaged(&format!("the {what} are missing")))
    }
}

/// The numbers of an element.
fn numbers(kind: u32, data: &[u8], little: bool) -> Result<Vec<f64>, String> {
    macro_rules! read {
        ($number:ty, $to:expr) => {
            data.chunks_exact(size_of::<$number>())
                .filter_map(|bytes| bytes.try_into().ok())
                .map(
                    |bytes| {
                        if little { <$number>::from_le_bytes(bytes) } else { <$number>::from_be_bytes(bytes) }
                    },
                )
                .map($to)
                .collect()
        };
    }
    Ok(match kind {
        1 => read!(i8, f64::from),
        2 => read!(u8, f64::from),
        3 => read!(i16, f64::from),
        4 => read!(u16, f64::from),
        5 => read!(i32, f64::from),
        6 => read!(u32, f64::from),
        7 => read!(f32, f64::from),
        9 => read!(f64, |x| x),
        12 => read!(i64, |x| x as f64),
        13 => read!(u64, |x| x as f64),
        MI_UTF8 => Vec::new(),
        _ => return Err(damaged(&format!("an element has the unknown type {kind}"))),
    })
}

impl NumericColumns for File {
    fn columns(&self) -> Vec<NamedColumn> {
        self.columns.iter().map(|(name, _)| NamedColumn::plain(name.as_str())).collect()
    }

    fn unreadable(&self) -> Vec<String> {
        self.unreadable.clone()
    }

    fn read_columns(&self, wanted: &[&str], _main: &str) -> Result<Vec<Vec<f64>>, String> {
        let one = |name: &&str| {
            let found = self.columns.iter().find(|(existing, _)| existing == name);
            found.map(|(_, values)| values.clone()).ok_or_else(|| format!("no \"{name}\""))
        };
        wanted.iter().map(one).collect()
    }
}
