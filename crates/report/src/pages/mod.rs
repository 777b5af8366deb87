//! The pages of results: check, diagnosis, prediction, plan, identifiability, comparison, examination, sweep.
//!
//! One module per page. Each has a function `page` of the results; most have a `summary_sentence` that the terminal prints too. The
//! pages show the contents of the result files and do not compute anything else.

pub mod algorithm_comparison;
pub mod diagnosis;
pub mod examination;
pub mod experiment_check;
pub mod experiment_plan;
pub mod formatting;
pub mod identifiability;
pub mod indented_specimens;
pub mod inspection;
pub mod model_consistency;
pub mod online_benchmark;
pub mod prediction;
pub mod repeated_insertions;
pub mod sweep;
pub mod transfer;
