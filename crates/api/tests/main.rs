//! Tests of the library interface, one file per promise; one program, because linking takes longer than testing.

mod fitted_law;
mod long_recordings;
mod online_export;
