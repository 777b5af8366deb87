//! The pages of Stylet: results of the computing crates, laid out with the drawing primitives of [`stylet_report`].
//!
//! One module per page; each has a function `page` of the results, and most a `sentence` that says them on the terminal too.
//! Nothing is computed here that a file of results would not hold.
#![forbid(unsafe_code)]

pub mod algorithm_comparison;
pub mod diagnosis;
pub mod examination;
pub mod experiment_plan;
pub mod formatting;
pub mod identifiability;
pub mod indented_specimens;
pub mod prediction;
pub mod repeated_insertions;
pub mod sweep;
