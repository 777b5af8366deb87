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

mod choice;
mod compensation;
pub mod config;
mod contact;
mod drop;
mod enhancer;
mod filter;
mod front;
mod guard;
mod history;
mod line;
mod reweigh;
mod rls;
mod sample;
mod stylet;
mod transition;

pub use choice::Enhancer;
pub use compensation::MAX_LAYERS;
pub use config::EnhanceConfig;

pub use rls::Rls;
pub use sample::{Cause, Detection, LayerEstimate, Output, Sample, State};
pub use transition::{TRANSITIONS, Transition, Trigger};
