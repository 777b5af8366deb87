//! The promises of scenario files, one file each; one program, because linking takes longer than testing.

mod arm_bad_input;
mod bad_input;
mod dialect;
mod motion;
mod ranges;
mod round_trip;
mod shipped_scenarios;
