//! Examinations at scale: the referee's cases handed to the engine, and what comes of it.

mod again;
mod engine;
mod examine;
mod journal;
#[cfg(feature = "own_world")]
pub mod own;

pub use again::Planning;
pub use examine::{Asked, Examination};
#[cfg(feature = "own_world")]
pub use own::own;

use crate::error::Error;

/// A word of a list.
///
/// # Errors
/// [`Error::Request`] for a word that there is not, with those that there are; `what` is the argument.
pub(crate) fn word<T: Copy>(
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
pub(crate) fn pool(threads: usize) -> Result<rayon::ThreadPool, Error> {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().map_err(Error::internal)
}
