//! Likelihood of measured needle forces, and its maximisation.
//!
//! Input: recordings of position and force, and an assumed tissue. Unknowns are the base parameters `K_i, b_i, F_i`, the geometry (surface
//! position, layer thicknesses), effect parameters, per-recording parameters (random effects), and the time of every rupture in every
//! recording. For given rupture times the predicted force is a smooth function of the other parameters; the model's own rupture condition
//! enters as an observation (`docs/reference/model.md`, base law).
//!
//! | module | contents |
//! |---|---|
//! | `motion` | base motion between samples: position, velocity, velocity jumps |
//! | [`block_averages`] | means of a recording over blocks of 20 ms |
//! | [`insertion_phases`], [`force_drops`] | motion phases and abrupt force changes; force drops by local regression |
//! | [`force_jumps`] | jumps of either sign between two samples |
//! | [`rupture_assignment`] | which force drop belongs to which layer |
//! | [`model`] | the fitted model: parameters with priors and bounds |
//! | [`forward_model`] | force prediction with imposed rupture times or the model's own |
//! | [`rupture_likelihood`] | likelihood of a rupture by force or by depth |
//! | [`noise`] | autoregressive noise per range of the force, whitening |
//! | [`discrepancy_noise`] | white noise equivalent to the residuals of an incomplete model |
//! | [`likelihood`], [`fit`], [`update_event_times`] | log posterior, damped least squares, search over rupture times |
//! | [`delay_refinement`] | estimate of a force delay to a fraction of the sampling interval |
//! | [`score_test`] | first-order gain of additional effects |
#![forbid(unsafe_code)]
#![allow(clippy::needless_range_loop, reason = "several columns of one recording share the index")]

pub mod block_averages;
pub mod delay_refinement;
pub mod discrepancy_noise;
pub mod fit;
pub mod force_drops;
pub mod force_jumps;
pub mod forward_model;
pub mod insertion_phases;
pub mod likelihood;
pub mod model;
mod motion;
pub mod noise;
pub mod rupture_assignment;
pub mod rupture_likelihood;
pub mod score_test;
#[cfg(test)]
mod test_support;
pub mod update_event_times;

/// Compiles the examples of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadmeExamples;
