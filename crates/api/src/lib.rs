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
pub mod compare;
mod diagnose;
pub mod effects;
mod enhance;
mod error;
pub mod folder;
pub mod hash;
pub mod heard;
mod inputs;
mod law;
pub mod need;
pub mod output;
pub mod picture;
pub mod plan;
mod predict;
pub mod prediction;
pub mod repeats;
mod run;
pub mod specimens;
pub mod sweep;
pub mod sweep_folder;

pub use diagnose::{Diagnosed, diagnose, forecast};
pub use enhance::{Enhanced, enhance, enhance_with_law, listen};
pub use error::Error;
pub use folder::Claim;
pub use inputs::{INPUTS, Inputs, name_of, read_all, read_options};
pub use law::FittedLaw;
pub use output::Output;
pub use picture::Ran;
pub use plan::{Planned, plan_after};
pub use predict::predict;
pub use run::{Run, settings_note, simulate, simulate_from, virtual_note};
pub use sweep::{Swept, sweep};

pub use stylet_core::{EnhanceConfig, Enhancer, Sample};
pub use stylet_diagnose::predict::{Foretold, Prediction, Refit};
pub use stylet_diagnose::{Diagnosis, Evidence};
pub use stylet_plan::Limits;
pub use stylet_record::{ColumnMap, ReadOptions, Recording, read_csv};
pub use stylet_scenario::{EnhanceFile, Scenario};
pub use stylet_sweep::{Sweep, SweepFile};
