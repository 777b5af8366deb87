//! Recordings with holes: rows whose values are no finite numbers are cut out and reported.

use crate::csv_reader::{ReadOptions, read_csv, read_csv_bytes};
use crate::error::RecordError;
use crate::file_formats::{FileFormat, to_csv};
use crate::quality::{QualityKind, QualityNote};
use crate::recording::Recording;
use std::path::Path;

/// As [`crate::read_csv`]; rows with a value that is no finite number are cut out and reported.
///
/// # Errors
/// As [`crate::read_csv`], but for values that are not finite: those only when hardly a row is left.
pub fn read_csv_skip_nonfinite(
    path: &Path,
    options: &ReadOptions,
) -> Result<(Recording, Vec<QualityNote>), RecordError> {
    let error = match read_csv(path, options) {
        Err(error @ RecordError::NotFinite { .. }) => error,
        other => return other,
    };
    let Ok(bytes) = std::fs::read(path) else { return Err(error) };
    let bytes = match FileFormat::detect(&bytes) {
        Some(kind) => to_csv(kind, &bytes, path, options.columns.as_ref())?,
        None => bytes,
    };
    let Ok(text) = String::from_utf8(bytes) else { return Err(error) };
    let hole = |line: &&str| {
        line.split([',', ';', '\t', '|']).any(|x| {
            let x = x.trim().trim_matches('"');
            x.parse::<f64>().is_ok_and(|x| !x.is_finite())
        })
    };
    let kept: Vec<&str> = text.lines().filter(|l| !hole(l)).collect();
    let (all, left) = (text.lines().count(), kept.len());
    if left < 3 {
        return Err(error);
    }
    let (recording, mut notes) = read_csv_bytes((kept.join("\n") + "\n").as_bytes(), path, options)?;
    let message =
        format!("{} row(s) hold a value that is not a finite number: they were cut out", all - left);
    notes.insert(
        0,
        QualityNote {
            kind: QualityKind::Gaps,
            message,
            numbers: [("count".to_owned(), (all - left) as f64)].into_iter().collect(),
            lines: text
                .lines()
                .enumerate()
                .filter(|(_, l)| hole(l))
                .take(100)
                .map(|(k, _)| k as u64 + 1)
                .collect(),
            blocking: false,
        },
    );
    Ok((recording, notes))
}
