//! Errors of the commands: what is wrong, where, and the remedy.

use miette::Diagnostic;
use std::path::Path;
use stylet_diagnose::repeated_insertions::dataset::DatasetError;
use stylet_plan::PlanError;
use stylet_sweep::shard::ShardError;

/// Error of a command; its text is what the command prints.
#[derive(Debug, thiserror::Error, Diagnostic)]
pub enum Error {
    /// A scenario or configuration is wrong.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Input(Box<stylet_scenario::InputError>),
    /// A value of a scenario or sweep that was not read from a file is wrong.
    #[error("{}: {}", .0.path, .0.message)]
    Problem(stylet_scenario::FieldError),
    /// A recording is wrong.
    #[error(transparent)]
    Recording(#[from] stylet_record::RecordError),
    /// The scenario cannot be simulated.
    #[error("{file}: {why}")]
    Simulate {
        /// Scenario file, or its name.
        file: String,
        /// Reason and remedy.
        why: stylet_testbed::SimulateError,
    },
    /// Recordings and scenario do not match.
    #[error(transparent)]
    Diagnose(#[from] stylet_diagnose::DiagnoseError),
    /// A data set cannot be used.
    #[error(transparent)]
    Dataset(Box<DatasetError>),
    /// The request cannot be fulfilled with these inputs; the text gives reason and remedy.
    #[error("{0}")]
    Request(String),
    /// A trial of a sweep failed.
    #[error(transparent)]
    Trial(#[from] stylet_sweep::TrialError),
    /// The output cannot be written.
    #[error("{path}: cannot be written: {why}; nothing was changed there")]
    Output {
        /// File or folder.
        path: String,
        /// The system's error.
        why: std::io::Error,
    },
    /// The output is committed, but can neither be moved to its place nor withdrawn.
    #[error(
        "{path}: cannot be written: {why}; the new results are complete in its folder .stylet-set, and the next stylet command that uses \
         {path} moves them to their places: repair the disk and repeat the command"
    )]
    Unfinished {
        /// Folder.
        path: String,
        /// The system's error.
        why: std::io::Error,
    },
    /// Another process holds the folder.
    #[error(
        "{path}: another stylet is writing to this folder; wait until it has ended, or give this command a folder of its own with --out"
    )]
    Busy {
        /// Folder.
        path: String,
    },
    /// The folder holds the results of another command.
    #[error(
        "{path}: holds the results of `stylet {command}` ({file}), with which these would be mixed; give this command a folder of its own \
         with --out"
    )]
    OtherCommand {
        /// Folder.
        path: String,
        /// The other command.
        command: &'static str,
        /// Its result file.
        file: &'static str,
    },
    /// A file that Stylet did not write, or that is an input, is at the place of an output.
    #[error(
        "{path}: {why}, and would be replaced; it is left as it is: choose another folder or name (--out), or move the file away"
    )]
    NotReplaced {
        /// File.
        path: String,
        /// What it is.
        why: &'static str,
    },
    /// The default folder holds the results for another input.
    #[error(
        "{path}: holds the results for {input}; give this command a folder of its own with --out, or remove that one"
    )]
    OtherInput {
        /// Folder.
        path: String,
        /// The other input.
        input: String,
    },
    /// A file of a set was changed or replaced.
    #[error(
        "{path}: does not belong to the same set of results as the folder's manifest.json: it was changed or replaced; repeat the \
         command, or restore the file"
    )]
    InconsistentSet {
        /// File.
        path: String,
    },
    /// A bug of Stylet.
    #[error("internal error: {0}; please report it")]
    Internal(String),
}

impl From<stylet_scenario::InputError> for Error {
    fn from(error: stylet_scenario::InputError) -> Self {
        Self::Input(Box::new(error))
    }
}

impl From<stylet_scenario::FieldError> for Error {
    fn from(problem: stylet_scenario::FieldError) -> Self {
        Self::Problem(problem)
    }
}

impl From<DatasetError> for Error {
    fn from(error: DatasetError) -> Self {
        match error {
            DatasetError::Input(error) => Self::Input(error),
            DatasetError::Recording(error) => Self::Recording(error),
            other => Self::Dataset(Box::new(other)),
        }
    }
}

impl From<ShardError> for Error {
    fn from(error: ShardError) -> Self {
        Self::Request(error.to_string())
    }
}

impl Error {
    /// Whether the inputs are valid, but the recordings are unusable for a diagnosis.
    #[must_use]
    pub fn is_unusable(&self) -> bool {
        matches!(self, Self::Diagnose(stylet_diagnose::DiagnoseError::Unusable { .. }))
    }

    /// Error of planning, with the file concerned.
    pub(crate) fn of_plan(file: &Path, why: PlanError) -> Self {
        match why {
            PlanError::Diagnose(why) => Self::Diagnose(why),
            PlanError::Simulate(why) => Self::Simulate { file: file.display().to_string(), why },
            other => Self::Request(format!("{}: {other}", file.display())),
        }
    }

    /// A file or folder that cannot be written.
    pub(crate) fn output(path: &Path, why: std::io::Error) -> Self {
        Self::Output { path: path.display().to_string(), why }
    }

    /// A bug of Stylet, from its description.
    pub fn internal(error: impl std::fmt::Display) -> Self {
        Self::Internal(error.to_string())
    }
}
