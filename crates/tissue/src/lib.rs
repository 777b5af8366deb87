//! Layered tissue as a needle feels it: the base law of puncture and friction, the effects by
//! which reality departs from it, the chain from the tissue's force to the recorded one, and the
//! kinematic replay.
//!
//! Pure state machines in SI units: `no_std` (with `alloc` for the lists of layers and effects),
//! no randomness, no allocation per sample, the same bits on every platform.
//!
//! ```
//! use stylet_tissue::{Law, LawState, Layer, Tissue};
//!
//! let gel = Layer {
//!     name: "gel".into(),
//!     thickness_m: 0.03,
//!     stiffness_n_per_m: 40.0,
//!     friction_ns_per_m2: 9000.0,
//!     puncture_n: None,
//! };
//! let law = Law::base(&Tissue { surface_m: 0.0, layers: vec![gel] });
//! let mut state = LawState::default();
//! let force = law.step(&mut state, 0.0, 0.01, 0.002, |_| {});
//! assert!((force.total_n - (40.0 * 0.01 + 9000.0 * 0.01 * 0.002)).abs() < 1e-12);
//! ```
#![no_std]
#![forbid(unsafe_code)]

extern crate alloc;

mod compliant_needle;
pub mod effect;
mod effect_info;
mod effects;
mod force;
mod force_law;
mod force_law_state;
mod layer;
mod layer_geometry;
mod measurement_chain;
mod replay;
mod rupture_policy;
mod shaft_friction;

pub use effect::{ChainStage, Effect};
pub use effect_info::{
    EffectInfo, FitScale, ParameterError, ParameterInfo, Proposal, effect_info, general_effects,
    per_layer_effects,
};
pub use effects::*;
pub use force::{Rupture, TissueForce};
pub use force_law::{ForceLaw, MAX_EFFECTS, TooManyEffects};
pub use force_law_state::ForceLawState;
pub use layer::{Layer, Tissue};
pub use layer_geometry::Slab;
pub use measurement_chain::{AveragingInterval, MeasurementChain, MeasurementState, SensorInput};
pub use replay::replay;
pub use rupture_policy::RuptureCriterion;
pub use shaft_friction::ShaftFriction;
