//! Given measured data: what the simulation gets wrong, why, and how much better it gets.
//!
//! [`diagnose()`] takes what a scenario believes and what was measured, and goes the eight steps of SPEC
//! section 7. The pieces, in the order in which data pass them:
//!
//! | module | what lives there |
//! |---|---|
//! | [`raw`] | saturation, quantisation, spikes: read off the raw force, named without a law |
//! | [`velocity`] | velocity from positions, with its jumps at their instants |
//! | [`track`] | columns made ready for thousands of replays; averages over blocks |
//! | [`ruptures`] | where each layer ruptured in the data: law-guided Viterbi path, then the edge of the drop |
//! | [`air`], [`noise`] | autoregressive noise (order two at most) before contact; whitening |
//! | [`model`], [`forward`] | base parameters and effects as one vector; the replay with imposed or free ruptures, and one event per rupture |
//! | [`columns`] | the slopes of the base parameters from one replay |
//! | [`fit`], [`refine`] | bounded Levenberg-Marquardt on Huber's loss; ruptures moved to where a model wants them |
//! | [`starts`], [`look`] | where fits begin; a linear look that ranks starts and tells what is invisible |
//! | [`search`] | forward selection, every rival with the base re-fitted; exchange, pruning |
//! | [`thresholds`] | what each effect must gain, calibrated on clean data |
//! | [`leftover`] | structure common to several recordings: the verdict `unknown` |
//! | [`held_out`] | the gain on recordings left out of the fit |
//! | [`outcome`], [`curves`] | `diagnosis.json`, and what the report draws |
//! | [`terms`] | the same candidates as columns, for sparse regressions beside |
//! | `hidden`, `benchmark` (feature `own_world`) | cases drawn with this law, for comparison with older tables |
#![forbid(unsafe_code)]
#![allow(clippy::needless_range_loop, reason = "several columns of one recording share the index")]

pub mod air;
#[cfg(feature = "own_world")]
pub mod benchmark;
mod check;
pub mod columns;
pub mod curves;
mod diagnose;
mod error;
pub mod fit;
pub mod forward;
pub mod held_out;
#[cfg(feature = "own_world")]
pub mod hidden;
pub mod leftover;
pub mod look;
pub mod model;
pub mod noise;
pub mod outcome;
pub mod profile;
pub mod raw;
pub mod refine;
pub mod ruptures;
pub mod search;
pub mod spectrum;
pub mod starts;
pub mod terms;
pub mod thresholds;
pub mod track;
pub mod velocity;
pub mod visible;

pub use diagnose::{CLASS_NATS, Evidence, Examined, Options, diagnose};
pub use error::DiagnoseError;
pub use outcome::{Diagnosis, Verdict};
