use super::super::group_deviation::Factor;
use super::super::group_update::GroupEstimate;
use super::super::insertion_course::{BINS, InsertionCourse};
use super::super::prepared::Prepared;
use super::super::target::Target;
use super::super::training_curves::TrainingSummary;
use super::super::uncertainty::{Uncertainty, free_run_force};
use super::{NOISE_VALUES, SEED, noise_values};
use crate::diagnosis_json::{Cause, Diagnosis, Estimate, LabelledParameter, ParameterLabel, RandomEffectSd};
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::collections::BTreeMap;
use std::sync::Arc;
use stylet_identify::block_averages::{BLOCK_S, BlockAverages};
use stylet_identify::likelihood::FitData;
use stylet_identify::model::{Assumptions, Model};
use stylet_identify::noise::Noise;
use stylet_record::Recording;
use stylet_tissue::{CoulombFriction, Layer, Tissue};

/// Advance by 30 mm in 6 s at 200 Hz, alternating noise of 0.02 N.
fn blocks() -> BlockAverages {
    let t: Vec<f64> = (0..1200).map(|k| f64::from(k) / 200.0).collect();
    let z = t.iter().map(|t| 0.005 * t).collect();
    let f = t.iter().enumerate().map(|(k, t)| 0.5 * t + if k % 2 == 0 { 0.02 } else { -0.02 }).collect();
    BlockAverages::new(&Recording::new(t, z, f).expect("a recording"), &[], BLOCK_S)
}

/// A diagnosis with the fields that a band uses.
fn diagnosis() -> Diagnosis {
    let base = |layer: usize, name: &str, value: f64, half: f64| {
        serde_json::json!({"layer": layer, "name": name, "assumed": value, "value": value, "low": value - half, "high": value + half,
                           "changed": false, "at_bound": false})
    };
    let mut d: Diagnosis = serde_json::from_value(serde_json::json!({
        "verdict": "named", "causes": [], "not_identifiable": [], "data_quality": [], "search_steps": [], "advice": [],
        "base_parameters": [
            base(1, "stiffness_n_per_m", 120.0, 12.0), base(1, "friction_ns_per_m2", 5000.0, 900.0), base(1, "puncture_n", 1.2, 0.3),
            base(1, "thickness_m", 0.012, 0.001), base(2, "stiffness_n_per_m", 200.0, 8.0), base(2, "thickness_m", 0.05, 0.002),
            base(0, "surface_m", 0.002, 0.0006)
        ],
        "gain": {"held_out": true, "recordings": [], "rmse_before_n": 0.0, "rmse_after_n": 0.0, "floor_n": 0.03, "per_recording_n": []},
        "residual_structure": {"p_value": 1.0, "depends_on": [], "nats": 0.0, "share": 0.0},
        "noise": {"sd_n": 0.03, "ar": [0.0, 0.0], "from_air": false}
    }))
    .expect("a diagnosis");
    d.random_effect_sd =
        RandomEffectSd { puncture: 0.04, rupture_depth_m: 3e-4, surface_m: 2e-4, friction: 0.05 };
    d.causes = vec![Cause {
        effect: "coulomb_friction".to_owned(),
        equivalent: Vec::new(),
        confidence: 1.0,
        parameters: BTreeMap::from([("c_n_per_m".to_owned(), Estimate { value: 8.0, low: 7.0, high: 9.5 })]),
        gain_nats: 0.0,
        share: 0.0,
        ..Cause::default()
    }];
    d
}

#[test]
fn noise_values_are_equally_likely_with_the_given_sd() {
    let at = noise_values(0.7);
    assert!((at.iter().map(|x| x * x).sum::<f64>() / 9.0 - 0.49).abs() < 1e-12);
    assert!(at[4].abs() < 1e-12 && at.windows(2).all(|w| w[0] < w[1]));
    let ratio = stylet_stats::normal::quantile(0.5 / 9.0) / stylet_stats::normal::quantile(1.5 / 9.0);
    assert!((at[0] / at[1] - ratio).abs() < 1e-12 && (at[8] + at[0]).abs() < 1e-12);
}

#[test]
fn the_uncertainty_is_read_from_the_diagnosis() {
    let b = blocks();
    let within = b.within_block_sd_n();
    assert!(within > 0.005, "{within}");
    let k = Uncertainty::new(Some(&diagnosis()), std::slice::from_ref(&b));
    assert_eq!(k.floor_n, 0.03);
    assert!(
        (k.block_n - (0.03 * 0.03 - within * within).max(0.03 * 0.03 / 4.0).sqrt()).abs() < 1e-12,
        "{}",
        k.block_n
    );
    let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} for {b}");
    assert_eq!(k.components(None, &[]).len(), 6);
    let mut d = diagnosis();
    d.random_effect_sd = RandomEffectSd { surface_m: 1e-4, ..RandomEffectSd::default() };
    // Noise hardly above the scatter within a block: the lower limit applies.
    d.noise.sd_n = 1.0001 * within;
    let k = Uncertainty::new(Some(&d), std::slice::from_ref(&b));
    near(k.block_n, d.noise.sd_n / 2.0);
    assert_eq!(k.components(None, &[]), ["sensor noise", "parameter intervals", "scatter of the surface"]);
    let k = Uncertainty::new(None, &[b.clone(), b.clone()]);
    let rough = crate::base_law_fit::roughness(&[b.clone(), b]);
    near(k.floor_n, (rough * rough + within * within).sqrt());
    near(k.block_n, rough);
    assert_eq!(k.components(None, &[Factor::Needle]), ["sensor noise", "another needle"]);
}

fn model() -> Model {
    let layer = |d: f64, k: f64, f: Option<f64>| Layer {
        name: String::new(),
        thickness_m: d,
        stiffness_n_per_m: k,
        friction_ns_per_m2: 5000.0,
        puncture_n: f,
    };
    let belief = Assumptions {
        tissue: Tissue {
            surface_m: 0.002,
            layers: vec![layer(0.012, 120.0, Some(1.2)), layer(0.05, 200.0, None)],
        },
        known_effects: vec![CoulombFriction { c_n_per_m: 8.0 }.into()],
        further_effects: Vec::new(),
        tolerance: vec![0.3; 2],
        thickness_tolerance: vec![0.1; 2],
        surface_tolerance_m: 0.01,
    };
    Model::base(Arc::new(belief), 1)
}

/// Mean and standard deviation of a quantity over draws, and its correlation with another one.
fn over_draws(k: &Uncertainty, of: &dyn Fn(&Model) -> f64, other: &dyn Fn(&Model) -> f64) -> (f64, f64, f64) {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let m = model();
    let draws: Vec<Model> = (0..4000).map(|_| k.draw(&m, 0, &mut rng)).collect();
    let column = |of: &dyn Fn(&Model) -> f64| -> Vec<f64> { draws.iter().map(of).collect() };
    let (a, b) = (column(of), column(other));
    let (mean_a, mean_b) = (stylet_stats::mean(&a), stylet_stats::mean(&b));
    let product: f64 = a.iter().zip(&b).map(|(a, b)| (a - mean_a) * (b - mean_b)).sum();
    let sd = stylet_stats::sd(&a);
    (mean_a, sd, product / (3999.0 * sd * stylet_stats::sd(&b)))
}

#[test]
fn drawn_models_scatter_as_the_intervals_say() {
    let k = Uncertainty::new(Some(&diagnosis()), &[blocks()]);
    let z = stylet_stats::Z95;
    let surface = |m: &Model| m.tissue.surface_m;
    let check = |of: &dyn Fn(&Model) -> f64, mean: f64, sd: f64| {
        let (drawn, drawn_sd, correlation) = over_draws(&k, of, &surface);
        assert!((drawn - mean).abs() < 0.1 * sd, "mean {drawn} for {mean}");
        assert!((drawn_sd / sd - 1.0).abs() < 0.05, "{drawn_sd} for {sd}");
        assert!(correlation.abs() < 0.06 || correlation > 0.999, "{correlation}");
    };
    check(&surface, 0.002, 0.0006 / z);
    check(&|m| m.tissue.layers[0].stiffness_n_per_m, 120.0, 12.0 / z);
    check(&|m| m.tissue.layers[1].stiffness_n_per_m, 200.0, 8.0 / z);
    check(&|m| m.tissue.layers[0].friction_ns_per_m2, 5000.0, 900.0 / z);
    check(&|m| m.tissue.layers[0].thickness_m, 0.012, (0.001 / z).hypot(3e-4));
    check(&|m| m.tissue.layers[0].puncture_n.unwrap_or(0.0), 1.2, (0.3 / z).hypot(1.2 * 0.04));
    check(&|m| m.assumed.known_effects[0].parameters()[0], 8.0, 2.5 / (2.0 * z));
    check(&|m| m.per_recording[0].surface_m, 0.0, 2e-4);
    check(&|m| m.per_recording[0].ln_friction, 0.0, 0.05);
    // A parameter without an interval does not vary.
    assert_eq!(over_draws(&k, &|m| m.tissue.layers[1].friction_ns_per_m2, &surface).1, 0.0);
}

#[test]
fn parameters_that_trade_are_drawn_together() {
    let mut d = diagnosis();
    let parameter = |name| LabelledParameter::new(1, None, name, ParameterLabel::Determined);
    d.parameters = vec![parameter("stiffness_n_per_m"), parameter("friction_ns_per_m2")];
    d.parameters.push(LabelledParameter::new(
        0,
        Some("coulomb_friction"),
        "c_n_per_m",
        ParameterLabel::Determined,
    ));
    d.covariance = vec![vec![36.0, -1900.0, 0.0], vec![-1900.0, 160_000.0, 0.0], vec![0.0, 0.0, 0.25]];
    let k = Uncertainty::new(Some(&d), &[blocks()]);
    let stiffness = |m: &Model| m.tissue.layers[0].stiffness_n_per_m;
    let friction = |m: &Model| m.tissue.layers[0].friction_ns_per_m2;
    let (_, sd, correlation) = over_draws(&k, &stiffness, &friction);
    assert!((sd / 6.0 - 1.0).abs() < 0.05, "{sd}");
    assert!((correlation + 1900.0 / 2400.0).abs() < 0.03, "{correlation}");
    let (_, sd, correlation) = over_draws(&k, &|m| m.assumed.known_effects[0].parameters()[0], &stiffness);
    assert!((sd / 0.5 - 1.0).abs() < 0.05 && correlation.abs() < 0.06, "{sd}, {correlation}");
}

/// Lower limits: 0, a hundredth of a puncture force, a twentieth of a thickness.
#[test]
fn drawn_parameters_stay_possible() {
    let mut d = diagnosis();
    d.base_parameters.iter_mut().for_each(|b| (b.low, b.high) = (b.value * -99.0, b.value * 101.0));
    let k = Uncertainty::new(Some(&d), &[blocks()]);
    let m = model();
    let all: Vec<Model> = (0..40).map(|s| k.draw(&m, 0, &mut ChaCha8Rng::seed_from_u64(s))).collect();
    let least = |of: &dyn Fn(&Model) -> f64| all.iter().map(of).fold(f64::INFINITY, f64::min);
    assert_eq!(least(&|m| m.tissue.layers[0].stiffness_n_per_m), 0.0);
    assert_eq!(least(&|m| m.tissue.layers[0].friction_ns_per_m2), 0.0);
    assert!(least(&|m| m.tissue.layers[0].puncture_n.unwrap_or(9.0)) < 0.0121);
    assert!(least(&|m| m.tissue.layers[0].puncture_n.unwrap_or(9.0)) > 0.0);
    assert!(least(&|m| m.tissue.layers[0].thickness_m) > 2.9e-5);
}

/// A law with a misfit of 0.2 N in the middle of the advance.
#[test]
fn band_edges_are_quantiles_of_draws_noise_and_misfit() {
    let b = blocks();
    let k = Uncertainty::new(Some(&diagnosis()), std::slice::from_ref(&b));
    let m = model();
    let z: Vec<f64> = (0..1200).map(|k| 2.5e-5 * f64::from(k)).collect();
    let t = (0..1200).map(|k| f64::from(k) / 200.0).collect();
    let course = InsertionCourse::new(&Recording::new(t, z, vec![0.0; 1200]).expect("a recording"));
    let training = TrainingSummary {
        range: course.range,
        runs: Vec::new(),
        residual_rms_n: 0.2,
        discrepancy_sd_n: (0..BINS).map(|k| Some(if (30..60).contains(&k) { 0.2 } else { 0.0 })).collect(),
        correlation_s: 0.0,
        recording_sd: [0.0; 4],
    };
    let places = course.places(&b, course.range, 0.0);
    let prepared = Prepared {
        zero_offset_n: vec![None],
        names: vec![String::new()],
        data: FitData::new(Arc::new(vec![b]), Noise::white(0.03), 0.0),
        courses: vec![course],
        model: m.clone(),
        uncertainty: k.clone(),
        training: Some(&training),
    };
    let target = Target { places, mean_residual: vec![Some(0.0); BINS], ..Target::default() };
    let same = GroupEstimate::new(&[], [0.0; 4], [0.0; 4]);
    let (low, high) = prepared.band(&target, &same, [0.0; 4], false, 0.0);
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let draws: Vec<Vec<f64>> = (0..80)
        .filter_map(|_| {
            let drawn = k.draw(&m, 0, &mut rng);
            let _: [f64; 4] = std::array::from_fn(|_| StandardNormal.sample(&mut rng));
            free_run_force(&drawn, &prepared.data, 0)
        })
        .collect();
    assert_eq!(draws.len(), 80);
    for (at, misfit_n) in [(20, 0.0), (130, 0.2), (260, 0.0)] {
        let sd_n = k.block_n.hypot(misfit_n);
        let mut all: Vec<f64> = draws.iter().flat_map(|d| noise_values(sd_n).map(|x| d[at] + x)).collect();
        assert_eq!(all.len(), 80 * NOISE_VALUES);
        all.sort_by(f64::total_cmp);
        assert!((low[at] - stylet_stats::quantile_of_sorted(&all, 0.05)).abs() < 1e-12);
        assert!((high[at] - stylet_stats::quantile_of_sorted(&all, 0.95)).abs() < 1e-12);
    }
    let (wide_low, wide_high) = prepared.band(
        &target,
        &GroupEstimate::new(&[], [1e-3, 0.3, 0.3, 0.3], [0.0; 4]),
        [0.0; 4],
        true,
        0.0,
    );
    let width = |low: &[f64], high: &[f64]| low.iter().zip(high).map(|(l, h)| h - l).sum::<f64>();
    assert!(width(&wide_low, &wide_high) > 1.5 * width(&low, &high));
}
