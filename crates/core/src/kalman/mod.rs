//! [`Algorithm::Stylet`](crate::config::Algorithm::Stylet): Kalman filters for the one-step force prediction and for the
//! layer parameters, CUSUM rupture alarm; one pass, bounded work per sample. Derivation: `docs/explanation/enhancer.md`.

mod air_decisions;
mod air_history;
mod air_sums;
mod baseline;
mod baseline_fit;
mod contact_detection;
mod continued_drop;
mod cusum;
mod force_predictor;
mod free_tip;
mod gaussian;
mod layer_estimator;
mod layer_friction;
mod motion;
mod noise_estimator;
mod output;
mod retraction_tracker;
mod rupture_detection;
mod shaft_friction;
mod state;
mod stop;
mod tissue_update;
mod velocity_estimator;
mod zero_step;
mod zero_step_state;

#[cfg(test)]
mod test_support;
#[cfg(test)]
mod tests;

use crate::config::{EnhanceConfig, MAX_SPEED_MPS};
use crate::sample::{Output, Sample, UnusedReason};
pub(crate) use state::KalmanEnhancer;

/// Multiplications and additions per sample outside the filters.
const OPERATIONS_PER_SAMPLE: u32 = 60;
/// Positions in m beyond this are logging errors.
const MAX_POSITION_M: f64 = 10.0;
/// Samples closer than this fraction of the usual interval, within these limits in s, are duplicates.
const DUPLICATE_INTERVAL_FRACTION: f64 = 0.02;
const MIN_DUPLICATE_INTERVAL_S: f64 = 1e-6;
const MAX_DUPLICATE_INTERVAL_S: f64 = 1e-4;

impl KalmanEnhancer {
    /// True if the values are possible for a needle; the limits on speed and position are tighter than in
    /// [`Sample::is_usable`].
    #[inline(always)]
    pub(crate) fn is_usable(sample: &Sample) -> bool {
        let in_range = sample.velocity_mps.abs() < MAX_SPEED_MPS && sample.position_m.abs() < MAX_POSITION_M;
        sample.is_usable() && in_range
    }

    /// The output for an ignored sample.
    #[cold]
    pub(crate) fn ignore(&mut self, why: UnusedReason) -> &Output {
        self.output.ignore(why);
        self.operations = OPERATIONS_PER_SAMPLE;
        &self.output
    }

    #[inline]
    pub(crate) fn step(&mut self, config: &EnhanceConfig, surface_m: f64, sample: Sample) -> &Output {
        self.output.detection = None;
        self.output.completed_drop = None;
        self.output.estimate = None;
        self.output.zero_step = None;
        self.output.restarted = false;
        self.operations = OPERATIONS_PER_SAMPLE;
        // Two samples at almost the same time carry no information about the velocity.
        let min_interval_s = (DUPLICATE_INTERVAL_FRACTION * self.noise.interval_s)
            .clamp(MIN_DUPLICATE_INTERVAL_S, MAX_DUPLICATE_INTERVAL_S);
        let later = sample.time_s - self.last_sample.time_s > min_interval_s;
        if !Self::is_usable(&sample) {
            return self.ignore(UnusedReason::of_values(&sample));
        }
        if self.started && !later {
            return self.ignore(UnusedReason::NotLater);
        }
        self.output.used = true;
        self.output.unused_reason = None;
        self.baseline.measured_n = sample.force_n;
        let subtracted_n = self.baseline.subtracted_n(sample.time_s, sample.position_m);
        let sample = Sample { force_n: sample.force_n - subtracted_n, ..sample };
        let last = if self.started { self.last_sample } else { sample };
        let (velocity_mps, sudden) =
            self.velocity_estimator.update(&last, &sample, self.speed_mps, self.low_pass_gains[3]);
        let (velocity_mps, sudden) = self.resolve_motion_start(&last, &sample, velocity_mps, sudden);
        let sample = Sample { velocity_mps, ..sample };
        let step = self.motion_step(config, &last, &sample, sudden);
        self.update_friction_drive(config, &step, &sample);
        if self.in_tissue && !self.baseline.settled {
            self.verify_evidence(config, &sample);
        }
        if self.in_tissue {
            self.update_in_tissue(config, &step, &sample);
        } else {
            self.detect_contact(config, surface_m, &step, &sample);
        }
        self.last_sample = sample;
        self.started = true;
        self.write_output(config, &sample);
        &self.output
    }
}
