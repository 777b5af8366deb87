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

pub mod base_law_fit;
mod bootstrap_noise;
pub mod competing_effects;
pub mod confidence_intervals;
mod diagnose;
pub mod diagnosis_json;
pub mod effect_selection;
pub mod effect_start_values;
mod error;
pub mod geometry_selection;
pub mod held_out;
mod identifiability;
mod input_checks;
pub mod model_comparison;
pub mod negligible_effects;
mod outlier_segment_test;
pub mod prediction;
pub mod random_effect_selection;
pub mod repeated_insertions;
pub mod report_curves;
pub mod residual_tests;
pub mod reweighted_fit;
mod rupture_start_values;
#[cfg(test)]
mod test_fixtures;
pub mod tone_detection;
pub mod varying_coefficient_test;

pub use competing_effects::EQUIVALENCE_NATS;
pub use diagnose::{
    DiagnosisResult, NamedRecording, Options, REASON_IMITATES_UNMODELLED, assumptions_of, diagnose,
};
pub use diagnosis_json::{Diagnosis, Verdict};
pub use error::DiagnoseError;
