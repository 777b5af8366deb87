//! Monte Carlo sweeps over scenarios: draws trials, simulates and scores each by kinematic replay, and estimates the sensitivity of
//! failures to the drawn quantities.
//!
//! A trial is a function of scenario, sweep, seed and trial number; a shard is a range of trials. The same inputs give the same
//! bytes for any number of threads and any split into shards.
#![forbid(unsafe_code)]

pub mod algorithm_comparison;
mod failure_rate_bins;
mod parallel_trials;
#[cfg(feature = "parquet")]
mod parquet;
mod sample_trial;
mod sampling_design;
pub mod score_gate;
pub mod sensitivity;
pub mod shard;
mod summary;
mod sweep_file;
mod trial_csv;
mod trial_row;
pub mod trial_simulation;
mod trial_table;

pub use failure_rate_bins::{BIN_COUNT, FailureMapRow, FailureRateBin, failure_map_rows, failure_rate_bins};
pub use parallel_trials::{TrialError, run_trials, run_trials_with_threads};
#[cfg(feature = "parquet")]
pub use parquet::write_parquet;
pub use sample_trial::{SampledTrial, SamplingError, TrialSampler};
pub use sampling_design::{MAX_SOBOL_DIMENSIONS, SamplingDesign, trial_seed};
pub use stylet_scenario::{Distribution, RandomEffect, Sampling, ScenarioField, SweepFile, VariedField};
pub use summary::{
    OutcomeSensitivity, QuantitySensitivity, ScoreSummary, Summary, WorstTrial, failed, score_value,
    summarise,
};
pub use sweep_file::{Overrides, Sweep};
pub use trial_csv::write_csv;
pub use trial_row::{Columns, TrialRow};
pub use trial_table::{DiskTrialTable, TrialTable, TrialTableWriter};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadmeExamples;
