//! Messages of a stream on the terminal: the first ones of each kind; all are counted in the summary.

use crate::cli::terminal_output::print_error;
use stylet_api::live_stream::StreamMessage;

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
    pub fn print(&mut self, report: &StreamMessage) {
        let count = match report {
            StreamMessage::Invalid(_) => &mut self.invalid,
            StreamMessage::Unused { .. } => &mut self.unused,
            StreamMessage::Restarted { .. } => &mut self.restarted,
        };
        *count = count.saturating_add(1);
        if *count <= PRINTED {
            let further = if *count == PRINTED { " (further ones are counted)" } else { "" };
            print_error(&format!("{report}{further}\n"));
        }
    }
}
