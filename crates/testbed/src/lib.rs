//! The testbed: from a scenario to a recording with its ground truth.
//!
//! A motion is carried out by a robot (the rapier [`Slide`], or the kinematic replay), the tissue
//! law of `stylet-tissue` makes the force, a sensor records it.
#![forbid(unsafe_code)]

mod insertion;
mod sensor;
mod simulate;
mod slide;

pub use insertion::{InsertionSample, Rates, on_slide, replayed};
pub use sensor::{Measuring, Noise};
pub use simulate::{SimulateError, Simulation, rates, simulate};
pub use slide::{NEEDLE_LENGTH_M, NEEDLE_MASS_KG, Slide};
