//! Named columns of numbers in a file.

use crate::columns::{ColumnRole, MappedColumns, TableHead, unit_of};
use crate::error::RecordError;
use crate::text::layout::{ColumnKind, ColumnSample};
use crate::units::{Dimension, Unit};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

/// A column before it is read.
#[derive(Debug, Clone)]
pub(crate) struct NamedColumn {
    pub name: String,
    /// Unit of the values that are read, from the type of the column.
    pub unit: Option<Unit>,
}

impl NamedColumn {
    /// A column without unit.
    pub(crate) fn plain(name: impl Into<String>) -> Self {
        Self { name: name.into(), unit: None }
    }
}

/// A column that was read: name and values.
pub(crate) type NamedValues = (String, Vec<f64>);

/// Samples of the columns whose values are given and whose units are known.
pub(crate) fn column_samples(head: TableHead<'_>, values: &[NamedValues]) -> Vec<ColumnSample> {
    let sample = |(at, name): (usize, &String)| {
        let (_, column) = values.iter().find(|(of, _)| of == name)?;
        Some(ColumnSample::of_values(column, unit_of(head, at)?.to_si))
    };
    head.names.iter().enumerate().map(|column| sample(column).unwrap_or_default()).collect()
}

/// A file with named columns of numbers.
pub(crate) trait NumericColumns {
    /// All columns, in the order of the file.
    fn columns(&self) -> Vec<NamedColumn>;

    /// Parts of the file that cannot be read, as sentences.
    fn unreadable(&self) -> Vec<String> {
        Vec::new()
    }

    /// Some of the columns, with equal lengths; where columns have different rows, those of `main` are used.
    fn read_columns(&self, wanted: &[&str], main: &str) -> Result<Vec<Vec<f64>>, String>;
}

/// A file with columns and its name for messages.
pub(crate) struct ColumnsOfFile<'a> {
    pub source: Box<dyn NumericColumns + 'a>,
    pub kind: &'static str,
    pub path: PathBuf,
}

impl ColumnsOfFile<'_> {
    fn error(&self, what: String) -> RecordError {
        RecordError::Foreign { path: self.path.clone(), kind: self.kind, what }
    }

    /// Names, units and kinds of all columns.
    pub(crate) fn names_and_units(&self) -> (Vec<String>, Vec<Option<Unit>>, Vec<ColumnKind>) {
        let all = self.source.columns();
        let kinds = vec![ColumnKind::Number; all.len()];
        let (names, units) = all.into_iter().map(|column| (column.name, column.unit)).unzip();
        (names, units, kinds)
    }

    /// The columns that `map` chooses: parts one after another, with equal lengths.
    pub(crate) fn read(
        &self,
        path: &Path,
        map: impl FnOnce(TableHead<'_>) -> Result<MappedColumns, RecordError>,
    ) -> Result<(MappedColumns, Vec<Vec<f64>>), RecordError> {
        let (names, units, kinds) = self.names_and_units();
        let unreadable = self.source.unreadable();
        if names.is_empty() {
            let why =
                if unreadable.is_empty() { String::new() } else { format!(": {}", unreadable.join("; ")) };
            return Err(self.error(format!("it has no column of numbers{why}")));
        }
        let head = TableHead::of_columns(path, &names, &units, &kinds);
        let samples = column_samples(head, &self.read_competing_columns(head));
        let mapped = map(TableHead { samples: &samples, ..head });
        let mapped = mapped.map_err(|error| match (error, unreadable.is_empty()) {
            (error, true) => error,
            (error, false) => self.error(format!("{error}; not read: {}", unreadable.join("; "))),
        })?;
        let wanted: Vec<&str> =
            mapped.indices().iter().filter_map(|index| names.get(*index)).map(String::as_str).collect();
        let columns = self
            .read_named(&wanted, mapped.of(ColumnRole::Force).and_then(|c| names.get(*c.indices.first()?)))?;
        Ok((mapped, columns))
    }

    /// Columns of length and force where there are several, whose values decide between them; none if they cannot be read.
    fn read_competing_columns(&self, head: TableHead<'_>) -> Vec<NamedValues> {
        let all_of = |dimension: Dimension| {
            let is_one = |at: &usize| unit_of(head, *at).is_some_and(|unit| unit.dimension == dimension);
            let all: Vec<&str> =
                (0..head.names.len()).filter(is_one).map(|at| head.names[at].as_str()).collect();
            if all.len() > 1 { all } else { Vec::new() }
        };
        let wanted = [all_of(Dimension::Length), all_of(Dimension::Force)].concat();
        if wanted.is_empty() {
            return Vec::new();
        }
        self.read_equal(&wanted).map(|(columns, _)| columns).unwrap_or_default()
    }

    /// The columns of these names. Rows are those of `main`, or of the first one.
    pub(crate) fn read_named(
        &self,
        wanted: &[&str],
        main: Option<&String>,
    ) -> Result<Vec<Vec<f64>>, RecordError> {
        let main = main.map(String::as_str).or_else(|| wanted.first().copied()).unwrap_or_default();
        // The libraries panic on some damaged files.
        let columns = catch_unwind(AssertUnwindSafe(|| self.source.read_columns(wanted, main)))
            .unwrap_or_else(|_| Err("it is damaged".to_owned()))
            .map_err(|why| self.error(why))?;
        let rows = columns.first().map_or(0, Vec::len);
        if let Some((name, other)) = wanted.iter().zip(&columns).find(|(_, c)| c.len() != rows) {
            return Err(self.error(format!(
                "\"{}\" has {rows} values and \"{name}\" has {}; the columns of a recording have equal lengths",
                wanted.first().copied().unwrap_or_default(),
                other.len()
            )));
        }
        if rows == 0 {
            return Err(self.error("its columns are empty".to_owned()));
        }
        Ok(columns)
    }

    /// As many of the columns as have the most frequent length, and sentences on the others.
    pub(crate) fn read_equal(&self, wanted: &[&str]) -> Result<(Vec<NamedValues>, Vec<String>), RecordError> {
        let main = wanted.first().copied().unwrap_or_default();
        let columns = catch_unwind(AssertUnwindSafe(|| {
            // A damaged column does not hide the others.
            self.source.read_columns(wanted, main).or_else(|_| {
                let each = wanted.iter().map(|name| {
                    let read = self.source.read_columns(&[name], name);
                    read.map(|mut columns| columns.pop().unwrap_or_default()).unwrap_or_default()
                });
                Ok(each.collect())
            })
        }))
        .unwrap_or_else(|_| Err("it is damaged".to_owned()))
        .map_err(|why: String| self.error(why))?;
        let mut lengths: std::collections::BTreeMap<usize, usize> = std::collections::BTreeMap::new();
        for column in columns.iter().filter(|column| !column.is_empty()) {
            *lengths.entry(column.len()).or_default() += 1;
        }
        let Some((rows, _)) = lengths.into_iter().max_by_key(|(length, count)| (*count, *length)) else {
            return Err(self.error("its columns are empty or cannot be read".to_owned()));
        };
        let (mut kept, mut left_out) = (Vec::new(), Vec::new());
        for (name, column) in wanted.iter().zip(columns) {
            if column.len() == rows {
                kept.push(((*name).to_owned(), column));
            } else {
                left_out
                    .push(format!("\"{name}\" has {} values, the other columns have {rows}", column.len()));
            }
        }
        Ok((kept, left_out))
    }
}
