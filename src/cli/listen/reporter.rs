//! Messages of a stream on the terminal: the first ones of each kind; all are counted in the summary.

use crate::cli::terminal_output::print_error;
use stylet_api::live_stream::Report;

/// Messages of a kind that are printed.
const PRINTED: u32 = 5;

/// Prints the first reports of each kind, with a note on the last one printed.
#[derive(Default)]
pub struct Reporter {
    invalid: u32,
    unused: u32,
    restarted: u32,
}

impl Reporter {
    /// Prints a report, unless there were many of its kind.
    pub fn print(&mut self, report: &Report) {
        let count = match report {
            Report::Invalid(_) => &mut self.invalid,
            Report::Unused { .. } => &mut self.unused,
            Report::Restarted { .. } => &mut self.restarted,
        };
        *count = count.saturating_add(1);
        if *count <= PRINTED {
            let further = if *count == PRINTED { " (further ones are counted)" } else { "" };
            print_error(&format!("{report}{further}\n"));
        }
    }
}
