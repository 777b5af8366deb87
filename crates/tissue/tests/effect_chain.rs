//! Promise: an absent or neutral effect leaves the base law bit for bit, effects act at their place
//! in the chain, and several act together in one simulation.

use stylet_tissue::*;

fn tissue() -> Tissue {
    let layer = |thickness_m, stiffness_n_per_m, friction_ns_per_m2, puncture_n| Layer {
        name: String::new(),
        thickness_m,
        stiffness_n_per_m,
        friction_ns_per_m2,
        puncture_n,
    };
    Tissue {
        surface_m: 0.0,
        layers: vec![layer(0.02, 50.0, 9000.0, None), layer(0.03, 70.0, 12000.0, Some(1.5))],
    }
}

/// Advance with a ripple, hold, retract: 3000 samples at 200 Hz.
fn motion() -> Vec<(f64, f64, f64)> {
    let mut z = -0.002;
    (0..3000)
        .map(|k| {
            let t = f64::from(k) / 200.0;
            let v = match k {
                0..1800 => 0.005 + 0.002 * (2.0 * t).sin(),
                1800..2200 => 0.0,
                _ => -0.004,
            };
            z += v / 200.0;
            (t, z, v)
        })
        .collect()
}

fn forces(effects: &[AnyEffect]) -> Vec<f64> {
    let law = ForceLaw::new(&tissue(), effects).expect("few effects");
    let mut out = Vec::new();
    replay(&law, motion(), |_| {}, |f| out.push(f.total_n));
    out
}

#[test]
fn neutral_effects_leave_the_base_law_bit_for_bit() {
    let base = forces(&[]);
    let neutral: Vec<AnyEffect> = vec![
        Respiration { amplitude_m: 0.0, frequency_hz: 0.25, phase_rad: 1.0 }.into(),
        NonlinearElasticity::default().into(),
        StressRelaxation { terms: vec![PronyTerm { fraction: 0.0, time_constant_s: 1.0 }] }.into(),
        IncompleteRelease::default().into(),
        CoulombFriction::default().into(),
        ToolInertia::default().into(),
    ];
    for effect in &neutral {
        assert!(effect.is_neutral(), "{}", effect.id());
    }
    let with: Vec<u64> = forces(&neutral).iter().map(|f| f.to_bits()).collect();
    let without: Vec<u64> = base.iter().map(|f| f.to_bits()).collect();
    assert_eq!(with, without);
}

#[test]
fn each_effect_of_the_tissue_changes_the_force() {
    let base = forces(&[]);
    let effects: Vec<AnyEffect> = vec![
        Respiration { amplitude_m: 1e-3, frequency_hz: 0.25, phase_rad: 0.0 }.into(),
        NonlinearElasticity { kappa_per_m: 10.0 }.into(),
        StressRelaxation { terms: vec![PronyTerm { fraction: 0.3, time_constant_s: 1.0 }] }.into(),
        IncompleteRelease { fraction: 0.3 }.into(),
        CoulombFriction { c_n_per_m: 5.0 }.into(),
    ];
    for effect in effects {
        let id = effect.id();
        let changed = forces(&[effect]);
        let rms = (base.iter().zip(&changed).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / 3000.0).sqrt();
        assert!(rms > 0.02, "{id} changes the force by only {rms} N rms");
    }
}

#[test]
fn the_order_of_the_list_does_not_matter_the_place_in_the_chain_does() {
    let a: AnyEffect = NonlinearElasticity { kappa_per_m: 10.0 }.into();
    let b: AnyEffect =
        StressRelaxation { terms: vec![PronyTerm { fraction: 0.3, time_constant_s: 1.0 }] }.into();
    assert_eq!(forces(&[a.clone(), b.clone()]), forces(&[b, a]));
}

#[test]
fn relaxation_follows_the_prony_series_while_the_needle_is_held() {
    let tissue = Tissue {
        surface_m: 0.0,
        layers: vec![Layer {
            name: String::new(),
            thickness_m: 0.1,
            stiffness_n_per_m: 100.0,
            friction_ns_per_m2: 0.0,
            puncture_n: None,
        }],
    };
    let effect = StressRelaxation { terms: vec![PronyTerm { fraction: 0.4, time_constant_s: 2.0 }] };
    let law = ForceLaw::new(&tissue, &[effect.into()]).expect("one effect");
    let mut state = ForceLawState::default();
    // A step to 10 mm, then a hold: E = 1 N.
    law.step(&mut state, 0.0, 0.01, 0.0, |_| {});
    for k in 1..=1000 {
        let t = f64::from(k) * 0.01;
        let f = law.step(&mut state, t, 0.01, 0.0, |_| {}).total_n;
        let expected = 1.0 - 0.4 * (1.0 - (-t / 2.0).exp());
        assert!((f - expected).abs() < 1e-12, "at {t} s: {f} against {expected}");
    }
}

#[test]
fn too_many_effects_are_refused() {
    let one: AnyEffect = CoulombFriction { c_n_per_m: 1.0 }.into();
    let error = ForceLaw::new(&tissue(), &vec![one; MAX_EFFECTS + 1]).expect_err("too many");
    assert!(error.to_string().contains("at most 16"), "{error}");
}
