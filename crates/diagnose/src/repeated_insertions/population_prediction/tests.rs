use super::{DRAWS, draw_force, friction_model, predict_force};
use crate::repeated_insertions::insertion_phase::phase_at;
use crate::repeated_insertions::random_effects_population::Population;
use crate::repeated_insertions::random_effects_population::tests::{population, run, tissue};
use crate::repeated_insertions::segmented_recording::SegmentedRecording;
use crate::test_fixtures;
use stylet_identify::model::{EffectTerm, Model};
use stylet_record::Recording;
use stylet_stats::normal::quantile;
use stylet_tissue::{
    DriveFriction, Effect, ForceDrift, ForceLaw, ForceLawState, PositionScale, ShaftSlip, TimeDelay,
};

#[test]
fn a_drawn_force_is_the_model_on_the_recorded_motion() {
    let p = population();
    let run = run();
    let m = p.draw(3, Some(0));
    let mut there = m.tissue.clone();
    there.surface_m += m.per_recording[0].surface_m + 1e-3;
    for layer in &mut there.layers {
        layer.friction_ns_per_m2 *= (m.per_recording[0].ln_friction + 0.2).exp();
    }
    let law = ForceLaw::new(&there, &[]).expect("a law");
    let mut state = ForceLawState::default();
    let r = &run.recording;
    let result = draw_force(&p, &run, 3, Some(0)).expect("a force");
    for i in 0..r.len() {
        let f = law.step(&mut state, r.time_s[i], r.position_m[i], r.velocity_mps[i], |_| {}).total_n;
        assert!((result[i] - f).abs() < 1e-9, "{i}: {} for {f}", result[i]);
    }
}

#[test]
fn an_unknown_day_has_a_wider_band() {
    let all = test_fixtures::simulated_recordings(&[], &[[0.008, 1e-4], [0.008, -1e-4], [0.016, 0.0]]);
    let recordings: Vec<&SegmentedRecording> = all.iter().collect();
    let fitted = test_fixtures::fit_from_truth(&[], &recordings);
    let plain = Population::from_fit(&fitted, &recordings);
    let open = plain.clone().with_parameter_uncertainty(&fitted);
    let wide = |p: &Population, day| {
        let result = predict_force(p, recordings[0], day, 8);
        (result.high_n[150] - result.low_n[150], result.mean_n)
    };
    assert_eq!(wide(&open, Some(0)), wide(&plain, Some(0)));
    let (result, without) = (wide(&open, None), wide(&plain, None));
    assert!(result.0 > 1.001 * without.0 && result.1 == without.1, "{} {}", result.0, without.0);
    assert!(result.0 < 2.0 * without.0);
}

#[test]
fn the_band_contains_ninety_per_cent_of_draws_and_residuals() {
    let mut p = population();
    let run = run();
    let first = |k: usize| super::draw_force_and_rupture(&p, &run, k, Some(0)).expect("a force");
    let forces: Vec<(Vec<f64>, f64)> = (1..=12).map(first).collect();
    let result = predict_force(&p, &run, Some(0), 12);
    let beyond = (6.0_f64 / 4.0).sqrt();
    assert!((p.new_recording_factor() - beyond).abs() < 1e-15);
    for i in [5, 120, 250, 340, 600] {
        let mean = forces.iter().map(|f| f.0[i]).sum::<f64>() / 12.0;
        assert!((result.mean_n[i] - mean).abs() < 1e-12);
        let mut all = Vec::new();
        for (f, at) in &forces {
            let left = p.residual_n[phase_at(&run, run.recording.time_s[i], *at) as usize];
            let left = if f[i] == 0.0 { 0.01 } else { left };
            for share in [0.05, 0.15, 0.25, 0.35, 0.45, 0.55, 0.65, 0.75, 0.85, 0.95] {
                all.push(f[i] + left * quantile(share));
            }
        }
        all.sort_by(f64::total_cmp);
        assert!((result.low_n[i] - all[6]).abs() < 1e-9 && (result.high_n[i] - all[113]).abs() < 1e-9, "{i}");
    }
    assert!(
        (result.high_n[5] - result.mean_n[5] - 0.01 * quantile(0.95)).abs() < 1e-12 && forces[0].0[5] == 0.0
    );
    p.recordings = 2;
    assert!((p.new_recording_factor() - 3.0_f64.sqrt()).abs() < 1e-15);
    assert!(predict_force(&p, &run, Some(0), 0).mean_n.is_empty());
    assert_eq!(DRAWS, 64);
}

#[test]
fn the_friction_model_takes_the_number_of_punctured_layers() {
    let mut p = population();
    let run = run();
    let r = &run.recording;
    let slips: [stylet_tissue::AnyEffect; 2] =
        [1, 2].map(|layer| ShaftSlip { layer, push_n: 1.0, ..ShaftSlip::default() }.into());
    p.model.effects = slips.iter().map(|e| EffectTerm::new(e.info(), &e.parameters())).collect();
    let law = ForceLaw::new(&tissue(), &slips).expect("a law");
    for instants in [vec![], vec![2.5], vec![2.5, 5.0]] {
        let mut result = friction_model(&p, r).expect("friction");
        let mut state = ForceLawState::default();
        for i in 0..r.len() {
            let (t, z, v) = (r.time_s[i], r.position_m[i], r.velocity_mps[i]);
            let count = instants.iter().filter(|at| **at <= t).count();
            let f = law.step_imposed(&mut state, t, z, v, count, |_| {});
            let wanted = if v < 0.0 { f.friction_n } else { f.total_n - f.tip_n };
            assert!((result.step(t, z, v, count) - wanted).abs() < 1e-12, "{instants:?} {i}");
        }
    }
}

#[test]
fn a_drawn_force_includes_the_measurement_chain() {
    let run = run();
    let with = |effects: &[stylet_tissue::AnyEffect]| {
        let mut p = population();
        p.model.effects = effects.iter().map(|e| EffectTerm::new(e.info(), &e.parameters())).collect();
        draw_force(&p, &run, 3, Some(0)).expect("a force")
    };
    let plain = with(&[]);
    let drive = with(&[DriveFriction { force_n: 0.3 }.into()]);
    let r = &run.recording;
    let moving = |i: &usize| r.velocity_mps[*i].abs() > 1e-3;
    for i in (0..r.len()).filter(moving) {
        let wanted = plain[i] + 0.3 * r.velocity_mps[i].signum();
        assert!((drive[i] - wanted).abs() < 1e-9, "{i}: {} for {wanted}", drive[i]);
    }
    let drift = with(&[ForceDrift { rate_n_per_s: 0.05 }.into()]);
    for (i, t) in r.time_s.iter().enumerate() {
        assert!((drift[i] - plain[i] - 0.05 * t).abs() < 1e-9, "{i}: {}", drift[i]);
    }
    // The measured position is 10 % too long.
    let scaled = with(&[PositionScale { eps: 0.1 }.into()]);
    let mut shorter = run.clone();
    let scale = Model {
        effects: vec![EffectTerm::new(PositionScale { eps: 0.1 }.info(), &[0.1])],
        ..population().model
    };
    let to_true = scale.compile(0).expect("a law").true_over_recorded;
    assert!((to_true - 1.0).abs() > 0.05, "{to_true}");
    shorter.recording.position_m.iter_mut().for_each(|z| *z *= to_true);
    shorter.recording.velocity_mps.iter_mut().for_each(|v| *v *= to_true);
    let wanted = draw_force(&population(), &shorter, 3, Some(0)).expect("a force");
    assert!(scaled.iter().zip(&wanted).all(|(a, b)| (a - b).abs() < 1e-9));
}

#[test]
fn a_delay_is_independent_of_the_sampling_rate() {
    let at = |k: i32| f64::from(k.min(216)) / 36.0 + f64::from((k - 216).max(0)) / 20.0;
    let t: Vec<f64> = (0..1200).map(at).collect();
    let z: Vec<f64> = t.iter().map(|t| (0.005 * t).min(0.03)).collect();
    let n = t.len();
    let run = SegmentedRecording::new(
        "a".to_owned(),
        Recording::new(t, z, vec![0.0; n]).expect("clean columns"),
        2,
    );
    let with = |effects: &[stylet_tissue::AnyEffect]| {
        let mut p = population();
        p.model.effects = effects.iter().map(|e| EffectTerm::new(e.info(), &e.parameters())).collect();
        draw_force(&p, &run, 3, Some(0)).expect("a force")
    };
    let (plain, late) = (with(&[]), with(&[TimeDelay { delay_s: 2.0 }.into()]));
    for i in 73..216 {
        assert!((late[i] - plain[i - 72]).abs() < 1e-6, "{i}: {} for {}", late[i], plain[i - 72]);
    }
    assert!(late[200] < plain[200] - 0.1);
}
