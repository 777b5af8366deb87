//! Work on a given number of threads.

use crate::cli::exit_codes::Failure;

/// Runs `work` on a pool of this many threads; 0 is one per core.
///
/// # Errors
/// [`Failure`] when the threads cannot be started.
pub fn with_threads<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> Result<T, Failure> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    pool.map(|pool| pool.install(work)).map_err(Failure::internal)
}
