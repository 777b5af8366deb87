//! Experiment design: what an experiment can identify, and which safe motion best discriminates the remaining
//! candidate effects.
//!
//! Candidates are the effects that a diagnosis could not decide between, or, without a diagnosis, every effect
//! of the library at its typical size. The separation of two candidates is `min 1/2 |whitened(f_i - f_j)|^2`
//! over the re-fitted parameters of the wrong one (T-optimality: Atkinson and Fedorov 1975), to first order and
//! with the scatter of ruptures between insertions as their variance. The plan maximises the smallest
//! separation over motions within limits: low-discrepancy sampling of motion programs, then refinement.
//!
//! | module | contents |
//! |---|---|
//! | [`limits`], [`motion_programs`] | limits of a motion; motion programs within these limits |
//! | [`candidate`], [`starting_information`] | candidate effects; candidates and information from a diagnosis or a scenario |
//! | [`information_state`], [`gram_matrix`] | information so far and after a motion, and the separation of candidates |
//! | [`motion_search`], [`insertion_plan`] | the best motions; the plan with its probabilities |
//! | [`simulation_check`] | simulates the planned motions and diagnoses the results |
//! | [`repeats`](mod@repeats) | number of repeated insertions when rupture forces scatter |
//! | [`identifiability`](mod@identifiability) | which effects an experiment can identify |
#![forbid(unsafe_code)]

pub mod candidate;
mod error;
pub mod gram_matrix;
pub mod identifiability;
pub mod information_state;
pub mod insertion_plan;
pub mod limits;
pub mod motion_programs;
pub mod motion_search;
pub mod repeats;
pub mod simulation_check;
pub mod starting_information;

pub use error::PlanError;
pub use identifiability::identifiability;
pub use information_state::InformationState;
pub use insertion_plan::{Plan, plan};
pub use limits::Limits;
pub use simulation_check::check_by_simulation;
pub use starting_information::{from_diagnosis, from_scenario};

/// Compiles the examples of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadmeExamples;
