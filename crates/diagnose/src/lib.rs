//! Given measured data: what the simulation gets wrong, why, and how much better it gets.
#![forbid(unsafe_code)]

pub mod air;
pub mod fit;
pub mod forward;
pub mod hidden;
pub mod look;
pub mod model;
pub mod noise;
pub mod refine;
pub mod ruptures;
pub mod search;
pub mod spectrum;
pub mod starts;
pub mod track;
