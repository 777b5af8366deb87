//! What is said of a sample: friction, enhanced force and its band, the layer before.

use super::Stylet;
use super::gaussian::at_least;
use super::layer_estimator::{self, B_PREV, K, K_PREV};
use super::shaft_friction::ShaftSample;
use crate::config::{EnhanceConfig, FrictionLaw};
use crate::sample::{LayerEstimate, Output, Sample, State};

/// Multiplications and additions of the friction of each layer on the way back.
const WORK_BACK: u32 = 16 * 5;

impl Stylet {
    /// The layer before, as it is known now.
    pub(super) fn report_previous_layer(&mut self, sample: &Sample) {
        let l = &self.estimator;
        let d = l.previous_thickness_m;
        let [k, b] = [l.belief.x[K_PREV], l.belief.x[B_PREV]];
        let doubt = self.noise.interval_inflation();
        let [vk, vb] = l.previous_variance(&self.noise).map(|v| v * doubt);
        let (cumulative, cumulative_variance) = l.friction_at_rupture(&self.noise);
        let drop = k * d;
        // The stiffness over the travel, which is as uncertain as the layer's begin.
        let drop_sd =
            libm::sqrt(d * d * at_least(0.0, vk) + k * k * l.previous_start_sd_m * l.previous_start_sd_m);
        if drop <= 1.96 * drop_sd {
            return;
        }
        self.output.estimate = Some(LayerEstimate {
            layer: self.output.ruptures,
            start_m: l.rupture_m - d,
            thickness_m: d,
            stiffness_n_per_m: k,
            friction: b,
            drop_n: drop,
            elastic_share: (k / (k + b * self.steady_drive_mps)).clamp(0.0, 1.0),
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
    pub(super) fn write_output(&mut self, config: &EnhanceConfig, sample: &Sample) {
        let standstill = config.drop.standstill_mps;
        let retracting = sample.velocity_mps < -standstill;
        let marginal = self.noise.marginal_variance();
        let (mut behind, mut variance) = self.estimator.shaft_friction(sample.position_m, &self.noise);
        if let (Some(fallen), true) = (&self.post_rupture, self.drop_continues) {
            // As long as elastic force may be left, friction is no more than what was expected of it.
            behind = behind.min(fallen.shaft_friction(sample.position_m, &self.noise).0);
        }
        behind = at_least(0.0, behind);
        if retracting && self.in_tissue {
            self.operations += WORK_BACK;
            behind = self.estimator.friction_during_retraction(
                &self.passed_layers,
                sample.position_m,
                self.deepest_m,
                &self.noise,
            );
        }
        let u = self.friction_drive_mps;
        let mut friction = behind * u;
        let behind_variance = variance;
        variance *= u * u;
        if self.in_tissue {
            let felt = self.shaft_sample(config, sample);
            let (dry_n, sd) = self.dry_friction.update(&felt);
            if self.base_law_failed && config.stylet.friction_law == FrictionLaw::Auto {
                (friction, variance) = (dry_n, sd * sd);
            }
        }
        let out = &mut self.output;
        out.state = if out.detection.is_some() {
            State::DetectedRupture
        } else if self.estimator.tip_free && !self.base_law_failed {
            State::FreeTip
        } else {
            State::NoRupture
        };
        self.shaft_friction_variance = behind_variance;
        let out = &mut self.output;
        out.cumulative_friction_ns_per_m = behind;
        out.enhanced_n = sample.force_n - friction;
        let half = 1.96 * libm::sqrt(marginal + at_least(0.0, variance));
        out.band_n = Some([out.enhanced_n - half, out.enhanced_n + half]);
    }

    /// A sample as the shaft's friction needs it.
    #[inline(always)]
    fn shaft_sample(&self, config: &EnhanceConfig, sample: &Sample) -> ShaftSample {
        let standstill = config.drop.standstill_mps;
        ShaftSample {
            gain: self.low_pass_gains[2],
            position_m: sample.position_m,
            force_n: sample.force_n - self.noise.bias_n(),
            advancing: sample.velocity_mps > standstill,
            retracting: sample.velocity_mps < -standstill,
            peak_force_n: self.peak_force_n,
            released: self.release_window_s > 0.0,
            noise_variance_n2: self.noise.marginal_variance(),
            track_retraction: config.stylet.track_retraction,
        }
    }

    /// Enhanced force of the last sample and its band, where a law fitted elsewhere says that `law_n` of the force is friction.
    pub(crate) fn apply_model_friction(
        &mut self,
        config: &EnhanceConfig,
        law_n: f64,
    ) -> Option<(f64, [f64; 2])> {
        let out = &self.output;
        if !out.used || !self.in_tissue || !law_n.is_finite() {
            return out.band_n.map(|band| (out.enhanced_n, band));
        }
        let felt = self.shaft_sample(config, &self.last_sample);
        let (friction_n, sd) = self.dry_friction.update_with_model(&felt, law_n);
        let enhanced_n = self.last_sample.force_n - friction_n;
        let half = 1.96 * libm::sqrt(felt.noise_variance_n2 + sd * sd);
        Some((enhanced_n, [enhanced_n - half, enhanced_n + half]))
    }

    /// Fills in what only callers of the whole output look at.
    pub(crate) fn complete_output(&mut self, sample: &Sample) -> &Output {
        let out = &mut self.output;
        if out.used {
            out.reconstructed_n = if self.in_tissue { sample.force_n - out.error_n } else { 0.0 };
            out.cusum_n2 = self.cusum.relative_level();
            if self.in_tissue {
                let belief = &self.estimator.belief;
                out.theta = [belief.x[K], belief.x[layer_estimator::B]];
                let sd = |i: usize| libm::sqrt((belief.p[i][i] * self.noise.variance).max(0.0));
                out.sd = [sd(K), sd(layer_estimator::B), libm::sqrt(self.shaft_friction_variance.max(0.0))];
            }
        }
        &self.output
    }
}

#[cfg(test)]
mod tests {
    use super::super::layer_estimator::D;
    use super::super::shaft_friction::DryShaftFriction;
    use super::super::tests::{inside, near, sample};
    use super::*;
    use crate::stylet::gaussian::Gaussian;

    /// In the second layer, behind one of 50 N/m and 8000 N s/m² over 20 mm and a gap of 3 mm: 200 N s/m are behind, to 0.6.
    fn second() -> Stylet {
        let mut stylet = inside();
        let l = &mut stylet.estimator;
        l.belief = Gaussian::new([200.0, 60.0, 9000.0, 50.0, 8000.0, 0.07], [900.0, 4.0, 5.0, 6.0, 7.0, 0.5]);
        (l.passed_count, l.previous_thickness_m, l.previous_start_sd_m, l.gap_m) = (1, 0.02, 5e-4, 0.003);
        (l.rupture_m, l.start_m) = (0.005, 0.008);
        stylet.passed_layers[0] = [-0.015, 0.008, 8000.0];
        stylet.output.ruptures = 1;
        stylet.friction_drive_mps = 0.0021;
        stylet
    }

    fn said(mut stylet: Stylet, sample: &Sample) -> Stylet {
        stylet.write_output(&EnhanceConfig::default(), sample);
        stylet
    }

    fn at(velocity_mps: f64) -> Sample {
        Sample { velocity_mps, ..sample(0.0099, 1.3) }
    }

    #[test]
    fn a_layer_is_reported_with_what_is_known_of_it_and_of_the_friction_behind() {
        let mut stylet = second();
        stylet.report_previous_layer(&sample(0.01, 1.3));
        let found = stylet.output.estimate.expect("an estimate");
        // The noise's level was learned from four hundred samples.
        let doubt = 1.005_f64;
        assert_eq!((found.layer, found.thickness_m, found.time_s), (1, 0.02, 5.0));
        near(found.start_m, -0.015);
        assert_eq!((found.stiffness_n_per_m, found.friction), (50.0, 8000.0));
        near(found.drop_n, 1.0);
        near(found.elastic_share, 50.0 / 66.0);
        near(found.added_friction_ns_per_m, 184.0);
        near(found.stiffness_sd, (6.0 * 4e-4 * doubt).sqrt());
        near(found.friction_sd, (7.0 * 4e-4 * doubt).sqrt());
        // Stiffness over the travel, and the travel that the begin is uncertain by.
        near(found.drop_sd_n, (4e-4 * 6.0 * 4e-4 * doubt + (50.0 * 5e-4_f64).powi(2)).sqrt());
        near(found.cumulative_ns_per_m, 176.0);
        near(found.cumulative_sd, ((900.0 + 9e-6 * 7.0) * 4e-4 * doubt).sqrt());
    }

    #[test]
    fn a_layer_whose_drop_may_be_none_is_not_reported() {
        // 1.96 standard deviations of a drop of 1 N as a share of it.
        for (share, said) in [(0.99, true), (1.01, false)] {
            let mut stylet = second();
            let sd = share / 1.96;
            let stiffness = (sd * sd - 6.25e-4) / 4e-4;
            stylet.estimator.belief.p[K_PREV][K_PREV] = stiffness / (4e-4 * 1.005);
            stylet.report_previous_layer(&sample(0.01, 1.3));
            assert_eq!(stylet.output.estimate.is_some(), said, "{share}");
        }
        for k in [-50.0, 0.0] {
            let mut stylet = second();
            stylet.estimator.belief.x[K_PREV] = k;
            stylet.report_previous_layer(&sample(0.01, 1.3));
            assert!(stylet.output.estimate.is_none());
        }
    }

    #[test]
    fn what_the_tip_feels_is_the_force_without_the_friction_behind_as_well_as_that_is_known() {
        let found = said(second(), &at(0.002));
        near(found.output.enhanced_n, 1.3 - 0.42);
        near(found.output.cumulative_friction_ns_per_m, 200.0);
        // Friction to 0.6 N s/m, and the noise itself.
        near(found.shaft_friction_variance, 0.36);
        let half = 1.96 * (4e-4 + 0.36 * 0.0021_f64.powi(2)).sqrt();
        let [low, high] = found.output.band_n.expect("a band");
        near(high - 0.88, half);
        near(0.88 - low, half);
        assert_eq!((found.output.state, found.operations), (State::NoRupture, 0));
        // No friction pulls on the way in.
        let mut stylet = second();
        stylet.estimator.belief.x[D] = -20.0;
        assert_eq!(said(stylet, &at(0.002)).output.enhanced_n, 1.3);
    }

    #[test]
    fn as_long_as_a_drop_goes_on_friction_is_no_more_than_just_after_the_rupture() {
        for (fallen, falling, friction) in [(150.0, true, 150.0), (150.0, false, 200.0), (250.0, true, 200.0)]
        {
            let mut stylet = second();
            let mut then = stylet.estimator;
            then.belief.x[D] = fallen;
            (stylet.post_rupture, stylet.drop_continues) = (Some(then), falling);
            near(said(stylet, &at(0.002)).output.cumulative_friction_ns_per_m, friction);
        }
    }

    #[test]
    fn on_the_way_back_friction_is_that_of_the_layers_around_the_shaft() {
        // The layer before began at -15 mm and reaches to 8 mm.
        for (v, z, friction, work) in [
            (-0.002, 0.0034, 200.0 * 0.0184 / 0.023, 80),
            (-6e-5, 0.0034, 200.0 * 0.0184 / 0.023, 80),
            (-4e-5, 0.0034, 200.0, 0),
            (-5e-5, 0.0034, 200.0, 0),
            (0.002, 0.0034, 200.0, 0),
        ] {
            let found = said(second(), &Sample { velocity_mps: v, ..sample(z, -0.3) });
            near(found.output.cumulative_friction_ns_per_m, friction);
            assert_eq!(found.operations, work, "{v} m/s");
        }
        let mut stylet = second();
        stylet.in_tissue = false;
        assert_eq!(said(stylet, &at(-0.002)).operations, 0, "there is none around it in the air");
    }

    #[test]
    fn the_state_is_a_rupture_then_a_free_tip_that_the_law_tells_then_none() {
        let state = |free: bool, dry: bool, ruptured: bool| {
            let mut stylet = second();
            (stylet.estimator.tip_free, stylet.base_law_failed) = (free, dry);
            if ruptured {
                let step = super::super::tests::step();
                stylet.declare_rupture(&step, &sample(0.01, 0.5), 1.3);
                stylet.estimator.tip_free = free;
            }
            said(stylet, &at(0.002)).output.state
        };
        assert_eq!(state(false, false, true), State::DetectedRupture);
        assert_eq!(state(true, false, true), State::DetectedRupture);
        assert_eq!(state(true, false, false), State::FreeTip);
        assert_eq!(state(true, true, false), State::NoRupture);
        assert_eq!(state(false, false, false), State::NoRupture);
    }

    #[test]
    fn where_the_law_has_failed_friction_is_what_the_shaft_is_told_to_feel() {
        let config = |law| {
            let mut config = EnhanceConfig::default();
            config.stylet.friction_law = law;
            config
        };
        // Speed, time that is left of a release, and what that means.
        for (v, releasing_s, advancing, retracting, jumped) in [
            (0.002, -0.1, true, false, false),
            (6e-5, 0.0, true, false, false),
            (5e-5, 0.0, false, false, false),
            (-4e-5, 0.0, false, false, false),
            (-0.002, 0.0, false, true, false),
            (-0.002, 0.01, false, true, true),
        ] {
            let mut stylet = second();
            stylet.base_law_failed = true;
            (stylet.release_window_s, stylet.low_pass_gains[2]) = (releasing_s, 0.4);
            stylet.dry_friction.rupture(0.005, 1.1);
            for position_m in [0.0055, 0.0099] {
                stylet
                    .dry_friction
                    .update(&ShaftSample { released: false, ..felt(position_m, 1.5, true, false) });
            }
            if retracting {
                stylet.dry_friction.update(&felt(0.0099, 0.2, false, true));
            }
            let mut shaft: DryShaftFriction = stylet.dry_friction;
            let (dry_n, sd) =
                shaft.update(&ShaftSample { released: jumped, ..felt(0.0099, 1.23, advancing, retracting) });
            stylet.write_output(&config(FrictionLaw::Auto), &at(v));
            near(stylet.output.enhanced_n, 1.3 - dry_n);
            let [low, high] = stylet.output.band_n.expect("a band");
            near(0.5 * (high - low), 1.96 * (4e-4 + sd * sd).sqrt());
            // A law that was asked for stays.
            stylet.write_output(&config(FrictionLaw::Viscous), &at(v));
            near(stylet.output.enhanced_n, 1.3 - 0.0021 * stylet.output.cumulative_friction_ns_per_m);
            // In the air there is no shaft to feel anything.
            let before = stylet.dry_friction;
            stylet.in_tissue = false;
            stylet.write_output(&config(FrictionLaw::Auto), &at(0.002));
            assert_eq!(alloc::format!("{before:?}"), alloc::format!("{:?}", stylet.dry_friction));
        }
        // As long as it holds the law is what says it.
        let mut stylet = second();
        stylet.dry_friction.rupture(0.005, 1.1);
        near(said(stylet, &at(0.002)).output.enhanced_n, 0.88);
    }

    fn felt(position_m: f64, force_n: f64, advancing: bool, retracting: bool) -> ShaftSample {
        ShaftSample {
            gain: 0.4,
            position_m,
            force_n,
            advancing,
            retracting,
            peak_force_n: 1.2,
            released: true,
            noise_variance_n2: 4e-4,
            track_retraction: true,
        }
    }

    #[test]
    fn the_whole_output_tells_prediction_sums_and_what_is_known() {
        let mut stylet = second();
        (stylet.output.used, stylet.output.error_n, stylet.shaft_friction_variance) = (true, 0.2, 0.36);
        stylet.cusum.update(-3.0);
        let out = *stylet.complete_output(&sample(0.01, 1.3));
        near(out.reconstructed_n, 1.1);
        assert_eq!((out.theta, out.cusum_n2), ([60.0, 9000.0], stylet.cusum.relative_level()));
        near(out.sd[0], 0.04);
        near(out.sd[1], (5.0 * 4e-4_f64).sqrt());
        near(out.sd[2], 0.6);
        // What was not used says what the one before said; in the air nothing is expected.
        stylet.output.used = false;
        (stylet.estimator.belief.x[K], stylet.output.error_n) = (1.0, 0.5);
        assert_eq!(stylet.complete_output(&sample(0.01, 1.3)).theta, [60.0, 9000.0]);
        let mut air = second();
        (air.output.used, air.in_tissue, air.output.error_n) = (true, false, 0.2);
        let out = air.complete_output(&sample(0.01, 1.3));
        assert_eq!((out.reconstructed_n, out.theta, out.sd), (0.0, [0.0; 2], [0.0; 3]));
    }
}
