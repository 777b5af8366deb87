//! Independent simulator for testing the diagnosis: tissue, needle and sensor implemented without its code, misspecified assumed scenarios,
//! and the scoring of answers.
//!
//! An engine is a function from a [`Question`] (the assumed scenario as RON text, the recordings) to an [`Answer`] (`diagnosis.json` as
//! plain data). It does not see the truth, and this crate does not depend on it: of this project it uses `record` and `stats` only.
//!
//! | module | contents |
//! |---|---|
//! | [`simulator`] | tissue, needle and sensor, written from docs/reference/model.md |
//! | [`cases`] | random cases: stacks, motions, hidden effects, misspecifications |
//! | [`scoring`] | expected answers, scores, and the results table |
//! | [`challenge_export`] | export of cases for other programs, and scoring of their answers |
//! | [`examination_plan`], [`mod@run_cases`] | selection of cases, and running an engine on them |
//! | [`online`] | benchmark of online puncture detection |
#![forbid(unsafe_code)]

pub mod cases;
pub mod challenge_export;
pub mod examination_plan;
mod named_enum;
pub mod online;
pub mod run_cases;
pub mod scoring;
pub mod simulator;
pub mod success_rate;

pub use cases::case_id::{CaseId, Hide, Severity, Size, World, Wrong};
pub use cases::case_recordings::{Case, NamedFile, Question, make_case, make_case_with};
pub use cases::custom_effect::CustomEffect;
pub use cases::second_insertion::SecondInsertion;
pub use examination_plan::Plan;
pub use run_cases::{RunError, run_cases, run_cases_with};
pub use scoring::case_outcome::CaseOutcome;
pub use scoring::diagnosis_answer::{Answer, Verdict};
pub use scoring::results_table;

/// Compiles the examples of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadmeExamples;
