//! Examinations at scale: the referee's cases handed to the engine, and what comes of it.

mod answer_question;
mod case_journal;
mod diagnosis;
#[cfg(feature = "own_world")]
pub mod own;
mod planning;

pub use diagnosis::{CaseSelection, DiagnosisBenchmark};
#[cfg(feature = "own_world")]
pub use own::own;
pub use planning::PlanningBenchmark;

use crate::error::Error;

/// A word of a list.
///
/// # Errors
/// [`Error::Request`] for a word that there is not, with those that there are; `what` is the argument.
pub(crate) fn parse_word<T: Copy>(
    what: &str,
    given: &str,
    all: &[T],
    parse: fn(&str) -> Option<T>,
    word: fn(T) -> &'static str,
) -> Result<T, Error> {
    parse(given).ok_or_else(|| {
        let known: Vec<&str> = all.iter().map(|x| word(*x)).collect();
        Error::Request(format!("{what}: there is no `{given}`; there are {}", known.join(", ")))
    })
}

/// Runs `work` with a number of threads; 0 is one per core.
///
/// # Errors
/// [`Error::Internal`] when the threads cannot be had.
pub(crate) fn thread_pool(threads: usize) -> Result<rayon::ThreadPool, Error> {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().map_err(Error::internal)
}
