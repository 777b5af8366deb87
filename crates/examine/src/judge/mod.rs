//! Which answers are right, and how many of an engine's are.

pub mod answer;
pub mod answers;
pub mod outcome;
pub mod table;
