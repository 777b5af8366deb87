//! The `stylet` binary.

#![deny(unsafe_code)]
#![warn(clippy::unwrap_used, clippy::panic, clippy::todo, clippy::unimplemented)]

mod cli;

use std::process::ExitCode;

/// Fits repeatedly allocate vectors as long as the recordings; this allocator reuses their pages.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> ExitCode {
    cli::main()
}
