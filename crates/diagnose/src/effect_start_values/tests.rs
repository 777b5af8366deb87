use super::*;
use crate::repeated_insertions::multistart_fit::SetFit;
use crate::test_fixtures::{
    assumed_layers, blocks_of, data_of, fit_from_truth, fit_simulated, recordings_with_added_force,
};
use stylet_identify::fit::Fit;
use stylet_identify::likelihood::residuals;
use stylet_identify::model::Model;
use stylet_tissue::{
    AnyEffect, CoulombFriction, ForceDrift, HiddenMembrane, RateDependentPuncture, Respiration,
};

/// Speeds (m/s) and surface shifts (m) of the insertions.
const AT: [[f64; 2]; 3] = [[2e-3, 3e-4], [3e-3, -3e-4], [4e-3, 0.0]];

/// Insertions with these effects, fitted without them.
fn fitted_without(effects: &[AnyEffect]) -> SetFit {
    fit_simulated(&[], effects, &AT, |_| 0.0)
}

/// All start values for these recordings, and the first of one effect.
fn proposed(f: &SetFit, lines: &[f64], id: &str) -> (Vec<Vec<EffectStart>>, Option<EffectStart>) {
    let prepared = PreparedRecordings::new(f.fit.model.assumed.clone(), f.data.recordings.to_vec(), 0.0);
    let all = effect_starts(&ScoreTest::new(&f.fit, &f.data), &prepared, lines);
    let starts = all.iter().find(|s| s[0].choice.info.id == id).map(|s| s[0].clone());
    (all, starts)
}

/// Recordings with an added sensor force, fitted without it.
fn fitted_without_added_force(more_n: impl Fn(f64) -> f64) -> SetFit {
    fit_simulated(&[], &[], &AT, more_n)
}

#[test]
fn at_most_two_starts_per_effect_in_order_of_gain() {
    let f = fitted_without_added_force(|t| 0.02 * t);
    let (all, starts) = proposed(&f, &[], "force_drift");
    let starts = starts.expect("a drift");
    assert!((starts.choice.values[0] - 0.02).abs() < 2e-3, "{:?}", starts.choice.values);
    assert!(starts.gain_nats > 1.0 && all.iter().all(|s| s.len() <= 2));
    assert!(all.windows(2).all(|w| w[0][0].gain_nats >= w[1][0].gain_nats));
    assert!(all.iter().all(|s| s.windows(2).all(|w| w[0].gain_nats >= w[1].gain_nats)));
    assert!(proposed(&f, &[], "periodic_interference").1.is_none(), "no line, no tone");
    // An effect that the model includes is not proposed again.
    let runs = recordings_with_added_force(&[], &AT, |t| 0.02 * t);
    let drift: AnyEffect = ForceDrift { rate_n_per_s: 0.02 }.into();
    let f = fit_from_truth(&[drift], &runs.iter().collect::<Vec<_>>());
    assert!(proposed(&f, &[], "force_drift").1.is_none());
    let bias = proposed(&fitted_without_added_force(|_| -0.1), &[], "force_bias").1.expect("a bias");
    assert!((bias.choice.values[0] + 0.1).abs() < 0.02, "{:?}", bias.choice.values);
}

#[test]
fn tone_starts_with_amplitude_and_phase_at_the_detected_frequency() {
    for (amplitude_n, phase_rad) in [(0.05, 0.7), (0.03, -2.1)] {
        let f =
            fitted_without_added_force(|t| amplitude_n * (std::f64::consts::TAU * 1.7 * t + phase_rad).sin());
        let start = proposed(&f, &[1.7], "periodic_interference").1.expect("a tone");
        let v = &start.choice.values;
        assert!((v[0] / amplitude_n - 1.0).abs() < 0.1, "{v:?}");
        assert!(v[1] == 1.7 && (v[2] - phase_rad).abs() < 0.1, "{v:?}");
    }
}

#[test]
fn breathing_starts_near_its_frequency_amplitude_and_phase() {
    let breathing_starts = Respiration { amplitude_m: 1.5e-4, frequency_hz: 0.4, phase_rad: 0.9 };
    let f = fitted_without(&[breathing_starts.into()]);
    let start = proposed(&f, &[], "respiration").1.expect("a breath");
    let v = &start.choice.values;
    assert!((v[1] - 0.4).abs() < 0.03, "{v:?}");
    assert!((v[0] / 1.5e-4 - 1.0).abs() < 0.3, "{v:?}");
    // At mid-recording the phase is that of the breathing motion, whatever the grid frequency.
    let at = |hz: f64, phase: f64| std::f64::consts::TAU * hz * 7.0 + phase;
    assert!((at(v[1], v[2]) - at(0.4, 0.9)).cos() > 0.8, "{v:?}");
}

/// Before the rupture the force is stiffness times depth plus friction times speed times depth.
#[test]
fn force_derivatives_are_stiffness_and_friction() {
    let f = fitted_without(&[]);
    let (fz, fv) = force_derivatives(&ScoreTest::new(&f.fit, &f.data)).expect("slopes");
    let model = &f.fit.model;
    let layer = &model.tissue.layers[0];
    let mut count = 0;
    for (r, b) in f.data.recordings.iter().enumerate() {
        let friction = layer.friction_ns_per_m2 * model.per_recording[r].ln_friction.exp();
        let surface_m = model.tissue.surface_m + model.per_recording[r].surface_m;
        for k in 0..b.len() {
            let (z, v) = b.motion.at(0.5 * (b.start_s[k] + b.end_s[k]));
            let inside = z - surface_m;
            if v > 1e-3 && (1e-3..5e-3).contains(&inside) {
                let (wanted_z, wanted_v) = (layer.stiffness_n_per_m + friction * v, friction * inside);
                assert!((fz[r][k] / wanted_z - 1.0).abs() < 0.05, "{} for {wanted_z}", fz[r][k]);
                assert!((fv[r][k] / wanted_v - 1.0).abs() < 0.05, "{} for {wanted_v}", fv[r][k]);
                count += 1;
            } else if inside < -1e-3 {
                assert_eq!((fz[r][k], fv[r][k]), (0.0, 0.0));
            }
        }
    }
    assert!(count > 50, "{count}");
}

/// A membrane that starts at 2 mm and breaks after 3 mm leaves a rise and a drop without a layer.
#[test]
fn membrane_starts_at_the_rise_and_drop_of_the_force() {
    let membrane = HiddenMembrane { depth_m: 2e-3, stiffness_n_per_m: 120.0, puncture_n: 0.36 };
    let f = fitted_without(&[membrane.into()]);
    let start = proposed(&f, &[], "hidden_membrane").1.expect("a membrane");
    let v = &start.choice.values;
    // It breaks at 5 mm; the grid of depths has a step of one millimetre.
    assert!((v[0] + v[2] / v[1] - 5e-3).abs() < 1.1e-3, "{v:?}");
    assert!(v[1] > 30.0 && v[1] < 400.0, "{v:?}");
    assert!(start.gain_nats > 20.0 && start.detectable_nats > 0.0);
}

/// Start values have a non-zero strength, of the sign that the effect allows.
#[test]
fn every_start_has_a_strength() {
    let membrane = HiddenMembrane { depth_m: 2e-3, stiffness_n_per_m: 120.0, puncture_n: 0.36 };
    let inside = |t: f64| if t > 3.0 { 0.1 } else { 0.0 };
    for f in [
        fitted_without_added_force(|t| 0.02 * t),
        fitted_without_added_force(inside),
        fitted_without_added_force(|t| -inside(t)),
        fitted_without(&[membrane.into()]),
    ] {
        let (all, _) = proposed(&f, &[], "");
        assert!(all.len() > 3);
        for s in all.iter().flatten() {
            let strong = |(p, x): (&stylet_tissue::ParameterInfo, &f64)| {
                p.strength && (x - p.inactive).abs() > 1e-12 && *x < 1e9
            };
            assert!(
                s.choice.info.parameters.iter().zip(&s.choice.values).any(strong),
                "{} {:?}",
                s.choice.info.id,
                s.choice.values
            );
        }
    }
}

fn info(id: &str) -> &'static EffectInfo {
    stylet_tissue::effect_info(id).expect("in the library")
}

/// Contribution of an effect to the force, without its influence on rupture times.
fn force(look: &ScoreTest, choice: &EffectTerm) -> JacobianColumn {
    let mut column = look.effect_column(choice).expect("a column");
    column.rupture_rows.iter_mut().for_each(|r| r.fill(0.0));
    column
}

/// The gain equals that of the sine and cosine columns together, and so do amplitude and phase.
#[test]
fn breathing_gain_is_that_of_its_sine_and_cosine() {
    let breathing_starts = Respiration { amplitude_m: 1.5e-4, frequency_hz: 0.4, phase_rad: 0.9 };
    let f = fitted_without(&[breathing_starts.into()]);
    let look = ScoreTest::new(&f.fit, &f.data);
    let starts = super::breathing_starts(info("respiration"), &look);
    let longest = f.data.recordings.iter().map(|b| b.span_s().1 - b.span_s().0).fold(0.0, f64::max);
    assert_eq!(starts.len(), (1.15 * longest / 0.6) as usize);
    for (k, s) in starts.iter().enumerate() {
        let [amplitude, hz, phase] = s.choice.values[..] else { unreachable!("three parameters") };
        assert!((hz - 0.05 - k as f64 * 0.6 / longest).abs() < 1e-12, "{hz}");
        let columns = [0.0, 0.5 * std::f64::consts::PI]
            .map(|phase| force(&look, &EffectTerm::new(s.choice.info, &[1e-6, hz, phase])));
        let gain = look.gain(&columns);
        assert!((s.gain_nats / gain.nats - 1.0).abs() < 0.01, "{hz}: {} for {}", s.gain_nats, gain.nats);
        let (a, b) = (1e-6 * gain.coefficients[0], 1e-6 * gain.coefficients[1]);
        let off = (amplitude * phase.cos() - a).hypot(amplitude * phase.sin() - b);
        assert!(off < 0.01 * a.hypot(b), "{hz}: {amplitude} {phase} for {a} {b}");
    }
}

/// Motion in air, and a residual of zero.
#[test]
fn zero_amplitude_gives_no_start() {
    let t: Vec<f64> = (0..600).map(|k| 0.02 * f64::from(k)).collect();
    let z = t.iter().map(|t| -0.05 + 1e-3 * t).collect();
    let data = data_of(vec![blocks_of(t, z, vec![0.0; 600])], 0.02);
    let model = Model::base(assumed_layers(&[[0.02, 100.0, 1000.0]]), 1);
    let fit = Fit { residuals: residuals(&model, &data).expect("a replay"), model };
    let look = ScoreTest::new(&fit, &data);
    assert!(super::breathing_starts(info("respiration"), &look).is_empty());
    assert!(super::tone_starts(info("periodic_interference"), &look, &[1.7]).is_empty());
}

#[test]
fn dry_friction_has_no_speed_derivative_at_rest() {
    let dry_friction: AnyEffect = CoulombFriction { c_n_per_m: 50.0 }.into();
    let f =
        fit_simulated(std::slice::from_ref(&dry_friction), std::slice::from_ref(&dry_friction), &AT, |_| 0.0);
    let (_, fv) = force_derivatives(&ScoreTest::new(&f.fit, &f.data)).expect("slopes");
    let mut rests = 0;
    for (fv, b) in fv.iter().zip(f.data.recordings.iter()) {
        for (k, slope) in fv.iter().enumerate() {
            let (z, v) = b.motion.at(0.5 * (b.start_s[k] + b.end_s[k]));
            rests += usize::from(v == 0.0 && z > 0.01);
            assert!(slope.abs() < 1e5, "{slope} at {z}");
        }
    }
    assert!(rests > 10, "{rests}");
}

#[test]
fn columns_of_the_wrong_sign_are_dropped_for_one_sided_effects() {
    let f = fitted_without(&[CoulombFriction { c_n_per_m: 50.0 }.into()]);
    let look = ScoreTest::new(&f.fit, &f.data);
    let started = |id: &str, group: &[&[f64]], coefficients: &[f64]| {
        let columns: Vec<_> =
            group.iter().filter_map(|v| look.effect_column(&EffectTerm::new(info(id), v))).collect();
        let gain = ScoreTestResult {
            nats: 7.0,
            coefficients: coefficients.to_vec(),
            detectable_nats: 1.0,
            unexplained_share: 1.0,
        };
        super::start(info(id), &look, group, &columns, gain)
    };
    for (id, values, adds) in [
        ("coulomb_friction", [1.0], true),
        ("needle_compliance", [1500.0], true),
        ("force_bias", [0.1], false),
        ("asymmetric_friction", [0.01], false),
    ] {
        assert_eq!(started(id, &[&values], &[0.5]).map(|s| s.gain_nats), Some(7.0), "{id}");
        assert_eq!(started(id, &[&values], &[0.0]).is_none(), adds, "{id}");
        assert_eq!(started(id, &[&values], &[-0.5]).is_none(), adds, "{id}");
    }
    let group: [&[f64]; 2] = [&[1.0, 1.0, 2e-3], &[0.0, 1.0, 2e-3]];
    let both = |a, b| started("stribeck_friction", &group, &[a, b]);
    assert_eq!(both(2.0, 0.5).map(|s| s.choice.values), Some(vec![2.0, 2.5, 2e-3]));
    let first =
        super::start_of_columns(info("stribeck_friction"), &look, &group[..1]).expect("more friction");
    assert!(first.gain_nats > 1.0 && first.choice.values[0] == first.choice.values[1]);
    let second =
        super::start_of_columns(info("stribeck_friction"), &look, &group[1..]).expect("more at low speed");
    for (a, b, alone) in [(2.0, 0.0, &first), (-2.0, 3.0, &second), (0.0, 3.0, &second)] {
        let starts = both(a, b).expect("the other one");
        assert_eq!((starts.gain_nats, &starts.choice.values), (alone.gain_nats, &alone.choice.values));
    }
    assert!(both(-2.0, -0.5).is_none());
}

#[test]
fn rupture_effects_start_from_their_own_model() {
    let later = RateDependentPuncture { alpha: 0.4 };
    let (all, starts) = proposed(&fitted_without(&[later.into()]), &[], "rate_dependent_puncture");
    assert!(starts.expect("a start").model.is_some());
    let at_ruptures = |s: &EffectStart| s.choice.info.stage == stylet_tissue::ChainStage::Puncture;
    assert!(all.iter().flatten().all(|s| s.model.is_none() || at_ruptures(s)));
}

/// Starts of a breaking membrane with force drops at these depths (m) and times (s).
fn starts_with_drops(f: &SetFit, drops: &[(f64, f64)]) -> Vec<EffectStart> {
    let surface_m = f.fit.model.tissue.surface_m;
    let drop = |&(depth_m, time_s): &(f64, f64)| ForceDrop {
        time_s,
        position_m: surface_m + depth_m,
        size_n: 0.3,
        score: 9.0,
    };
    let mut prepared = PreparedRecordings::new(f.fit.model.assumed.clone(), f.data.recordings.to_vec(), 0.0);
    prepared.drops = vec![drops.iter().map(drop).collect(), Vec::new(), Vec::new()];
    super::break_starts(info("hidden_membrane"), &ScoreTest::new(&f.fit, &f.data), &prepared)
}

/// Depths (m) at which the starts break.
fn depths(starts: &[EffectStart]) -> Vec<f64> {
    starts.iter().map(|s| &s.choice.values).map(|v| v[0] + v[2] / v[1]).collect()
}

#[test]
fn breaking_element_gains_until_it_breaks() {
    let membrane = HiddenMembrane { depth_m: 2e-3, stiffness_n_per_m: 120.0, puncture_n: 0.36 };
    let f = fit_simulated(&[], &[membrane.into()], &AT.map(|[speed, _]| [speed, 0.0]), |_| 0.0);
    let look = ScoreTest::new(&f.fit, &f.data);
    let starts = starts_with_drops(&f, &[]);
    assert_eq!(starts.len(), 2);
    assert!(starts[0].gain_nats >= starts[1].gain_nats);
    for s in &starts {
        let v = &s.choice.values;
        // So weak that it breaks there without moving a layer boundary.
        let broken = EffectTerm::new(s.choice.info, &[v[0], 1e-3, 1e-3 * v[2] / v[1]]);
        let gain = look.gain(&[force(&look, &broken)]);
        // Except for the block in which it breaks.
        assert!((s.gain_nats / gain.nats - 1.0).abs() < 0.15, "{} for {}", s.gain_nats, gain.nats);
        assert!((1e-3 * gain.coefficients[0] / v[1] - 1.0).abs() < 0.15, "{v:?}");
    }
}

#[test]
fn breaks_are_tried_at_unassigned_drops_and_on_a_grid() {
    let membrane = HiddenMembrane { depth_m: 2.25e-3, stiffness_n_per_m: 120.0, puncture_n: 0.36 };
    let f = fitted_without(&[membrane.into()]);
    let rupture_s = f.fit.model.rupture_times_s[0][0];
    let at = 5.25e-3;
    let breaks_at = |drops: &[(f64, f64)]| depths(&starts_with_drops(&f, drops))[0];
    let whole = breaks_at(&[]);
    assert!((whole - 5e-3).abs() < 1e-9, "{whole}");
    // A drop within 0.15 s of a rupture is assigned to its layer.
    for (apart_s, selected) in [(-0.14, true), (0.14, true), (-0.16, false), (0.16, false)] {
        let starts = breaks_at(&[(at, rupture_s + apart_s)]);
        assert!((starts - if selected { whole } else { at }).abs() < 1e-9, "{apart_s}: {starts}");
    }
    // Drops within 0.3 mm are merged into the first.
    for (before_m, wanted_m) in [(2.5e-4, at - 2.5e-4), (3.5e-4, at)] {
        let starts = breaks_at(&[(at, 1.0), (at - before_m, 1.0)]);
        assert!((starts - wanted_m).abs() < 1e-9, "{starts}");
    }
}

#[test]
fn breaks_are_tried_at_drops_common_to_all_recordings() {
    let f = fitted_without(&[]);
    let surface_m = f.fit.model.assumed.tissue.surface_m;
    let drop = |(depth_m, size_n): (f64, f64)| ForceDrop {
        time_s: 1.0,
        position_m: surface_m + depth_m,
        size_n,
        score: 9.0,
    };
    let mut prepared = PreparedRecordings::new(f.fit.model.assumed.clone(), f.data.recordings.to_vec(), 0.0);
    let starts = |prepared: &PreparedRecordings| {
        let at = |c: &EffectTerm| (c.values[0] + c.values[2] / c.values[1], c.values[2]);
        super::starts_at_common_drops(info("hidden_membrane"), prepared).iter().map(at).collect::<Vec<_>>()
    };
    // One place within three millimetres, another one missing in a recording.
    prepared.drops = [[(5e-3, 0.2), (12e-3, 0.9)], [(6e-3, 0.3), (20e-3, 0.9)], [(7e-3, 0.4), (12e-3, 0.9)]]
        .map(|of| of.map(drop).to_vec())
        .to_vec();
    let found = starts(&prepared);
    // Only stretches of 0.8 and 3 mm are shorter than the depth.
    assert_eq!(found.len(), 2);
    for (depth_m, size_n) in found {
        assert!((depth_m - 6e-3).abs() < 1e-9 && (size_n - 0.3).abs() < 1e-9, "{depth_m} {size_n}");
    }
    prepared.drops[1].clear();
    assert_eq!(starts(&prepared), []);
}

#[test]
fn breaking_elements_lie_within_the_travelled_tissue() {
    let whole = HiddenMembrane { depth_m: 5e-3, stiffness_n_per_m: 120.0, puncture_n: 9.0 };
    let at_surface = HiddenMembrane { depth_m: 0.0, stiffness_n_per_m: 120.0, puncture_n: 0.36 };
    for membrane in [whole, at_surface] {
        let starts = starts_with_drops(&fitted_without(&[membrane.into()]), &[]);
        assert!(!starts.is_empty());
        let ends = depths(&starts);
        assert!(
            starts.iter().zip(&ends).all(|(s, end)| s.choice.values[0] > 1e-9 && *end < 0.0121),
            "{ends:?}"
        );
    }
}
