//! Tests of the examination, one file per promise; one program, because linking takes longer than testing.

mod challenge;
mod independent;
mod worlds;
