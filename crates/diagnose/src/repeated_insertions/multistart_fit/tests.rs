use super::super::start_values::SLIP_RATE_INDEX;
use super::{
    AGREEMENT, MAX_RMS_RATIO, SAME_OPTIMUM, SET_BLOCK_S, StartValues, distinct_optima, fit_from,
    fit_with_noise_updates, move_day_trend_to_rate, set_blocks, start_values, update_scatter,
    with_initial_noise,
};
use crate::repeated_insertions::SegmentedRecording;
use crate::test_fixtures::{
    SENSOR_NOISE_SD_N, assumed_layers, fit_from_truth, gel_tissue, simulated_recordings,
};
use rand::{SeedableRng, rngs::ChaCha8Rng};
use std::sync::Arc;
use stylet_identify::fit::{Fit, Linearization};
use stylet_identify::likelihood::{FitData, residuals};
use stylet_identify::model::{DayParameters, EffectTerm, Model, ParameterRole, TiedParameter};
use stylet_identify::noise::Noise;
use stylet_record::sensor_artefacts::SensorArtefacts;
use stylet_tissue::{AnyEffect, Effect, ReleaseDepth, ShaftSlip};

/// Start values relative to their ranges, 0 to 1.
fn places(g: &StartValues) -> Vec<f64> {
    let even = |x: f64, low: f64, high: f64| (x - low) / (high - low);
    let by_factors = |x: f64, low: f64, high: f64| (x / low).ln() / (high / low).ln();
    vec![
        even(g.linear_share, 0.1, 0.9),
        even(g.hold_ratio, 0.3, 0.9),
        even(g.pull_ratio, 0.3, 0.9),
        even(g.kept_share, 0.4, 1.0),
        by_factors(g.exponent, 4.0, 18.0),
        even(g.wear_per_m[0], 0.0, 80.0),
        even(g.wear_per_m[1], 0.0, 120.0),
        even(g.rate, -0.3, 0.1),
        even(g.fractions[0], 0.02, 0.4),
        even(g.fractions[1], 0.02, 0.4),
        by_factors(g.time_constants_s[0], 0.03, 3.0),
        by_factors(g.time_constants_s[1], 4.0, 20.0),
        by_factors(g.delay_exponent, 6.0, 20.0),
        even(g.surface_m, -1.5e-3, 5e-4),
    ]
}

#[test]
fn the_first_start_is_central_and_the_others_are_uniform() {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let first = start_values(0, &mut rng);
    assert!(places(&first).iter().all(|x| (x - 0.5).abs() < 1e-12), "{:?}", places(&first));
    assert!((first.rupture_depth_m.expect("behind its front") - 1e-3).abs() < 1e-15);
    let all: Vec<StartValues> = (1..=1500).map(|k| start_values(k, &mut rng)).collect();
    for place in 0..14 {
        let mut x: Vec<f64> = all.iter().map(|g| places(g)[place]).collect();
        x.sort_by(f64::total_cmp);
        assert!(x[0] >= 0.0 && x[0] < 0.01 && x[1499] <= 1.0 && x[1499] > 0.99, "{place}");
        assert!((x[750] - 0.5).abs() < 0.05, "{place}: {}", x[750]);
    }
    // Six of ten rupture behind their front, the others at the drop.
    let behind: Vec<f64> = all.iter().filter_map(|g| g.rupture_depth_m).collect();
    assert!((behind.len() as f64 / 1500.0 - 0.6).abs() < 0.05, "{}", behind.len());
    assert!(behind.iter().all(|m| *m > 0.0 && *m <= 6e-3) && stylet_stats::mean(&behind) > 2.7e-3);
}

#[test]
fn blocks_have_the_set_length_and_omit_excluded_samples() {
    let all = simulated_recordings(&[], &[[0.004, 0.0], [0.004, 0.0]]);
    let recordings: Vec<&SegmentedRecording> = all.iter().collect();
    let n = all[0].recording.len();
    let exclude = vec![(0..n).map(|k| (100..150).contains(&k)).collect()];
    let result = set_blocks(&recordings, &SensorArtefacts { exclude, ..SensorArtefacts::default() });
    assert_eq!(result.len(), 2);
    assert!((result[0].end_s[7] - result[0].start_s[7] - SET_BLOCK_S).abs() < 1e-9);
    let excluded = |b: &stylet_identify::block_averages::BlockAverages| {
        (0..b.len()).filter(|k| !b.used[*k]).map(|k| b.end_s[k] - b.start_s[k]).sum::<f64>()
    };
    // One second, but for partial blocks at its ends.
    let more = excluded(&result[0]) - excluded(&result[1]);
    assert!((more - 1.0).abs() < 0.17, "{} {}", excluded(&result[0]), excluded(&result[1]));
    let largest = result.iter().flat_map(|b| &b.abs_force_n).fold(0.0_f64, |m, x| m.max(*x));
    assert!((with_initial_noise(result).noise.sd_n() / (0.1 * largest) - 1.0).abs() < 1e-9);
}

#[test]
fn noise_updates_converge_to_the_true_model_and_noise() {
    let all = simulated_recordings(&[], &[[0.004, 3e-4], [0.004, -2e-4], [0.008, 1e-4], [0.008, -2e-4]]);
    let recordings: Vec<&SegmentedRecording> = all.iter().collect();
    let result = fit_from_truth(&[], &recordings);
    let layer = &result.fit.model.tissue.layers[0];
    let gel = &gel_tissue().layers[0];
    assert!((layer.stiffness_n_per_m / gel.stiffness_n_per_m - 1.0).abs() < 0.02, "{layer:?}");
    assert!((layer.friction_ns_per_m2 / gel.friction_ns_per_m2 - 1.0).abs() < 0.02, "{layer:?}");
    // Four samples are averaged in a block.
    let block_n = SENSOR_NOISE_SD_N / 2.0;
    assert!((result.rms_n() / block_n - 1.0).abs() < 0.1, "{}", result.rms_n());
    let sd_n = result.data.noise.sd_n();
    assert!((sd_n / block_n - 1.0).abs() < 0.1, "{sd_n}");
    assert_eq!(result.starts, (1, 1));
    let moved: Vec<f64> = result.fit.model.per_recording.iter().map(|o| o.surface_m).collect();
    for (own, wanted) in moved.iter().zip([3e-4, -2e-4, 1e-4, -2e-4]) {
        assert!((own - wanted).abs() < 2e-5, "{moved:?}");
    }
    let spread = result.fit.model.scatter.surface_m;
    assert!((spread - 2.1e-4).abs() < 3e-5, "{spread}");
    let stiff = result.refit_with(&result.fit.model).expect("a fit");
    assert!((stiff.rms_n() / result.rms_n() - 1.0).abs() < 0.01 && stiff.drop_times_s == result.drop_times_s);
    assert!(
        fit_with_noise_updates(&result.fit.model, result.data.clone(), &result.drop_times_s, &[]).is_none()
    );
    let again = fit_from(&result.fit.model, result.data.recordings.to_vec(), result.drop_times_s.clone())
        .expect("a fit");
    assert!((again.rms_n() / result.rms_n() - 1.0).abs() < 0.01);
}

/// A model with random effects and the residuals at its values.
fn standing(noise_n: f64, change: impl Fn(&mut Model)) -> (Fit, FitData) {
    let all = simulated_recordings(&[], &[[0.004, 0.0], [0.008, 0.0], [0.008, 0.0]]);
    let recordings: Vec<&SegmentedRecording> = all.iter().collect();
    let data = FitData::new(
        Arc::new(set_blocks(&recordings, &SensorArtefacts::default())),
        Noise::white(noise_n),
        0.0,
    );
    let mut model = Model::base(assumed_layers(&[[0.05, 250.0, 2e4]]), 3);
    change(&mut model);
    let residuals = residuals(&model, &data).expect("a replay");
    (Fit { model, residuals }, data)
}

fn near(result: f64, wanted: f64) {
    assert!((result / wanted - 1.0).abs() < 1e-4, "{result} for {wanted}");
}

/// Mean of the squares and of the conditional variances, here by a 2 x 2 inverse.
#[test]
fn the_scatter_is_estimated_by_expectation_maximisation() {
    for noise_n in [0.01, 3.0] {
        let (at, data) = standing(noise_n, |m| {
            (m.free.recording_surface, m.free.recording_friction) = (true, true);
            for (own, x) in m.per_recording.iter_mut().zip([[3e-4, -0.02], [-5e-4, 0.07], [1e-4, 0.03]]) {
                [own.surface_m, own.ln_friction] = x;
            }
        });
        let linearization = Linearization::new(&at.model, &data, &at.residuals);
        let (mut surface, mut friction) = (0.0, 0.0);
        for r in 0..3 {
            let (i, j) = (linearization.index_of(0, r), linearization.index_of(1, r));
            let (a, b, c) = (
                linearization.normal_matrix.at(i, i),
                linearization.normal_matrix.at(j, i),
                linearization.normal_matrix.at(j, j),
            );
            let own = at.model.per_recording[r];
            surface += own.surface_m.powi(2) + c / (a * c - b * b);
            friction += own.ln_friction.powi(2) + a / (a * c - b * b);
        }
        let mut result = at.model.clone();
        update_scatter(&mut result, &data, &at);
        // At one speed surface and friction are almost collinear, and the factorisation's ridge shows.
        let within =
            |result: f64, wanted: f64| assert!((result / wanted - 1.0).abs() < 1e-3, "{result} for {wanted}");
        within(result.scatter.surface_m, (surface / 3.0).sqrt());
        within(result.scatter.ln_friction, (friction / 3.0).sqrt());
        assert_eq!(result.per_recording, at.model.per_recording);
    }
}

#[test]
fn a_random_effect_without_information_keeps_its_scatter() {
    let (at, data) = standing(0.01, |m| {
        (m.free.recording_surface, m.free.recording_friction, m.free.recording_effects) = (true, true, true);
        m.tissue.surface_m = 0.1;
        let release: AnyEffect = ReleaseDepth::default().into();
        m.effects = vec![EffectTerm::new(release.info(), &release.parameters())];
        (m.scatter.surface_m, m.scatter.ln_friction, m.scatter.varying[0]) = (7e-4, 0.03, 9e-4);
    });
    let mut result = at.model.clone();
    (result.scatter.surface_m, result.scatter.ln_friction, result.scatter.varying[0]) = (1.0, 1.0, 1.0);
    update_scatter(&mut result, &data, &at);
    near(result.scatter.surface_m, 7e-4);
    near(result.scatter.ln_friction, 0.03);
    near(result.scatter.varying[0], 9e-4);
}

#[test]
fn the_scatter_between_days_includes_its_prior() {
    let (at, data) = standing(0.5, |m| {
        (m.free.day_surface, m.free.day_friction) = (true, true);
        m.day_of = vec![0, 1, 1];
        m.days = vec![
            DayParameters { surface_m: 8e-4, ln_friction: -0.06 },
            DayParameters { surface_m: -3e-4, ln_friction: 0.09 },
        ];
    });
    let linearization = Linearization::new(&at.model, &data, &at.residuals);
    let (mut surface, mut friction) = (4.0 * 3e-4 * 3e-4, 4.0 * 0.03 * 0.03);
    for (i, n) in linearization.shared.iter().enumerate() {
        let open = 1.0 / linearization.normal_matrix.at(i, i);
        match n.role {
            ParameterRole::DaySurface(d) => surface += at.model.days[d].surface_m.powi(2) + open,
            ParameterRole::DayFriction(d) => friction += at.model.days[d].ln_friction.powi(2) + open,
            _ => {}
        }
    }
    let mut result = at.model.clone();
    update_scatter(&mut result, &data, &at);
    near(result.scatter.day_surface_m, (surface / 6.0).sqrt());
    near(result.scatter.day_ln_friction, (friction / 6.0).sqrt());
}

#[test]
fn day_effects_linear_in_log_speed_become_the_rate_exponent() {
    let slip = ShaftSlip { push_n: 1.0, pull_n: 0.6, rate: 0.1, ..ShaftSlip::default() };
    let friction = |m: &Model| m.days.iter().map(|d| d.ln_friction).collect::<Vec<_>>();
    let (at, data) = standing(0.1, |m| {
        let slip: AnyEffect = slip.clone().into();
        m.effects = vec![EffectTerm::new(slip.info(), &slip.parameters())];
        m.day_of = vec![0, 1, 1];
        m.days = vec![
            DayParameters { ln_friction: 0.2, ..DayParameters::default() },
            DayParameters { ln_friction: -0.1, ..DayParameters::default() },
        ];
    });
    let mut result = at.model.clone();
    move_day_trend_to_rate(&mut result, &data);
    // Speeds of 4 and 8 mm/s.
    let slope = -0.3 / 2.0_f64.ln();
    let level = 0.2 - slope * 4.0_f64.ln();
    let [push, rate] = [1, SLIP_RATE_INDEX].map(|k| result.effects[0].values[k]);
    assert!((rate - 0.1 - slope).abs() < 5e-3 && (push / level.exp() - 1.0).abs() < 1e-2, "{push} {rate}");
    assert!(friction(&result).iter().all(|f| f.abs() < 1e-12), "{:?}", result.days);
    let same = residuals(&result, &data).expect("a replay");
    let (a, b) = (same.residual_n.concat(), at.residuals.residual_n.concat());
    assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 0.02));
    // A fixed rate stays, and one speed has no slope.
    let mut held = at.model.clone();
    held.tied = vec![TiedParameter { effect: 0, parameter: SLIP_RATE_INDEX, tied_to: None }];
    let mut one = at.model.clone();
    one.day_of = vec![0, 0, 0];
    for mut m in [held, one] {
        let before = m.clone();
        move_day_trend_to_rate(&mut m, &data);
        assert_eq!((friction(&m), &m.effects[0].values), (friction(&before), &before.effects[0].values));
    }
}

#[test]
fn agreeing_starts_are_counted_and_distinct_optima_selected() {
    assert_eq!(distinct_optima(&[2.0, 2.003, 2.005, 2.059, 2.07, 2.79, 2.81]), (4, vec![0, 2, 3, 4]));
    assert_eq!(distinct_optima(&[2.0, 2.79, 2.81]), (1, vec![0, 1]));
    assert_eq!(
        distinct_optima(&[2.0, 2.0 * (1.0 + SAME_OPTIMUM), 2.0 * (1.0 + AGREEMENT), 2.0 * MAX_RMS_RATIO]),
        (2, vec![0, 2])
    );
    assert_eq!(distinct_optima(&[]), (0, vec![]));
}
