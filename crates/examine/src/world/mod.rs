//! Which cases there are: what is believed, what is true, what is wrong between them.

pub mod again;
pub mod amounts;
pub mod case;
pub mod draw;
pub mod fair;
pub mod hidden;
pub mod hide;
pub mod id;
pub mod ingredients;
pub mod outside;
pub mod paths;
pub mod setup;
pub mod strength;
