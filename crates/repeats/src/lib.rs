//! Repeated measured insertions: what a simulation lacks, what varies from run to run, and how well an insertion that
//! took no part is predicted.
//!
//! Many recordings of one insertion hold two kinds of numbers: those of the law, which all share, and those that every
//! run has of its own (where its surface lies, how strong its friction is, at which force it punctures). The pieces,
//! in the order in which data pass them:
//!
//! | module | what lives there |
//! |---|---|
//! | [`dataset`] | the description of a data set, its files |
//! | [`events`] | drops and releases, read off the raw force without a law |
//! | [`run`] | one insertion among its repeats |
//! | [`instrument`] | what a motion in air and a known load exclude |
//! | [`frame`] | what can be said before any fit: where faces may be, how large forces are |
//! | [`shape`] | which law: ingredients, their numbers, and the layers and effects that they make |
//! | [`forward`] | the law over a recording, ruptures imposed or its own |
//! | [`fit`](mod@fit) | the two-level fit: Levenberg-Marquardt on Huber's loss, own numbers with a prior |
//! | [`population`] | mean and scatter of the own numbers, deterministic draws |
//! | [`predict`] | mean and 90 % band of an insertion that nobody has seen |
//! | [`gain`] | runs and speeds left out; the mean of the others as the floor |
//! | [`ladder`] | the search, judged on runs left out; pruning |
//! | [`study`](mod@study) | all of it, and `diagnosis.json` |
//! | [`specimens`] | many specimens, each indented once and held |
#![forbid(unsafe_code)]
#![allow(clippy::needless_range_loop, reason = "several columns of one recording share the index")]

pub mod dataset;
pub use stylet_identify::phases as events;
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
