//! How fast the needle goes: what the log says, or what its positions say where the two cannot both be right.
//!
//! Velocities in logs are often smoothed or late: at a stop within one sample they go down over twenty, while friction, and with it the
//! force, is gone at once. The mean speed `w` of a step, from the positions, does not lag; but it carries the encoder's noise,
//! `sqrt(2) sigma/dt`. So what is said is taken as long as it agrees with `w` within four times their usual difference.

use super::gaussian::{at_least, at_most};
use crate::sample::Sample;

/// Squared number of standard deviations that count as a disagreement: 4.
const DISAGREEMENT: f64 = 16.0;
/// Least standard deviation of the difference as a share of the speed: what resolution and synchronisation of a good log leave.
const LEAST_SHARE: f64 = 0.005;
/// Time over which the usual difference is learned, in s: much longer than smoothing or a lag, so that these do not become usual.
pub(crate) const LEARNED_S: f64 = 2.0;

/// What is said to be below this in m/s is rest (SPEC section 6).
pub(crate) const DEAD_MPS: f64 = 1e-5;

/// Samples in a row that have to agree.
const AGREEING: u8 = 2;

#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Going {
    /// Mean square of the usual difference in (m/s)².
    usual: f64,
    said_mps: f64,
    /// The needle stands: it has not moved, and was not said to.
    standing: bool,
    /// They disagree for at least this many samples more: where the positions' speed jumps it may cross a smoothed one.
    apart: u8,
}

impl Going {
    /// Velocity in m/s at a sample, and whether log and positions are apart: then friction changes within the step, nobody knows
    /// when. `share` is that of a step in what is usual.
    #[inline(always)]
    pub(crate) fn speed(
        &mut self,
        last: &Sample,
        sample: &Sample,
        speed_mps: f64,
        share: f64,
    ) -> (f64, bool) {
        let said = sample.velocity_mps;
        let dt_s = sample.time_s - last.time_s;
        let stepped_m = sample.position_m - last.position_m;
        if stepped_m == 0.0 && (self.standing || said.abs() <= DEAD_MPS) {
            // A velocity that was smoothed in both directions of time rises before the needle has moved.
            (self.standing, self.said_mps) = (true, said);
            return (0.0, false);
        }
        let starts = core::mem::take(&mut self.standing);
        let before = self.said_mps;
        self.said_mps = said;
        if starts {
            return (said, true);
        }
        let off_m = stepped_m - 0.5 * (said + before) * dt_s;
        let least = LEAST_SHARE * speed_mps;
        let limit = DISAGREEMENT * at_least(least * least, self.usual);
        let off2_m2 = off_m * off_m;
        if off2_m2 > limit * (dt_s * dt_s) || self.apart > 0 {
            let off2 = off2_m2 / (dt_s * dt_s);
            self.usual += share * (at_most(limit, off2) - self.usual);
            return if dt_s > 0.0 {
                self.disagree(before, said, stepped_m / dt_s, limit)
            } else {
                (said, false)
            };
        }
        if off_m != 0.0 {
            self.usual += share * (off2_m2 / (dt_s * dt_s) - self.usual);
        } else if said != 0.0 {
            self.usual -= share * self.usual;
        }
        (said, false)
    }

    /// Whether a jump within the step explains it, so that the mean speed lies between those at the ends; otherwise the positions are right.
    #[cold]
    fn disagree(&mut self, before: f64, said: f64, stepped: f64, limit: f64) -> (f64, bool) {
        let between = at_most(said.max(before), at_least(said.min(before), stepped));
        let off = stepped - between;
        // Once they disagree, agreement has to be twice as close.
        let far = off * off > if self.apart > 0 { 0.25 * limit } else { limit };
        self.apart = if far { AGREEING } else { self.apart.saturating_sub(1) };
        (if self.apart > 0 { stepped } else { said }, true)
    }
}
