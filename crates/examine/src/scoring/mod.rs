//! Which answers are right, and how many of an engine's are.

pub mod case_outcome;
pub mod diagnosis_answer;
pub mod expected_answer;
pub mod results_table;
