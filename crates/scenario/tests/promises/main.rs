//! Tests of scenario files, one file per promise; one program, because linking takes longer than testing.

mod arm_bad_input;
mod bad_input;
mod dialect;
mod motion;
mod ranges;
mod reference_pages;
mod round_trip;
mod shipped_scenarios;
