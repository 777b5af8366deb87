//! Stylet: robot-assisted needle insertion into layered tissue. Simulation, online estimation, diagnosis of measured data.
//!
//! ```
//! use stylet::{Scenario, simulate};
//!
//! let scenario = Scenario::parse("two_gels.ron", r#"Scenario(
//!     name: "two gels",
//!     tissue: (layers: [
//!         (thickness_m: 0.02, stiffness_n_per_m: 50.0, friction_ns_per_m2: 9000.0, puncture_n: 0.8),
//!         (thickness_m: 0.04, stiffness_n_per_m: 90.0, friction_ns_per_m2: 14000.0),
//!     ]),
//!     motion: Constant(start_m: -0.005, velocity_mps: 0.0023, duration_s: 20.0),
//!     robot: Replay,
//! )"#)?;
//! let run = simulate(&scenario)?;
//! let score = run.algorithm_runs[0].score.as_ref().expect("a simulated run has a score");
//! println!("{} of {} ruptures missed", score.missed, score.ruptures.len());
//! # assert!(score.missed == 0 && !score.ruptures.is_empty());
//! # Ok::<(), stylet::Error>(())
//! ```
//!
//! The functions and their results are those of [`stylet_api`]; the crates below are re-exported under their own names:
//! [`core`] (the online algorithms, `no_std`), [`record`], [`scenario`], [`testbed`], [`score`], [`tissue`],
//! [`stats`].
#![forbid(unsafe_code)]

pub use stylet_api::*;

pub use stylet_api::sweep;
pub use stylet_core as core;
pub use stylet_record as record;
pub use stylet_scenario as scenario;
pub use stylet_score as score;
pub use stylet_stats as stats;
pub use stylet_testbed as testbed;
pub use stylet_tissue as tissue;

/// The README's examples.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
pub struct Readme;

/// The Rust examples of the documentation.
#[cfg(doctest)]
#[doc = include_str!("../docs/tutorials/core_in_your_loop.md")]
#[doc = include_str!("../docs/reference/languages.md")]
pub struct Documentation;
