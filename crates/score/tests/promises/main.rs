//! Tests of the scores, one file per promise, in one binary because linking takes longer than testing.

mod enhancement;
mod enhancement_trace;
mod layers_and_intervals;
mod measured_recording;
mod offline_estimates;
mod support;
