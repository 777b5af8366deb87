//! Promise: the core copes with real logs: noisy position and velocity, a short travel in air, other sampling rates, impossible
//! samples, a second insertion.

use crate::support::{Insertion, constant, detections, enhance, insertion};
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use stylet_core::config::{Contact, Depths, Reset};
use stylet_core::{EnhanceConfig, LayerEstimate, Output, Sample};
use stylet_tissue::Tissue;

fn estimates(outputs: &[Output]) -> Vec<LayerEstimate> {
    outputs.iter().filter_map(|o| o.estimate).collect()
}

fn assert_three(name: &str, data: &Insertion, found: &[f64]) {
    let truth: Vec<f64> = data.ruptures.iter().map(|r| r.time_s).collect();
    let hit =
        truth.len() == 3 && found.len() == 3 && truth.iter().zip(found).all(|(t, f)| (f - t).abs() < 0.05);
    assert!(hit, "{name}: true {truth:?}, found {found:?}");
}

#[test]
fn noise_on_position_and_velocity_hides_no_rupture() {
    for (hz, z_sd, v_sd) in
        [(200.0, 5e-6, 0.0), (1000.0, 1e-6, 0.0), (200.0, 2e-6, 2e-4), (1000.0, 0.0, 2.5e-4)]
    {
        let data = insertion(&Tissue::three_gels(), -0.005, 50.0, hz, 0.01, 1, |_| 0.0023);
        let mut rng = ChaCha8Rng::seed_from_u64(9);
        let mut draw = |sd: f64| {
            let w: f64 = StandardNormal.sample(&mut rng);
            sd * w
        };
        let noisy: Vec<Sample> = data
            .samples
            .iter()
            .map(|s| Sample {
                position_m: s.position_m + draw(z_sd),
                velocity_mps: s.velocity_mps + draw(v_sd),
                ..*s
            })
            .collect();
        let found = detections(&enhance(&EnhanceConfig::paper(), &noisy));
        assert_three(&format!("{hz} Hz, position sd {z_sd} m, velocity sd {v_sd} m/s"), &data, &found);
    }
}

#[test]
fn a_short_travel_in_air_is_enough_to_detect_contact() {
    for (start_m, v) in [(-0.0006, 0.0023), (-0.0003, 0.0023), (0.0, 0.0023), (-0.005, 0.015)] {
        let data = insertion(&Tissue::three_gels(), start_m, 0.115 / v, 200.0, 0.01, 1, move |_| v);
        let outputs = enhance(&EnhanceConfig::paper(), &data.samples);
        let contact = outputs.last().and_then(|o| o.contact_m);
        assert!(
            contact.is_some_and(|z| z.abs() < 1.5e-3),
            "from {start_m} m at {v} m/s: contact {contact:?}"
        );
        assert_three(&format!("from {start_m} m at {v} m/s"), &data, &detections(&outputs));
    }
}

#[test]
fn the_estimates_mean_the_same_at_every_sampling_rate() {
    let omega = std::f64::consts::TAU * 0.0167;
    for hz in [50.0, 100.0, 200.0, 1000.0, 5000.0] {
        let data = insertion(&Tissue::three_gels(), -0.005, 15.0, hz, 0.0, 1, move |t| {
            0.12 * omega * (omega * t).sin()
        });
        let mut core =
            stylet_core::Enhancer::new(EnhanceConfig::paper(), 0.0, vec![Sample::default(); 1 << 17]);
        let outputs: Vec<Output> = data.samples.iter().map(|s| core.step(*s)).collect();
        assert_three(&format!("{hz} Hz"), &data, &detections(&outputs));
        for (e, k) in estimates(&outputs).iter().zip([40.0, 60.0, 80.0]) {
            assert!((e.stiffness_n_per_m / k - 1.0).abs() < 0.25, "{hz} Hz: {e:?} against K {k}");
        }
    }
}

#[test]
fn resets_keep_their_frequency_where_it_does_not_divide_the_sampling_rate() {
    // At 100 Hz a reset at 40 Hz comes after two and three samples in turn, which differs from one every second sample.
    let data = insertion(&Tissue::three_gels(), -0.005, 12.0, 100.0, 0.01, 1, |_| 0.0023);
    let with = |hz| {
        let config = EnhanceConfig { reset: Reset::Frequency { hz }, ..EnhanceConfig::paper() };
        enhance(&config, &data.samples).last().map(|o| o.theta)
    };
    assert_ne!(with(40.0), with(50.0));
}

#[test]
fn an_impossible_sample_changes_nothing() {
    let data = constant(0.01, 1);
    let clean = enhance(&EnhanceConfig::paper(), &data.samples);
    for (force_n, velocity_mps) in [(1e308, 0.0023), (-1e100, 0.0023), (0.5, 1e200)] {
        let mut samples = data.samples.clone();
        samples.insert(3000, Sample { time_s: 14.9975, force_n, velocity_mps, ..samples[2999] });
        let mut outputs = enhance(&EnhanceConfig::paper(), &samples);
        assert!(!outputs.remove(3000).used);
        assert_eq!(outputs.last(), clean.last());
    }
}

#[test]
fn a_needle_known_to_start_inside_the_tissue_is_not_a_rupture() {
    let config = EnhanceConfig { contact: Contact::Known, ..EnhanceConfig::paper() };
    let data = insertion(&Tissue::three_gels(), 0.01, 45.0, 200.0, 0.01, 1, |_| 0.0023);
    assert_three("starting 10 mm inside", &data, &detections(&enhance(&config, &data.samples)));
}

#[test]
fn reinsertion_is_compensated_by_the_friction_around_the_shaft_only() {
    let v = |t: f64| if (35.0..45.0).contains(&t) { -0.004 } else { 0.0023 };
    let data = insertion(&Tissue::three_gels(), -0.005, 75.0, 200.0, 0.0, 1, v);
    let outputs = enhance(&EnhanceConfig::paper(), &data.samples);
    // Two layers have ruptured at 35 s; during retraction and reinsertion only friction acts until the third.
    let worst =
        (36 * 200..50 * 200).map(|k| (outputs[k].enhanced_n - data.truth[k].tip_n).abs()).fold(0.0, f64::max);
    let friction = data.truth[36 * 200].friction_n.abs();
    assert!(worst < 0.15 * friction, "off by {worst} N where friction is {friction} N");
}

#[test]
fn known_depths_end_a_layer_at_its_face_at_the_latest() {
    let mut tissue = Tissue::three_gels();
    for layer in &mut tissue.layers {
        // Without a drop only the known depths end the layer.
        layer.stiffness_n_per_m = 0.0;
        layer.puncture_n = None;
    }
    let config = EnhanceConfig {
        contact: Contact::Known,
        depths: Depths::Known(vec![0.0282, 0.0377, 0.0322]),
        ..EnhanceConfig::paper()
    };
    let data = insertion(&tissue, -0.005, 50.0, 200.0, 0.01, 1, |_| 0.0023);
    let outputs = enhance(&config, &data.samples);
    assert_three("known depths", &data, &detections(&outputs));
    for (e, d) in estimates(&outputs).iter().zip([0.0282, 0.0377, 0.0322]) {
        assert_eq!(e.thickness_m, d);
    }
}

#[test]
fn covariance_reset_only_at_ruptures_alarms_no_more_often_than_there_are_ruptures_at_constant_speed() {
    let config = EnhanceConfig { reset: Reset::Ruptures, ..EnhanceConfig::paper() };
    let data = constant(0.01, 1);
    assert_three("reset at ruptures", &data, &detections(&enhance(&config, &data.samples)));
}
