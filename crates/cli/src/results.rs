//! Where results go, and the last words of a command that makes a folder.

use crate::args::OutputArgs;
use crate::exit::Failure;
use crate::terminal::print;
use std::path::{Path, PathBuf};
use stylet_api::{OutputFiles, OutputLock};

impl OutputArgs {
    /// The folder for the results: the one that is named, else `stylet-out/` and the input's name with `more` behind it.
    pub fn output_folder(&self, input: &Path, more: &str) -> PathBuf {
        self.out.clone().unwrap_or_else(|| default_folder(input, more))
    }

    /// Writes the files; says, unless asked to be quiet, what they hold and where the report is.
    ///
    /// # Errors
    /// [`Failure`] when they cannot be written, or nothing can be said.
    pub fn write_and_print(
        &self,
        folder: &Path,
        output: &OutputFiles,
        said: impl FnOnce() -> String,
    ) -> Result<(), Failure> {
        output.write(folder)?;
        self.report(folder, said)
    }

    /// The same into a folder that is claimed already.
    ///
    /// # Errors
    /// [`Failure`] when they cannot be written, or nothing can be said.
    pub fn write_locked_and_print(
        &self,
        claim: &OutputLock,
        output: &OutputFiles,
        said: impl FnOnce() -> String,
    ) -> Result<(), Failure> {
        output.write_locked(claim)?;
        self.report(claim.folder(), said)
    }

    fn report(&self, folder: &Path, said: impl FnOnce() -> String) -> Result<(), Failure> {
        if self.quiet {
            return Ok(());
        }
        print(&format!("{}\nReport: {}\n", said(), folder.join("report.html").display()))
    }
}

/// Where results go when nothing is said: `stylet-out/` and the input's name.
pub fn default_folder(input: &Path, more: &str) -> PathBuf {
    let mut name = input.file_stem().unwrap_or(input.as_os_str()).to_os_string();
    name.push(more);
    Path::new("stylet-out").join(name)
}
