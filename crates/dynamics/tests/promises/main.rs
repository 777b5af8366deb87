//! Tests of the dynamics, one file per promise; one program, because linking takes longer than testing.

mod common;
mod friction;
mod observer;
mod properties;
mod reach;
mod reference;
