//! What the commands of Stylet do, as functions with plain results.
//!
//! | function | from | to |
//! |---|---|---|
//! | [`simulate`] | [`Scenario`] | [`Run`]: recording, truth, what the core made of it, scores |
//! | [`enhance`] | [`Recording`] | [`Enhanced`]: enhanced force, ruptures, layers |
//! | [`diagnose`] | [`Scenario`] and recordings | [`Diagnosed`]: what the scenario gets wrong, and the scenario that does not |
//! | [`forecast`] | [`Scenario`] and recordings that took no part | [`Foretold`]: errors beside the noise, coverage of the band |
//! | [`sweep`](fn@sweep) | [`Sweep`] | [`Swept`]: one row per insertion, summary |
//! | [`repeats`](fn@repeats::repeats), [`specimens`](fn@specimens::specimens) | a data set | laws, what varies from run to run, numbers over the specimens |
//! | [`plan`](fn@plan::plan), [`identifiability`](plan::identifiability) | [`Inputs`] | the next insertion; what an experiment can show |
//! | [`compare`] | scenarios, or the referee's cases | one row per algorithm |
//! | [`benchmark`] | the referee's cases | the diagnosis and the planning examined |
//!
//! Every result has the files that the command writes, byte for byte, as an [`Output`] that is written at once or not at
//! all. The command line, the package `stylet` and the Python package are thin layers over this crate.
#![forbid(unsafe_code)]

pub mod benchmark;
pub mod compare_algorithms;
mod diagnose;
pub mod diagnose_repeats;
pub mod diagnose_specimens;
mod diagnosis_inputs;
mod enhance;
pub mod enhancement;
mod error;
mod force_along_motion;
mod identified_model;
pub mod output_files;
pub mod output_folder;
pub mod plan_insertion;
pub mod prediction_files;
pub mod reference_insertion;
pub mod resource_estimate;
pub mod result_hash;
pub mod run_report;
mod simulate;
pub mod sweep;
pub mod sweep_folder;

pub use diagnose::{DiagnosisReport, diagnose, predict_recordings};
pub use diagnosis_inputs::{DiagnosisInputs, INPUTS_FILE, read_options, read_recordings, recording_name};
pub use enhance::{Enhanced, enhance, enhance_as, enhance_with_model};
pub use error::Error;
pub use force_along_motion::force_along_motion;
pub use identified_model::IdentifiedModel;
pub use output_files::OutputFiles;
pub use output_folder::OutputLock;
pub use plan_insertion::{PlanReport, plan_after_recordings};
pub use run_report::AlgorithmRun;
pub use simulate::{Run, settings_note, simulate, simulate_from, virtual_note};
pub use sweep::{SweepResult, sweep};

pub use stylet_core::{EnhanceConfig, Enhancer, Sample};
pub use stylet_diagnose::prediction::{Prediction, PredictionResult, Refit};
pub use stylet_diagnose::{Diagnosis, NamedRecording};
pub use stylet_plan::Limits;
pub use stylet_record::{ColumnMap, ReadOptions, Recording, read_csv};
pub use stylet_scenario::{EnhancerConfigFile, Scenario};
pub use stylet_sweep::{Sweep, SweepFile};
