//! The engine.
pub mod base;
pub mod judge;
pub mod propose;
pub mod select;
