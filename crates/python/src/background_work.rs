//! Long work on a background thread: the interpreter stays free, Ctrl-C works, progress is reported.

use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuildError, ThreadPoolBuilder};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

/// Interval between checks for Ctrl-C.
const SIGNAL_CHECK_INTERVAL: Duration = Duration::from_millis(50);

/// Panic payload that ends cancelled work.
struct Stopped;

/// Reports progress from the worker thread and carries the request to stop.
pub struct ProgressCallback {
    sender: Sender<(String, u64)>,
    stop: std::sync::Arc<AtomicBool>,
}

impl ProgressCallback {
    /// Reports the current stage and the number of finished parts; `false` requests the work to end.
    pub fn report(&self, what: &str, done: u64) -> bool {
        // A closed channel is no reason to fail.
        let _ = self.sender.send((what.to_owned(), done));
        !self.stop.load(Ordering::Relaxed)
    }

    /// Reports, and unwinds out of the work when it should end: for work that does not check.
    pub fn report_or_stop(&self, what: &str, done: u64) {
        if !self.report(what, done) {
            std::panic::resume_unwind(Box::new(Stopped));
        }
    }
}

/// Process and threads of work that may call Python.
static CALLING_THREADS: Mutex<Option<(u32, &'static ThreadPool)>> = Mutex::new(None);

/// From now on, work runs on threads that the interpreter knows: to make a thread known for a call and to forget it takes longer
/// than the call.
pub fn start_calling_threads() -> Result<(), ThreadPoolBuildError> {
    let mut threads = CALLING_THREADS.lock().unwrap_or_else(PoisonError::into_inner);
    // A process that was forked has none of the threads of its parent.
    if threads.is_none_or(|(process, _)| process != std::process::id()) {
        let pool = ThreadPoolBuilder::new().spawn_handler(|thread| {
            let known = || Python::attach(|py| py.detach(|| thread.run()));
            std::thread::Builder::new().spawn(known).map(drop)
        });
        *threads = Some((std::process::id(), Box::leak(Box::new(pool.build()?))));
    }
    Ok(())
}

/// The threads, if they were started in this process or in its parent.
fn calling_threads() -> Option<&'static ThreadPool> {
    let started = || *CALLING_THREADS.lock().unwrap_or_else(PoisonError::into_inner);
    started()?;
    // Without new threads the work is only slower.
    start_calling_threads().ok()?;
    started().map(|(_, pool)| pool)
}

/// Runs `work` on another thread while the interpreter is free; `progress` (a callable or none) is called with a text and a count. On
/// Ctrl-C, or when `progress` raises, the work ends at its next report and the exception is raised.
pub fn run_in_background<T: Send + 'static>(
    py: Python<'_>,
    progress: Option<Py<PyAny>>,
    work: impl FnOnce(&ProgressCallback) -> T + Send + 'static,
) -> PyResult<T> {
    let (sender, words) = channel();
    let words = Mutex::new(words);
    let stop = std::sync::Arc::new(AtomicBool::new(false));
    let callback = ProgressCallback { sender, stop: stop.clone() };
    let thread = std::thread::spawn(move || match calling_threads() {
        Some(pool) => pool.install(|| work(&callback)),
        None => work(&callback),
    });
    let outcome = loop {
        // The mutex only makes the receiver usable outside the interpreter's thread.
        let word = py.detach(|| match words.lock() {
            Ok(words) => words.recv_timeout(SIGNAL_CHECK_INTERVAL),
            Err(_) => Err(RecvTimeoutError::Disconnected),
        });
        let asked = match word {
            Ok((what, done)) => progress.as_ref().map_or(Ok(()), |f| f.call1(py, (what, done)).map(drop)),
            Err(RecvTimeoutError::Timeout) => Ok(()),
            Err(RecvTimeoutError::Disconnected) => break Ok(()),
        };
        if let Err(raised) = asked.and_then(|()| py.check_signals()) {
            stop.store(true, Ordering::Relaxed);
            break Err(raised);
        }
    };
    // After an exception the thread is left to find out by itself.
    outcome?;
    match py.detach(|| thread.join()) {
        Ok(result) => Ok(result),
        Err(_) => Err(pyo3::exceptions::PyRuntimeError::new_err(
            "internal error: the work stopped unexpectedly; please report it",
        )),
    }
}
