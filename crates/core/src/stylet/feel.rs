//! A sample in the tissue: predicted, judged, learned from.

use super::gaussian::{at_least, at_most};
use super::layers::Layers;
use super::local::{self, Local, Step};
use super::noise::Noise;
use super::{LONGEST_DROP_S, STIFFEST, Stylet, WORK_RUPTURE};
use crate::config::EnhanceConfig;
use crate::sample::Sample;

/// A force outside this many standard deviations that comes alone is a spike.
const SPIKE_SDS: f64 = 6.0;
/// A spike lasts at most this many samples.
const SPIKE_SAMPLES: u8 = 3;
/// Misfit at which the law of layers does not hold; it has to be shown that it does.
pub(super) const UNPROVEN: f64 = 3.0;
/// Multiplications and additions of the local predictor: five shears, an innovation and an update of five unknowns.
const WORK_LOCAL: u32 = 5 * 14 + 2 * 24 + 2 * 20;
/// Of the layers: an innovation and an update of six unknowns.
const WORK_LAYERS: u32 = 2 * 35 + 2 * 27 + 12;

impl Stylet {
    /// In the tissue.
    #[inline(always)]
    pub(super) fn feel(&mut self, config: &EnhanceConfig, step: &Step, sample: &Sample) {
        let force_n = sample.force_n;
        self.mend(step, sample);
        self.work += WORK_LOCAL;
        self.local.advance(step, &self.noise);
        if step.sudden {
            // Friction has changed by any part of the force, at any instant of the step.
            self.local.level(force_n, &self.noise);
            self.layers.pass();
            self.alarm.rest();
            (self.fall, self.was_quiet) = (None, true);
            self.deepest_m = at_least(self.deepest_m, sample.position_m);
            return;
        }
        self.last_level_n = if self.fall.is_none() { self.local.level_n() } else { self.last_level_n };
        let innovation = self.local.innovation(force_n, step, &self.noise);
        let sd = libm::sqrt(innovation.s * self.noise.variance);
        let z = innovation.e / sd;
        self.out.error_n = innovation.e;
        self.since = self.since.saturating_add(1);
        self.since_s += step.dt_s;
        let standstill = config.drop.standstill_mps;
        let forward = sample.velocity_mps > -standstill
            && sample.position_m > self.deepest_m - config.guard.old_ground_m;
        if sample.position_m > self.deepest_m {
            self.deepest_m = sample.position_m;
        }
        let share = step.dz_m.abs() / (step.dz_m.abs() + 2.0 * local::MEMORY_M);
        // A spike: upwards, or below what any rupture can leave, and not for long.
        let below = force_n - self.noise.bias_n() < -SPIKE_SDS * libm::sqrt(self.noise.marginal());
        let odd = z > SPIKE_SDS || (forward && z < -SPIKE_SDS && below);
        // A release of the shaft takes as long as a drop.
        self.releasing_s =
            if z > SPIKE_SDS && !forward { LONGEST_DROP_S } else { self.releasing_s - step.dt_s };
        if odd && forward && self.spikes < SPIKE_SAMPLES {
            self.spikes += 1;
            self.local.pass();
            self.layers.pass();
            return;
        }
        if odd {
            // It stays: the force has jumped.
            let force = (force_n - self.noise.bias_n()).abs();
            self.local.renew(force_n, force.max(sd), &self.noise, step.speed_mps, false);
        }
        self.spikes = 0;
        let rough = 1.0 + self.rough * at_least(0.0, self.texture - 1.0);
        let smoothed = if rough > 1.0 { z / libm::sqrt(rough) } else { z };
        let heard = self.alarm.take(if forward && !odd { smoothed } else { 0.0 });
        if !forward {
            self.alarm.rest();
        }
        if !heard.quiet && (self.was_quiet || heard.outweighs) {
            self.before = self.layers;
            self.before_m = self.last.position_m;
        }
        self.was_quiet = heard.quiet || !forward;
        if forward && !odd && !heard.quiet {
            self.fall(step, sample, heard.outweighs);
        }
        if heard.quiet {
            self.fall = None;
        }
        if heard.alarm && forward && !odd {
            let recent = self.out.ruptures > 0 && self.since_s <= LONGEST_DROP_S;
            if recent {
                // Still the same drop.
                self.go_on_falling(step, sample, sd);
                return;
            }
            if self.is_a_drop(config) {
                self.rupture(step, sample, heard.evidence);
                return;
            }
        }
        if !odd {
            self.noise.in_tissue(innovation.e, innovation.s);
            self.local.take(&innovation, force_n);
            self.texture += share * (at_most(36.0, z * z) - self.texture);
        }
        self.falling = self.fallen.is_some() && self.settle(step, sample);
        if self.falling {
            if let Some(fallen) = self.fallen {
                self.layers = fallen;
            }
        } else if forward && sample.position_m >= self.layers.start_m {
            self.work += WORK_LAYERS;
            let before = self.layers.free.then_some(self.layers);
            let (e, s) = self.layers.take(sample.position_m, self.drive, force_n, step.rho);
            let standard = e / libm::sqrt(s * self.noise.variance);
            let z2 = at_most(400.0, standard * standard);
            if self.fallen.is_none() {
                let (work, bent) = self.slack.follow(
                    &mut self.layers,
                    (before, self.last.position_m),
                    (sample.position_m, standard, at_least(1e-6, self.steady)),
                    self.since,
                    &self.noise,
                    &mut self.behind,
                );
                self.work += work;
                if bent {
                    // What the predictor has missed since was the bend.
                    self.alarm.rest();
                    (self.fall, self.was_quiet) = (None, true);
                }
            }
            if s < 2.0 || sample.velocity_mps.abs() <= standstill {
                let share = at_least(share, at_most(0.5, step.dt_s * (0.25 / local::MEMORY_S)));
                self.misfit += share * (z2 - self.misfit);
            }
            self.peak_n = at_least(self.peak_n, self.local.level_n() - self.noise.bias_n());
            // Where the law of layers does not hold, small falls are texture.
            let weight = (self.misfit - 0.5 * UNPROVEN) / (UNPROVEN - 0.5 * UNPROVEN - 1.0);
            let weight = at_most(1.0, at_least(0.0, weight));
            self.rough = weight;
            // A law that has failed is not trusted again.
            if self.misfit >= UNPROVEN && self.deepest_m - self.first_m >= config.guard.blind_travel_m {
                self.dry = true;
            }
            self.least_n = weight * config.stylet.smallest_drop * self.peak_n;
        } else {
            self.layers.pass();
        }
        if self.since >= self.report_at {
            self.report_at = self.report_at.saturating_mul(2);
            self.report(sample);
        }
    }

    /// Beliefs that senseless data have spoilt begin afresh.
    #[inline(always)]
    pub(super) fn mend(&mut self, step: &Step, sample: &Sample) {
        if !(self.noise.variance.is_finite() && self.noise.variance < 1e12) {
            self.noise = Noise::new(1e-3);
        }
        if !self.local.state.is_usable() {
            self.local = Local::new(sample.force_n);
            let force = (sample.force_n - self.noise.bias_n()).abs().max(1e-3);
            self.local.renew(sample.force_n, force, &self.noise, step.speed_mps, true);
            self.work += WORK_RUPTURE;
        }
        if !self.layers.belief.is_usable() {
            self.layers = Layers::contact(sample.position_m, 0.0, 1.0, STIFFEST, step.speed_mps, &self.noise);
            self.before = self.layers;
            self.fallen = None;
            self.work += WORK_RUPTURE;
        }
    }
}
