//! The `stylet` binary.

#![deny(unsafe_code)]
#![warn(clippy::unwrap_used, clippy::panic, clippy::todo, clippy::unimplemented)]

mod cli;

use std::process::ExitCode;

/// Fits ask for vectors as long as the recordings again and again; this allocator keeps their pages.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> ExitCode {
    cli::main()
}
