//! Number and speeds of repeated insertions when rupture forces scatter.

use crate::limits::Limits;
use serde::Serialize;
use stylet_identify::model::Model;

/// Repeated insertions.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Repeats {
    /// Relative standard deviation of a puncture force between insertions.
    pub scatter: f64,
    /// Number of insertions at all speeds.
    pub insertions: usize,
    /// The two speeds in m/s, with equally many insertions each: the ends of the range determine a slope best.
    pub speeds_mps: [f64; 2],
    /// Relative half width of the 95 % interval of the mean puncture force.
    pub mean_half_width: f64,
    /// Change of the puncture force per factor e in speed that is detected with ten nats.
    pub detectable_alpha: f64,
}

/// Relative scatter below which repeats are not proposed.
const MIN_SCATTER: f64 = 0.003;
/// Change of the puncture force per factor e in speed to be detected, and the required nats.
const TARGET_ALPHA: f64 = 0.05;
const TARGET_NATS: f64 = 10.0;
/// Target half width of the mean puncture force, relative.
const TARGET_MEAN_HALF_WIDTH: f64 = 0.02;
/// Smallest and largest number of proposed insertions.
const INSERTION_RANGE: (f64, f64) = (4.0, 60.0);
/// Largest ratio of the speeds: slower insertions take too long.
const MAX_SPEED_RATIO: f64 = 8.0;

/// Repeats for a model whose layers rupture by force; `None` without scatter.
#[must_use]
pub fn plan_repeats(model: &Model, limits: &Limits) -> Option<Repeats> {
    let s = model.scatter.rupture_force;
    if s < MIN_SCATTER || model.tissue.layers.iter().all(|l| l.puncture_n.is_none()) {
        return None;
    }
    let span = MAX_SPEED_RATIO
        .min((limits.depth_m.abs() * 2.0 / limits.duration_s / limits.speed_mps).recip())
        .max(1.5);
    // With n/2 insertions at either end: sum of (ln v - mean)^2 = n (ln span / 2)^2, gap = alpha^2 sum / (2
    // s^2).
    let half = 0.5 * libm::log(span);
    let for_slope = 2.0 * TARGET_NATS * s * s / (TARGET_ALPHA * half).powi(2);
    let for_mean = (stylet_stats::Z95 * s / TARGET_MEAN_HALF_WIDTH).powi(2);
    let n = 2.0 * (0.5 * for_slope.max(for_mean).clamp(INSERTION_RANGE.0, INSERTION_RANGE.1)).ceil();
    let fast = 0.95 * limits.speed_mps;
    Some(Repeats {
        scatter: s,
        insertions: n as usize,
        speeds_mps: [fast / span, fast],
        mean_half_width: stylet_stats::Z95 * s / n.sqrt(),
        detectable_alpha: (2.0 * TARGET_NATS / n).sqrt() * s / half,
    })
}
