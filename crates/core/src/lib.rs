//! The online core: needle-tissue identification and force enhancement while the needle advances.
//!
//! Ferro, Gaz, Anzidei, Vendittelli, "Online needle-tissue interaction model identification for
//! force feedback enhancement in robot-assisted interventional procedures" (2021): recursive least
//! squares on a Kelvin-Voigt or multi-layer model, rupture detection by CUSUM and force derivative,
//! a posteriori re-weighting of the covariance by the force drop, friction compensation.
//!
//! `no_std`; no allocation after construction; a bounded amount of work per sample.
//!
//! ```
//! use stylet_core::{EnhanceConfig, Enhancer, Sample};
//!
//! let mut storage = [Sample::default(); 1024];
//! let mut core = Enhancer::new(EnhanceConfig::default(), 0.0, &mut storage[..]);
//! let out = core.step(Sample { time_s: 0.0, position_m: -0.005, velocity_mps: 0.0023, force_n: 0.0 });
//! assert_eq!(out.enhanced_n, 0.0);
//! ```
#![no_std]
#![forbid(unsafe_code)]

extern crate alloc;

pub mod config;
mod contact_detection;
mod enhancer;
mod force_drop;
mod friction_compensation;
mod layer_replay;
mod line_fit;
mod low_pass;
mod motion_guard;
mod paper_enhancer;
mod preprocessing;
mod rls;
mod sample;
mod sample_ring;
mod state_machine;
mod stylet;

pub use config::EnhanceConfig;
pub use enhancer::Enhancer;
pub use friction_compensation::MAX_LAYERS;

pub use rls::Rls;
pub use sample::{Cause, Detection, LayerEstimate, Output, Sample, State};
pub use state_machine::{TRANSITIONS, Transition, Trigger};
