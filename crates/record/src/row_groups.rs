//! Reader of a text table that holds several recordings, which the values of some columns separate.

use std::collections::BTreeMap;
use std::path::Path;

use crate::assemble::assemble;
use crate::columns::missing;
use crate::error::RecordError;
use crate::quality::{QualityNote, assess};
use crate::recording::Recording;
use crate::table_source::{ReadOptions, Select, decoded, read_bytes, with_text};
use crate::text::delimiter::split;
use crate::text::find::find_table;
use crate::text::source::{SourceFile, TextSource, header_start};

/// Reads the recordings of a text table, one per combination of the values in the columns `by`, in the order of the first rows. The
/// name of a recording is these values with a blank between them. Layouts are those of [`read_csv`](crate::read_csv).
///
/// # Errors
/// As [`read_csv_bytes`](crate::read_csv_bytes), with lines counted as if each recording had a file of its own;
/// [`RecordError::MissingColumn`] when there is no such column.
pub fn read_csv_groups(
    path: impl AsRef<Path>,
    options: &ReadOptions,
    by: &[String],
) -> Result<Vec<(String, Recording, Vec<QualityNote>)>, RecordError> {
    let path = path.as_ref();
    let bytes = read_bytes(path)?;
    let map = options.columns.as_ref();
    map.map_or(Ok(()), crate::column_map::ColumnMap::check)?;
    let (text, _) = decoded(&bytes, path, map)?;
    split_rows(&text, path, options, by)?
        .into_iter()
        .map(|(name, text)| {
            let (recording, mut notes) =
                with_text(text.as_bytes(), path, map, Select::Recording, |file, table| {
                    assemble(file, table, options)
                })?;
            notes.extend(assess(&recording));
            Ok((name, recording, notes))
        })
        .collect()
}

/// The text above the rows followed by the rows of one group, for every group.
fn split_rows(
    text: &[u8],
    path: &Path,
    options: &ReadOptions,
    by: &[String],
) -> Result<Vec<(String, String)>, RecordError> {
    let start = header_start(text).ok_or_else(|| RecordError::EmptyFile { path: path.to_owned() })?;
    let file = SourceFile { text: TextSource::Bytes(text), path, header: start };
    let line = file.line_of_row(start)?;
    let text = std::str::from_utf8(text).unwrap_or_default();
    let (layout, _) = find_table(text, start, line, path, options.columns.as_ref(), &file.spread_lines()?)?;
    let place = |wanted: &String| {
        let found = layout.names.iter().position(|name| name == wanted);
        found.ok_or_else(|| missing(layout.head(path), wanted, "to split by"))
    };
    let places = by.iter().map(place).collect::<Result<Vec<_>, _>>()?;
    let (above, rows) = text.split_at(layout.data_start);
    let mut groups: Vec<(String, String)> = Vec::new();
    let mut known: BTreeMap<String, usize> = BTreeMap::new();
    let is_row = |row: &&str| {
        let first = row.trim_start().bytes().next();
        first.is_some() && first != layout.comment
    };
    for row in rows.split_inclusive('\n').filter(is_row) {
        let fields = split(row, layout.delimiter);
        let values: Vec<&str> = places.iter().map(|p| fields.get(*p).map_or("", String::as_str)).collect();
        let group = *known.entry(values.join(" ")).or_insert_with_key(|key| {
            groups.push((key.clone(), above.to_owned()));
            groups.len() - 1
        });
        groups[group].1.push_str(row);
    }
    Ok(groups)
}

#[cfg(test)]
mod tests {
    use super::split_rows;
    use crate::table_source::ReadOptions;
    use std::path::Path;

    #[test]
    fn rows_are_split_in_any_layout_that_is_read() {
        let text = "Made by a logger\n\n\
                    specimen;time_s;position_m;force_n\n\
                    \"p; left\";0,0;0,000;0,0\n\
                    q;0,0;0,001;0,1\n\
                    \n\
                    \"p; left\";0,1;0,002;0,2\n\
                    q;0,1;0,003;0,3\n\
                    q;0,2;0,004;0,4\n";
        let split = |by: &str| {
            split_rows(text.as_bytes(), Path::new("all.csv"), &ReadOptions::default(), &[by.to_owned()])
        };
        let groups = split("specimen").expect("two specimens");
        let head = "Made by a logger\n\nspecimen;time_s;position_m;force_n\n";
        let expected = [
            ("p; left", format!("{head}\"p; left\";0,0;0,000;0,0\n\"p; left\";0,1;0,002;0,2\n")),
            ("q", format!("{head}q;0,0;0,001;0,1\nq;0,1;0,003;0,3\nq;0,2;0,004;0,4\n")),
        ];
        assert_eq!(groups.len(), 2);
        for ((name, text), (expected_name, expected_text)) in groups.iter().zip(&expected) {
            assert_eq!((name.as_str(), text), (*expected_name, expected_text));
        }
        let message = split("colour").expect_err("no such column").to_string();
        assert!(message.contains("no column \"colour\" (to split by)"), "{message}");
    }
}
