use super::{PRIMES, Population, halton, normal_quantiles, residual_quantiles, sample_noise_n};
use crate::repeated_insertions::insertion_phase::{InsertionPhase, phase_at};
use crate::repeated_insertions::segmented_recording::SegmentedRecording;
use crate::test_fixtures;
use std::sync::Arc;
use stylet_identify::model::{Assumptions, DayParameters, EffectTerm, Model, NO_RUPTURE};
use stylet_record::Recording;
use stylet_stats::student_t;
use stylet_tissue::{DelayedPuncture, Effect, Layer, ReleaseDepth, ShaftSlip, Tissue};

pub(crate) fn tissue() -> Tissue {
    let layer = |k: f64, f: f64| Layer {
        name: String::new(),
        thickness_m: 0.02,
        stiffness_n_per_m: k,
        friction_ns_per_m2: 4000.0,
        puncture_n: Some(f),
    };
    Tissue { surface_m: 0.002, layers: vec![layer(150.0, 1.1), layer(220.0, 1.9)] }
}

#[test]
fn halton_points_are_radical_inverses() {
    // 6 is 110 in base 2, 11 is 102 in base 3, 23 is 43 in base 5.
    assert_eq!(halton(6, 2), 0.375);
    assert!((halton(11, 3) - (2.0 / 3.0 + 1.0 / 27.0)).abs() < 1e-15);
    assert!((halton(23, 5) - (3.0 / 5.0 + 4.0 / 25.0)).abs() < 1e-15);
    assert_eq!(halton(0, 7), 0.0);
}

pub(crate) fn population() -> Population {
    let belief = Assumptions {
        tissue: tissue(),
        known_effects: Vec::new(),
        further_effects: Vec::new(),
        tolerance: vec![0.3; 2],
        thickness_tolerance: vec![0.1; 2],
        surface_tolerance_m: 0.01,
    };
    let mut law = Model::base(Arc::new(belief), 0);
    (law.scatter.surface_m, law.scatter.ln_friction, law.scatter.rupture_force) = (3e-4, 0.07, 0.05);
    (law.scatter.day_surface_m, law.scatter.day_ln_friction) = (7e-4, 0.11);
    (law.free.recording_surface, law.free.recording_friction, law.free.day_surface, law.free.day_friction) =
        (true, true, true, true);
    law.days = vec![DayParameters { surface_m: 1e-3, ln_friction: 0.2 }];
    let residual_n = [0.03, 0.05, 0.02, 0.07];
    let pieces_n = residual_n.map(normal_quantiles);
    Population {
        model: law,
        residual_n,
        residual_quantiles_n: pieces_n,
        air_quantiles_n: normal_quantiles(0.01),
        recordings: 5,
        days: 1,
        parameter_information: None,
    }
}

/// Advance by 30 mm in 6 s, hold of 2 s, retraction.
pub(crate) fn run() -> SegmentedRecording {
    let t: Vec<f64> = (0..700).map(|k| 0.02 * f64::from(k)).collect();
    let z = t.iter().map(|t| {
        if *t < 6.0 {
            0.005 * t
        } else if *t < 8.0 {
            0.03
        } else {
            0.03 - 0.005 * (t - 8.0)
        }
    });
    let z: Vec<f64> = z.collect();
    let f = z.iter().map(|z| 100.0 * z).collect();
    SegmentedRecording::new("one".to_owned(), Recording::new(t, z, f).expect("clean columns"), 2)
}

/// Dimensions of the Halton sequence: surface, friction, puncture force of each layer, effect
/// parameters, day; Student's distribution, widened for a new recording.
#[test]
fn random_effects_follow_the_halton_sequence() {
    let mut p = population();
    let wide = (6.0_f64 / 4.0).sqrt();
    // Four random effects, five recordings.
    let n = |k: usize, dimension: usize| student_t::quantile(halton(k, PRIMES[dimension]), 16.0) * wide;
    // One day with a prior of four.
    let day =
        |k: usize, dimension: usize| student_t::quantile(halton(k, PRIMES[dimension]), 4.0) * 2.0_f64.sqrt();
    for k in [1, 7, 50] {
        let m = p.draw(k, None);
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-12 * (1.0 + b.abs()), "{k}: {a} for {b}");
        near(m.per_recording[0].surface_m, 3e-4 * n(k, 0));
        near(m.per_recording[0].ln_friction, 0.07 * n(k, 1));
        near(m.tissue.layers[0].puncture_n.unwrap_or(0.0), 1.1 * (1.0 + 0.05 * n(k, 2)));
        near(m.tissue.layers[1].puncture_n.unwrap_or(0.0), 1.9 * (1.0 + 0.05 * n(k, 3)));
        near(m.days[1].surface_m, 7e-4 * day(k, 4));
        near(m.days[1].ln_friction, 0.11 * day(k, 5));
        assert_eq!(
            (m.day_of.as_slice(), m.rupture_times_s.as_slice()),
            (&[1][..], &[vec![NO_RUPTURE; 2]][..])
        );
        assert_eq!(p.draw(k, Some(0)).day_of, [0]);
        assert_eq!(p.draw(k, Some(0)).days.len(), 1);
    }
    p.recordings = 1;
    let open = p.draw(7, None).per_recording[0].surface_m / (3e-4 * student_t::quantile(halton(7, 2), 4.0));
    assert!((open - 3.0_f64.sqrt()).abs() < 1e-12, "{open}");
    p.days = 3;
    let open = p.draw(7, None).days[1].surface_m / (7e-4 * student_t::quantile(halton(7, PRIMES[4]), 6.0));
    assert!((open - (4.0_f64 / 3.0).sqrt()).abs() < 1e-12, "{open}");
    p.days = 1;
    p.recordings = 5;
    p.model.free = stylet_identify::model::FreeParameters::default();
    let m = p.draw(7, None);
    assert_eq!(
        (
            m.per_recording[0].surface_m,
            m.per_recording[0].ln_friction,
            m.days[1].surface_m,
            m.days[1].ln_friction
        ),
        (0.0, 0.0, 0.0, 0.0)
    );
    // Forces have a lower limit of a fifth.
    p.model.scatter.rupture_force = 9.0;
    let k = (1..200).find(|k| halton(*k, PRIMES[2]) < 0.2).expect("a low point");
    assert!((p.draw(k, None).tissue.layers[0].puncture_n.unwrap_or(0.0) - 0.22).abs() < 1e-12);
}

#[test]
fn a_delayed_puncture_scatters_with_its_layer() {
    let mut p = population();
    let effects: [stylet_tissue::AnyEffect; 3] = [
        ShaftSlip { layer: 1, push_n: 1.0, ..ShaftSlip::default() }.into(),
        DelayedPuncture { layer: 2, force_n: 2.0, exponent: 9.0 }.into(),
        ReleaseDepth { layer: 1, depth_m: 1e-3 }.into(),
    ];
    p.model.effects = effects.iter().map(|e| EffectTerm::new(e.info(), &e.parameters())).collect();
    p.model.free.recording_effects = true;
    p.model.scatter.varying[0] = 4e-4;
    let m = p.draw(9, Some(0));
    let wide = (6.0_f64 / 4.0).sqrt();
    let n = |dimension: usize| student_t::quantile(halton(9, PRIMES[dimension]), 20.0) * wide;
    let force = m.effects[1].values[1];
    assert!((force - 2.0 * (1.0 + 0.05 * n(3))).abs() < 1e-12, "{force}");
    let differing = p.model.varying_parameters().count();
    assert!(differing > 0);
    for k in 0..differing {
        assert!((m.per_recording[0].varying[k] - p.model.varying_sd(k) * n(4 + k)).abs() < 1e-15);
    }
}

#[test]
fn sample_noise_is_estimated_about_local_lines() {
    // Alternating noise of 0.02 about a ramp; the residual of its line of eight samples is computed
    // below.
    let t: Vec<f64> = (0..83).map(|k| 0.1 * f64::from(k)).collect();
    let f: Vec<f64> =
        t.iter().enumerate().map(|(k, t)| 1.0 + 0.3 * t + if k % 2 == 0 { 0.02 } else { -0.02 }).collect();
    let r = Recording::new(t, vec![0.0; 83], f).expect("clean columns");
    // sum (k - 3.5)(-1)^k = -4 and sum (k - 3.5)^2 = 42: the line takes 16/42 of 8.
    let wanted = 0.02 * ((8.0 - 16.0 / 42.0) / 8.0_f64 * 8.0 / 6.0).sqrt();
    assert!((sample_noise_n(&r) / wanted - 1.0).abs() < 1e-9, "{} for {wanted}", sample_noise_n(&r));
}

/// By hand: of sizes 0 to 10 a tenth is below 1, and so on; noise of 1 contributes the normal quantiles
/// 0.1257 to 1.6449.
#[test]
fn residual_quantiles_follow_the_empirical_distribution() {
    let left: Vec<f64> = (0..=10).map(|k| if k % 2 == 0 { f64::from(k) } else { -f64::from(k) }).collect();
    let near = |result: [f64; 10], wanted: [f64; 5]| {
        for k in 0..5 {
            let (low, high) = (result[4 - k], result[5 + k]);
            assert!((high - wanted[k]).abs() < 1e-3 && (low + wanted[k]).abs() < 1e-3, "{result:?}");
        }
    };
    let noise = [0.1257, 0.3853, 0.6745, 1.0364, 1.6449];
    near(residual_quantiles(&left, 0.0), [1.0, 3.0, 5.0, 7.0, 9.0]);
    near(residual_quantiles(&left, 1.0), std::array::from_fn(|k| f64::hypot(2.0 * k as f64 + 1.0, noise[k])));
    near(residual_quantiles(&[], 1.0), noise);
    // Few outliers do not widen the band.
    let spikes: Vec<f64> = left.iter().map(|e| if e.abs() < 10.0 { *e } else { 100.0 * e }).collect();
    near(residual_quantiles(&spikes, 0.0), [1.0, 3.0, 5.0, 7.0, 9.0]);
}

#[test]
fn the_residual_is_estimated_by_phase() {
    let all = test_fixtures::simulated_recordings(&[], &[[0.004, 0.0], [0.008, 0.0]]);
    let recordings: Vec<&SegmentedRecording> = all.iter().collect();
    let mut fitted = test_fixtures::fit_from_truth(&[], &recordings);
    for (r, e) in fitted.fit.residuals.residual_n.iter_mut().enumerate() {
        e.iter_mut().enumerate().for_each(|(k, e)| *e = 1e-3 * ((k * (r + 3)) % 17) as f64);
    }
    let mut blocks = fitted.data.recordings.to_vec();
    blocks[1].used[20..30].fill(false);
    fitted.data = fitted.data.with_recordings(blocks);
    let noise_n = 0.5 * (sample_noise_n(&all[0].recording) + sample_noise_n(&all[1].recording));
    // Two blocks with no modelled force, in one of them up to rounding errors.
    for (k, predicted_n) in [(3, 0.0), (4, 1e-9)] {
        fitted.fit.residuals.residual_n[0][k] = fitted.data.recordings[0].force_n[k] - predicted_n;
    }
    let expected = |r: usize, k: usize| (r, k) != (0, 3) && (r, k) != (0, 4);
    let air: Vec<f64> = fitted.fit.residuals.residual_n[0][3..5].to_vec();
    let result = Population::from_fit(&fitted, &recordings);
    assert_eq!(result.air_quantiles_n, residual_quantiles(&air, noise_n));
    for wanted in
        [InsertionPhase::Loading, InsertionPhase::Cutting, InsertionPhase::Hold, InsertionPhase::Retraction]
    {
        let mut e = Vec::new();
        for (r, b) in fitted.data.recordings.iter().enumerate() {
            let first = fitted.fit.model.rupture_times_s[r][0];
            let here = |k: &usize| {
                expected(r, *k)
                    && phase_at(recordings[r], 0.5 * (b.start_s[*k] + b.end_s[*k]), first) == wanted
            };
            e.extend(
                (0..b.len())
                    .filter(|k| b.used[*k])
                    .filter(here)
                    .map(|k| fitted.fit.residuals.residual_n[r][k]),
            );
        }
        assert!(e.len() > 10, "{wanted:?}");
        let square = e.iter().map(|e| e * e).sum::<f64>() / e.len() as f64 + noise_n * noise_n;
        assert!((result.residual_n[wanted as usize] - square.sqrt()).abs() < 1e-12, "{wanted:?}");
        assert_eq!(
            result.residual_quantiles_n[wanted as usize],
            residual_quantiles(&e, noise_n),
            "{wanted:?}"
        );
    }
    assert_eq!((result.recordings, result.model.per_recording.len()), (2, 0));
}
