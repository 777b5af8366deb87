//! Formulas with units: parsed with the position of every error, checked for dimensions, compiled for evaluation.
//!
//! | module | contents |
//! |---|---|
//! | `formula` | a parsed and compiled formula |
//! | `syntax_tree` | the parsed formula, every node with its place in the text |
//! | `function` | operators and functions: name, number of arguments, value |
//! | `token`, `parser` | text to syntax tree |
//! | `unit` | exponents of metre, kilogram and second; parsing of `N s/m` |
//! | `unit_check` | the unit of a formula |
//! | `unknown_units` | inference of units from formulas |
//! | `program` | evaluation without allocation, and derivatives |
//! | `formula_error` | error with its place in the text |
//!
//! Written here because the crates for expressions give no position to an error of units, and use the platform's
//! logarithms and powers; here they are those of `libm`, which give the same bits everywhere.
#![no_std]
#![forbid(unsafe_code)]

extern crate alloc;

mod formula;
mod formula_error;
mod function;
mod parser;
mod program;
mod syntax_tree;
mod token;
mod unit;
mod unit_check;
mod unknown_units;

pub use formula::Formula;
pub use formula_error::FormulaError;
pub use function::{Function, SGN_DEAD_BAND_MPS};
pub use program::{MAX_STACK, Program};
pub use unit::Unit;
pub use unknown_units::solve_unknown_units;

/// Compiles the examples of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadmeExamples;
