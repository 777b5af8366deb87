//! The `stylet` binary.

use std::process::ExitCode;

fn main() -> ExitCode {
    stylet_cli::main()
}
