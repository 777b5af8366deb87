//! Finite acceleration of the drive at a commanded velocity jump.
//!
//! Where two segments of constant velocity meet, a drive with constant acceleration deviates from both lines by
//! `dv (a/2 - |t - t0|)^2 / (2 a)`, with duration `a` and intersection time `t0`. If the jump were modelled as instantaneous, the force
//! would appear to have a lag or inertia.

use super::smooth_interval::{Cells, SmoothInterval};
use super::velocity_estimate::VelocityJump;

/// Longest ramp (s): slower changes are fitted as segments of their own.
const MAX_DURATION_S: f64 = 0.6;
/// Smallest improvement (nats) for one more parameter and the search over it.
const MIN_GAIN_NATS: f64 = 8.0;

/// A constant acceleration between two velocities.
#[derive(Clone, Copy, Debug)]
pub(super) struct AccelerationRamp {
    mid_s: f64,
    duration_s: f64,
    position_m: f64,
    velocity_mps: [f64; 2],
}

impl AccelerationRamp {
    /// Best ramp between two constant-velocity segments that meet at a jump; `None` if it improves the fit too little.
    pub fn between(
        left: &SmoothInterval,
        right: &SmoothInterval,
        jump: &VelocityJump,
        cells: &Cells,
    ) -> Option<Self> {
        let even = |s: &SmoothInterval| {
            s.segment.as_ref().is_some_and(super::motion_segment::MotionSegment::is_constant_velocity)
        };
        if !even(left) || !even(right) {
            return None;
        }
        let of = |lasts_s: f64| Self {
            mid_s: jump.time_s,
            duration_s: lasts_s,
            position_m: jump.position_m,
            velocity_mps: jump.velocity_mps,
        };
        let reach = (0.5 * MAX_DURATION_S / cells.dt) as usize + 1;
        let at = cells.t.partition_point(|t| *t < jump.time_s);
        let around = at.saturating_sub(reach).max(left.from)..(at + reach).min(right.to);
        // The other half of a short neighbour belongs to its other border.
        let longest = MAX_DURATION_S.min(cells.dt * (left.to - left.from).min(right.to - right.from) as f64);
        let off = |lasts_s: f64| -> f64 {
            let ramp = of(lasts_s);
            around.clone().map(|k| (cells.z[k] - ramp.position(cells.t[k])).powi(2)).sum()
        };
        let tried = (1..=(2.0 * longest / cells.dt) as usize).map(|k| 0.5 * k as f64 * cells.dt);
        let best = tried.map(|a| (off(a), a)).min_by(|a, b| a.0.total_cmp(&b.0))?;
        let gained = (off(0.0) - best.0) / (2.0 * cells.noise_m * cells.noise_m);
        (gained > MIN_GAIN_NATS).then(|| of(best.1))
    }

    fn position(&self, t: f64) -> f64 {
        let (off, [before, after]) = (t - self.mid_s, self.velocity_mps);
        let even = self.position_m + if off < 0.0 { before } else { after } * off;
        let inside = 0.5 * self.duration_s - off.abs();
        if inside > 0.0 { even + (after - before) * inside * inside / (2.0 * self.duration_s) } else { even }
    }

    /// Position (m) and velocity (m/s) at a time; `None` outside the ramp.
    pub fn at(&self, t: f64) -> Option<(f64, f64)> {
        let share = (t - self.mid_s) / self.duration_s + 0.5;
        let [before, after] = self.velocity_mps;
        (0.0..1.0).contains(&share).then(|| (self.position(t), before + share * (after - before)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RAMP: AccelerationRamp =
        AccelerationRamp { mid_s: 2.0, duration_s: 0.4, position_m: 0.01, velocity_mps: [0.005, -0.001] };

    #[test]
    fn a_ramp_joins_both_lines_smoothly() {
        assert_eq!((RAMP.at(1.79), RAMP.at(2.2)), (None, None));
        for (t, z, v) in [(1.8, 0.009, 0.005), (2.0, 0.01 - 0.006 * 0.4 / 8.0, 0.002)] {
            let actual = RAMP.at(t).expect("within");
            assert!((actual.0 - z).abs() < 1e-12 && (actual.1 - v).abs() < 1e-12, "{actual:?} at {t}");
        }
        for t in [1.85, 1.97, 2.04, 2.15] {
            let slope = (RAMP.position(t + 1e-6) - RAMP.position(t - 1e-6)) / 2e-6;
            assert!((RAMP.at(t).expect("within").1 - slope).abs() < 1e-8, "{t}");
        }
        assert!((RAMP.position(2.3) - (0.01 - 0.001 * 0.3)).abs() < 1e-12);
    }
}
