//! The paper, figure by figure and claim by claim: our analogues of the figures of Ferro, Gaz, Anzidei and
//! Vendittelli (2021) and its supplement, from the shipped scenarios, and a verdict on every claim.
//!
//! - [`case`]: which scenario stands for which experiment; [`variant`]: the ways the algorithm is run.
//! - [`study`]: all runs over all noise seeds, once.
//! - [`claims`]: one file per claim; [`verdict`]: the rule that makes a verdict of numbers.
#![forbid(unsafe_code)]

pub mod case;
pub mod claims;
pub mod friction;
pub mod outcome;
pub mod spread;
pub mod study;
pub mod variant;
pub mod verdict;
