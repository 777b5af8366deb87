//! Tests of the readers of recordings, one file per promise; one program, because linking takes longer than testing.

mod bad_input;
mod foreign;
mod lab_exports;
mod long;
mod measured;
mod mutated_files;
mod other_software;
mod reading;
mod round_trip;
mod strange_files;
