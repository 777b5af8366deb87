//! How a command ends: exit codes, and errors that say what, where and what would be right.

use miette::Diagnostic;
use std::process::ExitCode;

/// Exit code: the command did what it was asked.
pub const DONE: u8 = 0;
/// Exit code: a gate or a check failed.
pub const CHECK_FAILED: u8 = 1;
/// Exit code: the input is wrong; the message names file, line and field.
pub const INPUT_WRONG: u8 = 2;
/// Exit code: an internal error; please report it.
pub const INTERNAL: u8 = 3;

/// Why a command ended early.
#[derive(Debug, thiserror::Error, Diagnostic)]
pub enum Failure {
    /// A scenario or configuration is wrong.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Input(Box<stylet_scenario::InputError>),
    /// A recording is wrong.
    #[error(transparent)]
    Recording(#[from] stylet_record::RecordError),
    /// The scenario asks for what cannot be simulated.
    #[error("{file}: {why}")]
    Simulate {
        /// Scenario file.
        file: String,
        /// Reason and remedy.
        why: stylet_testbed::SimulateError,
    },
    /// The output cannot be written.
    #[error("{path}: cannot be written: {why}; nothing was changed there")]
    Output {
        /// File or folder.
        path: String,
        /// What the system says.
        why: std::io::Error,
    },
    /// Standard output cannot be written.
    #[error(
        "standard output cannot be written: {0}; files in the output folder are complete, only what would be printed is lost: make room \
         where it goes, or use --quiet"
    )]
    Say(std::io::Error),
    /// What was asked for cannot be done with what was given; the sentence says why and what would.
    #[error("{0}")]
    Check(String),
    /// Bounds of a gate do not hold.
    #[error("{failed} of {of} bounds do not hold")]
    Gate {
        /// Bounds that do not hold.
        failed: usize,
        /// All bounds.
        of: usize,
    },
    /// Recordings and scenario do not belong together.
    #[error(transparent)]
    Diagnose(#[from] stylet_diagnose::DiagnoseError),
    /// A data set cannot be used.
    #[error(transparent)]
    Dataset(stylet_diagnose::set::dataset::DatasetError),
    /// An argument names what there is not.
    #[error("{0}")]
    Argument(String),
    /// A mistake of ours.
    #[error("internal error: {0}; please report it")]
    Internal(String),
}

impl From<stylet_scenario::InputError> for Failure {
    fn from(error: stylet_scenario::InputError) -> Self {
        Self::Input(Box::new(error))
    }
}

impl From<stylet_api::Error> for Failure {
    fn from(error: stylet_api::Error) -> Self {
        use stylet_api::Error;
        match error {
            Error::Input(error) => Self::Input(error),
            Error::Problem(_) | Error::Trial(_) | Error::Busy { .. } | Error::NotOneSet { .. } => {
                Self::Check(error.to_string())
            }
            Error::Recording(error) => Self::Recording(error),
            Error::Simulate { file, why } => Self::Simulate { file, why },
            Error::Diagnose(error) => Self::Diagnose(error),
            Error::Output { path, why } => Self::Output { path, why },
            Error::Internal(what) => Self::Internal(what),
        }
    }
}

impl From<stylet_diagnose::set::dataset::DatasetError> for Failure {
    fn from(error: stylet_diagnose::set::dataset::DatasetError) -> Self {
        match error {
            stylet_diagnose::set::dataset::DatasetError::Input(error) => Self::Input(error),
            stylet_diagnose::set::dataset::DatasetError::Recording(error) => Self::Recording(error),
            other => Self::Dataset(other),
        }
    }
}

impl Failure {
    /// The exit code that goes with it.
    #[must_use]
    pub fn code(&self) -> ExitCode {
        ExitCode::from(match self {
            Failure::Input(_)
            | Failure::Recording(_)
            | Failure::Simulate { .. }
            | Failure::Output { .. }
            | Failure::Say(_)
            | Failure::Check(_)
            | Failure::Diagnose(_)
            | Failure::Dataset(_)
            | Failure::Argument(_) => INPUT_WRONG,
            Failure::Gate { .. } => CHECK_FAILED,
            Failure::Internal(_) => INTERNAL,
        })
    }
}
