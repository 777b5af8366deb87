//! How the needle moves, and what drives the friction along its shaft.

use super::gaussian::at_least;
use super::going::{DEAD_MPS, LEARNED_S};
use super::{Step, Stylet, shaft};
use crate::config::{EnhanceConfig, FrictionLaw};
use crate::sample::Sample;

/// Smoothing of the speed that stands for the motion, in s.
pub(super) const SPEED_S: f64 = 0.2;

impl Stylet {
    /// The drive of friction, by the law in force.
    #[inline(always)]
    pub(super) fn drive_friction(&mut self, config: &EnhanceConfig, step: &Step, sample: &Sample) {
        let v = sample.velocity_mps;
        let (dry_mps, travel_m) = match config.stylet.law {
            FrictionLaw::Auto | FrictionLaw::Viscous => {
                self.drive = v;
                self.steady = step.speed_mps;
                return;
            }
            FrictionLaw::CoulombViscous { dry_mps } => (dry_mps, 0.0),
            FrictionLaw::Presliding { dry_mps, travel_m } => (dry_mps, travel_m),
        };
        let sign = if v > DEAD_MPS {
            1.0
        } else if v < -DEAD_MPS {
            -1.0
        } else {
            0.0
        };
        self.xi = if travel_m > 0.0 {
            // Builds up while any shaft is inside; a hold leaves it as it is.
            let travel = step.dz_m.abs();
            let inside = self.in_tissue && sign != 0.0 && travel > 0.0;
            if inside { sign + (self.xi - sign) * libm::exp(-travel / travel_m) } else { self.xi }
        } else {
            sign
        };
        self.drive = v + dry_mps * self.xi;
        self.steady = step.speed_mps + dry_mps;
    }

    /// A needle that is said to have set off but has not moved yet: a log of exact velocities, or one that was smoothed? The force knows: with
    /// the speed friction is there at once.
    #[inline(always)]
    pub(super) fn set_off(&self, last: &Sample, sample: &Sample, mps: f64, sudden: bool) -> (f64, bool) {
        let said = sample.velocity_mps;
        if mps != 0.0 || said.abs() <= DEAD_MPS || !self.in_tissue {
            return (mps, sudden);
        }
        let (moves, stands) =
            (self.layers.says(sample.position_m, said), self.layers.says(sample.position_m, 0.0));
        let jumped = sample.force_n - last.force_n;
        if (jumped > 0.0) == (said > 0.0) && jumped.abs() > 0.5 * (moves - stands).abs() {
            (said, true)
        } else {
            (mps, sudden)
        }
    }

    /// How the needle has moved since the last sample.
    #[inline(always)]
    pub(super) fn motion(
        &mut self,
        config: &EnhanceConfig,
        last: &Sample,
        sample: &Sample,
        sudden: bool,
    ) -> Step {
        let dt_s = sample.time_s - last.time_s;
        if dt_s > 0.0 {
            self.noise.clock(dt_s);
            if (dt_s - self.shares[0]).abs() > 1e-9 {
                let share = |time_s: f64| dt_s / (dt_s + time_s);
                self.shares = [dt_s, share(SPEED_S), share(shaft::SMOOTH_S), share(LEARNED_S)];
            }
        }
        let speed = sample.velocity_mps.abs();
        if speed > config.drop.standstill_mps {
            if self.speed_mps == 0.0 {
                self.speed_mps = speed;
            } else {
                self.speed_mps += self.shares[1] * (speed - self.speed_mps);
            }
        }
        Step {
            dt_s,
            dz_m: sample.position_m - last.position_m,
            dv_mps: sample.velocity_mps - last.velocity_mps,
            rho: self.noise.rho_over(dt_s),
            sudden,
            speed_mps: at_least(config.drop.standstill_mps, self.speed_mps),
        }
    }
}
