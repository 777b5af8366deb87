//! The commands of Stylet as functions with plain results.
//!
//! | function | input | result |
//! |---|---|---|
//! | [`simulate`](fn@simulate) | [`Scenario`] | [`Run`]: recording, truth, outputs of the online algorithm, scores |
//! | [`enhance`](fn@enhance) | [`Recording`] | [`AlgorithmRun`]: enhanced force, ruptures, layers |
//! | [`check`] | assumed [`Scenario`] and recordings | [`CheckReport`]: what they can show |
//! | [`diagnose`](fn@diagnose) | assumed [`Scenario`] and recordings | [`DiagnosisReport`]: causes, re-fitted scenario |
//! | [`predict_recordings`] | model and held-out recordings | errors, noise, coverage of the band |
//! | [`transfer`] | model and recordings of another group | parameters that differ; plan of further recordings |
//! | [`sweep`](fn@sweep) | [`Sweep`] | [`SweepResult`]: one row per insertion, summary |
//! | [`diagnose_repeats`](fn@diagnose_repeats::diagnose_repeats), [`diagnose_specimens`](fn@diagnose_specimens::diagnose_specimens) | a data set | fitted models, variation between recordings or specimens |
//! | [`plan`](fn@plan_insertion::plan), [`identifiability`](plan_insertion::identifiability) | [`DiagnosisInputs`] | the next insertion; what an experiment can identify |
//! | [`compare_algorithms`] | scenarios, or cases of the independent simulator | one row per algorithm |
//! | [`benchmark`] | cases of the independent simulator | accuracy of diagnosis and planning |
//!
//! Every result holds the files that the command writes, byte for byte, as [`OutputFiles`], which are written all or none. The command, the
//! package `stylet` and the Python package are thin layers over this crate.
#![forbid(unsafe_code)]

pub mod benchmark;
mod check_experiment;
pub mod compare_algorithms;
pub mod compare_models;
mod diagnose;
pub mod diagnose_repeats;
pub mod diagnose_specimens;
mod diagnosis_inputs;
pub mod enhancement;
mod error;
mod force_along_motion;
pub mod live_stream;
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
pub mod transfer;

pub use check_experiment::{CheckReport, check};
pub use diagnose::{DiagnosisReport, diagnose, identify, predict_recordings};
pub use diagnosis_inputs::{DiagnosisInputs, INPUTS_FILE, read_options, read_recordings, recording_name};
pub use enhancement::{IdentifiedModel, enhance, enhance_as, enhance_with_model};
pub use error::Error;
pub use force_along_motion::force_along_motion;
pub use output_files::OutputFiles;
pub use output_folder::OutputLock;
pub use plan_insertion::{PlanReport, plan_after_recordings};
pub use run_report::AlgorithmRun;
pub use simulate::{Run, settings_note, simulate, simulate_from, virtual_note};
pub use sweep::{SweepResult, sweep};

pub use stylet_core::{EnhanceConfig, Enhancer, Sample};
pub use stylet_diagnose::prediction::{Factor, Prediction, PredictionOptions, PredictionResult, Refit};
pub use stylet_diagnose::{Diagnosis, NamedRecording, Options as DiagnoseOptions};
pub use stylet_plan::Limits;
pub use stylet_record::{ColumnMap, ReadOptions, Recording, read_csv};
pub use stylet_scenario::{EnhancerConfigFile, Scenario};
pub use stylet_sweep::{Sweep, SweepFile};

/// The README's example.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
pub struct Readme;
