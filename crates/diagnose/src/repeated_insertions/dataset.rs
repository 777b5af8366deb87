//! Description of a data set: recordings, reference recordings and the assumed tissue.
//!
//! ```ron
//! Dataset(
//!     name: "skin on muscle",
//!     columns: (time: (name: "time", scale: 1e-6), position: (name: "pz", scale: 1e-3), force: (name: "fz")),
//!     tissue: (surface_m: 0.004, layers: [(name: "skin", thickness_m: 0.011, stiffness_n_per_m: 300.0, friction_ns_per_m2: 10000.0)]),
//!     recordings: ["needle_phantom/skin-on-muscle_*.csv"],
//!     air: "needle_phantom/air_blank.csv",
//!     load: (file: "needle_phantom/constant_5N.csv", force_n: 5.0),
//! )
//! ```
//! File names are relative to the folder in the environment variable `STYLET_MEASURED`; `*` in the last component matches
//! any text. The format is described in `docs/reference/files.md`.

use super::segmented_recording::SegmentedRecording;
use serde::Deserialize;
use std::path::{Path, PathBuf};
use stylet_record::{
    ColumnMap, QualityKind, QualityNote, ReadOptions, RecordError, Recording, check_usable,
    find_outlier_recordings, read_csv, read_csv_groups,
};
use stylet_scenario::{FieldError, InputError, Scenario, parse, read_text};
use stylet_tissue::Tissue;

/// Recording of a known force.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KnownLoad {
    /// File name.
    pub file: String,
    /// Force in N.
    pub force_n: f64,
}

/// Recordings of one layer by itself.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SingleLayerPart {
    /// Name.
    pub name: String,
    /// Layer of the whole tissue, 1-based.
    pub layer: usize,
    /// File names.
    pub recordings: Vec<String>,
}

/// Description of a data set.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename = "Dataset", deny_unknown_fields)]
pub struct Dataset {
    /// Title.
    pub name: String,
    /// Origin of the data.
    #[serde(default)]
    pub source: String,
    /// Names and units of the columns; Stylet's own when omitted.
    #[serde(default)]
    pub columns: Option<ColumnMap>,
    /// Assumed tissue: number, names and thickness of the layers.
    pub tissue: Tissue,
    /// Files of repeated insertions.
    #[serde(default)]
    pub recordings: Vec<String>,
    /// Columns whose values separate the specimens in one file. Every specimen is a separate material.
    #[serde(default)]
    pub split_by: Vec<String>,
    /// File of a motion in air.
    #[serde(default)]
    pub air: Option<String>,
    /// File of a known load.
    #[serde(default)]
    pub load: Option<KnownLoad>,
    /// Recordings of single layers.
    #[serde(default)]
    pub parts: Vec<SingleLayerPart>,
    /// The scenario of which the set was made: its numbers are assumptions to be compared with the fitted ones. Those of a data set
    /// file are starting values.
    #[serde(skip)]
    pub scenario: Option<Scenario>,
    /// Whether to drop and report rows with decreasing or repeated time stamps; set by the command line.
    #[serde(skip)]
    pub repair: bool,
}

/// Error of reading a data set.
#[derive(Debug, thiserror::Error)]
pub enum DatasetError {
    /// Invalid description.
    #[error(transparent)]
    Input(Box<InputError>),
    /// Invalid recording.
    #[error(transparent)]
    Recording(#[from] RecordError),
    /// A file is missing.
    #[error(
        "no file matches {pattern} in {folder}; set STYLET_MEASURED to the folder that holds the recordings, or name them with --data"
    )]
    NoFile {
        /// File name or pattern.
        pattern: String,
        /// Folder that was searched.
        folder: String,
    },
    /// Too few data or missing columns.
    #[error("{0}")]
    TooLittle(String),
}

impl From<InputError> for DatasetError {
    fn from(error: InputError) -> Self {
        Self::Input(Box::new(error))
    }
}

/// Whether a file describes a data set rather than a scenario.
///
/// # Errors
///
/// When the file cannot be read.
pub fn is_dataset(path: &Path) -> Result<bool, InputError> {
    let text = read_text(path)?;
    let first =
        text.lines().map(str::trim).find(|l| !l.is_empty() && !l.starts_with("//") && !l.starts_with("#!"));
    Ok(first.is_some_and(|l| l.starts_with("Dataset")))
}

impl Dataset {
    /// Loads and validates a description.
    ///
    /// # Errors
    ///
    /// [`InputError`] with file, line and column.
    pub fn load(path: &Path) -> Result<Self, InputError> {
        Self::parse(&path.display().to_string(), &read_text(path)?)
    }

    /// Parses and validates a description; `file` is its name in errors.
    ///
    /// # Errors
    /// [`InputError`] with line and column.
    pub fn parse(file: &str, text: &str) -> Result<Self, InputError> {
        let out: Self = parse(file, text)?;
        out.check().map_err(|problem| problem.in_file(file, text))?;
        Ok(out)
    }

    fn check(&self) -> Result<(), FieldError> {
        let layers = self.tissue.layers.len();
        if !(1..=7).contains(&layers) {
            return Err(FieldError::new(
                "tissue.layers",
                format!("there are {layers} layers; 1 to 7 are supported"),
            ));
        }
        for (i, layer) in self.tissue.layers.iter().enumerate() {
            if !(layer.thickness_m > 0.0 && layer.thickness_m < 1.0) {
                let what = format!("is {}; it must lie between 0 and 1 m", layer.thickness_m);
                return Err(FieldError::new(format!("tissue.layers[{i}].thickness_m"), what));
            }
        }
        for (i, part) in self.parts.iter().enumerate() {
            if !(1..=layers).contains(&part.layer) {
                let what = format!("is {}; the tissue has layers 1 to {layers}", part.layer);
                return Err(FieldError::new(format!("parts[{i}].layer"), what));
            }
        }
        match &self.load {
            Some(load) if !(load.force_n.is_finite() && load.force_n != 0.0) => Err(FieldError::new(
                "load.force_n",
                format!("is {}; it must be the known force in N", load.force_n),
            )),
            _ => Ok(()),
        }
    }

    /// Options of the CSV reader.
    #[must_use]
    pub fn options(&self) -> ReadOptions {
        ReadOptions { columns: self.columns.clone(), repair: self.repair }
    }

    /// Reads recordings of a tissue with `layers` layers, and assesses each by itself and against the others ([`stylet_record::assess`],
    /// [`find_outlier_recordings`]).
    ///
    /// # Errors
    /// [`DatasetError`]; [`RecordError::Unusable`] names every unusable recording. Specimens in one file ([`Dataset::split_by`]) share
    /// columns and sensor; those that are too short or without contact are excluded later by the analysis.
    pub fn load_recordings(
        &self,
        files: &[PathBuf],
        layers: usize,
    ) -> Result<Vec<SegmentedRecording>, DatasetError> {
        let mut read = Vec::with_capacity(files.len());
        for file in files {
            read.extend(self.read(file)?);
        }
        if self.split_by.is_empty() {
            check_usable(read.iter().map(|(name, _, notes)| (name.as_str(), notes.as_slice())))?;
            let recordings: Vec<&Recording> = read.iter().map(|(_, recording, _)| recording).collect();
            let outliers = find_outlier_recordings(&recordings);
            for ((_, _, notes), outliers) in read.iter_mut().zip(outliers) {
                notes.extend(outliers);
            }
        } else {
            let grave = |notes: &[QualityNote]| {
                notes.iter().any(|n| {
                    n.blocking
                        && !matches!(n.kind, QualityKind::TooShort | QualityKind::InAir | QualityKind::Stuck)
                })
            };
            if read.iter().all(|(_, _, notes)| grave(notes)) {
                check_usable(read.iter().map(|(name, _, notes)| (name.as_str(), notes.as_slice())))?;
            }
        }
        Ok(read
            .into_iter()
            .map(|(name, recording, notes)| SegmentedRecording {
                notes,
                ..SegmentedRecording::new(name, recording, layers)
            })
            .collect())
    }

    /// Reads the recordings in a file: one, or with [`Dataset::split_by`] one per specimen.
    ///
    /// # Errors
    /// [`DatasetError::Recording`].
    pub fn read(&self, file: &Path) -> Result<Vec<(String, Recording, Vec<QualityNote>)>, DatasetError> {
        let name =
            file.file_name().map_or_else(|| file.display().to_string(), |n| n.to_string_lossy().into_owned());
        if self.split_by.is_empty() {
            let (recording, notes) = read_csv(file, &self.options())?;
            return Ok(vec![(name, recording, notes)]);
        }
        Ok(read_csv_groups(file, &self.options(), &self.split_by)?)
    }
}

/// Files that match a pattern, sorted. Relative patterns start at the folder in the environment variable `STYLET_MEASURED`.
///
/// # Errors
/// [`DatasetError::NoFile`].
pub fn find_files(pattern: &str) -> Result<Vec<PathBuf>, DatasetError> {
    let folder = std::env::var_os("STYLET_MEASURED").map(PathBuf::from);
    let named = folder.as_ref().map_or("STYLET_MEASURED (not set)".to_owned(), |f| f.display().to_string());
    let missing = || DatasetError::NoFile { pattern: pattern.to_owned(), folder: named.clone() };
    let whole = match folder {
        Some(folder) => folder.join(pattern),
        None if Path::new(pattern).is_absolute() => PathBuf::from(pattern),
        None => return Err(missing()),
    };
    let last = whole.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    if !last.contains('*') {
        return if whole.is_file() { Ok(vec![whole]) } else { Err(missing()) };
    }
    let place = whole.parent().map_or_else(PathBuf::new, Path::to_path_buf);
    let mut out: Vec<PathBuf> = std::fs::read_dir(&place)
        .map_err(|_| missing())?
        .flatten()
        .map(|entry| entry.path())
        .filter(|path| path.file_name().is_some_and(|n| matches(&last, &n.to_string_lossy())))
        .collect();
    out.sort();
    if out.is_empty() { Err(missing()) } else { Ok(out) }
}

/// Whether `name` matches `pattern`, in which `*` matches any text.
fn matches(pattern: &str, name: &str) -> bool {
    let mut parts = pattern.split('*');
    let first = parts.next().unwrap_or_default();
    let Some(mut rest) = name.strip_prefix(first) else { return false };
    let parts: Vec<&str> = parts.collect();
    for (i, part) in parts.iter().enumerate() {
        if i + 1 == parts.len() {
            return rest.ends_with(part);
        }
        match rest.find(part) {
            Some(at) => rest = &rest[at + part.len()..],
            None => return false,
        }
    }
    rest.is_empty()
}

#[cfg(test)]
mod tests;
