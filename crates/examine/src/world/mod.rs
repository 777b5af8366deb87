//! Which cases there are: what is believed, what is true, what is wrong between them.

pub mod amounts;
pub mod case;
pub mod draw;
pub mod hidden;
pub mod id;
pub mod ingredients;
pub mod outside;
pub mod paths;
pub mod strength;
