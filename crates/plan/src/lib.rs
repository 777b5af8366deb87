//! Which insertion to make next: what an experiment can show, and the safe motion that tells remaining causes apart.
//!
//! Candidates are what a diagnosis left open, or, without one, every effect of the library at its typical size. Two of them
//! are as far apart as the truth's advantage over the other re-fitted, `min 1/2 |whitened(f_i - f_j)|^2` (T-optimality: Atkinson and
//! Fedorov 1975), linear in the columns that the fit has, with the scatter of ruptures between insertions as their variance. The plan
//! maximises the worst pair over motions within limits: an evenly filling sequence of programs, then refinement.
//!
//! | module | what lives there |
//! |---|---|
//! | [`limits`], [`draw`] | what a motion may do; programs within these limits |
//! | [`candidate`], [`start`] | what may be the case, after a diagnosis or before any |
//! | [`ground`], [`gram`] | what is known, what a motion would show, and how far candidates are apart |
//! | [`search`](mod@search), [`plan`](mod@plan) | the best motions; the plan with its probabilities |
//! | [`check`](mod@check) | the plan simulated and diagnosed |
//! | [`repeats`](mod@repeats) | how many insertions when ruptures scatter |
//! | [`identifiability`](mod@identifiability) | what an experiment can show |
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
