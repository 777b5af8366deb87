//! The online core: identifies the needle-tissue interaction and computes the enhanced force during insertion, sample by
//! sample.
//!
//! Ferro, Gaz, Anzidei, Vendittelli, "Online needle-tissue interaction model identification for force feedback enhancement in
//! robot-assisted interventional procedures" (2021): recursive least squares on a Kelvin-Voigt or multi-layer model, rupture
//! detection by CUSUM and force derivative, a posteriori re-weighting of the covariance by the force drop, friction
//! compensation. The default algorithm, `Stylet`, uses Kalman filters instead, see `docs/explanation/enhancer.md`.
//!
//! `no_std`; no allocation after construction; bounded work per sample.
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

mod bounds;
pub mod config;
mod enhancer;
mod kalman;
mod paper;
mod sample;
mod sample_clock;
mod units;

pub use config::EnhanceConfig;
pub use enhancer::Enhancer;
pub use paper::rls::Rls;
pub use paper::state_machine::{TRANSITIONS, Transition, Trigger};
pub use sample::{
    Baseline, BaselineKind, Cause, CompletedDrop, Detection, LayerEstimate, MAX_LAYERS, Output, Sample,
    State, UnusedReason, ZeroStep,
};

pub use units::Units;

/// The example of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
pub struct Readme;
