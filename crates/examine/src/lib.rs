//! Independent simulator for judging the diagnosis: tissue, needle and sensor written without its code, misspecified assumed scenarios, and
//! the scoring of answers.
//!
//! An engine is a function from a [`Question`] (the assumed scenario as RON text, the recordings) to an
//! [`Answer`] (`diagnosis.json` as plain data). It does not see the truth, and this crate knows nothing about
//! it: of the crates of this project it depends on those of columns and statistics alone (`record`, `stats`).
//!
//! | module | what lives there |
//! |---|---|
//! | [`simulator`] | tissue, needle and sensor, written from the page |
//! | [`cases`] | what is drawn: stacks, motions, effects, what is wrong and how much of it |
//! | [`scoring`] | which answers are right, and the table |
//! | [`challenge_export`] | cases for others, and judging their answers |
//! | [`examination_plan`], [`mod@run_cases`] | which cases, and running an engine on them |
//! | [`online`] | benchmark of online puncture detection |
#![forbid(unsafe_code)]

pub mod cases;
pub mod challenge_export;
pub mod examination_plan;
pub mod online;
pub mod run_cases;
pub mod scoring;
pub mod simulator;
pub mod success_rate;
mod words;

pub use cases::case_id::{CaseId, Hide, Severity, Size, World, Wrong};
pub use cases::case_recordings::{Case, NamedFile, Question, make_case};
pub use cases::second_insertion::SecondInsertion;
pub use examination_plan::Plan;
pub use run_cases::{RunError, run_cases};
pub use scoring::case_outcome::CaseOutcome;
pub use scoring::diagnosis_answer::{Answer, Verdict};
pub use scoring::results_table;

/// Compiles the examples of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadmeExamples;
