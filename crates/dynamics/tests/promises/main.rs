//! The promises of the arm's dynamics, one file each; one program, because linking takes longer than testing.

mod common;
mod friction;
mod observer;
mod properties;
mod reach;
mod reference;
