//! Cases with something hidden in them, drawn with the law that a diagnosis believes: for comparison with older tables. The
//! referee's own realities are in `stylet-examine`.
//!
//! The drawing knows the tissue law and the measuring chain and nothing of the diagnosis: it steps the
//! law at 1 kHz from a phase of its own and keeps every fifth sample.
#![forbid(unsafe_code)]

mod draw;
mod motion;
mod outside;
mod plan;

pub use draw::{Case, Drawn, SAMPLE_HZ, case, case_sampled, clean_force, library_ids, scenario};
pub use motion::Motions;
pub use outside::{OUTSIDE, Outside};
pub use plan::{Harder, Kind, Size, Sketch, largest_force, scaled, sketch, sketch_of};
