//! The promises of the scores, one file each; one program, because linking takes longer than testing.

mod enhancement;
mod layers_and_intervals;
mod measured_run;
mod offline_beside_online;
mod support;
mod trace_of_a_run;
