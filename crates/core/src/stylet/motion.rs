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

#[cfg(test)]
mod tests {
    use super::*;

    const SPEED_MPS: f64 = 0.002;
    const DRY_MPS: f64 = 0.01;

    /// The drive of friction after each of these travels at constant speed, 49 samples each; a travel of none is a hold.
    fn drives(law: FrictionLaw, travels_m: &[f64]) -> alloc::vec::Vec<f64> {
        let mut config = EnhanceConfig::default();
        config.stylet.law = law;
        let mut stylet = Stylet::new(&config, 0.0);
        stylet.in_tissue = true;
        let mut last = Sample::default();
        travels_m
            .iter()
            .map(|travel_m| {
                for _ in 0..49 {
                    let sample = Sample {
                        time_s: last.time_s + 0.005,
                        position_m: last.position_m + travel_m / 49.0,
                        velocity_mps: if *travel_m == 0.0 { 0.0 } else { SPEED_MPS.copysign(*travel_m) },
                        force_n: 0.0,
                    };
                    let step = stylet.motion(&config, &last, &sample, false);
                    stylet.drive_friction(&config, &step, &sample);
                    last = sample;
                }
                stylet.drive
            })
            .collect()
    }

    fn assert_near(found: &[f64], expected: &[f64]) {
        let near = found.iter().zip(expected).all(|(f, e)| (f - e).abs() < 1e-9);
        assert!(near && found.len() == expected.len(), "{found:?} for {expected:?}");
    }

    #[test]
    fn viscous_friction_is_driven_by_the_speed_and_dry_friction_by_its_direction_too() {
        let travels = [0.004, 0.0, -0.001, 0.002];
        for law in [FrictionLaw::Auto, FrictionLaw::Viscous] {
            assert_near(&drives(law, &travels), &[SPEED_MPS, 0.0, -SPEED_MPS, SPEED_MPS]);
        }
        let law = FrictionLaw::CoulombViscous { dry_mps: DRY_MPS };
        let both = SPEED_MPS + DRY_MPS;
        assert_near(&drives(law, &travels), &[both, 0.0, -both, both]);
    }

    #[test]
    fn presliding_friction_builds_up_over_its_travel_and_stays_in_a_hold() {
        // xi' = (v/travel)(1 - xi sgn v): towards the direction of motion by exp(-x/travel).
        let travel_m = 0.001;
        let law = FrictionLaw::Presliding { dry_mps: DRY_MPS, travel_m };
        let faded = |x: f64| (-x / travel_m).exp();
        let first = 1.0 - faded(0.0005);
        let second = 1.0 - faded(0.003);
        let back = -1.0 + (second + 1.0) * faded(0.0007);
        let expected = [
            SPEED_MPS + DRY_MPS * first,
            SPEED_MPS + DRY_MPS * second,
            DRY_MPS * second,
            -SPEED_MPS + DRY_MPS * back,
        ];
        assert_near(&drives(law, &[0.0005, 0.0025, 0.0, -0.0007]), &expected);
    }
}
