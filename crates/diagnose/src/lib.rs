//! Given measured data: what the simulation gets wrong, why, and how much better it gets.
#![forbid(unsafe_code)]

pub mod air;
pub mod benchmark;
mod check;
pub mod curves;
mod diagnose;
mod error;
pub mod fit;
pub mod forward;
pub mod held_out;
pub mod hidden;
pub mod leftover;
pub mod look;
pub mod model;
pub mod noise;
pub mod outcome;
pub mod raw;
pub mod refine;
pub mod ruptures;
pub mod search;
pub mod spectrum;
pub mod starts;
pub mod track;
pub mod visible;

pub use diagnose::{CLASS_NATS, Evidence, Examined, Options, diagnose};
pub use error::DiagnoseError;
pub use outcome::{Diagnosis, Verdict};
