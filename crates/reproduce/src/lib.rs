//! The paper.
#![forbid(unsafe_code)]
pub mod case;
pub mod change;
pub mod claims;
pub mod effect;
pub mod friction;
pub mod insertion;
pub mod interval;
pub mod outcome;
pub mod protocol;
pub mod spread;
pub mod study;
pub mod tuning;
pub mod variant;
pub mod verdict;
pub mod view;
