//! Long work beside the interpreter: it is released, Ctrl-C is honoured, progress is told.

use pyo3::prelude::*;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::time::Duration;

/// How long Ctrl-C may have to wait.
const LOOK_AT_SIGNALS: Duration = Duration::from_millis(50);

/// What unwinds out of work that is no longer wanted.
struct Stopped;

/// What the work is given: it tells how far it is, and ends when nobody wants it any more.
pub struct ProgressCallback {
    sender: Sender<(String, u64)>,
    stop: std::sync::Arc<AtomicBool>,
}

impl ProgressCallback {
    /// Tells what is done now, and how many parts are done. `false` when the work should end.
    pub fn report(&self, what: &str, done: u64) -> bool {
        // Nobody listening is no reason to fail.
        let _ = self.sender.send((what.to_owned(), done));
        !self.stop.load(Ordering::Relaxed)
    }

    /// Tells, and leaves the work at once when it should end: for work that asks nobody.
    pub fn report_or_stop(&self, what: &str, done: u64) {
        if !self.report(what, done) {
            std::panic::resume_unwind(Box::new(Stopped));
        }
    }
}

/// Does `work` on another thread while the interpreter is free; `progress` (a callable or none) is called with a text and a
/// count. On Ctrl-C, or when `progress` raises, the work ends at its next word and the exception is raised.
pub fn run_in_background<T: Send + 'static>(
    py: Python<'_>,
    progress: Option<Py<PyAny>>,
    work: impl FnOnce(&ProgressCallback) -> T + Send + 'static,
) -> PyResult<T> {
    let (sender, words) = channel();
    let words = Mutex::new(words);
    let stop = std::sync::Arc::new(AtomicBool::new(false));
    let told = ProgressCallback { sender, stop: stop.clone() };
    let thread = std::thread::spawn(move || work(&told));
    let outcome = loop {
        // Nobody else locks it; the lock is what lets it leave the interpreter's thread.
        let word = py.detach(|| match words.lock() {
            Ok(words) => words.recv_timeout(LOOK_AT_SIGNALS),
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
