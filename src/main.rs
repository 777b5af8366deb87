//! The `stylet` binary.

use std::process::ExitCode;

/// Fits ask for vectors as long as the recordings again and again; this allocator keeps their pages.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> ExitCode {
    stylet_cli::main()
}
