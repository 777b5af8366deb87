//! Files of one output folder, waiting to be written as one set.

use crate::error::Error;
use crate::output_folder::{OutputLock, StagedFile};
use serde::Serialize;
use std::path::Path;

/// A value as the text of a JSON file.
///
/// # Errors
/// [`Error::Internal`] when the value cannot be written.
pub fn to_json_bytes(value: &impl Serialize) -> Result<Vec<u8>, Error> {
    let mut json = serde_json::to_vec_pretty(value).map_err(Error::internal)?;
    json.push(b'\n');
    Ok(json)
}

/// Files of one output folder, waiting to be written together.
#[derive(Debug, Default)]
pub struct OutputFiles {
    files: Vec<(&'static str, Vec<u8>)>,
    /// Files that lie in the claimed folder already.
    parts: Vec<StagedFile>,
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

    /// Adds a file that was written piece by piece; the set then belongs into the folder of the claim that began it.
    pub fn add_staged(&mut self, part: StagedFile) {
        self.parts.push(part);
    }

    /// Names and contents of the files in memory.
    pub fn files(&self) -> impl Iterator<Item = (&'static str, &[u8])> {
        self.files.iter().map(|(name, content)| (*name, content.as_slice()))
    }

    /// Writes all files into `folder`, which is made when it does not exist, and `manifest.json` that tells of them. Files of the
    /// same names are replaced, others are left alone.
    ///
    /// # Errors
    /// [`Error::Output`], [`Error::Busy`]; the folder is then as it was before.
    pub fn write(&self, folder: &Path) -> Result<(), Error> {
        self.write_locked(&OutputLock::new(folder)?)
    }

    /// The same into a folder that is claimed already.
    ///
    /// # Errors
    /// [`Error::Output`]; the folder is then as it was before.
    pub fn write_locked(&self, claim: &OutputLock) -> Result<(), Error> {
        claim.write_staged(&self.parts, &self.files)
    }
}
