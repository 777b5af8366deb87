//! First contact: detection in air and its verification in the first layer.

use super::air_history::Form;
use super::cusum::CusumBank;
use super::force_predictor::{self, ForcePredictor, MotionStep};
use super::free_tip::{FreeTipDetector, OPERATIONS_PER_BEND_TEST};
use super::layer_estimator::LayerEstimator;
use super::state::{FAILED_MISFIT, KalmanEnhancer, MAX_STIFFNESS_N_PER_M, SURE_DROP_SDS};
use crate::bounds::at_least;
use crate::config::{Contact, EnhanceConfig};
use crate::sample::Sample;

/// Consecutive samples beyond the threshold after which the hypotheses in air are evaluated.
const CONTACT_SAMPLES: u32 = 5;
/// Samples used to estimate the noise when the recording does not begin in air.
const MIN_NOISE_SAMPLES: f64 = 40.0;
/// Multiplications and additions of a slope with its variance, and of the bend test.
const OPERATIONS_PER_VERIFICATION: u32 = 10 + OPERATIONS_PER_BEND_TEST;

impl KalmanEnhancer {
    pub(super) fn detect_contact(
        &mut self,
        config: &EnhanceConfig,
        surface_m: f64,
        step: &MotionStep,
        sample: &Sample,
    ) {
        self.deepest_m = self.deepest_m.max(sample.position_m);
        let known = config.contact == Contact::Known;
        if known && sample.position_m >= surface_m {
            self.start_known_contact(config, step, sample, surface_m);
            return;
        }
        self.baseline.history.push(&Sample { force_n: self.baseline.measured_n, ..*sample });
        if config.contact == Contact::None {
            self.start_without_air(config, step, sample);
            return;
        }
        if !self.baseline.moving {
            self.noise.update_in_air(sample.force_n);
        }
        let search = &config.contact_search;
        if !self.started {
            self.low_passed_n = sample.force_n;
        }
        let gain = step.dt_s / (step.dt_s + search.time_constant_s);
        self.low_passed_n += gain * (sample.force_n - self.low_passed_n);
        if self.noise.air_sample_count() == 0.0 {
            return;
        }
        let rise = self.low_passed_n - self.noise.bias_n();
        let marginal = self.noise.marginal_variance();
        let low_passed = self.noise.variance * self.noise.long_run_factor() * self.noise.interval_s
            / (2.0 * search.time_constant_s);
        let mut variance = low_passed.min(marginal) + self.noise.bias_variance().min(marginal);
        if self.baseline.moving {
            let fit = &self.baseline.fit;
            variance += fit.level_variance(sample.time_s - fit.time_s, sample.position_m - fit.position_m);
        }
        let sd = libm::sqrt(variance);
        let above = rise > search.noise_sds * sd
            && sample.force_n > self.noise.bias_n()
            && sample.velocity_mps > -config.drop.standstill_mps;
        let below = rise < -search.noise_sds * sd && sample.force_n < self.noise.bias_n();
        self.samples_above_threshold = if above { self.samples_above_threshold + 1 } else { 0 };
        self.samples_below_threshold = if below { self.samples_below_threshold + 1 } else { 0 };
        let count = self.samples_above_threshold.max(self.samples_below_threshold);
        let mut side = 0;
        if count <= CONTACT_SAMPLES {
            self.next_air_evaluation_at = CONTACT_SAMPLES;
        }
        if count >= self.next_air_evaluation_at {
            self.next_air_evaluation_at = count + 1 + count / 4;
            side = if above { 1 } else { -1 };
        }
        if let Some(evidence) = self.evaluate_air_evidence(sample, side)
            && !known
        {
            self.start_contact_at_bend(config, step, sample, &evidence, (rise, sd));
        }
    }

    /// Starts the contact at a configured surface, with the present baseline.
    #[cold]
    fn start_known_contact(
        &mut self,
        config: &EnhanceConfig,
        step: &MotionStep,
        sample: &Sample,
        surface_m: f64,
    ) {
        self.start_contact(config, step, sample, surface_m, 0.0, 0.0);
        if self.baseline.moving {
            let fit = self.baseline.fit.at(sample.time_s, sample.position_m);
            self.set_estimator_baseline(&fit);
        }
    }

    /// Starts a recording that begins in tissue: the noise is estimated from differences, the bias is zero.
    fn start_without_air(&mut self, config: &EnhanceConfig, step: &MotionStep, sample: &Sample) {
        let history = &self.baseline.history;
        if history.samples < MIN_NOISE_SAMPLES {
            return;
        }
        let (variance, rho) = (history.noise_variance(), history.rho());
        self.noise.restart_in_air(0.0, variance, rho, history.samples, sample.force_n);
        let force_n = at_least(0.0, sample.force_n);
        let sd_n = force_n + 3.0 * libm::sqrt(variance);
        self.start_contact(config, step, sample, sample.position_m, force_n, sd_n);
        self.output.contact_m = None;
    }

    /// Tests whether the contact was real: the force in air is flat until the tissue begins. `z` is the standardised
    /// innovation of a sample in the first layer, `before` the estimator without it.
    pub(super) fn verify_contact(
        &mut self,
        config: &EnhanceConfig,
        step: &MotionStep,
        sample: &Sample,
        (z, before): (f64, &LayerEstimator),
    ) {
        self.operations += OPERATIONS_PER_VERIFICATION;
        let (slope, sd) = self.estimator.slope_and_sd(self.steady_drive_mps, &self.noise);
        // The force rises, and along a straight line.
        self.estimator.layer_confirmed = slope > SURE_DROP_SDS * sd && self.free_tip.is_straight();
        if !self.contact_given
            && !self.estimator.layer_confirmed
            && self.free_tip.bends_up(z, before, self.last_sample.position_m)
        {
            if !self.baseline.settled {
                self.operations += self.baseline.history.evaluation_operations();
                let evidence = self.baseline.history.evaluate();
                if evidence.bend.form != Form::Constant && evidence.contact_nats() > 0.0 {
                    let sd = libm::sqrt(self.noise.marginal_variance());
                    self.low_passed_n = self.predictor.level_n();
                    self.start_contact_at_bend(config, step, sample, &evidence, (0.0, sd));
                    self.misfit = FAILED_MISFIT;
                    return;
                }
            }
            let rise = self.predictor.level_n() - self.noise.bias_n();
            let sd_n = rise.abs() + 3.0 * libm::sqrt(self.noise.marginal_variance());
            self.start_contact(config, step, sample, sample.position_m, rise.max(0.0), sd_n);
            self.misfit = FAILED_MISFIT;
        }
    }

    /// Initialises all filters for a contact at `start_m`, with a force `force_n` (standard deviation `sd_n`) acting at the
    /// sample.
    #[cold]
    pub(super) fn start_contact(
        &mut self,
        config: &EnhanceConfig,
        step: &MotionStep,
        sample: &Sample,
        start_m: f64,
        force_n: f64,
        sd_n: f64,
    ) {
        self.in_tissue = true;
        self.contact_given = config.contact != Contact::Detected;
        self.baseline.settled |= self.contact_given;
        self.contact_sample_m = sample.position_m;
        let (per_hour, interval_s) = (config.stylet.false_alarms_per_hour, self.noise.interval_s);
        self.cusum = CusumBank::new(per_hour, interval_s);
        let drive = self.steady_drive_mps.max(1e-6);
        self.estimator =
            LayerEstimator::at_contact(start_m, force_n, sd_n, MAX_STIFFNESS_N_PER_M, drive, &self.noise);
        self.snapshot = self.estimator;
        self.snapshot_m = sample.position_m;
        self.free_tip = FreeTipDetector::new(per_hour, interval_s, &self.estimator);
        self.predictor = ForcePredictor::new(sample.force_n);
        let scale_n = MAX_STIFFNESS_N_PER_M * force_predictor::MEMORY_M;
        self.predictor.restart(sample.force_n, scale_n, &self.noise, step.speed_mps, true);
        self.output.contact_m = Some(start_m);
    }
}

#[cfg(test)]
mod tests;
