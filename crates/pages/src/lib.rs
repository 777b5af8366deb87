//! The pages of Stylet: results of the computing crates, laid out with the drawing primitives of [`stylet_report`].
//!
//! One module per page; each has a function `page` of the results, and most a `sentence` that says them on the terminal too.
//! Nothing is computed here that a file of results would not hold.
#![forbid(unsafe_code)]

pub mod benchmark;
pub mod compare;
pub mod diagnosis;
pub mod identifiability;
pub mod plan;
pub mod prediction;
pub mod repeats;
pub mod specimens;
pub mod sweep;
pub mod words;
