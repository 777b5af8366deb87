//! Reading CSV files with NaN or infinite values: such rows are dropped and reported.

use crate::csv_reader::{ReadOptions, read_csv, read_csv_bytes};
use crate::error::RecordError;
use crate::file_formats::{FileFormat, to_csv};
use crate::quality::{QualityKind, QualityNote};
use crate::recording::Recording;
use std::path::Path;

/// As [`crate::read_csv`]; rows with a value that is not finite are dropped and reported.
///
/// # Errors
/// As [`crate::read_csv`], except for values that are not finite: those only when fewer than three rows remain.
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
    let is_nonfinite = |line: &&str| {
        line.split([',', ';', '\t', '|']).any(|x| {
            let x = x.trim().trim_matches('"');
            x.parse::<f64>().is_ok_and(|x| !x.is_finite())
        })
    };
    let kept: Vec<&str> = text.lines().filter(|l| !is_nonfinite(l)).collect();
    let (all, left) = (text.lines().count(), kept.len());
    if left < 3 {
        return Err(error);
    }
    let (recording, mut notes) = read_csv_bytes((kept.join("\n") + "\n").as_bytes(), path, options)?;
    let message = format!("{} row(s) with a value that is not a finite number were dropped", all - left);
    notes.insert(
        0,
        QualityNote {
            lines: text
                .lines()
                .enumerate()
                .filter(|(_, l)| is_nonfinite(l))
                .take(100)
                .map(|(k, _)| k as u64 + 1)
                .collect(),
            ..QualityNote::new(QualityKind::Gaps, message, [("count", (all - left) as f64)])
        },
    );
    Ok((recording, notes))
}
