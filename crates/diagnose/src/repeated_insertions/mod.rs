//! Diagnosis of repeated insertions into the same tissue: one model for all recordings, in which surface, friction, puncture
//! forces and selected effect parameters vary between recordings and days (random effects).
//!
//! Modules in the order of the data flow:
//!
//! | module | purpose |
//! |---|---|
//! | [`dataset`] | description of a data set and its files |
//! | [`segmented_recording`], [`insertion_phase`] | recordings with phases and events, grouped by speed and stroke |
//! | [`instrument_faults`] | detection and correction of sensor and drive faults |
//! | `start_values`, [`multistart_fit`], [`stick_slip_fit`] | priors, start values and fits |
//! | [`random_effects_population`], [`population_prediction`] | random effects, and predicted force with its band |
//! | `empirical_discrepancy` | correction of a prediction by the residuals of other recordings |
//! | [`cross_validation`], `nested_cross_validation` | held-out errors and the repeatability floor |
//! | [`scored_model`], `held_out_loss`, `ablation`, [`model_selection`] | comparison of models and of their terms |
//! | `parameter_estimates` | estimates with jackknife intervals |
//! | [`diagnose_set`](mod@diagnose_set) | the complete diagnosis |
//! | [`repeatability_report`](mod@repeatability_report), `data_quality_notes`, `mean_scenario`(mod@mean_scenario) | its results |
//! | [`layer_composition`] | stack of layers measured alone |
//! | [`indentation_relaxation`] | specimens indented once and held |

mod ablation;
pub mod cross_validation;
mod data_quality_notes;
pub mod dataset;
pub mod diagnose_set;
mod empirical_discrepancy;
mod held_out_loss;
pub mod indentation_relaxation;
pub mod insertion_phase;
pub mod instrument_faults;
pub mod layer_composition;
mod mean_scenario;
pub mod model_selection;
pub mod multistart_fit;
mod nested_cross_validation;
mod parameter_estimates;
pub mod population_prediction;
pub mod random_effects_population;
pub mod repeatability_report;
pub mod scored_model;
pub mod segmented_recording;
mod start_values;
pub mod stick_slip_fit;

pub use segmented_recording::SegmentedRecording;
