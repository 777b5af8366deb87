//! Promise: a set of repeated insertions is explained by one law with numbers of each run's and each day's own. From insertions drawn
//! with a known law the fit finds that law, a surface that is shifted on one day, and predicts an insertion that took no part as well as
//! the insertions scatter; whatever the number of threads, with the same bits.

use rand::{Rng, SeedableRng, rngs::ChaCha8Rng};
use rand_distr::{Distribution, StandardNormal};
use stylet_diagnose::set::fitted::{Fitted, fitted};
use stylet_diagnose::set::left_out::{floor, one_left_out};
use stylet_diagnose::set::{Insertion, first};
use stylet_record::Recording;
use stylet_tissue::{AnyEffect, DelayedPuncture, Law, LawState, Layer, LetGo, ShaftSlip, Tissue};

/// Exponent of the slip in the law that draws.
const EXPONENT: f64 = 9.0;
/// Standard deviation of the sensor's noise in N.
const NOISE_N: f64 = 0.02;
/// Shift of the surface on the second day, in m.
const SHIFT_M: f64 = 1.5e-3;

fn believed() -> Tissue {
    let layer = Layer {
        name: "gel".into(),
        thickness_m: 0.08,
        stiffness_n_per_m: 100.0,
        friction_ns_per_m2: 0.0,
        puncture_n: None,
    };
    Tissue { surface_m: 0.004, layers: vec![layer] }
}

/// One insertion by 25 mm, a hold of 5 s, and back.
fn insertion(name: String, speed_mps: f64, shift_m: f64, rng: &mut impl Rng) -> Insertion {
    let mut normal = || -> f64 { StandardNormal.sample(rng) };
    let (surface, friction, tough) = (1e-4 * normal(), 0.03 * normal(), 0.03 * normal());
    let mut tissue = believed();
    tissue.surface_m += shift_m + surface;
    let mut slip = ShaftSlip {
        layer: 1,
        push_n: 1.8 * friction.exp(),
        pull_n: 1.1 * friction.exp(),
        kept: 0.7,
        exponent: EXPONENT,
        curve_n_per_m2: 3e4,
        fractions: [0.15, 0.2],
        time_constants_s: [1.0, 9.0],
        ..ShaftSlip::default()
    };
    slip.rate = -0.05;
    let effects: [AnyEffect; 3] = [
        slip.into(),
        DelayedPuncture { layer: 1, force_n: 3.0 * (1.0 + tough), exponent: 12.0 }.into(),
        LetGo { layer: 1, depth_m: 1e-3 + 2e-4 * normal() }.into(),
    ];
    let law = Law::new(&tissue, &effects).expect("three effects");
    let travel_s = 0.025 / speed_mps;
    let (mut state, mut columns) = (LawState::default(), [vec![], vec![], vec![]]);
    for k in 0..((2.0 * travel_s + 5.5) * 100.0) as usize {
        let t = k as f64 * 0.01;
        let (z, v) = match t {
            t if t < travel_s => (speed_mps * t, speed_mps),
            t if t < travel_s + 5.0 => (0.025, 0.0),
            t if t < 2.0 * travel_s + 5.0 => (0.025 - speed_mps * (t - travel_s - 5.0), -speed_mps),
            _ => (0.0, 0.0),
        };
        let f = law.step(&mut state, t, z, v, |_| {}).total_n + NOISE_N * normal();
        columns.iter_mut().zip([t, z, f]).for_each(|(c, x)| c.push(x));
    }
    let [t, z, f] = columns;
    Insertion::new(name, Recording::new(t, z, f).expect("clean columns"), 1)
}

fn drawn(seed: u64) -> Vec<Insertion> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut out = Vec::new();
    for (speed_mps, shift_m) in [(1e-3, 0.0), (3e-3, SHIFT_M)] {
        for k in 0..4 {
            out.push(insertion(format!("{speed_mps} {k}"), speed_mps, shift_m, &mut rng));
        }
    }
    out
}

fn fit(runs: &[Insertion], threads: usize) -> Fitted {
    let runs: Vec<&Insertion> = runs.iter().collect();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    pool.install(|| fitted(&believed(), &runs, 4, &mut rng)).expect("a fit")
}

#[test]
fn a_drawn_set_gives_its_law_back_and_the_surface_that_is_shifted_on_one_day() {
    let all = drawn(7);
    let runs: Vec<&Insertion> = all.iter().collect();
    assert_eq!(first::groups(&runs), vec![vec![0, 1, 2, 3], vec![4, 5, 6, 7]]);
    assert!(runs.iter().all(|r| r.ruptures_s[0].is_finite()), "every run shows its rupture");
    let found = fit(&all, 2);
    assert!(found.rms_n() < 0.05, "{} N left", found.rms_n());
    let model = &found.fit.model;
    let slip = &model.effects[0];
    let of = |path: &str| {
        let k = slip.info.parameters.iter().position(|p| p.path == path).expect("a parameter");
        slip.values[k]
    };
    assert!((of("push_n") / 1.8 - 1.0).abs() < 0.1, "{}", of("push_n"));
    assert!((of("pull_n") / 1.1 - 1.0).abs() < 0.1, "{}", of("pull_n"));
    assert!((of("exponent") / EXPONENT - 1.0).abs() < 0.35, "{}", of("exponent"));
    let shift = model.days[1].surface_m - model.days[0].surface_m;
    assert!((shift - SHIFT_M).abs() < 3e-4, "the surface is shifted by {shift} m");
    // Without the run itself: no worse than another insertion as the predictor.
    let scores = one_left_out(&found, &runs);
    let floors: Vec<f64> = floor(&runs).into_iter().flatten().map(|f| f.0.rmse_n).collect();
    let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len() as f64;
    let errors: Vec<f64> = scores.iter().map(|s| s.rmse_n).collect();
    assert!(floors.len() == 8 && mean(&errors) < 1.1 * mean(&floors), "{errors:?} {floors:?}");
}

#[test]
fn the_fit_of_a_set_does_not_depend_on_the_number_of_threads() {
    let some: Vec<Insertion> = drawn(8).into_iter().skip(1).step_by(3).collect();
    let (one, many) = (fit(&some, 1), fit(&some, 3));
    assert_eq!(one.fit.residuals.e, many.fit.residuals.e);
    assert_eq!(one.starts, many.starts);
}
