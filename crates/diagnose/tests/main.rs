//! Tests of the diagnosis, one file per promise; one program, because linking takes longer than testing.

mod answer_file;
mod bad_input;
mod instrument_faults_are_detected;
mod recorded_answers;
mod repeated_insertions_are_diagnosed;
mod repeated_insertions_recover_the_model;
mod rough_guess;
mod sensor_baseline;
mod simulated_recordings;
