//! Accuracy of diagnosis, planning and online detection on cases of the independent simulator.

mod answer_question;
mod case_journal;
mod custom_effects;
mod diagnosis;
mod online;
mod online_export;
mod planning;

pub use diagnosis::{CaseSelection, DiagnosisBenchmark};
pub use online::{TestedDetector, online_files, replay_streams, score_online};
pub use online_export::OnlineExport;
pub use planning::PlanningBenchmark;

use crate::error::Error;

/// Parses a word of the argument `what`.
///
/// # Errors
/// [`Error::Request`] for an unknown word, with the known ones.
pub(crate) fn parse_word<T: Copy + PartialEq>(
    what: &str,
    given: &str,
    all: &[T],
    parse: fn(&str) -> Option<T>,
    word: fn(T) -> &'static str,
) -> Result<T, Error> {
    parse(given).filter(|found| all.contains(found)).ok_or_else(|| {
        let known: Vec<&str> = all.iter().map(|x| word(*x)).collect();
        Error::Request(format!("{what}: there is no `{given}`; there are {}", known.join(", ")))
    })
}

/// A pool of this many threads; 0 is one per core.
///
/// # Errors
/// [`Error::Internal`] when the threads cannot be started.
pub(crate) fn thread_pool(threads: usize) -> Result<rayon::ThreadPool, Error> {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().map_err(Error::internal)
}
