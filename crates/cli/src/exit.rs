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
    /// What was asked for could not be done.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Work(Box<stylet_api::Error>),
    /// Standard output cannot be written.
    #[error(
        "standard output cannot be written: {0}; files in the output folder are complete, only what would be printed is lost: make room \
         where it goes, or use --quiet"
    )]
    Stdout(std::io::Error),
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
}

/// Errors of [`stylet_api`], and of the crates below it, for each of which it has a place.
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
    /// A mistake of ours, from what was said about it.
    pub fn internal(error: impl std::fmt::Display) -> Self {
        stylet_api::Error::Internal(error.to_string()).into()
    }

    /// The exit code that goes with it.
    #[must_use]
    pub fn code(&self) -> ExitCode {
        ExitCode::from(match self {
            Failure::Work(why) if matches!(**why, stylet_api::Error::Internal(_)) => INTERNAL,
            Failure::Work(_) | Failure::Stdout(_) | Failure::Check(_) => INPUT_WRONG,
            Failure::Gate { .. } => CHECK_FAILED,
        })
    }
}
