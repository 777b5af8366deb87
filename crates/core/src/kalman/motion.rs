//! Motion between samples, and the drive of shaft friction.

use super::force_predictor::MotionStep;
use super::shaft_friction::FORCE_TIME_CONSTANT_S;
use super::state::{KalmanEnhancer, SURE_DROP_SDS};
use super::velocity_estimator::{DISAGREEMENT_MEMORY_S, REST_SPEED_MPS};
use crate::bounds::{at_least, at_most};
use crate::config::{EnhanceConfig, FrictionLaw};
use crate::sample::Sample;

/// Time constant of the low-passed speed, in s.
pub(super) const SPEED_TIME_CONSTANT_S: f64 = 0.2;

impl KalmanEnhancer {
    /// Friction drive by the configured law, see [`FrictionLaw`].
    #[inline(always)]
    pub(super) fn update_friction_drive(
        &mut self,
        config: &EnhanceConfig,
        step: &MotionStep,
        sample: &Sample,
    ) {
        let v = sample.velocity_mps;
        let (dry_mps, travel_m) = match config.stylet.friction_law {
            FrictionLaw::Auto | FrictionLaw::Viscous => {
                self.friction_drive_mps = v;
                self.steady_drive_mps = step.speed_mps;
                return;
            }
            FrictionLaw::CoulombViscous { dry_mps } => (dry_mps, 0.0),
            FrictionLaw::Presliding { dry_mps, travel_m } => (dry_mps, travel_m),
        };
        let sign = if v > REST_SPEED_MPS {
            1.0
        } else if v < -REST_SPEED_MPS {
            -1.0
        } else {
            0.0
        };
        self.presliding_state = if travel_m > 0.0 {
            // Builds up while the shaft slides in tissue and persists in a hold.
            let travel = step.dz_m.abs();
            let sliding = self.in_tissue && sign != 0.0 && travel > 0.0;
            if sliding {
                sign + (self.presliding_state - sign) * libm::exp(-travel / travel_m)
            } else {
                self.presliding_state
            }
        } else {
            sign
        };
        self.friction_drive_mps = v + dry_mps * self.presliding_state;
        self.steady_drive_mps = step.speed_mps + dry_mps;
    }

    /// Resolves a nonzero logged velocity at an unchanged position. If the force has jumped in the direction of its friction, by half
    /// of that or by more than the noise, the log is right; otherwise it is smoothed and the needle rests.
    #[inline(always)]
    pub(super) fn resolve_motion_start(
        &self,
        last: &Sample,
        sample: &Sample,
        velocity_mps: f64,
        sudden: bool,
    ) -> (f64, bool) {
        let logged = sample.velocity_mps;
        if velocity_mps != 0.0 || logged.abs() <= REST_SPEED_MPS || !self.in_tissue {
            return (velocity_mps, sudden);
        }
        let (moving_n, resting_n) = (
            self.estimator.predict(sample.position_m, logged),
            self.estimator.predict(sample.position_m, 0.0),
        );
        let jump_n = sample.force_n - last.force_n;
        let noise_n = SURE_DROP_SDS * libm::sqrt(2.0 * self.noise.marginal_variance());
        let smallest_n = at_most(noise_n, 0.5 * (moving_n - resting_n).abs());
        if (jump_n > 0.0) == (logged > 0.0) && jump_n.abs() > smallest_n {
            (logged, true)
        } else {
            (velocity_mps, sudden)
        }
    }

    #[inline(always)]
    pub(super) fn motion_step(
        &mut self,
        config: &EnhanceConfig,
        last: &Sample,
        sample: &Sample,
        sudden: bool,
    ) -> MotionStep {
        let dt_s = sample.time_s - last.time_s;
        if dt_s > 0.0 {
            self.noise.update_interval(dt_s);
            if (dt_s - self.low_pass_gains[0]).abs() > 1e-9 {
                let gain = |time_s: f64| dt_s / (dt_s + time_s);
                self.low_pass_gains = [
                    dt_s,
                    gain(SPEED_TIME_CONSTANT_S),
                    gain(FORCE_TIME_CONSTANT_S),
                    gain(DISAGREEMENT_MEMORY_S),
                ];
            }
        }
        let speed = sample.velocity_mps.abs();
        if speed > config.drop.standstill_mps {
            if self.speed_mps == 0.0 {
                self.speed_mps = speed;
            } else {
                self.speed_mps += self.low_pass_gains[1] * (speed - self.speed_mps);
            }
        }
        MotionStep {
            dt_s,
            dz_m: sample.position_m - last.position_m,
            dv_mps: sample.velocity_mps - last.velocity_mps,
            rho: self.noise.rho_over(dt_s),
            sudden,
            speed_mps: at_least(config.drop.standstill_mps, self.speed_mps),
        }
    }
}

#[cfg(test)]
mod tests;
