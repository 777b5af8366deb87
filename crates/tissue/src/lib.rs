//! Force model of layered tissue: the base law of puncture and friction, a library of effects that depart from it, the
//! measurement chain from the force of the tissue to the recorded one, and kinematic replay.
//!
//! Pure state machines in SI units: `no_std` (with `alloc` for the lists of layers and effects), no randomness, no
//! allocation per sample, the same bits on every platform. Symbols and equations: docs/reference/model.md.
//!
//! ```
//! use stylet_tissue::{ForceLaw, ForceLawState, Layer, Tissue};
//!
//! let gel = Layer {
//!     name: "gel".into(),
//!     thickness_m: 0.03,
//!     stiffness_n_per_m: 40.0,
//!     friction_ns_per_m2: 9000.0,
//!     puncture_n: None,
//! };
//! let law = ForceLaw::base(&Tissue { surface_m: 0.0, layers: vec![gel] });
//! let mut state = ForceLawState::default();
//! let force = law.step(&mut state, 0.0, 0.01, 0.002, |_| {});
//! assert!((force.total_n - (40.0 * 0.01 + 9000.0 * 0.01 * 0.002)).abs() < 1e-12);
//! ```
#![no_std]
#![forbid(unsafe_code)]

extern crate alloc;

mod chain_stage;
mod compile_custom;
mod compliant_needle;
mod custom_equation;
mod custom_error;
mod custom_names;
mod custom_text;
mod define_custom;
pub mod effect;
mod effect_info;
mod effects;
mod equation_inputs;
mod force;
mod force_law;
mod force_law_state;
mod formula_equation;
mod layer;
mod layer_geometry;
mod measurement_chain;
mod replay;
mod rupture_policy;
mod shaft_friction;

pub use chain_stage::ChainStage;
pub use custom_equation::{CustomDefinition, Equation, EquationSample, MAX_PARAMETERS, MAX_STATES};
pub use custom_error::CustomError;
pub use custom_text::{CustomText, NamedList, ParameterText, Place, Prior};
pub use define_custom::known_effect_info;
pub use effect::Effect;
pub use effect_info::{EffectInfo, FitScale, ParameterError, ParameterInfo, Proposal};
pub use effects::*;
pub use force::{Rupture, TissueForce};
pub use force_law::{ForceLaw, TooManyEffects};
pub use force_law_state::{ForceLawState, MAX_EFFECTS};
pub use formula_equation::{VARIABLES, Variable};
pub use layer::{Layer, Tissue};
pub use layer_geometry::Slab;
pub use measurement_chain::{AveragingInterval, MeasurementChain, MeasurementState, SensorInput};
pub use replay::replay;
pub use rupture_policy::RuptureCriterion;
pub use shaft_friction::ShaftFriction;

/// Compiles the examples of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadmeExamples;
