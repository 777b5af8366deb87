//! Output of a sample: friction, enhanced force and its band, the estimate of the previous layer.

use super::layer_estimator::{B, B_PREV, K, K_PREV};
use super::retraction_tracker::ShaftSample;
use super::state::KalmanEnhancer;
use crate::bounds::{at_least, at_most};
use crate::config::{EnhanceConfig, FrictionLaw};
use crate::sample::{LayerEstimate, Output, Sample, State};

/// Multiplications and additions of the friction of each layer during retraction.
const OPERATIONS_PER_RETRACTION: u32 = 16 * 5;
/// Quantile of the standard normal distribution for 95 % intervals.
const Z95: f64 = 1.96;

impl KalmanEnhancer {
    /// Reports the present estimate of the previous layer, unless its drop may be zero.
    pub(super) fn report_previous_layer(&mut self, sample: &Sample) {
        let l = &self.estimator;
        let d = l.previous_thickness_m;
        let [k, b] = [l.state.x[K_PREV], l.state.x[B_PREV]];
        let inflation = self.noise.interval_inflation();
        let [vk, vb] = l.previous_variance(&self.noise).map(|v| v * inflation);
        let (cumulative, cumulative_variance) = l.friction_at_rupture(&self.noise);
        let drop = k * d;
        // Uncertain stiffness and uncertain start of the layer.
        let drop_sd =
            libm::sqrt(d * d * at_least(0.0, vk) + k * k * l.previous_start_sd_m * l.previous_start_sd_m);
        if drop <= Z95 * drop_sd {
            return;
        }
        self.output.estimate = Some(LayerEstimate {
            layer: self.output.ruptures,
            start_m: l.rupture_m - d,
            thickness_m: d,
            stiffness_n_per_m: k,
            friction: b,
            drop_n: drop,
            elastic_share: at_least(0.0, at_most(1.0, k / (k + b * self.steady_drive_mps))),
            added_friction_ns_per_m: b * (d + l.gap_m),
            time_s: sample.time_s,
            stiffness_sd: libm::sqrt(vk.max(0.0)),
            friction_sd: libm::sqrt(vb.max(0.0)),
            drop_sd_n: drop_sd,
            cumulative_ns_per_m: cumulative,
            cumulative_sd: libm::sqrt((cumulative_variance * inflation).max(0.0)),
        });
    }

    #[inline(always)]
    pub(super) fn write_output(&mut self, config: &EnhanceConfig, sample: &Sample) {
        let retracting = sample.velocity_mps < -config.drop.standstill_mps;
        let marginal = self.noise.marginal_variance();
        let (mut friction_per_drive, mut variance) =
            self.estimator.shaft_friction(sample.position_m, &self.noise);
        if let (Some(post_rupture), true) = (&self.post_rupture, self.drop_continues) {
            // While elastic force may remain, friction is at most what was expected just after the rupture.
            friction_per_drive =
                friction_per_drive.min(post_rupture.shaft_friction(sample.position_m, &self.noise).0);
        }
        friction_per_drive = at_least(0.0, friction_per_drive);
        if retracting && self.in_tissue {
            self.operations += OPERATIONS_PER_RETRACTION;
            friction_per_drive = self.estimator.friction_during_retraction(
                &self.passed_layers,
                sample.position_m,
                self.deepest_m,
                &self.noise,
            );
        }
        let u = self.friction_drive_mps;
        let mut friction = friction_per_drive * u;
        self.shaft_friction_variance = variance;
        variance *= u * u;
        if self.in_tissue {
            let shaft_sample = self.shaft_sample(config, sample);
            let (dry_n, sd) = self.dry_friction.update(&shaft_sample);
            if self.base_law_failed && config.stylet.friction_law == FrictionLaw::Auto {
                (friction, variance) = (dry_n, sd * sd);
            }
        }
        let (mut baseline_n, mut baseline_variance) = (0.0, 0.0);
        if self.in_tissue {
            (baseline_n, baseline_variance) = self.baseline_residual_n(sample);
        }
        variance += baseline_variance;
        let out = &mut self.output;
        out.state = if out.detection.is_some() {
            State::DetectedRupture
        } else if self.estimator.tip_free && !self.base_law_failed {
            State::FreeTip
        } else {
            State::NoRupture
        };
        out.cumulative_friction_ns_per_m = friction_per_drive;
        out.enhanced_n = sample.force_n - friction - baseline_n;
        let half = Z95 * libm::sqrt(marginal + at_least(0.0, variance));
        out.band_n = Some([out.enhanced_n - half, out.enhanced_n + half]);
    }

    /// What remains of a moving baseline in the force of a sample, in N, and its variance in N².
    #[inline(always)]
    pub(super) fn baseline_residual_n(&self, sample: &Sample) -> (f64, f64) {
        let residual = self.estimator.baseline_residual_n(sample.position_m, &self.noise);
        let (residual_n, variance) = residual.unwrap_or((0.0, 0.0));
        // Where the base law fails, its misfit looks like a drift.
        if self.base_law_failed { (0.0, variance + residual_n * residual_n) } else { (residual_n, variance) }
    }

    /// Force of a sample without the sensor's baseline, in N.
    #[inline(always)]
    pub(super) fn force_without_baseline_n(&self, sample: &Sample) -> f64 {
        sample.force_n - self.noise.bias_n() - self.baseline_residual_n(sample).0
    }

    #[inline(always)]
    fn shaft_sample(&self, config: &EnhanceConfig, sample: &Sample) -> ShaftSample {
        let standstill = config.drop.standstill_mps;
        ShaftSample {
            gain: self.low_pass_gains[2],
            position_m: sample.position_m,
            force_n: self.force_without_baseline_n(sample),
            advancing: sample.velocity_mps > standstill,
            retracting: sample.velocity_mps < -standstill,
            peak_force_n: self.peak_force_n,
            released: self.release_window_s > 0.0,
            noise_variance_n2: self.noise.marginal_variance(),
            track_retraction: config.stylet.track_retraction,
        }
    }

    /// Enhanced force of the last sample and its 95 % band, with the shaft friction `model_n` of an identified model.
    pub(crate) fn apply_model_friction(
        &mut self,
        config: &EnhanceConfig,
        model_n: f64,
    ) -> Option<(f64, [f64; 2])> {
        let out = &self.output;
        if !out.used || !self.in_tissue || !model_n.is_finite() {
            return out.band_n.map(|band| (out.enhanced_n, band));
        }
        let shaft_sample = self.shaft_sample(config, &self.last_sample);
        let (friction_n, sd) = self.dry_friction.update_with_model(&shaft_sample, model_n);
        let (baseline_n, baseline_variance) = self.baseline_residual_n(&self.last_sample);
        let enhanced_n = self.last_sample.force_n - friction_n - baseline_n;
        let half = Z95 * libm::sqrt(shaft_sample.noise_variance_n2 + sd * sd + baseline_variance);
        Some((enhanced_n, [enhanced_n - half, enhanced_n + half]))
    }

    /// Fills in the fields that only [`Enhancer::step`](crate::Enhancer::step) returns.
    pub(crate) fn complete_output(&mut self, sample: &Sample) -> &Output {
        let baseline = self.baseline_now(sample);
        let out = &mut self.output;
        if out.used {
            out.baseline = baseline;
            out.reconstructed_n = if self.in_tissue { sample.force_n - out.error_n } else { 0.0 };
            out.cusum_n2 = self.cusum.relative_level();
            if self.in_tissue {
                let state = &self.estimator.state;
                out.theta = [state.x[K], state.x[B]];
                let sd = |i: usize| libm::sqrt((state.p[i][i] * self.noise.variance).max(0.0));
                out.sd = [sd(K), sd(B), libm::sqrt(self.shaft_friction_variance.max(0.0))];
            }
        }
        &self.output
    }
}

#[cfg(test)]
mod tests;
