//! One likelihood for measured force.
//!
//! Unknowns are the base parameters `K_i, b_i, F_i`, the geometry (surface, thicknesses), the numbers of effects, numbers
//! of each recording's own, and the instant of every rupture in every recording. With the instants given, the force is a
//! smooth function of everything else; the law's own condition for a rupture enters as a datum.
//!
//! | module | what lives there |
//! |---|---|
//! | [`blocks`] | a recording as means over blocks of 20 ms |
//! | [`model`] | what is fitted: numbers with their priors and bounds |
//! | [`forward`] | the law replayed with imposed ruptures, or its own |
//! | [`events`] | the likelihood of a rupture: by force or by place |
//! | [`noise`] | autoregressive noise per range of the force, whitening |
//! | [`discrepancy`](mod@discrepancy) | what an unfinished law leaves, as noise |
//! | [`objective`], [`fit`], [`retime`] | the likelihood, its optimum, instants moved |
//! | [`nats`] | nats that say by what they were reckoned |
//! | [`late`] | a delay to a fraction of a sampling step |
//! | [`phases`] | advance, hold and way back; sudden falls and releases in the raw force |
//! | [`drops`], [`assign`] | drops of the force, and which layer each belongs to |
//! | [`look`] | what every effect would gain, to first order |
#![forbid(unsafe_code)]
#![allow(clippy::needless_range_loop, reason = "several columns of one recording share the index")]

pub mod block_averages;
pub mod delay_refinement;
pub mod discrepancy_noise;
pub mod evidence_nats;
pub mod fit;
pub mod force_drops;
pub mod forward_model;
pub mod insertion_phases;
pub mod likelihood;
pub mod model;
pub mod noise;
pub mod rupture_assignment;
pub mod rupture_likelihood;
pub mod score_test;
pub mod update_event_times;
