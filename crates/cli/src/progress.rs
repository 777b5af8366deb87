//! The progress bar: rate and remaining time; nothing when nobody looks at a terminal.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::IsTerminal;

/// A bar on standard error.
pub struct Progress(ProgressBar);

impl Progress {
    /// A bar over `trials`, called `what`.
    pub fn new(trials: u64, what: &str, quiet: bool) -> Self {
        let seen = !quiet && std::io::stderr().is_terminal();
        let target = if seen { ProgressDrawTarget::stderr_with_hz(5) } else { ProgressDrawTarget::hidden() };
        let bar = ProgressBar::with_draw_target(Some(trials), target);
        let style = format!("{{wide_bar}} {{pos}}/{{len}} {what}, {{per_sec}}, {{eta}} left");
        if let Ok(style) = ProgressStyle::with_template(&style) {
            bar.set_style(style);
        }
        Self(bar)
    }

    /// Trials that were run.
    pub fn advance(&self, trials: u64) {
        self.0.inc(trials);
    }

    /// Trials that were there already: they do not count for the rate.
    pub fn skip(&self, trials: u64) {
        self.0.inc(trials);
        self.0.reset_eta();
    }

    /// Takes the bar away.
    pub fn finish(&self) {
        self.0.finish_and_clear();
    }
}
