//! State of the tests that distinguish a step of the zero from a rupture.

use super::layer_estimator::LayerEstimator;
use super::shaft_friction::DryShaftFriction;
use crate::sample::Sample;

/// Deviations of consecutive samples from the prediction.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Jump {
    pub(super) sum_n: f64,
    pub(super) low_n: f64,
    pub(super) high_n: f64,
    /// Variance of the prediction in N².
    pub(super) variance: f64,
    pub(super) count: u8,
    /// Difference of the first of them to the sample before, in N.
    pub(super) first_n: f64,
    pub(super) start: Sample,
}

/// Test of two hypotheses on the last rupture: a step of the zero, or a rupture.
#[derive(Clone, Copy, Debug)]
pub(super) struct ZeroStepTest {
    /// The old layer with another zero.
    pub(super) estimator: LayerEstimator,
    /// The new layer after a drop of uncertain size.
    pub(super) rupture: LayerEstimator,
    pub(super) bias_n: f64,
    /// Log odds of the step in nats.
    pub(super) nats: f64,
    pub(super) at: Sample,
    /// State to restore if the rupture is withdrawn.
    pub(super) dry_friction: DryShaftFriction,
    pub(super) contact: (Option<f64>, f64),
    pub(super) counts: (u32, u32, f64),
}
