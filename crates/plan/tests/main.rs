//! Tests of the planning, one file per promise; one program, because linking takes longer than testing.

mod motion_limits;
mod planned_insertion;
