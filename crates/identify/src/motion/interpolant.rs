//! Position and velocity between samples, with their integrals over time.

use super::jump_timing::JumpTiming;

/// Interpolates position and velocity between knots.
#[derive(Clone, Debug, Default)]
pub(super) struct Interpolant {
    /// Time in s, non-decreasing; repeated at a velocity jump.
    pub(super) t: Vec<f64>,
    /// Position in m.
    pub(super) z: Vec<f64>,
    /// Velocity in m/s.
    pub(super) v: Vec<f64>,
    /// Integral of the position in m s up to each knot.
    sum_z: Vec<f64>,
    /// Integral of the velocity in m up to each knot.
    sum_v: Vec<f64>,
    /// Whether positions are precise enough for a cubic Hermite interpolation, whose velocity integrates to the position difference.
    /// Otherwise both are linear, so that position noise does not enter the mean velocity.
    cubic: bool,
}

impl Interpolant {
    pub(super) fn new(cubic: bool) -> Self {
        Self { cubic, ..Self::default() }
    }

    pub(super) fn push(&mut self, t: f64, z: f64, v: f64) {
        let (mut sum_z, mut sum_v) = (0.0, 0.0);
        if let (Some(t0), Some(z0), Some(v0)) = (self.t.last(), self.z.last(), self.v.last()) {
            let dt = t - t0;
            sum_z = self.sum_z.last().unwrap_or(&0.0) + 0.5 * dt * (z0 + z);
            let travel = if self.cubic && dt > 0.0 { z - z0 } else { 0.5 * dt * (v0 + v) };
            sum_v = self.sum_v.last().unwrap_or(&0.0) + travel;
        }
        self.t.push(t);
        self.z.push(z);
        self.v.push(v);
        self.sum_z.push(sum_z);
        self.sum_v.push(sum_v);
    }

    /// Velocity in m/s at a knot; the search starts at knot `near`.
    pub(super) fn velocity_at(&self, at_s: f64, near: &mut usize) -> f64 {
        while self.t.get(*near + 1).is_some_and(|t| *t <= at_s) {
            *near += 1;
        }
        self.v.get(*near).copied().unwrap_or(0.0)
    }

    /// Last knot at or before `at_s`, or the first one.
    pub(super) fn index_before(&self, at_s: f64) -> usize {
        self.t.partition_point(|t| *t <= at_s).saturating_sub(1)
    }

    /// [`integrals`](Self::integrals) with the motion on one side of a jump extrapolated beyond the jump.
    pub(super) fn integrals_beyond_jump(
        &self,
        jump: &JumpTiming,
        side: usize,
        at_s: f64,
        near: &mut usize,
    ) -> (f64, f64) {
        let (z, v) = self.integrals(jump.time_s, near);
        let (dt, speed) = (at_s - jump.time_s, jump.velocity_mps[side]);
        (z + dt * (jump.position_m + 0.5 * dt * speed), v + dt * speed)
    }

    /// Integrals of position and velocity up to a time; the search starts at knot `near`.
    pub(super) fn integrals(&self, at_s: f64, near: &mut usize) -> (f64, f64) {
        let last = self.t.len() - 1;
        let mut k = (*near).min(last);
        if self.t[k] > at_s {
            k = self.index_before(at_s);
        }
        while k < last && self.t[k + 1] <= at_s {
            k += 1;
        }
        *near = k;
        let dt = at_s - self.t[k];
        if k == last || dt <= 0.0 {
            return (self.sum_z[k] + dt * self.z[k], self.sum_v[k] + dt * self.v[k]);
        }
        let step = self.t[k + 1] - self.t[k];
        let share = dt / step;
        let mix = |x: &[f64]| x[k] + 0.5 * share * (x[k + 1] - x[k]);
        let travel = if self.cubic {
            // Cubic Hermite interpolation of positions and velocities at both knots.
            let (v0, v1, mean) = (self.v[k], self.v[k + 1], (self.z[k + 1] - self.z[k]) / step);
            dt * (v0 + share * (3.0 * mean - 2.0 * v0 - v1 + share * (v0 + v1 - 2.0 * mean)))
        } else {
            dt * mix(&self.v)
        };
        (self.sum_z[k] + dt * mix(&self.z), self.sum_v[k] + travel)
    }
}
