//! Internal units of length and force. The core's constants are made for insertions of centimetres and forces of newtons; recordings
//! of another scale are converted to units in which they have these magnitudes.

use crate::sample::{Baseline, CompletedDrop, Detection, LayerEstimate, Output, Sample, ZeroStep};

/// Smallest travel in m for which metres are the unit of length.
const MIN_TRAVEL_M: f64 = 5e-4;
/// Range of the mean change of the force in N for which newtons are the unit of force.
const FORCE_RANGE_N: [f64; 2] = [0.007, 70.0];
/// Ratio of successive units.
const STEP: f64 = 1e3;
/// Largest number of such steps.
const MAX_STEPS: u32 = 3;

/// Internal units of an enhancer, in m and N: its configuration and constants are expressed in them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Units {
    /// Unit of length in m.
    pub length_m: f64,
    /// Unit of force in N.
    pub force_n: f64,
}

impl Default for Units {
    fn default() -> Self {
        Self { length_m: 1.0, force_n: 1.0 }
    }
}

impl Units {
    /// Units for a recording of this travel and mean absolute change of the force: m and N, or these by powers of 1000.
    #[must_use]
    pub fn for_extent(travel_m: f64, mean_change_n: f64) -> Self {
        let mut out = Self::default();
        for _ in 0..MAX_STEPS {
            if travel_m > 0.0 && travel_m < MIN_TRAVEL_M * out.length_m {
                out.length_m /= STEP;
            }
            if mean_change_n > 0.0 && mean_change_n < FORCE_RANGE_N[0] * out.force_n {
                out.force_n /= STEP;
            } else if mean_change_n.is_finite() && mean_change_n > FORCE_RANGE_N[1] * out.force_n {
                out.force_n *= STEP;
            }
        }
        out
    }

    pub(crate) fn are_si(&self) -> bool {
        *self == Self::default()
    }

    pub(crate) fn sample(&self, sample: &Sample) -> Sample {
        Sample {
            time_s: sample.time_s,
            position_m: sample.position_m / self.length_m,
            velocity_mps: sample.velocity_mps / self.length_m,
            force_n: sample.force_n / self.force_n,
        }
    }

    /// Converts an output to m and N. `friction_per_length`: whether `b` is friction per length (multi-layer model).
    pub(crate) fn output(&self, out: &Output, friction_per_length: bool) -> Output {
        let (l, f) = (self.length_m, self.force_n);
        let stiffness = f / l;
        let friction = if friction_per_length { f / (l * l) } else { stiffness };
        Output {
            enhanced_n: f * out.enhanced_n,
            reconstructed_n: f * out.reconstructed_n,
            error_n: f * out.error_n,
            theta: [stiffness * out.theta[0], friction * out.theta[1]],
            derivative_n_per_s: f * out.derivative_n_per_s,
            cumulative_friction_ns_per_m: stiffness * out.cumulative_friction_ns_per_m,
            band_n: out.band_n.map(|band| band.map(|n| f * n)),
            sd: [stiffness * out.sd[0], friction * out.sd[1], stiffness * out.sd[2]],
            contact_m: out.contact_m.map(|z| l * z),
            contact_sd_m: l * out.contact_sd_m,
            baseline: self.baseline(&out.baseline),
            zero_step: out.zero_step.map(|step| ZeroStep {
                position_m: l * step.position_m,
                size_n: f * step.size_n,
                sd_n: f * step.sd_n,
                ..step
            }),
            detection: out.detection.map(|d| Detection {
                position_m: l * d.position_m,
                located_m: l * d.located_m,
                drop_n: f * d.drop_n,
                drop_sd_n: f * d.drop_sd_n,
                ..d
            }),
            completed_drop: out.completed_drop.map(|d| CompletedDrop {
                drop_n: f * d.drop_n,
                drop_sd_n: f * d.drop_sd_n,
                ..d
            }),
            estimate: out.estimate.map(|e| LayerEstimate {
                start_m: l * e.start_m,
                thickness_m: l * e.thickness_m,
                stiffness_n_per_m: stiffness * e.stiffness_n_per_m,
                friction: friction * e.friction,
                drop_n: f * e.drop_n,
                added_friction_ns_per_m: stiffness * e.added_friction_ns_per_m,
                stiffness_sd: stiffness * e.stiffness_sd,
                friction_sd: friction * e.friction_sd,
                drop_sd_n: f * e.drop_sd_n,
                cumulative_ns_per_m: stiffness * e.cumulative_ns_per_m,
                cumulative_sd: stiffness * e.cumulative_sd,
                ..e
            }),
            ..*out
        }
    }

    fn baseline(&self, b: &Baseline) -> Baseline {
        let (f, line) = (self.force_n, self.force_n / self.length_m);
        Baseline {
            offset_n: f * b.offset_n,
            drift_n_per_s: f * b.drift_n_per_s,
            line_n_per_m: line * b.line_n_per_m,
            sd: [f * b.sd[0], f * b.sd[1], line * b.sd[2]],
            ..*b
        }
    }
}
