//! Given measured data: what the simulation gets wrong, why, and how much better it gets.
//!
//! [`diagnose()`] takes what a scenario believes and what was measured, and goes the steps of SPEC section 7 on the one
//! likelihood of `stylet-identify`. The pieces, in the order in which data pass them:
//!
//! | module | what lives there |
//! |---|---|
//! | [`base`] | the base law with its geometry: drops given to layers, numbers and instants in turn |
//! | [`propose`], [`lines`] | what every effect would gain to first order, and where its fit starts |
//! | [`select`], [`judge`] | effects enter by what they gain and leave when the others can do without them |
//! | [`geometry`] | whether the believed geometry stands; a scaled position, a shifted face |
//! | [`rivals`] | effects that explain the data as well |
//! | [`intervals`] | intervals of every number |
//! | [`leftover`] | structure common to several recordings: the verdict `unknown` |
//! | [`silent`], [`otherwise`] | what is heard where an unknown force is silent, and whether an effect beside it acts by its own law |
//! | [`held_out`], [`small`] | the gain on recordings left out of the fit; effects too small to matter |
//! | [`predict`] | a model against recordings that took no part |
//! | [`outcome`], [`curves`] | `diagnosis.json`, and what the report draws |
#![forbid(unsafe_code)]
#![allow(clippy::needless_range_loop, reason = "several columns of one recording share the index")]

mod at_ruptures;
pub mod base;
mod check;
pub mod curves;
mod diagnose;
mod error;
pub mod geometry;
pub mod held_out;
pub mod intervals;
pub mod judge;
pub mod leftover;
pub mod lines;
#[cfg(test)]
mod made;
pub mod otherwise;
pub mod outcome;
pub mod predict;
pub mod propose;
pub mod rivals;
pub mod select;
pub mod set;
pub mod silent;
pub mod small;
mod stretch;
mod told_again;
pub mod varied;
mod visible;

pub use diagnose::{Evidence, Examined, IMITATED, Options, belief, diagnose};
pub use error::DiagnoseError;
pub use outcome::{Diagnosis, Verdict};
pub use rivals::CLASS_NATS;
