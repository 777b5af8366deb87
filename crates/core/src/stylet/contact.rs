//! From the air into the tissue.

use super::alarm::Alarm;
use super::layers::Layers;
use super::local::{self, Local, Step};
use super::slack::Slack;
use super::{STIFFEST, Stylet};
use crate::config::{Contact, EnhanceConfig};
use crate::sample::Sample;

/// Samples in a row above the threshold that are a contact.
const CONTACT_SAMPLES: u32 = 5;

impl Stylet {
    /// In the air.
    pub(super) fn look_for_contact(
        &mut self,
        config: &EnhanceConfig,
        surface_m: f64,
        step: &Step,
        sample: &Sample,
    ) {
        self.deepest_m = self.deepest_m.max(sample.position_m);
        let known = config.contact == Contact::Known;
        if known && sample.position_m >= surface_m {
            self.touch(config, step, sample, surface_m, 0.0, 0.0);
            return;
        }
        self.noise.in_air(sample.force_n);
        let search = &config.contact_search;
        if !self.started {
            self.low_passed_n = sample.force_n;
        }
        let share = step.dt_s / (step.dt_s + search.time_constant_s);
        self.low_passed_n += share * (sample.force_n - self.low_passed_n);
        if known || self.noise.in_air_count() == 0.0 {
            return;
        }
        let risen = self.low_passed_n - self.noise.bias_n();
        let spread =
            self.noise.variance * self.noise.slow() * self.noise.step_s / (2.0 * search.time_constant_s);
        let sd = libm::sqrt(
            spread.min(self.noise.marginal()) + self.noise.bias_variance().min(self.noise.marginal()),
        );
        if risen > search.noise_sds * sd
            && sample.force_n > self.noise.bias_n()
            && sample.velocity_mps > -config.drop.standstill_mps
        {
            self.above += 1;
        } else {
            self.above = 0;
        }
        if self.above >= CONTACT_SAMPLES {
            self.touch(config, step, sample, sample.position_m, risen, risen + 3.0 * sd);
        }
    }

    #[cold]
    pub(super) fn touch(
        &mut self,
        config: &EnhanceConfig,
        step: &Step,
        sample: &Sample,
        start_m: f64,
        force_n: f64,
        sd_n: f64,
    ) {
        self.in_tissue = true;
        self.first_m = sample.position_m;
        self.alarm = Alarm::new(config.stylet.false_alarms_per_hour, self.noise.step_s);
        let drive = self.steady.max(1e-6);
        self.layers = Layers::contact(start_m, force_n, sd_n, STIFFEST, drive, &self.noise);
        self.before = self.layers;
        self.before_m = sample.position_m;
        self.slack = Slack::new(config.stylet.false_alarms_per_hour, self.noise.step_s, &self.layers);
        self.local = Local::new(sample.force_n);
        self.local.renew(sample.force_n, STIFFEST * local::MEMORY_M, &self.noise, step.speed_mps, true);
        self.out.contact_m = Some(start_m);
    }
}
