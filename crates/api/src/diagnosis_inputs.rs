//! What a diagnosis is made of: scenario, recordings, column map.

use crate::error::Error;
use crate::output_folder::recover;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use stylet_diagnose::NamedRecording;
use stylet_record::{ReadOptions, read_csv_skip_nonfinite};

/// What a diagnosis is made of: `inputs.json` of its folder. Paths as they were given.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct DiagnosisInputs {
    /// Scenario.
    pub scenario: PathBuf,
    /// Recordings.
    pub data: Vec<PathBuf>,
    /// Column map.
    pub columns: Option<PathBuf>,
    /// Whether rows with backward time stamps were dropped.
    pub repair: bool,
}

/// The file in which a diagnosis names its inputs.
pub const INPUTS_FILE: &str = "inputs.json";

impl DiagnosisInputs {
    /// The inputs with absolute paths, so that the folder can be used from anywhere.
    #[must_use]
    pub fn with_absolute_paths(&self) -> Self {
        let full = |p: &PathBuf| std::path::absolute(p).unwrap_or_else(|_| p.clone());
        Self {
            scenario: full(&self.scenario),
            data: self.data.iter().map(full).collect(),
            columns: self.columns.as_ref().map(full),
            repair: self.repair,
        }
    }

    /// What the diagnosis in a folder was made of.
    ///
    /// # Errors
    /// [`Error::Request`] when the folder does not say; as [`settle`] when a killed command had begun something there.
    pub fn from_folder(folder: &Path) -> Result<Self, Error> {
        recover(folder)?;
        let path = folder.join(INPUTS_FILE);
        let text = std::fs::read_to_string(&path).map_err(|_| {
            Error::Request(format!(
                "{}: holds no {INPUTS_FILE}; name the folder that `stylet diagnose` wrote, or a scenario file",
                folder.display()
            ))
        })?;
        serde_json::from_str(&text)
            .map_err(|e| Error::Request(format!("{}: {e}; make the diagnosis anew", path.display())))
    }

    /// The recordings, read.
    ///
    /// # Errors
    /// What is wrong with the column map or with a recording, and where.
    pub fn read_recordings(&self) -> Result<Vec<NamedRecording>, Error> {
        read_recordings(&self.data, &read_options(self.columns.as_deref(), self.repair)?)
    }

    /// The command that repeats a diagnosis of single recordings.
    #[must_use]
    pub fn command_line(&self) -> String {
        let mut command = format!("stylet diagnose {} --data", self.scenario.display());
        for path in &self.data {
            let _ = write!(command, " {}", path.display());
        }
        if let Some(columns) = &self.columns {
            let _ = write!(command, " --columns {}", columns.display());
        }
        command
    }
}

/// How recordings are read: by the column map of a file, if there is one.
///
/// # Errors
/// [`Error::Input`] when the map is wrong.
pub fn read_options(columns: Option<&Path>, repair: bool) -> Result<ReadOptions, Error> {
    Ok(ReadOptions { columns: columns.map(stylet_scenario::load).transpose()?, repair })
}

/// Reads recordings, several at once.
///
/// # Errors
/// [`Error::Recording`] with file and line.
pub fn read_recordings(data: &[PathBuf], options: &ReadOptions) -> Result<Vec<NamedRecording>, Error> {
    let read: Vec<_> = data.par_iter().map(|path| read_csv_skip_nonfinite(path, options)).collect();
    let named = data.iter().zip(read).map(|(path, read)| {
        let (recording, notes) = read?;
        Ok(NamedRecording { name: recording_name(path, data), recording, notes })
    });
    named.collect()
}

/// The file's name, with its folder when names repeat.
#[must_use]
pub fn recording_name(path: &Path, all: &[PathBuf]) -> String {
    let repeated = all.iter().filter(|p| p.file_name() == path.file_name()).count() > 1;
    match path.file_name() {
        Some(name) if !repeated => name.to_string_lossy().into_owned(),
        _ => path.display().to_string(),
    }
}
