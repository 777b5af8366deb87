//! Tests of the model and fit, one file per promise; one program, because linking takes longer than testing.

mod common;
mod compliance_and_lag;
mod delay_refinement;
mod incremental_replay;
