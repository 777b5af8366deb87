//! Why a function ends early: what, where, and what would be right.

use miette::Diagnostic;
use std::path::Path;
use stylet_diagnose::repeated_insertions::dataset::DatasetError;
use stylet_plan::PlanError;
use stylet_sweep::shard::ShardError;

/// Why a function ended early. The sentence is the one that the command prints.
#[derive(Debug, thiserror::Error, Diagnostic)]
pub enum Error {
    /// A scenario or configuration is wrong.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Input(Box<stylet_scenario::InputError>),
    /// A number of a scenario or sweep that did not come from a file is wrong.
    #[error("{}: {}", .0.path, .0.message)]
    Problem(stylet_scenario::FieldError),
    /// A recording is wrong.
    #[error(transparent)]
    Recording(#[from] stylet_record::RecordError),
    /// The scenario asks for what cannot be simulated.
    #[error("{file}: {why}")]
    Simulate {
        /// Scenario file, or its name.
        file: String,
        /// Reason and remedy.
        why: stylet_testbed::SimulateError,
    },
    /// Recordings and scenario do not belong together.
    #[error(transparent)]
    Diagnose(#[from] stylet_diagnose::DiagnoseError),
    /// A data set cannot be used.
    #[error(transparent)]
    Dataset(Box<DatasetError>),
    /// What was asked for cannot be done with what was given; the sentence says why and what would.
    #[error("{0}")]
    Request(String),
    /// A trial of a sweep gives no row.
    #[error(transparent)]
    Trial(#[from] stylet_sweep::TrialError),
    /// The output cannot be written.
    #[error("{path}: cannot be written: {why}; nothing was changed there")]
    Output {
        /// File or folder.
        path: String,
        /// What the system says.
        why: std::io::Error,
    },
    /// The output is written aside, and cannot be brought to its places or given up.
    #[error(
        "{path}: cannot be written: {why}; the new results are whole in its folder .stylet-set, and the next stylet command that uses \
         {path} puts them in their places: mend the disk and give it again"
    )]
    Unfinished {
        /// Folder.
        path: String,
        /// What the system says.
        why: std::io::Error,
    },
    /// Another process writes there.
    #[error(
        "{path}: another stylet is writing to this folder; wait until it has ended, or give this one a folder of its own with --out"
    )]
    Busy {
        /// Folder.
        path: String,
    },
    /// A file of a set was changed or replaced.
    #[error(
        "{path}: does not belong to the same set of results as the folder's manifest.json: it was changed or replaced; make the \
         results anew, or put the file back"
    )]
    InconsistentSet {
        /// File.
        path: String,
    },
    /// A mistake of ours.
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
    /// Why there is no plan, with the file that says what is wrong.
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

    /// A mistake of ours, from what was said about it.
    pub(crate) fn internal(error: impl std::fmt::Display) -> Self {
        Self::Internal(error.to_string())
    }
}
