//! Monte Carlo: a sweep draws scenarios, runs each through the kinematic replay, scores it, and tells
//! which drawn quantity explains the failures.
//!
//! A trial is a function of scenario, sweep, seed and its number alone; a shard is a range of trials.
//! The same inputs give the same bytes for any number of threads and any split into shards.
#![forbid(unsafe_code)]

mod along;
pub mod compare;
mod design;
mod distribution;
mod draw;
mod field;
pub mod gate;
#[cfg(feature = "parquet")]
mod parquet;
mod row;
mod run;
pub mod sensitivity;
pub mod shard;
mod summary;
mod sweep;
pub mod trial;
mod trials;

pub use along::{BINS, Bin, MapRow, bins, map_rows};
pub use design::{Design, SOBOL_DIMENSIONS, Sampling, trial_seed};
pub use distribution::Distribution;
pub use draw::{DrawError, Drawer, Drawn};
pub use field::Field;
#[cfg(feature = "parquet")]
pub use parquet::parquet;
pub use row::{Columns, Row, csv};
pub use run::{TrialError, rows, rows_with};
pub use summary::{Explained, Outcome, ScoreSummary, Summary, WorstTrial, failed, summarise, value};
pub use sweep::{Overrides, RandomEffect, Sweep, SweepFile, Vary};
pub use trials::{Trials, TrialsOnDisk, TrialsWriter};
