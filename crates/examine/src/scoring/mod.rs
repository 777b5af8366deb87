//! Expected answers, and the scores of an engine.

pub mod case_outcome;
pub mod diagnosis_answer;
pub mod expected_answer;
pub mod results_table;
