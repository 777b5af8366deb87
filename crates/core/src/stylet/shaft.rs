//! Friction where the law of layers does not hold: dry, building up over travel, staying in holds.
//!
//! Measured insertions do not follow `f = D v + K x + b x v`: friction hardly depends on speed, and what is left of the force is curved. What
//! can be said there without a law:
//!
//! - Just after a rupture nothing acts at the tip: the next layer is not loaded yet. Over [`MEMORY_M`] of travel, in which friction
//!   builds up again after the needle has slipped, all of the force is friction.
//! - While the needle advances, the force of a layer that does not give way does not fall. Where the measured force falls slowly, friction
//!   falls; and friction is never more than the whole force.
//! - In a hold both relax, and nothing tells one from the other: their ratio stays.
//! - On the way back the tip feels nothing unless it is caught: the force is friction, from the force of the hold over zero to a pull of its own,
//!   `P(x) = -S + (F + S) exp(-x/delta)`. The way in cannot teach `S` and `delta`; [`PULL`] and [`RELAX_M`] are prior means.
//!   What the way back itself shows is added by a tracker: changes over more than [`TRACK_M`] count as friction, faster ones as the tip's, and a sudden
//!   release of the pull, which a tip that is only pulled cannot make, as friction.

use super::gaussian::{at_least, at_most};
use super::local::MEMORY_M;

/// Pull of the friction on the way back as a share of the largest force: with a puncture that leaves half of its force as friction, and a pull of
/// half the push (Okamura 2004: asymmetric friction), a quarter.
const PULL: f64 = 0.25;
/// Travel over which the force of the hold relaxes to zero on the way back, in m: presliding of soft tissue reaches over millimetres.
const RELAX_M: f64 = 2.5e-3;
/// Travel of the tracker, in m: a change at the tip keeps `exp(-x/2 mm)` of itself after a travel `x`.
const TRACK_M: f64 = 2e-3;
/// Travel over which the tracker's slope is learned, in m: several times its own.
const SLOPE_M: f64 = 8e-3;
/// Travel over which it gives in to an excess push, which no tip can make on the way back, in m.
const EXCESS_M: f64 = 1e-3;
/// Smoothing of the force in s, shorter than a drop.
pub(crate) const SMOOTH_S: f64 = 0.05;

#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Shaft {
    /// Friction in N while advancing or holding.
    level_n: f64,
    smooth_n: f64,
    rupture_m: f64,
    passed: bool,
    back: Option<Back>,
}

/// The way back.
#[derive(Clone, Copy, Debug)]
struct Back {
    turn_m: f64,
    deepest_back_m: f64,
    force_n: f64,
    pull_n: f64,
    delta_m: f64,
    off_n: f64,
    slope: f64,
    last_n: f64,
    scatter_n2: f64,
}

/// One sample, as the shaft's friction needs it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Felt {
    /// Share that the sample has in the smoothed force.
    pub(crate) share: f64,
    pub(crate) position_m: f64,
    /// Force without the sensor's zero in N.
    pub(crate) force_n: f64,
    pub(crate) advancing: bool,
    pub(crate) retracting: bool,
    /// Largest force so far in N.
    pub(crate) peak_n: f64,
    /// The force has just jumped up.
    pub(crate) jumped: bool,
    /// Variance of the noise in N².
    pub(crate) noise_n2: f64,
    pub(crate) track: bool,
}

impl Shaft {
    /// A rupture, or one that goes on.
    pub(crate) fn rupture(&mut self, position_m: f64, force_n: f64) {
        self.passed = true;
        self.rupture_m = position_m;
        self.smooth_n = force_n;
        self.level_n = force_n.max(0.0);
        self.back = None;
    }

    /// Takes a sample; returns the friction in N and its standard deviation.
    #[inline(always)]
    pub(crate) fn take(&mut self, felt: &Felt) -> (f64, f64) {
        let before = self.smooth_n;
        self.smooth_n += felt.share * (felt.force_n - before);
        if felt.retracting && self.back.is_none() {
            self.turn(felt, before);
        }
        if let Some(back) = &mut self.back {
            if felt.advancing && felt.position_m >= back.turn_m {
                self.back = None;
                self.level_n = self.level_n.min(self.smooth_n.max(0.0));
            } else {
                return back.take(felt);
            }
        }
        if !self.passed {
            return (0.0, 0.0);
        }
        let change = self.smooth_n - before;
        if felt.position_m - self.rupture_m < MEMORY_M {
            self.level_n = self.smooth_n;
        } else if felt.advancing {
            if change < 0.0 {
                self.level_n += change;
            }
        } else if before > 0.0 {
            self.level_n *= (self.smooth_n / before).clamp(0.0, 2.0);
        }
        self.level_n = at_least(0.0, at_most(self.smooth_n, self.level_n));
        // Friction may still build up, or have been the new layer's force: not known better than to a quarter.
        (self.level_n, 0.25 * self.level_n)
    }

    #[cold]
    fn turn(&mut self, felt: &Felt, force_n: f64) {
        let pull = (PULL * felt.peak_n).max(libm::sqrt(felt.noise_n2)).max(1e-9);
        let force = force_n.max(0.05 * pull);
        self.back = Some(Back {
            turn_m: felt.position_m,
            deepest_back_m: felt.position_m,
            force_n: force,
            pull_n: pull,
            delta_m: RELAX_M / libm::log(1.0 + force / pull),
            off_n: 0.0,
            slope: 0.0,
            last_n: 0.0,
            scatter_n2: 0.0,
        });
    }
}

impl Back {
    #[inline(never)]
    fn take(&mut self, felt: &Felt) -> (f64, f64) {
        let travel = (self.deepest_back_m - felt.position_m).max(0.0);
        if travel > 0.0 {
            self.deepest_back_m = felt.position_m;
        }
        let x = (self.turn_m - self.deepest_back_m).max(0.0);
        let taught = -self.pull_n + (self.force_n + self.pull_n) * libm::exp(-x / self.delta_m);
        if !felt.track {
            return (taught, 0.25 * felt.peak_n);
        }
        self.off_n += self.slope * travel;
        let mut rest = felt.force_n - taught - self.off_n;
        if felt.jumped && rest > 0.0 {
            let released = (rest - self.last_n).clamp(0.0, rest);
            self.off_n += released;
            rest -= released;
        }
        self.last_n = rest;
        let friction = taught + self.off_n;
        let reach = if rest < 0.0 { TRACK_M } else { EXCESS_M };
        self.off_n += (1.0 - libm::exp(-travel / reach)) * rest;
        self.slope += travel / (TRACK_M * SLOPE_M) * rest;
        let bounded = rest.clamp(-felt.peak_n, felt.peak_n);
        self.scatter_n2 += travel / (travel + TRACK_M) * (bounded * bounded - self.scatter_n2);
        (friction, libm::sqrt(self.scatter_n2))
    }
}
