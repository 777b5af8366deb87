//! Work in a thread, with its stages and a way to cancel it.

use crate::messages::Problem;
use serde_json::{Value, json};
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

/// Progress of a thread.
struct Progress<T> {
    stages: Vec<String>,
    result: Option<Result<T, Problem>>,
}

/// Ends the work at its next stage.
struct Cancelled;

/// Work in a thread; `T` is its result.
pub struct BackgroundJob<T> {
    kind: &'static str,
    started: Instant,
    cancelled: Arc<AtomicBool>,
    progress: Arc<Mutex<Progress<T>>>,
    state: &'static str,
    error: String,
    elapsed_s: f64,
}

impl<T: Send + 'static> BackgroundJob<T> {
    /// Starts work, which reports the name of each stage through the given function.
    ///
    /// # Errors
    /// When no thread can be started.
    pub fn start(
        kind: &'static str,
        work: impl FnOnce(&dyn Fn(&str)) -> Result<T, Problem> + Send + 'static,
    ) -> Result<Self, Problem> {
        let cancelled = Arc::new(AtomicBool::new(false));
        let progress = Arc::new(Mutex::new(Progress { stages: Vec::new(), result: None }));
        let (stop, shared) = (cancelled.clone(), progress.clone());
        let run = move || {
            let stage = |name: &str| {
                if stop.load(Ordering::Relaxed) {
                    // Unwinds without printing a panic message.
                    resume_unwind(Box::new(Cancelled));
                }
                shared.lock().unwrap_or_else(PoisonError::into_inner).stages.push(name.to_owned());
            };
            let result = catch_unwind(AssertUnwindSafe(|| work(&stage)))
                .unwrap_or_else(|_| Err(Problem::new("the work stopped unexpectedly; please report it")));
            shared.lock().unwrap_or_else(PoisonError::into_inner).result = Some(result);
        };
        std::thread::Builder::new()
            .name(format!("stylet-{kind}"))
            .spawn(run)
            .map_err(|why| Problem::new(format!("no thread can be started: {why}")))?;
        let started = Instant::now();
        Ok(Self {
            kind,
            started,
            cancelled,
            progress,
            state: "running",
            error: String::new(),
            elapsed_s: 0.0,
        })
    }

    pub fn is_running(&self) -> bool {
        self.state == "running"
    }

    /// Cancels the work: its result is discarded, and its thread ends at the next stage.
    pub fn cancel(&mut self) {
        if self.is_running() {
            self.cancelled.store(true, Ordering::Relaxed);
            self.end("cancelled", String::new());
        }
    }

    /// The result, once.
    pub fn take_result(&mut self) -> Option<T> {
        let result = self.progress.lock().unwrap_or_else(PoisonError::into_inner).result.take()?;
        if !self.is_running() {
            return None;
        }
        match result {
            Ok(result) => {
                self.end("done", String::new());
                Some(result)
            }
            Err(problem) => {
                self.end("failed", problem.error);
                None
            }
        }
    }

    fn end(&mut self, state: &'static str, error: String) {
        (self.state, self.error, self.elapsed_s) = (state, error, self.started.elapsed().as_secs_f64());
    }

    /// What the page shows; `state` is `running`, `done`, `failed` or `cancelled`.
    pub fn view(&self) -> Value {
        let running = self.is_running();
        json!({
            "kind": self.kind,
            "state": self.state,
            "stages": self.progress.lock().unwrap_or_else(PoisonError::into_inner).stages,
            "elapsed_s": if running { self.started.elapsed().as_secs_f64() } else { self.elapsed_s },
            "error": self.error,
        })
    }
}
