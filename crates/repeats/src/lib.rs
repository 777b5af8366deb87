//! Repeated measured insertions: what a simulation lacks, what varies from run to run, how well a new
//! insertion is predicted.
#![forbid(unsafe_code)]

pub mod dataset;
pub mod events;
pub mod fit;
pub mod forward;
pub mod frame;
pub mod gain;
pub mod instrument;
pub mod ladder;
pub mod population;
pub mod predict;
pub mod run;
pub mod shape;
pub mod specimens;
pub mod stats;
pub mod study;
