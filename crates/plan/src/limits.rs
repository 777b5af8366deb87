//! Limits of a planned insertion.

use crate::error::PlanError;
use serde::{Deserialize, Serialize};

/// Limits of a planned insertion, satisfied at every time of the motion.
///
/// Written in RON: `Limits(depth_m: 0.09, speed_mps: 0.008, acceleration_mps2: 0.1, duration_s: 90.0, force_n:
/// 6.0)`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Limits {
    /// Deepest position of the tip in m, on the axis of the recordings (the surface is at the scenario's
    /// `surface_m`).
    pub depth_m: f64,
    /// Largest speed in m/s in either direction.
    pub speed_mps: f64,
    /// Largest acceleration in m/s².
    pub acceleration_mps2: f64,
    /// Longest duration in s.
    pub duration_s: f64,
    /// Largest force in N expected under any candidate, plus three standard deviations of the noise.
    pub force_n: f64,
}

impl Limits {
    /// Checks that all limits are positive numbers.
    ///
    /// # Errors
    /// [`PlanError::Limit`] with the field and an admissible value.
    pub fn check(&self) -> Result<(), PlanError> {
        let all = [
            ("speed_mps", self.speed_mps, "a positive speed in m/s, such as 0.008"),
            ("acceleration_mps2", self.acceleration_mps2, "a positive acceleration in m/s², such as 0.1"),
            ("duration_s", self.duration_s, "a positive time in s, such as 90.0"),
            ("force_n", self.force_n, "a positive force in N, such as 6.0"),
        ];
        if !self.depth_m.is_finite() {
            let expected = "a position in m, such as 0.09";
            return Err(PlanError::Limit { field: "depth_m", value: self.depth_m, expected });
        }
        match all.into_iter().find(|(_, value, _)| !(value.is_finite() && *value > 0.0)) {
            Some((field, value, expected)) => Err(PlanError::Limit { field, value, expected }),
            None => Ok(()),
        }
    }
}
