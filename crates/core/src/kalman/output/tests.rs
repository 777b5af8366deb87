use super::super::baseline_fit::BaselineFit;
use super::super::layer_estimator::{D, DRIFT, LINE};
use super::super::shaft_friction::DryShaftFriction;
use super::super::test_support::{advancing, inside, near, sample};
use super::*;
use crate::kalman::gaussian::Gaussian;

/// In the second layer, after one of 50 N/m and 8000 N s/m² over 20 mm and a gap of 3 mm; friction 200 N s/m, standard
/// deviation 0.6.
fn second() -> KalmanEnhancer {
    let mut stylet = inside();
    let l = &mut stylet.estimator;
    l.state = Gaussian::new(
        [200.0, 60.0, 9000.0, 50.0, 8000.0, 0.07, 0.0, 0.0],
        [900.0, 4.0, 5.0, 6.0, 7.0, 0.5, 0.0, 0.0],
    );
    (l.passed_count, l.previous_thickness_m, l.previous_start_sd_m, l.gap_m) = (1, 0.02, 5e-4, 0.003);
    (l.rupture_m, l.start_m) = (0.005, 0.008);
    stylet.passed_layers[0] = [-0.015, 0.008, 8000.0];
    stylet.output.ruptures = 1;
    stylet.friction_drive_mps = 0.0021;
    stylet
}

fn output_of(mut stylet: KalmanEnhancer, sample: &Sample) -> KalmanEnhancer {
    stylet.write_output(&EnhanceConfig::default(), sample);
    stylet
}

fn at(velocity_mps: f64) -> Sample {
    Sample { velocity_mps, ..sample(0.0099, 1.3) }
}

#[test]
fn a_layer_report_has_estimates_and_standard_deviations() {
    let mut stylet = second();
    stylet.report_previous_layer(&sample(0.01, 1.3));
    let found = stylet.output.estimate.expect("an estimate");
    // Noise estimated from 400 samples.
    let doubt = 1.005_f64;
    assert_eq!((found.layer, found.thickness_m, found.time_s), (1, 0.02, 5.0));
    near(found.start_m, -0.015);
    assert_eq!((found.stiffness_n_per_m, found.friction), (50.0, 8000.0));
    near(found.drop_n, 1.0);
    near(found.elastic_share, 50.0 / 66.0);
    near(found.added_friction_ns_per_m, 184.0);
    near(found.stiffness_sd, (6.0 * 4e-4 * doubt).sqrt());
    near(found.friction_sd, (7.0 * 4e-4 * doubt).sqrt());
    // Uncertain stiffness and uncertain start.
    near(found.drop_sd_n, (4e-4 * 6.0 * 4e-4 * doubt + (50.0 * 5e-4_f64).powi(2)).sqrt());
    near(found.cumulative_ns_per_m, 176.0);
    near(found.cumulative_sd, ((900.0 + 9e-6 * 7.0) * 4e-4 * doubt).sqrt());
}

#[test]
fn a_layer_whose_drop_may_be_zero_is_not_reported() {
    // 1.96 standard deviations relative to a drop of 1 N.
    for (share, reported) in [(0.99, true), (1.01, false)] {
        let mut stylet = second();
        let sd = share / 1.96;
        let stiffness = (sd * sd - 6.25e-4) / 4e-4;
        stylet.estimator.state.p[K_PREV][K_PREV] = stiffness / (4e-4 * 1.005);
        stylet.report_previous_layer(&sample(0.01, 1.3));
        assert_eq!(stylet.output.estimate.is_some(), reported, "{share}");
    }
    for k in [-50.0, 0.0] {
        let mut stylet = second();
        stylet.estimator.state.x[K_PREV] = k;
        stylet.report_previous_layer(&sample(0.01, 1.3));
        assert!(stylet.output.estimate.is_none());
    }
}

#[test]
fn the_enhanced_force_subtracts_shaft_friction_with_its_uncertainty() {
    let found = output_of(second(), &at(0.002));
    near(found.output.enhanced_n, 1.3 - 0.42);
    near(found.output.cumulative_friction_ns_per_m, 200.0);
    // Standard deviation of friction 0.6 N s/m, plus sensor noise.
    near(found.shaft_friction_variance, 0.36);
    let half = 1.96 * (4e-4 + 0.36 * 0.0021_f64.powi(2)).sqrt();
    let [low, high] = found.output.band_n.expect("a band");
    near(high - 0.88, half);
    near(0.88 - low, half);
    assert_eq!((found.output.state, found.operations), (State::NoRupture, 0));
    // Friction does not pull during insertion.
    let mut stylet = second();
    stylet.estimator.state.x[D] = -20.0;
    assert_eq!(output_of(stylet, &at(0.002)).output.enhanced_n, 1.3);
}

#[test]
fn while_a_drop_continues_friction_is_limited_to_its_value_after_the_rupture() {
    for (fallen, falling, friction) in [(150.0, true, 150.0), (150.0, false, 200.0), (250.0, true, 200.0)] {
        let mut stylet = second();
        let mut then = stylet.estimator;
        then.state.x[D] = fallen;
        (stylet.post_rupture, stylet.drop_continues) = (Some(then), falling);
        near(output_of(stylet, &at(0.002)).output.cumulative_friction_ns_per_m, friction);
    }
}

#[test]
fn during_retraction_friction_is_that_of_the_layers_around_the_shaft() {
    // The previous layer extends from -15 to 8 mm.
    for (v, z, friction, work) in [
        (-0.002, 0.0034, 200.0 * 0.0184 / 0.023, 80),
        (-6e-5, 0.0034, 200.0 * 0.0184 / 0.023, 80),
        (-4e-5, 0.0034, 200.0, 0),
        (-5e-5, 0.0034, 200.0, 0),
        (0.002, 0.0034, 200.0, 0),
    ] {
        let found = output_of(second(), &Sample { velocity_mps: v, ..sample(z, -0.3) });
        near(found.output.cumulative_friction_ns_per_m, friction);
        assert_eq!(found.operations, work, "{v} m/s");
    }
    let mut stylet = second();
    stylet.in_tissue = false;
    assert_eq!(output_of(stylet, &at(-0.002)).operations, 0, "no friction in air");
}

#[test]
fn the_state_is_rupture_before_free_tip_before_none() {
    let state = |free: bool, dry: bool, ruptured: bool| {
        let mut stylet = second();
        (stylet.estimator.tip_free, stylet.base_law_failed) = (free, dry);
        if ruptured {
            let step = super::super::test_support::step();
            stylet.declare_rupture(&step, &sample(0.01, 0.5), 1.3);
            stylet.estimator.tip_free = free;
        }
        output_of(stylet, &at(0.002)).output.state
    };
    assert_eq!(state(false, false, true), State::DetectedRupture);
    assert_eq!(state(true, false, true), State::DetectedRupture);
    assert_eq!(state(true, false, false), State::FreeTip);
    assert_eq!(state(true, true, false), State::NoRupture);
    assert_eq!(state(false, false, false), State::NoRupture);
}

#[test]
fn where_the_base_law_has_failed_friction_is_dry() {
    let config = |law| {
        let mut config = EnhanceConfig::default();
        config.stylet.friction_law = law;
        config
    };
    // Speed, remaining release window, and the resulting flags.
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
                .update(&ShaftSample { released: false, ..shaft_sample(position_m, 1.5, true, false) });
        }
        if retracting {
            stylet.dry_friction.update(&shaft_sample(0.0099, 0.2, false, true));
        }
        let mut shaft: DryShaftFriction = stylet.dry_friction;
        let (dry_n, sd) = shaft
            .update(&ShaftSample { released: jumped, ..shaft_sample(0.0099, 1.23, advancing, retracting) });
        stylet.write_output(&config(FrictionLaw::Auto), &at(v));
        near(stylet.output.enhanced_n, 1.3 - dry_n);
        let [low, high] = stylet.output.band_n.expect("a band");
        near(0.5 * (high - low), 1.96 * (4e-4 + sd * sd).sqrt());
        // A configured friction law stays in use.
        stylet.write_output(&config(FrictionLaw::Viscous), &at(v));
        near(stylet.output.enhanced_n, 1.3 - 0.0021 * stylet.output.cumulative_friction_ns_per_m);
        // In air the shaft friction is not updated.
        let before = stylet.dry_friction;
        stylet.in_tissue = false;
        stylet.write_output(&config(FrictionLaw::Auto), &at(0.002));
        assert_eq!(alloc::format!("{before:?}"), alloc::format!("{:?}", stylet.dry_friction));
    }
    // While the base law holds it is used.
    let mut stylet = second();
    stylet.dry_friction.rupture(0.005, 1.1);
    near(output_of(stylet, &at(0.002)).output.enhanced_n, 0.88);
}

fn shaft_sample(position_m: f64, force_n: f64, is_advancing: bool, is_retracting: bool) -> ShaftSample {
    ShaftSample {
        gain: 0.4,
        advancing: is_advancing,
        retracting: is_retracting,
        peak_force_n: 1.2,
        released: true,
        noise_variance_n2: 4e-4,
        ..advancing(position_m, force_n)
    }
}

#[test]
fn the_complete_output_has_prediction_cusum_and_standard_deviations() {
    let mut stylet = second();
    (stylet.output.used, stylet.output.error_n, stylet.shaft_friction_variance) = (true, 0.2, 0.36);
    stylet.cusum.update(-3.0);
    let out = *stylet.complete_output(&sample(0.01, 1.3));
    near(out.reconstructed_n, 1.1);
    assert_eq!((out.theta, out.cusum_n2), ([60.0, 9000.0], stylet.cusum.relative_level()));
    near(out.sd[0], 0.04);
    near(out.sd[1], (5.0 * 4e-4_f64).sqrt());
    near(out.sd[2], 0.6);
    // An ignored sample repeats the output; in air nothing is predicted.
    stylet.output.used = false;
    (stylet.estimator.state.x[K], stylet.output.error_n) = (1.0, 0.5);
    assert_eq!(stylet.complete_output(&sample(0.01, 1.3)).theta, [60.0, 9000.0]);
    let mut air = second();
    (air.output.used, air.in_tissue, air.output.error_n) = (true, false, 0.2);
    let out = air.complete_output(&sample(0.01, 1.3));
    assert_eq!((out.reconstructed_n, out.theta, out.sd), (0.0, [0.0; 2], [0.0; 3]));
}

/// A moving baseline whose subtracted drift and line were wrong by 0.05 N and by 0.1 N at this sample.
fn with_moving_baseline(mut stylet: KalmanEnhancer) -> KalmanEnhancer {
    stylet.estimator.set_baseline(&BaselineFit::default(), &stylet.noise);
    stylet.estimator.elapsed_s = 5.0;
    stylet.estimator.state.x[DRIFT] = 0.01;
    stylet.estimator.state.x[LINE] = 0.1 / 0.0099;
    stylet
}

#[test]
fn where_the_base_law_fails_its_drift_is_not_subtracted_before_friction_is_compared() {
    // The force lies 0.5 N above the offset, all of which is friction just after a rupture.
    let moved = Sample { force_n: 0.07 + 0.5, ..at(0.002) };
    for (model_n, friction_n) in [(0.3, 0.3), (0.6, 0.5)] {
        let mut stylet = with_moving_baseline(second());
        stylet.base_law_failed = true;
        stylet.dry_friction.rupture(0.0095, stylet.force_without_baseline_n(&moved));
        (stylet.output.used, stylet.last_sample) = (true, moved);
        stylet.write_output(&EnhanceConfig::default(), &moved);
        // The offset of the sensor stays in the enhanced force.
        near(stylet.output.enhanced_n, 0.07);
        let found = stylet.apply_model_friction(&EnhanceConfig::default(), model_n);
        near(found.expect("a model").0, 0.07 + 0.5 - friction_n);
    }
}
