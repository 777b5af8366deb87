//! Tests of the sweeps, one file per promise; one program, because linking takes longer than testing.

mod distributions;
mod trial_is_a_function;
