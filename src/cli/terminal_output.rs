//! Output on the terminal.

use crate::cli::exit_codes::Failure;
use std::io::{IsTerminal as _, Write as _};

/// Prints to standard output. A reader that has closed the pipe, as in `stylet run ... | head`, is not an error.
///
/// # Errors
/// [`Failure::Stdout`] when standard output cannot be written, as on a full disk.
pub fn print(text: &str) -> Result<(), Failure> {
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(why) if why.kind() != std::io::ErrorKind::BrokenPipe => Err(Failure::Stdout(why)),
        _ => Ok(()),
    }
}

/// Prints to standard error; a failure there cannot be reported.
pub fn print_error(text: &str) {
    let _ = std::io::stderr().lock().write_all(text.as_bytes());
}

/// A callback that prints the name of each stage of the work, followed by `after`, when standard error is a terminal.
pub fn stage_printer(quiet: bool, after: &'static str) -> impl Fn(&str) {
    let enabled = !quiet && std::io::stderr().is_terminal();
    move |stage| {
        if enabled {
            print_error(&format!("  {stage}{after}\n"));
        }
    }
}
