//! Diagnosis of measured insertions: which effects a scenario lacks, their parameters, and the improvement of its predictions with them.
//!
//! [`diagnose()`] compares recordings with a scenario. Its modules in the order of the data flow:
//!
//! | module | contents |
//! |---|---|
//! | `input_checks` | units, signs and reach of the recordings |
//! | [`base_law_fit`], `random_effect_selection` | fit of the base law and of random effects |
//! | `baseline_search`, `zero_steps` | sensor baseline: offset, drift, force linear in position, steps of the zero |
//! | [`effect_start_values`], [`tone_detection`] | first-order gain and start values of every effect |
//! | `effect_selection`, `model_comparison` | forward selection by penalised gain, and pruning |
//! | `motion_period` | periodic causes that the commanded motion hides |
//! | `geometry_selection` | fixed or free layer boundaries, position scale, shifted boundaries |
//! | `reweighted_fit`, `varying_coefficient_test` | robustness against unmodelled effects |
//! | `competing_effects` | effects that explain the data equally well |
//! | `confidence_intervals` | confidence intervals of all parameters |
//! | `residual_tests` | tests for structure in the residual: the verdict `unknown` |
//! | `held_out`, `negligible_effects` | improvement on held-out recordings, and negligible effects |
//! | [`prediction`] | predictions of new recordings |
//! | [`diagnosis_json`], [`report_curves`] | results, and the data for the report |
#![forbid(unsafe_code)]
#![allow(clippy::needless_range_loop, reason = "several columns of one recording share the index")]

pub mod base_law_fit;
mod baseline_search;
mod bootstrap_noise;
pub mod check_json;
pub mod claims;
mod competing_effects;
mod confidence_intervals;
mod diagnose;
pub mod diagnosis_json;
mod effect_selection;
mod effect_start;
pub mod effect_start_values;
mod error;
pub mod experiment_check;
mod fast_tone_cause;
mod fast_tones;
mod formula_proposals;
mod found_tissue;
mod general_forms;
mod geometry_selection;
mod held_out;
mod identifiability;
mod input_checks;
mod layer_count;
mod layer_starts;
mod local_minima;
mod mains_frequency;
mod measured_start;
mod model_comparison;
pub mod model_consistency;
mod model_grade;
mod model_pruning;
mod motion_period;
mod negligible_effects;
mod outlier_segment_test;
mod parameter_json;
mod parameter_labels;
mod parameters_by_recording;
mod partial_model;
pub mod prediction;
mod random_effect_selection;
pub mod repeated_insertions;
pub mod report_curves;
mod residual_tests;
mod reweighted_fit;
mod rupture_start_values;
mod selection_restarts;
mod selection_state;
mod sensor_artefact_causes;
mod slow_noise;
#[cfg(test)]
mod test_fixtures;
pub mod tone_detection;
mod varying_coefficient_test;
mod verdict;
mod zero_steps;

pub use base_law_fit::assumptions_of;
pub use competing_effects::EQUIVALENCE_NATS;
pub use diagnose::{DiagnosisResult, Options, REASON_IMITATES_UNMODELLED};
pub use diagnosis_json::{Diagnosis, Verdict};
pub use error::DiagnoseError;
pub use input_checks::NamedRecording;
pub use layer_count::{diagnose, identify, scenario_from_recordings};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
