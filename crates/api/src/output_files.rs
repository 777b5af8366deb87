//! The files of one output folder, collected in memory and written as one set.

use crate::error::Error;
use crate::output_folder::{Inputs, OutputLock, StagedFile};
use serde::Serialize;
use std::path::Path;

/// A value as the content of a JSON file.
///
/// # Errors
/// [`Error::Internal`] when the value cannot be written.
pub fn to_json_bytes(value: &impl Serialize) -> Result<Vec<u8>, Error> {
    let mut json = serde_json::to_vec_pretty(value).map_err(Error::internal)?;
    json.push(b'\n');
    Ok(json)
}

/// Removes line breaks, so that a path fits in a one-line comment.
pub(crate) fn one_line(text: &str) -> String {
    text.chars()
        .map(|c| if c.is_control() { c.escape_default().to_string() } else { c.to_string() })
        .collect()
}

/// The files of one output folder.
#[derive(Debug, Default)]
pub struct OutputFiles {
    files: Vec<(&'static str, Vec<u8>)>,
    /// Files already staged in the locked folder.
    staged: Vec<StagedFile>,
    inputs: Inputs,
}

impl OutputFiles {
    /// Adds a file.
    pub fn add(&mut self, name: &'static str, content: impl Into<Vec<u8>>) {
        self.files.push((name, content.into()));
    }

    /// Adds a value as a JSON file.
    ///
    /// # Errors
    /// [`Error::Internal`] when the value cannot be written.
    pub fn add_json(&mut self, name: &'static str, value: &impl Serialize) -> Result<(), Error> {
        self.add(name, to_json_bytes(value)?);
        Ok(())
    }

    /// Adds a file that was staged piece by piece. The set must then be written with the lock that staged it.
    pub fn add_staged(&mut self, part: StagedFile) {
        self.staged.push(part);
    }

    /// Names the inputs, which are then not replaced.
    #[must_use]
    pub fn with_inputs(self, inputs: Inputs) -> Self {
        Self { inputs, ..self }
    }

    /// Names and contents of the files in memory.
    pub fn files(&self) -> impl Iterator<Item = (&'static str, &[u8])> {
        self.files.iter().map(|(name, content)| (*name, content.as_slice()))
    }

    /// Writes all files and `manifest.json` into `folder`, which is created if missing. Files of the same names are replaced when they
    /// are those of an earlier set.
    ///
    /// # Errors
    /// [`Error::Output`], [`Error::Busy`], [`Error::OtherCommand`], [`Error::NotReplaced`]; the folder is then unchanged.
    pub fn write(&self, folder: &Path) -> Result<(), Error> {
        self.write_locked(&OutputLock::new(folder)?)
    }

    /// As [`Self::write`], into a folder that is locked already.
    ///
    /// # Errors
    /// [`Error::Output`], [`Error::OtherCommand`], [`Error::NotReplaced`]; the folder is then unchanged.
    pub fn write_locked(&self, lock: &OutputLock) -> Result<(), Error> {
        lock.write_set(&self.staged, &self.files, &self.inputs)
    }
}
