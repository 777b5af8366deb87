//! Output folder of a command: its arguments, its default, and the last lines on the terminal.

use crate::cli::exit_codes::Failure;
use crate::cli::terminal_output::print;
use clap::Args;
use std::ffi::OsString;
use std::path::{Component, Path, PathBuf};
use stylet_api::output_folder::Inputs;
use stylet_api::{OutputFiles, OutputLock};

/// Output folder and verbosity, common to the commands that write a folder.
#[derive(Clone, Debug, Default, Args)]
pub struct OutputArgs {
    /// Folder for the results [default: stylet-out/<name of the input>].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Print nothing but errors.
    #[arg(long, short)]
    pub quiet: bool,
}

impl OutputArgs {
    /// The folder given by `--out`, else the default for this input.
    pub fn output_folder(&self, input: &Path, suffix: &str) -> PathBuf {
        self.out.clone().unwrap_or_else(|| default_folder(input, suffix))
    }

    /// The inputs of a command whose default folder is named after `named`.
    pub fn inputs<'a>(&self, named: &'a Path, others: impl IntoIterator<Item = &'a PathBuf>) -> Inputs {
        let files = std::iter::once(named).chain(others.into_iter().map(PathBuf::as_path));
        Inputs {
            files: files.map(Path::to_path_buf).collect(),
            names_folder: self.out.is_none().then(|| named.to_path_buf()),
        }
    }

    /// Writes the files; unless quiet, prints the summary and the path of the report.
    ///
    /// # Errors
    /// [`Failure`] when files or standard output cannot be written.
    pub fn write_and_print(
        &self,
        folder: &Path,
        output: &OutputFiles,
        summary: impl FnOnce() -> String,
    ) -> Result<(), Failure> {
        output.write(folder)?;
        self.print_summary(folder, summary)
    }

    /// As [`Self::write_and_print`], into a folder that is locked already.
    ///
    /// # Errors
    /// [`Failure`] when files or standard output cannot be written.
    pub fn write_locked_and_print(
        &self,
        lock: &OutputLock,
        output: &OutputFiles,
        summary: impl FnOnce() -> String,
    ) -> Result<(), Failure> {
        output.write_locked(lock)?;
        self.print_summary(lock.folder(), summary)
    }

    fn print_summary(&self, folder: &Path, summary: impl FnOnce() -> String) -> Result<(), Failure> {
        if self.quiet {
            return Ok(());
        }
        print(&format!("{}\nReport: {}\n", summary(), folder.join("report.html").display()))
    }
}

/// File names given by Stylet itself, which occur in many folders.
const GENERIC_NAMES: [&str; 4] = ["extended", "recording", "scenario", "sweep"];

/// The default output folder: `stylet-out/` and the input's name. For a recording (whatever is not RON) and for the names that Stylet
/// gives itself the folders of the path are part of the name, so that inputs in different folders have different output folders.
pub fn default_folder(input: &Path, suffix: &str) -> PathBuf {
    let stem = input.file_stem().unwrap_or(input.as_os_str());
    let is_recording = input.extension().is_some_and(|ending| ending != "ron");
    let mut name = OsString::new();
    if is_recording || GENERIC_NAMES.iter().any(|generic| stem == *generic) {
        for component in input.parent().into_iter().flat_map(Path::components) {
            if let Component::Normal(folder) = component {
                name.push(folder);
                name.push("-");
            }
        }
    }
    name.push(stem);
    name.push(suffix);
    Path::new("stylet-out").join(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn recordings_of_the_same_name_in_different_folders_have_different_output_folders() {
        let folder = |input: &str, suffix: &str| default_folder(Path::new(input), suffix);
        assert_eq!(folder("recording.csv", ""), Path::new("stylet-out/recording"));
        assert_eq!(folder("./day1/recording.csv", ""), Path::new("stylet-out/day1-recording"));
        assert_eq!(folder("/data/day2/recording.csv", ""), Path::new("stylet-out/data-day2-recording"));
        assert_eq!(folder("scenarios/gel.ron", "-diagnosis"), Path::new("stylet-out/gel-diagnosis"));
        assert_eq!(
            folder("out/a/extended.ron", "-prediction"),
            Path::new("stylet-out/out-a-extended-prediction")
        );
        assert_eq!(folder("out/diagnosis", "-plan"), Path::new("stylet-out/diagnosis-plan"));
    }
}
