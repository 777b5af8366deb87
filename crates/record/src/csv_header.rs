//! CSV header: delimiter, column names and their roles.

use std::path::Path;

use crate::column_map::{Column, ColumnMap};
use crate::error::RecordError;
use crate::recording::JOINTS;

/// Supported delimiters; the header decides.
const DELIMITERS: [u8; 4] = [b',', b';', b'\t', b'|'];

/// Quantity of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ColumnRole {
    Time,
    Position,
    Force,
    Velocity,
    ForceVirtual,
    JointTorque(usize),
}

/// A column to be read: its role, its index in a row, its name and unit.
#[derive(Debug, Clone)]
pub(crate) struct MappedColumn {
    pub role: ColumnRole,
    pub index: usize,
    pub column: Column,
}

/// Delimiter and columns of a CSV file, from its header.
#[derive(Debug, Clone)]
pub(crate) struct CsvLayout {
    pub delimiter: u8,
    /// Fields per row.
    pub width: usize,
    /// Time first; each role at most once.
    pub columns: Vec<MappedColumn>,
}

/// A required column with its description for error messages.
struct Wanted {
    role: ColumnRole,
    column: Column,
    what: &'static str,
}

/// Reads the header at the beginning of `text` with the first delimiter, by frequency, that gives all required columns.
pub(crate) fn read_layout(
    text: &[u8],
    path: &Path,
    line: u64,
    map: Option<&ColumnMap>,
) -> Result<CsvLayout, RecordError> {
    let first_line = text.split(|byte| matches!(byte, b'\n' | b'\r')).next().unwrap_or_default();
    let mut candidates = DELIMITERS;
    candidates.sort_by_key(|delimiter| {
        std::cmp::Reverse(first_line.iter().filter(|byte| *byte == delimiter).count())
    });
    let mut first_error = None;
    let all_numbers =
        |names: &[String]| names.len() > 1 && names.iter().all(|name| name.parse::<f64>().is_ok());
    for delimiter in candidates {
        let names = header_names(text, delimiter, path, line)?;
        match map_columns(&names, path, line, map) {
            Ok(sources) => {
                return Ok(CsvLayout { delimiter, width: names.len(), columns: sources });
            }
            Err(RecordError::MissingColumn { .. }) if all_numbers(&names) => {
                return Err(RecordError::NoHeader { path: path.to_owned(), line, found: names });
            }
            Err(error) => first_error = first_error.or(Some(error)),
        }
    }
    // The error of the most frequent delimiter, which was tried first.
    Err(first_error.unwrap_or_else(|| RecordError::EmptyFile { path: path.to_owned() }))
}

fn header_names(text: &[u8], delimiter: u8, path: &Path, line: u64) -> Result<Vec<String>, RecordError> {
    let mut reader =
        csv::ReaderBuilder::new().has_headers(false).flexible(true).delimiter(delimiter).from_reader(text);
    let mut header = csv::StringRecord::new();
    reader.read_record(&mut header).map_err(|error| RecordError::BadTable {
        path: path.to_owned(),
        line,
        message: error.to_string(),
    })?;
    Ok(header.iter().map(|name| name.trim().to_owned()).collect())
}

pub(crate) fn map_columns(
    names: &[String],
    path: &Path,
    line: u64,
    map: Option<&ColumnMap>,
) -> Result<Vec<MappedColumn>, RecordError> {
    let mut sources = Vec::new();
    for Wanted { role, column, what } in wanted(names, map) {
        let mut places = names.iter().enumerate().filter(|(_, name)| *name == column.name.trim());
        let Some((index, _)) = places.next() else {
            return Err(RecordError::MissingColumn {
                path: path.to_owned(),
                line,
                suggestion: closest(&column.name, names),
                column: column.name,
                what,
                available: names.to_vec(),
            });
        };
        if places.next().is_some() {
            return Err(RecordError::AmbiguousColumn { path: path.to_owned(), line, column: column.name });
        }
        sources.push(MappedColumn { role, index, column });
    }
    Ok(sources)
}

fn wanted(names: &[String], map: Option<&ColumnMap>) -> Vec<Wanted> {
    if let Some(map) = map {
        let required = [
            (ColumnRole::Time, Some(&map.time), "the column map's time"),
            (ColumnRole::Position, Some(&map.position), "the column map's position"),
            (ColumnRole::Force, Some(&map.force), "the column map's force"),
            (ColumnRole::Velocity, map.velocity.as_ref(), "the column map's velocity"),
            (ColumnRole::ForceVirtual, map.force_virtual.as_ref(), "the column map's virtual force"),
        ];
        return required
            .into_iter()
            .filter_map(|(role, column, what)| {
                column.map(|column| Wanted { role, column: column.clone(), what })
            })
            .collect();
    }
    let si_column = |role, name: &str, what| Wanted { role, column: Column::si(name), what };
    let mut wanted = vec![
        si_column(ColumnRole::Time, "time_s", "time in seconds"),
        si_column(ColumnRole::Position, "position_m", "tip position in metres"),
        si_column(ColumnRole::Force, "force_n", "axial force in newtons"),
    ];
    let has = |name: &str| names.iter().any(|existing| existing == name);
    if has("velocity_mps") {
        wanted.push(si_column(ColumnRole::Velocity, "velocity_mps", "tip velocity in m/s"));
    }
    if has("force_virtual_n") {
        wanted.push(si_column(ColumnRole::ForceVirtual, "force_virtual_n", "virtual force in newtons"));
    }
    if (0..JOINTS).any(|joint| has(&joint_torque_name(joint))) {
        for joint in 0..JOINTS {
            wanted.push(si_column(
                ColumnRole::JointTorque(joint),
                &joint_torque_name(joint),
                "joint torque in N m: all seven joints or none",
            ));
        }
    }
    wanted
}

/// Header name of the torque of a joint (0-based); names count from one.
pub(crate) fn joint_torque_name(joint: usize) -> String {
    format!("joint_torque_{}_nm", joint + 1)
}

/// The most similar existing name, if any is close.
fn closest(wanted: &str, names: &[String]) -> Option<String> {
    let target = wanted.to_lowercase();
    let stem = target.rsplit_once('_').map_or(target.as_str(), |(stem, _unit)| stem);
    let max_distance = (target.chars().count() / 3).max(2);
    names
        .iter()
        .filter(|name| !name.is_empty())
        .map(|name| {
            let candidate = name.to_lowercase();
            let same_quantity =
                candidate.starts_with(stem) || (candidate.len() >= 3 && stem.starts_with(&candidate));
            let distance = edit_distance(&target, &candidate).min(1 + edit_distance(stem, &candidate));
            (if same_quantity { distance.min(max_distance) } else { distance }, name)
        })
        .filter(|(distance, _)| *distance <= max_distance)
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, name)| name.clone())
}

/// Levenshtein distance in characters.
fn edit_distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, from) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, to) in b.iter().enumerate() {
            let substituted = diagonal + usize::from(from != *to);
            diagonal = row[j + 1];
            row[j + 1] = substituted.min(diagonal + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(line: &str) -> Vec<String> {
        line.split(',').map(str::to_owned).collect()
    }

    #[test]
    fn a_similar_name_is_suggested_and_a_different_one_is_not() {
        assert_eq!(closest("time_s", &names("Time_s,fz")), Some("Time_s".to_owned()));
        assert_eq!(closest("time_s", &names("timestamp_ns,fz")), Some("timestamp_ns".to_owned()));
        assert_eq!(closest("position_m", &names("t,pos,fz")), Some("pos".to_owned()));
        assert_eq!(closest("force_n", &names("fz,px,forse_n")), Some("forse_n".to_owned()));
        assert_eq!(closest("force_n", &names("fz,px,py")), None);
    }

    #[test]
    fn edit_distance_counts_insertions_deletions_and_substitutions() {
        assert_eq!(edit_distance("force", "forse"), 1);
        assert_eq!(edit_distance("time", ""), 4);
        assert_eq!(edit_distance("kitten", "sitting"), 3);
    }
}
