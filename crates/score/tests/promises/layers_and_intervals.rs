//! Every ruptured layer is compared with the estimate of its detection and with the intervals of the core.

use crate::support::{LAYERS, detection, detection_output, estimate_output, near, rupture};
use stylet_core::LayerEstimate;
use stylet_core::config::Model;
use stylet_score::{EstimateError, Score, Scorer};

const FIRST: LayerEstimate = LayerEstimate {
    layer: 1,
    start_m: 0.010,
    thickness_m: 0.008,
    stiffness_n_per_m: 44.0,
    friction: 1500.0,
    drop_n: 0.3,
    elastic_share: 0.5,
    added_friction_ns_per_m: 18.0,
    time_s: 5.1,
    stiffness_sd: 0.0,
    friction_sd: 0.0,
    drop_sd_n: 0.0,
    cumulative_ns_per_m: 0.0,
    cumulative_sd: 0.0,
};

const SECOND: LayerEstimate = LayerEstimate {
    layer: 2,
    thickness_m: 0.005,
    stiffness_n_per_m: 80.0,
    friction: 3300.0,
    added_friction_ns_per_m: 17.0,
    ..FIRST
};

/// Both layers rupture, the second before its far face; the core detects at `detected` and has these estimates.
fn scored(model: Model, detected: &[f64], estimates: &[LayerEstimate]) -> Score {
    let mut scorer = Scorer::new(LAYERS.to_vec(), model);
    scorer.add_rupture(rupture(1, 5.0, 0.020));
    scorer.add_rupture(rupture(2, 8.0, 0.024));
    for (index, time_s) in detected.iter().enumerate() {
        scorer.add_event(&detection_output(detection(index + 1, *time_s)));
    }
    for estimate in estimates {
        scorer.add_event(&estimate_output(*estimate));
    }
    scorer.set_contact(Some(0.0103));
    scorer.finish()
}

#[test]
fn coefficients_are_compared_with_the_truth() {
    let score = scored(Model::MultiLayer, &[5.2, 8.1], &[FIRST, SECOND]);
    let (first, second) = (&score.layers[0], &score.layers[1]);
    assert_eq!((first.layer, second.layer), (1, 2));
    assert_eq!(first.stiffness_n_per_m.truth, 40.0);
    near(first.stiffness_n_per_m.relative_error, 0.1);
    near(first.friction_ns_per_m2.relative_error, 0.25);
    near(first.thickness_m.relative_error, 0.2);
    near(second.stiffness_n_per_m.relative_error, 0.2);
    near(second.friction_ns_per_m2.estimated, 3300.0);
    // Friction of the ruptured layers: 2000 x 10 mm, and 3000 x 4 mm more.
    near(Some(first.cumulative_friction_ns_per_m.truth), 20.0);
    near(first.cumulative_friction_ns_per_m.estimated, 18.0);
    near(Some(second.cumulative_friction_ns_per_m.truth), 32.0);
    near(second.cumulative_friction_ns_per_m.estimated, 35.0);
    assert_eq!(score.cumulative_friction_ns_per_m, second.cumulative_friction_ns_per_m);
    assert_eq!((score.contact_m.truth, score.contact_m.estimated), (0.010, Some(0.0103)));
    near(score.worst_stiffness_error(), 0.2);
    near(score.worst_friction_error(), 0.25);
    near(score.median_delay_s(), 0.15);
    assert_eq!((score.missed, score.false_alarms), (0, 0));
}

#[test]
fn kelvin_voigt_friction_is_divided_by_the_thickness() {
    let voigt = LayerEstimate { friction: 12.0, ..FIRST };
    let score = scored(Model::KelvinVoigt, &[5.2], &[voigt]);
    near(score.layers[0].friction_ns_per_m2.estimated, 1500.0);
}

#[test]
fn a_layer_is_compared_with_the_estimate_of_its_own_detection() {
    // The core's first detection is false: its second is the first layer's.
    let score = scored(Model::MultiLayer, &[2.0, 5.2], &[FIRST, SECOND]);
    assert_eq!((score.missed, score.false_alarms, &score.false_s[..]), (1, 1, &[2.0][..]));
    near(score.layers[0].stiffness_n_per_m.estimated, 80.0);
    // The friction of the false layer is part of the sum.
    near(score.layers[0].cumulative_friction_ns_per_m.estimated, 35.0);
    assert_eq!(score.layers[1].stiffness_n_per_m, EstimateError::new(100.0, None));
    near(score.worst_stiffness_error(), 1.0);
}

#[test]
fn the_last_estimate_of_a_layer_counts() {
    let revised = LayerEstimate { stiffness_n_per_m: 41.0, added_friction_ns_per_m: 19.0, ..FIRST };
    let score = scored(Model::MultiLayer, &[5.2, 8.1], &[FIRST, SECOND, revised]);
    near(score.layers[0].stiffness_n_per_m.estimated, 41.0);
    near(score.layers[1].stiffness_n_per_m.estimated, 80.0);
    near(score.layers[1].cumulative_friction_ns_per_m.estimated, 36.0);
}

#[test]
fn hits_are_chance_with_more_false_alarms_than_ruptures() {
    assert!(!scored(Model::MultiLayer, &[1.0, 2.0, 5.2], &[]).hits_are_chance);
    let many = scored(Model::MultiLayer, &[1.0, 2.0, 3.0, 5.2], &[]);
    assert!(many.hits_are_chance && many.missed == 1 && many.false_alarms == 3, "{many:?}");
}

#[test]
fn a_run_without_ruptures_or_estimates_has_no_errors_and_no_delay() {
    let mut scorer = Scorer::new(LAYERS.to_vec(), Model::MultiLayer);
    assert!(scorer.detections().is_empty());
    scorer.add_event(&detection_output(detection(1, 3.0)));
    assert_eq!(scorer.detections(), [detection(1, 3.0)]);
    let score = scorer.finish();
    assert_eq!((score.median_delay_s(), score.worst_stiffness_error()), (None, None));
    assert_eq!(score.worst_friction_error(), None);
    assert!(score.layers.is_empty() && score.hits_are_chance);
    assert_eq!(score.cumulative_friction_ns_per_m, EstimateError::new(0.0, None));
    // A true value of zero has no relative error, an estimate of zero an error of one.
    assert_eq!(EstimateError::new(0.0, Some(3.0)).relative_error, None);
    assert_eq!(EstimateError::new(-4.0, Some(0.0)).relative_error, Some(1.0));
}

/// Estimate of the first layer with these errors and standard deviations of 5 N/m, 300 N s/m² and 0.1 N s/m.
fn with_error(stiffness: f64, friction: f64, cumulative: f64) -> LayerEstimate {
    LayerEstimate {
        stiffness_n_per_m: 40.0 + stiffness,
        stiffness_sd: 5.0,
        friction: 2000.0 + friction,
        friction_sd: 300.0,
        cumulative_ns_per_m: 20.0 + cumulative,
        cumulative_sd: 0.1,
        ..FIRST
    }
}

#[test]
fn a_truth_within_1_96_standard_deviations_is_covered() {
    for (estimate, inside) in [
        (with_error(9.7, -580.0, 0.19), [1.0, 1.0, 1.0]),
        (with_error(-9.7, 580.0, -0.19), [1.0, 1.0, 1.0]),
        (with_error(9.9, 580.0, 0.19), [0.0, 1.0, 1.0]),
        (with_error(9.7, -600.0, 0.19), [1.0, 0.0, 1.0]),
        (with_error(-9.7, 580.0, -0.20), [1.0, 1.0, 0.0]),
    ] {
        let of = scored(Model::MultiLayer, &[5.2], &[estimate]).coverage;
        assert_eq!([of.stiffness, of.friction, of.cumulative], inside.map(|n| [n, 1.0]), "{estimate:?}");
    }
}

#[test]
fn coverage_counts_the_layers_with_standard_deviations() {
    let second = LayerEstimate {
        layer: 2,
        stiffness_n_per_m: 100.0,
        friction: 3000.0,
        // 2000 x 10 mm and 3000 x 4 mm.
        cumulative_ns_per_m: 32.0,
        ..with_error(0.0, 0.0, 0.0)
    };
    let of = scored(Model::MultiLayer, &[5.2, 8.1], &[with_error(20.0, 0.0, 0.0), second]).coverage;
    assert_eq!([of.stiffness, of.friction, of.cumulative], [[1.0, 2.0], [2.0, 2.0], [2.0, 2.0]]);
    // An algorithm without standard deviations does not count.
    let without = scored(Model::MultiLayer, &[5.2, 8.1], &[FIRST, SECOND]).coverage;
    assert_eq!([without.stiffness, without.friction, without.cumulative], [[0.0, 0.0]; 3]);
    // Nor does a missed layer.
    let one = scored(Model::MultiLayer, &[8.1], &[with_error(0.0, 0.0, 0.0)]).coverage;
    assert_eq!(one.stiffness[1], 1.0);
}
