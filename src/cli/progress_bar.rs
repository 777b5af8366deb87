//! Progress bar with rate and remaining time, shown when standard error is a terminal.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::IsTerminal;

/// A bar on standard error.
pub struct Progress(ProgressBar);

impl Progress {
    /// A bar over `trials` of the given unit.
    pub fn new(trials: u64, what: &str, quiet: bool) -> Self {
        let shown = !quiet && std::io::stderr().is_terminal();
        let target = if shown { ProgressDrawTarget::stderr_with_hz(5) } else { ProgressDrawTarget::hidden() };
        let bar = ProgressBar::with_draw_target(Some(trials), target);
        let style = format!("{{wide_bar}} {{pos}}/{{len}} {what}, {{per_sec}}, {{eta}} left");
        if let Ok(style) = ProgressStyle::with_template(&style) {
            bar.set_style(style);
        }
        Self(bar)
    }

    /// Counts finished trials.
    pub fn advance(&self, trials: u64) {
        self.0.inc(trials);
    }

    /// Counts trials that were already present; they do not enter the rate.
    pub fn skip(&self, trials: u64) {
        self.0.inc(trials);
        self.0.reset_eta();
    }

    /// Removes the bar.
    pub fn finish(&self) {
        self.0.finish_and_clear();
    }
}
