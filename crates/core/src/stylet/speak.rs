//! What is said of a sample: friction, enhanced force and its band, the layer before.

use super::Stylet;
use super::gaussian::at_least;
use super::layers::{self, FP, K, KP};
use super::shaft::Felt;
use crate::config::{EnhanceConfig, FrictionLaw};
use crate::sample::{LayerEstimate, Output, Sample, State};

/// Multiplications and additions of the friction of each layer on the way back.
const WORK_BACK: u32 = 16 * 5;

impl Stylet {
    /// The layer before, as it is known now.
    pub(super) fn report(&mut self, sample: &Sample) {
        let l = &self.layers;
        let d = l.previous_m;
        let [k, b] = [l.belief.x[KP], l.belief.x[FP]];
        let doubt = self.noise.doubt();
        let [vk, vb] = l.previous_variance(&self.noise).map(|v| v * doubt);
        let (cumulative, cumulative_variance) = l.when_it_gave_way(&self.noise);
        let drop = k * d;
        // The stiffness over the travel, which is as uncertain as the layer's begin.
        let drop_sd = libm::sqrt(d * d * at_least(0.0, vk) + k * k * l.previous_sd_m * l.previous_sd_m);
        if drop <= 1.96 * drop_sd {
            return;
        }
        self.out.estimate = Some(LayerEstimate {
            layer: self.out.ruptures,
            start_m: l.start_m - d,
            thickness_m: d,
            stiffness_n_per_m: k,
            friction: b,
            drop_n: drop,
            elastic_share: (k / (k + b * self.steady)).clamp(0.0, 1.0),
            added_friction_ns_per_m: b * (d + l.gap_m),
            time_s: sample.time_s,
            stiffness_sd: libm::sqrt(vk.max(0.0)),
            friction_sd: libm::sqrt(vb.max(0.0)),
            drop_sd_n: drop_sd,
            cumulative_ns_per_m: cumulative,
            cumulative_sd: libm::sqrt((cumulative_variance * doubt).max(0.0)),
        });
    }

    #[inline(always)]
    pub(super) fn speak(&mut self, config: &EnhanceConfig, sample: &Sample) {
        let standstill = config.drop.standstill_mps;
        let retracting = sample.velocity_mps < -standstill;
        let marginal = self.noise.marginal();
        let (mut behind, mut variance) = self.layers.behind(sample.position_m, &self.noise);
        if let (Some(fallen), true) = (&self.fallen, self.falling) {
            // As long as elastic force may be left, friction is no more than what was expected of it.
            behind = behind.min(fallen.behind(sample.position_m, &self.noise).0);
        }
        behind = at_least(0.0, behind);
        if retracting && self.in_tissue {
            self.work += WORK_BACK;
            behind = self.layers.around_shaft(&self.behind, sample.position_m, self.deepest_m, &self.noise);
        }
        let u = self.drive;
        let mut friction = behind * u;
        let behind_variance = variance;
        variance *= u * u;
        if self.in_tissue {
            let felt = Felt {
                share: self.shares[2],
                position_m: sample.position_m,
                force_n: sample.force_n - self.noise.bias_n(),
                advancing: sample.velocity_mps > standstill,
                retracting,
                peak_n: self.peak_n,
                jumped: self.releasing_s > 0.0,
                noise_n2: marginal,
                track: config.stylet.track_way_back,
            };
            let (dry_n, sd) = self.shaft.take(&felt);
            if self.dry && config.stylet.law == FrictionLaw::Auto {
                (friction, variance) = (dry_n, sd * sd);
            }
        }
        let out = &mut self.out;
        out.state = if out.detection.is_some() {
            State::DetectedRupture
        } else if self.layers.free && !self.dry {
            State::FreeTip
        } else {
            State::NoRupture
        };
        self.behind_variance = behind_variance;
        let out = &mut self.out;
        out.cumulative_friction_ns_per_m = behind;
        out.enhanced_n = sample.force_n - friction;
        let half = 1.96 * libm::sqrt(marginal + at_least(0.0, variance));
        out.band_n = Some([out.enhanced_n - half, out.enhanced_n + half]);
    }

    /// Fills in what only callers of the whole output look at.
    pub(crate) fn complete(&mut self, sample: &Sample) -> &Output {
        let out = &mut self.out;
        if out.used {
            out.reconstructed_n = if self.in_tissue { sample.force_n - out.error_n } else { 0.0 };
            out.cusum_n2 = self.alarm.level();
            if self.in_tissue {
                let belief = &self.layers.belief;
                out.theta = [belief.x[K], belief.x[layers::F]];
                let sd = |i: usize| libm::sqrt((belief.p[i][i] * self.noise.variance).max(0.0));
                out.sd = [sd(K), sd(layers::F), libm::sqrt(self.behind_variance.max(0.0))];
            }
        }
        &self.out
    }
}
