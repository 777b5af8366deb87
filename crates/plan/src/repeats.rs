//! Repeats: how many insertions, and at which speeds, when the forces at which layers give way scatter.

use crate::limits::Limits;
use serde::Serialize;
use stylet_identify::model::Model;

/// Repeats of an insertion.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Repeats {
    /// Standard deviation of a puncture force between insertions, relative.
    pub scatter: f64,
    /// How many insertions, all speeds together.
    pub insertions: usize,
    /// The speeds in m/s, equally often each: the ends of the range tell a slope best.
    pub speeds_mps: [f64; 2],
    /// Half width of the 95 % interval of a mean puncture force after these, relative.
    pub mean_half_width: f64,
    /// Change of the puncture force per factor e in speed that they show with ten nats.
    pub detectable_alpha: f64,
}

/// Scatter below this, relative, is not worth repeats.
const MIN_SCATTER: f64 = 0.003;
/// Change of the puncture force per factor e in speed that repeats have to show, and the nats that show it.
const TARGET_ALPHA: f64 = 0.05;
const TARGET_NATS: f64 = 10.0;
/// A mean puncture force has to be known to this, relative.
const TARGET_MEAN_HALF_WIDTH: f64 = 0.02;
/// Fewest and most insertions that are proposed.
const INSERTION_RANGE: (f64, f64) = (4.0, 60.0);
/// Speeds span at most this factor: slower insertions take too long.
const MAX_SPEED_RATIO: f64 = 8.0;

/// The repeats for a model whose layers give way by force; none when nothing scatters.
#[must_use]
pub fn plan_repeats(model: &Model, limits: &Limits) -> Option<Repeats> {
    let s = model.scatter.rupture_force;
    if s < MIN_SCATTER || model.tissue.layers.iter().all(|l| l.puncture_n.is_none()) {
        return None;
    }
    let span = MAX_SPEED_RATIO
        .min((limits.depth_m.abs() * 2.0 / limits.duration_s / limits.speed_mps).recip())
        .max(1.5);
    // Half of n insertions at either end: sum of (ln v - mean)^2 = n (ln span / 2)^2, gap = alpha^2 sum / (2 s^2).
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
