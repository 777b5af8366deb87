//! Promise: the estimates are those of the paper's equations. Batch size and storage of the replay do not change them, weighting
//! the covariance equals scaling the regressor (supplement eqs. 8-12), and values that are not finite are ignored.

use crate::support;
use crate::support::{constant, enhance, sinusoid};
use proptest::prelude::*;
use stylet_core::config::{DropConfig, Model, Reset};
use stylet_core::{EnhanceConfig, Enhancer, LayerEstimate, Rls, Sample};
use stylet_tissue::Tissue;

fn estimates(config: &EnhanceConfig, samples: &[Sample]) -> Vec<LayerEstimate> {
    enhance(config, samples).iter().filter_map(|o| o.estimate).collect()
}

#[test]
fn constant_insertion_without_noise_gives_stiffness_and_friction_back() {
    // The third layer starts 1 mm late, because the second ruptured before its far face.
    let expected = [(40.0, 9000.0, 0.002), (60.0, 12000.0, 0.002), (80.0, 16000.0, 0.04)];
    let found = estimates(&EnhanceConfig::paper(), &constant(0.0, 1).samples);
    assert_eq!(found.len(), 3);
    for (e, (k, b, within)) in found.iter().zip(expected) {
        assert!((e.stiffness_n_per_m / k - 1.0).abs() < within, "{e:?} against K {k}");
        assert!((e.friction / b - 1.0).abs() < within, "{e:?} against b {b}");
    }
}

#[test]
fn the_replay_batch_size_changes_the_time_of_an_estimate_and_not_its_value() {
    let data = sinusoid(0.02, 2);
    let with = |replay_per_tick| {
        let config = EnhanceConfig {
            drop: DropConfig { replay_per_tick, ..DropConfig::default() },
            ..EnhanceConfig::paper()
        };
        estimates(&config, &data.samples)
    };
    let (slow, fast) = (with(8), with(1_000_000));
    assert_eq!(slow.len(), 3);
    assert!(slow[0].time_s > fast[0].time_s, "eight samples per step must take more steps");
    for (a, b) in slow.iter().zip(&fast) {
        assert_eq!(a.stiffness_n_per_m, b.stiffness_n_per_m);
        assert_eq!(a.friction, b.friction);
    }
}

#[test]
fn storage_shorter_than_a_layer_still_gives_an_estimate() {
    let data = constant(0.0, 1);
    let mut core = Enhancer::new(EnhanceConfig::paper(), 0.0, vec![Sample::default(); 1024]);
    let found: Vec<LayerEstimate> = data.samples.iter().filter_map(|s| core.step(*s).estimate).collect();
    assert_eq!(found.len(), 3);
    assert!((found[0].stiffness_n_per_m - 40.0).abs() < 0.5, "{found:?}");
}

#[test]
fn without_reweighting_the_friction_is_negligible_and_compensates_nothing() {
    let config = EnhanceConfig {
        drop: DropConfig { reweight: false, ..DropConfig::default() },
        ..EnhanceConfig::paper()
    };
    for e in estimates(&config, &constant(0.02, 1).samples) {
        assert!(e.added_friction_ns_per_m < 1.0, "{e:?}");
    }
}

#[test]
fn samples_that_are_not_finite_or_not_later_are_ignored() {
    let data = constant(0.02, 1);
    let clean = enhance(&EnhanceConfig::paper(), &data.samples);
    let mut core = Enhancer::new(EnhanceConfig::paper(), 0.0, vec![Sample::default(); 16384]);
    for (sample, expected) in data.samples.iter().zip(&clean) {
        assert_eq!(core.step(*sample), *expected);
        for spoiled in [
            Sample { force_n: f64::NAN, time_s: sample.time_s + 1e-3, ..*sample },
            Sample { velocity_mps: f64::INFINITY, time_s: sample.time_s + 1e-3, ..*sample },
            *sample,
            Sample { time_s: sample.time_s - 1.0, ..*sample },
        ] {
            assert!(!core.step(spoiled).used);
        }
    }
}

#[test]
fn the_covariance_stays_symmetric_and_positive_over_a_million_updates_with_forgetting() {
    let mut rls = Rls::new([1e6, 1e6]);
    for k in 0..1_000_000u32 {
        let t = f64::from(k) * 0.005;
        rls.update([0.02 + 0.01 * t.sin(), 1e-3 * t.cos()], 1.0, 0.999);
    }
    let [p11, p12, p22] = rls.covariance;
    assert!(p11 > 0.0 && p22 > 0.0 && p11 * p22 - p12 * p12 > 0.0, "{rls:?}");
    assert!(rls.theta.iter().all(|x| x.is_finite()));
}

proptest! {
    /// RLS from `Lambda P Lambda` on `phi` has the predictions of RLS from `P` on `Lambda phi`, and `Lambda` times its parameters
    /// (supplement eqs. 8-12).
    #[test]
    fn weighting_the_covariance_equals_scaling_the_regressor(
        w in (0.01f64..100.0, 0.01f64..100.0),
        data in prop::collection::vec((0.001f64..0.04, 0.0005f64..0.013, -1.0f64..5.0), 1..60),
    ) {
        let mut weighted = Rls::new([1e6 * w.0 * w.0, 1e6 * w.1 * w.1]);
        let mut scaled = Rls::new([1e6, 1e6]);
        for (dz, v, y) in data {
            let phi = [dz, dz * v];
            let a = weighted.update(phi, y, 1.0);
            let b = scaled.update([w.0 * phi[0], w.1 * phi[1]], y, 1.0);
            prop_assert!((a - b).abs() < 1e-6 * (1.0 + y.abs()), "{} {}", a, b);
        }
        for (a, (b, w)) in weighted.theta.iter().zip(scaled.theta.iter().zip([w.0, w.1])) {
            prop_assert!((a - w * b).abs() <= 1e-5 * (1.0 + a.abs()), "{} {}", a, w * b);
        }
    }
}

#[test]
fn kelvin_voigt_and_multi_layer_reset_only_at_ruptures_agree_on_a_layer_without_friction() {
    let mut tissue = Tissue::three_gels();
    tissue.layers.truncate(1);
    tissue.layers[0].friction_ns_per_m2 = 0.0;
    let data = support::insertion(&tissue, -0.005, 20.0, 200.0, 0.0, 1, |_| 0.0023);
    for model in [Model::KelvinVoigt, Model::MultiLayer] {
        let config = EnhanceConfig { model, reset: Reset::Ruptures, ..EnhanceConfig::paper() };
        let found = estimates(&config, &data.samples);
        assert_eq!(found.len(), 1, "{model:?}");
        assert!((found[0].stiffness_n_per_m / 40.0 - 1.0).abs() < 0.02, "{model:?}: {found:?}");
    }
}
