//! Limits of a planned insertion.

use crate::error::PlanError;
use serde::{Deserialize, Serialize};

/// Largest distance of the deepest position from zero in m; a larger number is in another unit.
const MAX_DEPTH_M: f64 = 2.0;
/// Largest speed in m/s.
const MAX_SPEED_MPS: f64 = 1.0;
/// Largest acceleration in m/s².
const MAX_ACCELERATION_MPS2: f64 = 1e3;
/// Longest duration in s.
const MAX_DURATION_S: f64 = 1e5;
/// Largest force in N.
const MAX_FORCE_N: f64 = 1e4;

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
    /// Checks that all limits are numbers in the range of an insertion.
    ///
    /// # Errors
    /// [`PlanError::Limit`] with the field and an admissible value.
    pub fn check(&self) -> Result<(), PlanError> {
        let all = [
            (
                "depth_m",
                self.depth_m,
                (-MAX_DEPTH_M, MAX_DEPTH_M),
                "a position in m between -2 and 2, such as 0.09",
            ),
            (
                "speed_mps",
                self.speed_mps,
                (0.0, MAX_SPEED_MPS),
                "a positive speed in m/s up to 1, such as 0.008",
            ),
            (
                "acceleration_mps2",
                self.acceleration_mps2,
                (0.0, MAX_ACCELERATION_MPS2),
                "a positive acceleration in m/s² up to 1000, such as 0.1",
            ),
            (
                "duration_s",
                self.duration_s,
                (0.0, MAX_DURATION_S),
                "a positive time in s up to 1e5, such as 90.0",
            ),
            ("force_n", self.force_n, (0.0, MAX_FORCE_N), "a positive force in N up to 1e4, such as 6.0"),
        ];
        let outside = |value: f64, (low, high): (f64, f64)| !(value > low && value <= high);
        match all.into_iter().find(|(_, value, range, _)| outside(*value, *range)) {
            Some((field, value, _, expected)) => Err(PlanError::Limit { field, value, expected }),
            None => Ok(()),
        }
    }
}
