//! Processing of a sample in tissue: prediction, spike and rupture tests, updates of predictor, layer estimator and noise.

use super::force_predictor::{self, ForcePredictor, MotionStep};
use super::layer_estimator::{LayerEstimator, LayerInnovation};
use super::noise_estimator::NoiseEstimator;
use super::state::{
    FAILED_MISFIT, KalmanEnhancer, MAX_ALARM_MISFIT, MAX_DROP_DURATION_S, MAX_STIFFNESS_N_PER_M,
    OPERATIONS_PER_RUPTURE,
};
use crate::bounds::{at_least, at_most};
use crate::config::EnhanceConfig;
use crate::sample::Sample;

/// Standard deviations beyond which an isolated force is a spike, and the longest spike in samples.
pub(super) const SPIKE_SDS: f64 = 6.0;
const MAX_SPIKE_SAMPLES: u8 = 3;
/// Multiplications and additions of the predictor: five shears, an innovation and an update of five unknowns.
const OPERATIONS_PER_PREDICTION: u32 = 5 * 14 + 2 * 24 + 2 * 20;
/// Of the layer estimator: an innovation, and an update of six unknowns.
const OPERATIONS_PER_LAYER_INNOVATION: u32 = 2 * 35;
const OPERATIONS_PER_LAYER_UPDATE: u32 = 2 * 27 + 12;
/// Largest relative deviation from the usual speed at which the layer estimator feeds the CUSUMs.
const MAX_SPEED_DEVIATION: f64 = 0.05;
/// Limits on squared standardised innovations, so that one sample does not dominate a mean.
const MAX_SQUARED_PREDICTION_ERROR: f64 = 36.0;
const MAX_SQUARED_LAYER_ERROR: f64 = 400.0;

impl KalmanEnhancer {
    #[inline(always)]
    pub(super) fn update_in_tissue(&mut self, config: &EnhanceConfig, step: &MotionStep, sample: &Sample) {
        let force_n = sample.force_n;
        self.restart_if_invalid(config, step, sample);
        self.update_stop(step, sample);
        self.complete_drop();
        self.estimator.elapsed_s += step.dt_s;
        self.operations += OPERATIONS_PER_PREDICTION;
        self.predictor.advance(step, &self.noise);
        if step.sudden {
            // Friction may have changed by any part of the force, at any time within the step.
            self.predictor.reset_level(force_n, &self.noise);
            self.estimator.skip_sample();
            self.reset_detector();
            (self.deferred, self.waiting_from_m) = (false, None);
            self.deepest_m = at_least(self.deepest_m, sample.position_m);
            return;
        }
        self.level_before_fall_n =
            if self.candidate.is_none() { self.predictor.level_n() } else { self.level_before_fall_n };
        let innovation = self.predictor.innovation(force_n, step, &self.noise);
        let sd = libm::sqrt(innovation.s * self.noise.variance);
        let z = innovation.e / sd;
        self.output.error_n = innovation.e;
        self.samples_since_rupture = self.samples_since_rupture.saturating_add(1);
        self.time_since_rupture_s += step.dt_s;
        let standstill = config.drop.standstill_mps;
        let forward = sample.velocity_mps > -standstill
            && sample.position_m > self.deepest_m - config.guard.revisit_margin_m;
        if sample.position_m > self.deepest_m {
            self.deepest_m = sample.position_m;
        }
        let travel_gain = step.dz_m.abs() / (step.dz_m.abs() + 2.0 * force_predictor::MEMORY_M);
        // A spike is short and goes up, or below the lowest force that a rupture may leave.
        let outlier = z > SPIKE_SDS || (forward && z < -SPIKE_SDS && self.is_below_ruptures(sample));
        // A release of the shaft lasts as long as a drop.
        self.release_window_s =
            if z > SPIKE_SDS && !forward { MAX_DROP_DURATION_S } else { self.release_window_s - step.dt_s };
        if outlier && forward && self.spike_samples < MAX_SPIKE_SAMPLES {
            self.spike_samples += 1;
            self.is_lasting_jump(sample, (innovation.e, innovation.s));
            self.skip_sample();
            return;
        }
        if outlier && forward && self.is_lasting_jump(sample, (innovation.e, innovation.s)) {
            self.accept_jump();
            return;
        }
        if outlier {
            // Longer than a spike: the force has jumped.
            let force = (force_n - self.noise.bias_n()).abs();
            self.predictor.restart(force_n, force.max(sd), &self.noise, step.speed_mps, false);
        }
        self.spike_samples = 0;
        if forward && !outlier {
            self.follow_drop(step, sample);
        }
        let widening = self.innovation_widening();
        let alarm_z = if widening > 1.0 { z / libm::sqrt(widening) } else { z };
        let layer_innovation = if forward && !outlier { self.layer_innovation(step, sample) } else { None };
        let better = layer_innovation.as_ref().filter(|layer| layer.s < innovation.s);
        let alarm_z = better.map_or(alarm_z, |layer| layer.e / libm::sqrt(layer.s * self.noise.variance));
        let outcome = self.cusum.update(if forward && !outlier { alarm_z } else { 0.0 });
        if !forward {
            self.cusum.reset();
        }
        if !outcome.all_zero && (self.cusum_was_zero || outcome.outweighs_history) {
            self.snapshot = self.estimator;
            self.snapshot_m = self.last_sample.position_m;
        }
        self.cusum_was_zero = outcome.all_zero || !forward;
        if forward && !outlier && !outcome.all_zero {
            self.track_candidate(step, sample, outcome.outweighs_history);
        }
        if outcome.all_zero {
            self.candidate = None;
        }
        let far = innovation.e * innovation.e > SPIKE_SDS * SPIKE_SDS * self.noise.marginal_variance();
        self.deferred = self.velocity_estimator.uses_positions()
            && far
            && !self.deferred
            && self.waiting_from_m.is_none();
        if self.deferred {
            // The next sample shows whether the velocity has jumped within this step.
            self.skip_sample();
            return;
        }
        let waiting_from_m = self.waiting_from_m.take();
        if outcome.alarm && forward && !outlier {
            let recent = self.output.ruptures > 0 && self.time_since_rupture_s <= MAX_DROP_DURATION_S;
            if recent {
                self.continue_drop(step, sample, sd);
                return;
            }
            if self.is_rupture(config) {
                if self.is_late_friction(sample) {
                    self.predictor.reset_level(force_n, &self.noise);
                    self.estimator.skip_sample();
                    self.reset_detector();
                    return;
                }
                if config.stylet.derived_velocity && self.may_be_a_stop(sample, waiting_from_m) {
                    self.waiting_from_m = waiting_from_m.or(Some(sample.position_m));
                    self.skip_sample();
                    return;
                }
                self.declare_rupture(step, sample, outcome.excess_nats);
                return;
            }
        }
        if !outlier {
            // The innovations of an event are not noise.
            if !outcome.alarm && self.post_rupture.is_none() {
                self.noise.update_in_tissue(innovation.e, innovation.s);
            }
            self.predictor.update(&innovation, force_n);
            self.roughness += travel_gain * (at_most(MAX_SQUARED_PREDICTION_ERROR, z * z) - self.roughness);
        }
        self.drop_continues = self.post_rupture.is_some() && self.drop_is_ongoing(step, sample);
        if self.drop_continues {
            self.zero_step_test = None;
            if let Some(post_rupture) = self.post_rupture {
                self.estimator = post_rupture;
            }
        } else if forward && sample.position_m >= self.estimator.start_m {
            self.update_layers(config, step, sample, layer_innovation, travel_gain);
        } else {
            self.estimator.skip_sample();
        }
        if self.samples_since_rupture >= self.next_report_at {
            self.next_report_at = self.next_report_at.saturating_mul(2);
            self.report_previous_layer(sample);
        }
    }

    /// Variance of the recent innovations over that of the noise, where the base law fails.
    #[inline(always)]
    pub(super) fn innovation_widening(&self) -> f64 {
        1.0 + self.misfit_weight * at_least(0.0, self.roughness - 1.0)
    }

    /// Updates the layer estimator and the misfit of the base law.
    #[inline(always)]
    fn update_layers(
        &mut self,
        config: &EnhanceConfig,
        step: &MotionStep,
        sample: &Sample,
        innovation: Option<LayerInnovation>,
        travel_gain: f64,
    ) {
        let (position_m, force_n, drive) = (sample.position_m, sample.force_n, self.friction_drive_mps);
        let before = self.estimator.may_be_free().then_some(self.estimator);
        let innovation = innovation.unwrap_or_else(|| {
            self.operations += OPERATIONS_PER_LAYER_INNOVATION;
            self.estimator.innovation(position_m, drive, force_n, step.rho)
        });
        let (e, s) = self.estimator.apply(&innovation, position_m, drive, force_n);
        if self.zero_step_test.is_some() {
            self.update_zero_step_test(sample, step.rho);
            if self.decide_zero_step(sample) {
                return;
            }
        }
        self.operations += OPERATIONS_PER_LAYER_UPDATE;
        let z = e / libm::sqrt(s * self.noise.variance);
        if self.estimator.passed_count == 0 {
            if let Some(before) = &before {
                self.verify_contact(config, step, sample, (z, before));
            }
        } else if self.post_rupture.is_none() {
            let (operations, bent) = self.free_tip.update(
                &mut self.estimator,
                (before, self.last_sample.position_m),
                (position_m, z, at_least(1e-6, self.steady_drive_mps)),
                self.samples_since_rupture,
                &self.noise,
                &mut self.passed_layers,
            );
            self.operations += operations;
            if bent {
                // The bend explains the innovations accumulated so far; the new layer has not seen this sample.
                self.estimator.update(position_m, drive, force_n, step.rho);
                self.operations += OPERATIONS_PER_LAYER_INNOVATION + OPERATIONS_PER_LAYER_UPDATE;
                self.reset_detector();
            }
        }
        // Samples with a wide prediction interval do not count towards the misfit, except in a hold.
        if s < 2.0 || sample.velocity_mps.abs() <= config.drop.standstill_mps {
            let hold_gain = at_most(0.5, step.dt_s * (0.25 / force_predictor::MEMORY_S));
            self.misfit +=
                at_least(travel_gain, hold_gain) * (at_most(MAX_SQUARED_LAYER_ERROR, z * z) - self.misfit);
        }
        self.peak_force_n = at_least(self.peak_force_n, self.predictor.level_n() - self.noise.bias_n());
        // Where the base law does not hold, small drops are texture.
        let weight = (self.misfit - 0.5 * FAILED_MISFIT) / (FAILED_MISFIT - 0.5 * FAILED_MISFIT - 1.0);
        let weight = at_most(1.0, at_least(0.0, weight));
        self.misfit_weight = weight;
        // A rejected law is not used again.
        if self.misfit >= FAILED_MISFIT
            && self.deepest_m - self.contact_sample_m >= config.guard.blind_travel_m
        {
            // From here on the estimated drift is not subtracted.
            self.dry_friction.shift(self.baseline_residual_n(sample).0);
            self.base_law_failed = true;
        }
        self.min_drop_n = weight * config.stylet.min_drop_share * self.peak_force_n;
    }

    /// True if the force is below the lowest one that a rupture may leave.
    #[cold]
    fn is_below_ruptures(&self, sample: &Sample) -> bool {
        let margin_n = SPIKE_SDS * libm::sqrt(self.noise.marginal_variance());
        sample.force_n - self.lowest_after_rupture_n(sample.position_m) < -margin_n
    }

    #[inline(always)]
    pub(super) fn skip_sample(&mut self) {
        self.predictor.skip_sample();
        self.estimator.skip_sample();
    }

    /// Innovation of the layer estimator where it may feed the alarm: the base law holds and the speed is the usual one.
    #[inline(always)]
    fn layer_innovation(&mut self, step: &MotionStep, sample: &Sample) -> Option<LayerInnovation> {
        let estimator = &self.estimator;
        let holds = self.misfit_weight == 0.0
            && self.misfit < MAX_ALARM_MISFIT
            && estimator.layer_confirmed
            && self.post_rupture.is_none();
        let usual_speed = (sample.velocity_mps - self.speed_mps).abs() < MAX_SPEED_DEVIATION * self.speed_mps;
        if !(holds && usual_speed && sample.position_m >= estimator.start_m) {
            return None;
        }
        self.operations += OPERATIONS_PER_LAYER_INNOVATION;
        Some(estimator.innovation(sample.position_m, self.friction_drive_mps, sample.force_n, step.rho))
    }

    /// Restarts filters whose state is no longer finite.
    #[inline(always)]
    pub(super) fn restart_if_invalid(&mut self, config: &EnhanceConfig, step: &MotionStep, sample: &Sample) {
        if !(self.noise.variance.is_finite() && self.noise.variance < 1e12) {
            self.noise = NoiseEstimator::new(config.contact_search.min_noise_n);
        }
        if !self.predictor.state.is_finite() {
            self.predictor = ForcePredictor::new(sample.force_n);
            let force = (sample.force_n - self.noise.bias_n()).abs().max(1e-3);
            self.predictor.restart(sample.force_n, force, &self.noise, step.speed_mps, true);
            self.operations += OPERATIONS_PER_RUPTURE;
        }
        if !self.estimator.state.is_finite() {
            self.estimator = LayerEstimator::at_contact(
                sample.position_m,
                0.0,
                1.0,
                MAX_STIFFNESS_N_PER_M,
                step.speed_mps,
                &self.noise,
            );
            self.snapshot = self.estimator;
            self.post_rupture = None;
            self.operations += OPERATIONS_PER_RUPTURE;
        }
    }
}

#[cfg(test)]
mod tests;
