//! Inputs of a diagnosis: scenario, recordings, column map.

use crate::error::Error;
use crate::output_folder::recover;
use serde::{Deserialize, Serialize};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use stylet_diagnose::NamedRecording;
use stylet_record::{ReadOptions, read_csv};
use stylet_scenario::Scenario;
use stylet_stats::parallel::*;

/// Inputs of a diagnosis; the content of `inputs.json`.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct DiagnosisInputs {
    /// Scenario file.
    pub scenario: PathBuf,
    /// Files of custom effects that are candidates, too.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub effects: Vec<PathBuf>,
    /// Files of the recordings.
    pub data: Vec<PathBuf>,
    /// File of the column map.
    pub columns: Option<PathBuf>,
    /// Whether rows with backward time stamps are dropped.
    pub repair: bool,
}

/// File in the folder of a diagnosis that lists its inputs.
pub const INPUTS_FILE: &str = "inputs.json";

impl DiagnosisInputs {
    /// The same with absolute paths, independent of the working directory.
    #[must_use]
    pub fn with_absolute_paths(&self) -> Self {
        let full = |p: &PathBuf| std::path::absolute(p).unwrap_or_else(|_| p.clone());
        Self {
            scenario: full(&self.scenario),
            effects: self.effects.iter().map(full).collect(),
            data: self.data.iter().map(full).collect(),
            columns: self.columns.as_ref().map(full),
            repair: self.repair,
        }
    }

    /// The scenario, with the effects of all files among its candidates.
    ///
    /// # Errors
    /// [`Error::Input`] when a file is wrong.
    pub fn load_scenario(&self) -> Result<Scenario, Error> {
        let mut scenario = Scenario::load(&self.scenario)?;
        for file in &self.effects {
            scenario.add_candidates(file)?;
        }
        Ok(scenario)
    }

    /// The inputs of the diagnosis in a folder.
    ///
    /// # Errors
    /// [`Error::Request`] when the folder has no valid `inputs.json`; as [`recover`].
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
            .map_err(|e| Error::Request(format!("{}: {e}; repeat the diagnosis", path.display())))
    }

    /// Reads the recordings.
    ///
    /// # Errors
    /// [`Error::Input`] for the column map, [`Error::Recording`] with file and line.
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

/// Options for reading recordings, with the column map of a file.
///
/// # Errors
/// [`Error::Input`] when the map is wrong.
pub fn read_options(columns: Option<&Path>, repair: bool) -> Result<ReadOptions, Error> {
    Ok(ReadOptions { columns: columns.map(stylet_scenario::load).transpose()?, repair })
}

/// Reads recordings in parallel.
///
/// # Errors
/// [`Error::Recording`] with file and line.
pub fn read_recordings(data: &[PathBuf], options: &ReadOptions) -> Result<Vec<NamedRecording>, Error> {
    let read: Vec<_> = data.par_iter().map(|path| read_csv(path, options)).collect();
    let named = data.iter().zip(read).map(|(path, read)| {
        let (recording, notes) = read?;
        Ok(NamedRecording { name: recording_name(path, data), recording, notes })
    });
    named.collect()
}

/// Name of a recording: the file name, or the whole path when file names repeat.
#[must_use]
pub fn recording_name(path: &Path, all: &[PathBuf]) -> String {
    let repeated = all.iter().filter(|p| p.file_name() == path.file_name()).count() > 1;
    match path.file_name() {
        Some(name) if !repeated => name.to_string_lossy().into_owned(),
        _ => path.display().to_string(),
    }
}
