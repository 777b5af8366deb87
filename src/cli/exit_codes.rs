//! Exit codes and the errors that lead to them.

use miette::Diagnostic;
use std::process::ExitCode;

/// Exit code: success.
pub const DONE: u8 = 0;
/// Exit code: a gate or a check failed.
pub const CHECK_FAILED: u8 = 1;
/// Exit code: the input is wrong; the message names file, line and field.
pub const INPUT_WRONG: u8 = 2;
/// Exit code: an internal error; please report it.
pub const INTERNAL: u8 = 3;

/// Error of a command.
#[derive(Debug, thiserror::Error, Diagnostic)]
pub enum Failure {
    /// The work failed.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Work(Box<stylet_api::Error>),
    /// Standard output cannot be written.
    #[error(
        "standard output cannot be written: {0}; files in the output folder are complete, only the printed text is lost: free space there, or use --quiet"
    )]
    Stdout(std::io::Error),
    /// The request cannot be fulfilled with these inputs; the message gives reason and remedy.
    #[error("{0}")]
    Check(String),
    /// The recordings are unusable for a diagnosis.
    #[error("a diagnosis of these recordings would mean nothing: {0}")]
    Unusable(String),
    /// Bounds of a gate do not hold.
    #[error("{failed} of {of} bounds do not hold")]
    Gate {
        /// Number of bounds that do not hold.
        failed: usize,
        /// Number of bounds.
        of: usize,
    },
}

/// Conversions from errors of [`stylet_api`] and of the crates below it.
macro_rules! from {
    ($($error:ty),*) => {
        $(impl From<$error> for Failure {
            fn from(error: $error) -> Self {
                Self::Work(Box::new(error.into()))
            }
        })*
    };
}

from!(
    stylet_api::Error,
    stylet_scenario::InputError,
    stylet_record::RecordError,
    stylet_diagnose::repeated_insertions::dataset::DatasetError,
    stylet_sweep::TrialError
);

impl Failure {
    /// A bug of Stylet.
    pub fn internal(error: impl std::fmt::Display) -> Self {
        stylet_api::Error::Internal(error.to_string()).into()
    }

    /// The exit code that goes with it.
    #[must_use]
    pub fn code(&self) -> ExitCode {
        ExitCode::from(match self {
            Failure::Work(why) if matches!(**why, stylet_api::Error::Internal(_)) => INTERNAL,
            Failure::Work(why) if why.is_unusable() => CHECK_FAILED,
            Failure::Work(_) | Failure::Stdout(_) | Failure::Check(_) => INPUT_WRONG,
            Failure::Gate { .. } | Failure::Unusable(_) => CHECK_FAILED,
        })
    }
}
