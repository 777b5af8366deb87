use super::*;
use crate::base_law_fit::fit_base_law;
use crate::test_fixtures::{
    blocks_of, data_of, fit_from_truth, fit_simulated, recordings_with_added_force, uniform_sequence,
};
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use std::sync::Arc;
use stylet_identify::likelihood::replay;
use stylet_identify::model::Assumptions;
use stylet_identify::noise::NoiseSource;
use stylet_tissue::{
    AnyEffect, BoundaryShift, CoulombFriction, Effect, ForceDrift, ForceLaw, ForceLawState, Layer,
    PositionScale, Tissue,
};

/// Layers of 20, 30, 40, ... mm with deviations in tenths of a mm.
fn model(off: &[f64], effects: &[AnyEffect]) -> Model {
    let layers: Vec<Layer> = (0..off.len())
        .map(|l| Layer {
            name: String::new(),
            thickness_m: 0.02 + 0.01 * l as f64,
            stiffness_n_per_m: 100.0,
            friction_ns_per_m2: 1000.0,
            puncture_n: None,
        })
        .collect();
    let assumed = Assumptions {
        tissue: Tissue { surface_m: 0.003, layers },
        known_effects: Vec::new(),
        further_effects: Vec::new(),
        tolerance: vec![0.3; off.len()],
        thickness_tolerance: vec![0.1; off.len()],
        surface_tolerance_m: 0.01,
    };
    let mut m = Model::base(Arc::new(assumed), 1);
    m.tissue.surface_m = 0.004;
    m.tissue.layers.iter_mut().zip(off).for_each(|(l, o)| l.thickness_m += 1e-4 * o);
    m.effects = effects.iter().map(|e| EffectTerm::new(e.info(), &e.parameters())).collect();
    m
}

fn found(off: &[f64]) -> Vec<(&'static str, Vec<f64>)> {
    let round = |x: &f64| (x * 1e9).round() / 1e9;
    geometry_effects(&model(off, &[]), true)
        .iter()
        .map(|c| (c.info.id, c.values.iter().map(round).collect()))
        .collect()
}

#[test]
fn shifted_boundary_makes_one_layer_thicker_and_the_next_thinner() {
    // Layers of 20, 30, 40 and 50 mm with tolerances of 10 %.
    assert_eq!(found(&[25.0, -24.0, 0.5]), [("boundary_shift", vec![1.0, 2.5e-3])]);
    assert_eq!(found(&[4.0, -35.0, 33.0]), [("boundary_shift", vec![2.0, -3.5e-3])]);
    // To a fifth of its size, for the next layer and for the others.
    assert!(found(&[30.0, -24.3, 0.0]).len() == 1 && found(&[30.0, -23.7, 0.0]).is_empty());
    assert!(found(&[30.0, -35.7, 0.0]).len() == 1 && found(&[30.0, -36.3, 0.0]).is_empty());
    assert!(found(&[30.0, -30.0, 5.7]).len() == 1 && found(&[30.0, -30.0, 6.3]).is_empty());
    assert!(found(&[30.0, -30.0, 0.0, -5.7]).len() == 1 && found(&[30.0, -30.0, 0.0, -6.3]).is_empty());
    let selected = model(&[25.0, -24.0, 0.5], &[BoundaryShift { layer: 1, shift_m: 2.5e-3 }.into()]);
    assert!(geometry_effects(&selected, true).is_empty());
    // Within the tolerances of both thicknesses it is no cause.
    for (off, count) in
        [(&[19.0, -19.0][..], 0), (&[21.0, -21.0], 1), (&[19.0, -19.0, 0.0], 0), (&[0.0, 31.0, -31.0], 1)]
    {
        assert_eq!(geometry_effects(&model(off, &[]), true).len(), count, "{off:?}");
    }
}

#[test]
fn position_scale_scales_all_layers_that_were_passed() {
    // 20, 30, 40 and 50 mm, the last boundary not passed.
    let found = |off: &[f64]| geometry_effects(&model(off, &[]), false);
    // By 5, 4.2, 4.6 and 99 per cent.
    let all = found(&[10.0, 12.6, 18.4, 495.0]);
    assert_eq!(all.len(), 1);
    assert_eq!((all[0].info.id, all[0].values.len()), ("position_scale", 1));
    assert!((all[0].values[0] - 0.046).abs() < 1e-9, "{all:?}");
    // Each within a fifth of the mean.
    assert!(found(&[10.0, 12.2, 16.4, 0.0]).len() == 1 && found(&[10.0, 9.9, 18.0, 0.0]).is_empty());
    assert!(found(&[-10.0, -15.0, -20.0, 0.0]).len() == 1);
    // Scales below 1e-4 are ignored.
    assert!(found(&[0.021, 0.0315, 0.042, 0.0]).len() == 1);
    assert!(found(&[0.019, 0.0285, 0.038, 0.0]).is_empty());
    // A single layer is in proportion to anything, and two by chance.
    assert!(found(&[10.0, 15.0, 0.0]).is_empty() && found(&[10.0, 0.0]).is_empty());
    assert!(found(&[10.0]).is_empty());
    // When the last boundary was passed the last thickness counts.
    let with = |off: &[f64]| geometry_effects(&model(off, &[]), true).len();
    assert!(with(&[10.0, 15.0]) == 0 && with(&[10.0]) == 0);
    assert!(with(&[10.0, 15.0, 20.0]) == 1 && with(&[10.0, 15.0, 10.0]) == 0);
    let selected = model(&[10.0, 15.0, 20.0], &[PositionScale { eps: 0.01 }.into()]);
    assert!(geometry_effects(&selected, true).is_empty());
}

/// Thicknesses (m) whose differences and ratios have no rounding errors.
#[test]
fn deviation_at_the_limit_follows_no_pattern() {
    let count = |assumed: [f64; 3], here: [f64; 3]| {
        let mut m = model(&[0.0; 3], &[]);
        m.tissue.layers.iter_mut().zip(assumed).for_each(|(l, d)| l.thickness_m = d);
        m.assumed = Arc::new(Assumptions { tissue: m.tissue.clone(), ..Assumptions::clone(&m.assumed) });
        m.tissue.layers.iter_mut().zip(here).for_each(|(l, d)| l.thickness_m = d);
        geometry_effects(&m, true).len()
    };
    // A shifted boundary, for the next layer and for the others; a scale.
    let off = |by: [i32; 3]| count([0.25; 3], by.map(|k| 0.25 + f64::from(k) / 1024.0));
    assert_eq!((off([40, -36, 0]), off([40, -32, 0])), (1, 0));
    assert_eq!((off([40, -40, 4]), off([40, -40, 8])), (1, 0));
    assert_eq!((off([11, 9, 10]), off([12, 8, 10])), (1, 0));
    // A ten-thousandth.
    assert_eq!(count([1e4; 3], [1e4 + 1.0; 3]), 0);
}

#[test]
fn fixed_geometry_lies_at_the_prior() {
    let m = model(&[10.0, -9.0, 0.5], &[]);
    let free = |surface, thickness| FreeParameters {
        surface,
        thickness,
        recording_friction: true,
        ..FreeParameters::default()
    };
    let both = with_fixed_geometry(&m, free(false, false));
    assert_eq!((both.tissue.surface_m, &both.tissue.layers), (0.003, &m.assumed.tissue.layers));
    assert!(both.free.recording_friction && !both.free.surface);
    let surface = with_fixed_geometry(&m, free(true, false));
    assert_eq!((surface.tissue.surface_m, &surface.tissue.layers), (0.004, &m.assumed.tissue.layers));
    let thickness = with_fixed_geometry(&m, free(false, true));
    assert_eq!((thickness.tissue.surface_m, &thickness.tissue.layers), (0.003, &m.tissue.layers));
}

/// 30 mm in and back.
fn there_and_back() -> FitData {
    let t: Vec<f64> = (0..4000).map(|k| f64::from(k) / 200.0).collect();
    let z = t.iter().map(|t| 3e-3 * (10.0 - (t - 10.0).abs())).collect();
    data_of(vec![blocks_of(t, z, vec![0.0; 4000])], 0.5)
}

#[test]
fn position_scale_is_equivalent_to_scaled_boundaries_and_coefficients() {
    let data = there_and_back();
    let scale = EffectTerm::new(PositionScale { eps: 0.05 }.info(), &[0.05]);
    let mut scaled_layers = model(&[0.0, 0.0], &[]);
    scaled_layers.tissue.surface_m = 1.05 * 0.003;
    scaled_layers.tissue.layers.iter_mut().for_each(|l| l.thickness_m *= 1.05);
    let force = |m: &Model| replay(m, &data, 0).expect("a replay").force_n;
    let off = |m: Model| {
        let scaled = with_fixed_geometry(&m, FreeParameters::default()).with_effect(scale.clone());
        let differ =
            force(&scaled_layers).iter().zip(force(&scaled)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        differ / force(&scaled_layers).into_iter().fold(0.0, f64::max)
    };
    assert!(
        off(with_scaled_coefficients(&scaled_layers, &scale)) < 1e-9,
        "{}",
        off(with_scaled_coefficients(&scaled_layers, &scale))
    );
    assert!(off(scaled_layers.clone()) > 0.04, "{}", off(scaled_layers.clone()));
    // An effect that moves no position has no scale.
    let friction = EffectTerm::new(CoulombFriction { c_n_per_m: 1.0 }.info(), &[1.0]);
    assert_eq!(with_scaled_coefficients(&scaled_layers, &friction).tissue, scaled_layers.tissue);
}

#[test]
fn last_boundary_is_passed_when_the_needle_goes_beyond_it() {
    let data = there_and_back();
    // 20 mm from 4 mm on; 20 and 30 mm.
    assert!(
        passed_last_boundary(&model(&[0.0], &[]), &data)
            && !passed_last_boundary(&model(&[0.0, 0.0], &[]), &data)
    );
    // Beyond the boundary, not at it.
    assert!(
        passed_last_boundary(&model(&[59.0], &[]), &data)
            && !passed_last_boundary(&model(&[61.0], &[]), &data)
    );
}

/// Half the logarithm of the number of blocks per parameter, four nats per effect.
#[test]
fn free_geometry_is_penalised_by_its_parameters() {
    let t: Vec<f64> = (0..1000).map(|k| f64::from(k) / 100.0).collect();
    let z = t.iter().map(|t| 2e-3 * t).collect();
    let data = data_of(vec![blocks_of(t, z, vec![0.0; 1000])], 0.5);
    let each = 0.5 * (data.compared_block_count() as f64).ln();
    let friction: AnyEffect = CoulombFriction { c_n_per_m: 1.0 }.into();
    for (surface, thickness, effects, wanted) in [
        (true, true, vec![], 4.0 * each),
        (false, true, vec![], 3.0 * each),
        (true, false, vec![], each),
        (false, false, vec![friction.clone()], each + 4.0),
        (true, true, vec![friction, PositionScale { eps: 0.01 }.into()], 6.0 * each + 8.0),
    ] {
        let mut m = model(&[0.0, 0.0, 0.0], &effects);
        (m.free.surface, m.free.thickness) = (surface, thickness);
        assert!((penalty_nats(&m, &data) - wanted).abs() < 1e-9, "{} for {wanted}", penalty_nats(&m, &data));
    }
}

#[test]
fn intervals_have_free_geometry_unless_an_effect_moves_it() {
    let with = |effects: &[AnyEffect]| {
        let mut m = model(&[0.0; 3], effects);
        m.free = FreeParameters::default();
        let f = free_geometry(&m).free;
        (f.surface, f.thickness)
    };
    assert_eq!(with(&[]), (true, true));
    assert_eq!(with(&[CoulombFriction { c_n_per_m: 1.0 }.into()]), (true, true));
    assert_eq!(with(&[BoundaryShift { layer: 1, shift_m: 1e-3 }.into()]), (false, false));
    assert_eq!(with(&[PositionScale { eps: 0.01 }.into()]), (false, false));
}

/// Recordings with a common surface shift, with free surface or thickness: whether an effect is added, and what
/// stays free.
fn geometry_after_fixing(moved_m: f64, surface: bool, thickness: bool) -> (bool, FreeParameters) {
    let f = fit_simulated(&[], &[], &[[4e-3, moved_m], [5e-3, moved_m], [6e-3, moved_m]], |_| 0.0);
    let mut model = f.fit.model.clone();
    model.free = FreeParameters {
        surface,
        thickness,
        recording_surface: false,
        recording_friction: false,
        ..model.free
    };
    model.per_recording.iter_mut().for_each(|o| (o.surface_m, o.ln_friction) = (0.0, 0.0));
    if !surface {
        model.tissue.surface_m = model.assumed.tissue.surface_m;
    }
    let prepared = PreparedRecordings::new(model.assumed.clone(), f.data.recordings.to_vec(), 0.0);
    let start = fit(&model, &f.data, Effort::FULL).expect("a fit");
    let data = f.data.with_estimated_noise(&start.residuals.residual_n, NoiseSource::Detrended);
    let start = fit(&start.model, &data, Effort::FULL).expect("a fit");
    let mut search = Search::from_fit(start, data);
    (fix_geometry(&mut search, &prepared), search.best.model.free)
}

#[test]
fn geometry_that_agrees_with_the_prior_is_fixed() {
    for (moved_m, surface) in [(0.0, false), (1e-3, true)] {
        let (named, free) = geometry_after_fixing(moved_m, true, true);
        assert_eq!((named, free.surface, free.thickness), (false, surface, false), "{moved_m}");
    }
    // A fixed parameter is not freed.
    let (named, free) = geometry_after_fixing(1e-3, false, false);
    assert_eq!((named, free.surface, free.thickness), (false, false, false));
    // A single free parameter is fixed as well.
    for (surface, thickness) in [(true, false), (false, true)] {
        let (_, free) = geometry_after_fixing(0.0, surface, thickness);
        assert_eq!((free.surface, free.thickness), (false, false), "{surface}");
    }
}

#[test]
fn penalty_counts_effects_surface_and_thickness() {
    let drift: AnyEffect = ForceDrift { rate_n_per_s: 0.02 }.into();
    let runs = recordings_with_added_force(&[], &[[4e-3, 3e-4], [5e-3, -3e-4], [6e-3, 0.0]], |t| 0.02 * t);
    let with = fit_from_truth(std::slice::from_ref(&drift), &runs.iter().collect::<Vec<_>>());
    // The parameter of the drift, and a free surface and thickness.
    let wanted = with.fit.nats() + 4.0 + 3.0 * 0.5 * (with.data.compared_block_count() as f64).ln();
    let penalised = penalised_nats(&with.fit, &with.data);
    assert!((penalised - wanted).abs() < 1e-9, "{penalised} for {wanted}");
}

/// Three layers whose first boundary is `shift_m` deeper than assumed; `off` are relative errors of the assumed
/// thicknesses.
fn search_with_shift(shift_m: f64, off: [f64; 3]) -> (Search, PreparedRecordings) {
    let layer = |thickness_m, stiffness_n_per_m, puncture_n| Layer {
        name: String::new(),
        thickness_m,
        stiffness_n_per_m,
        friction_ns_per_m2: 9000.0,
        puncture_n,
    };
    let layers =
        vec![layer(0.0085, 150.0, Some(0.8)), layer(0.0092, 200.0, Some(1.1)), layer(0.0131, 170.0, None)];
    let mut tissue = Tissue { surface_m: 0.0, layers };
    let law = ForceLaw::new(&tissue, &[BoundaryShift { layer: 1, shift_m }.into()]).expect("a law");
    let mut covariance = uniform_sequence(5);
    let blocks = [0.004, 0.005, 0.0034].map(|speed| {
        let t: Vec<f64> =
            (0..(100.0 * 0.031 / speed) as usize).map(|k| f64::from(k as u32) / 100.0).collect();
        let z: Vec<f64> = t.iter().map(|t| speed * t - 0.002 + 3e-4 * (1.0 - (4.0 * t).cos())).collect();
        let mut state = ForceLawState::default();
        let f = t.iter().zip(&z).map(|(t, z)| {
            let v = speed + 12e-4 * (4.0 * t).sin();
            law.step(&mut state, *t, *z, v, |_| {}).total_n + 0.03 * (covariance() - 0.5)
        });
        let f = f.collect();
        blocks_of(t, z, f)
    });
    tissue.layers.iter_mut().zip(off).for_each(|(l, off)| l.thickness_m *= 1.0 + off);
    let assumed = Assumptions {
        tissue,
        known_effects: Vec::new(),
        further_effects: Vec::new(),
        tolerance: vec![0.3; 3],
        thickness_tolerance: vec![0.1; 3],
        surface_tolerance_m: 0.002,
    };
    let prepared = PreparedRecordings::new(Arc::new(assumed), blocks.to_vec(), 0.0);
    let (start, data) = fit_base_law(&prepared).expect("a fit");
    (Search::from_fit(start, data), prepared)
}

/// Outside the tolerance of a thickness, one parameter of an effect replaces three of free thicknesses; within the tolerances of both there
/// is no cause.
#[test]
fn boundary_shift_replaces_free_thicknesses_outside_their_tolerances() {
    let (mut search, prepared) = search_with_shift(1e-3, [0.0; 3]);
    assert!(fix_geometry(&mut search, &prepared));
    let model = &search.best.model;
    assert_eq!(
        (model.effects[0].info.id, model.free.surface, model.free.thickness),
        ("boundary_shift", false, false)
    );
    assert!((model.effects[0].values[1] - 1e-3).abs() < 2e-4, "{:?}", model.effects[0].values);
    let (mut search, prepared) = search_with_shift(5e-4, [0.0; 3]);
    assert!(!fix_geometry(&mut search, &prepared));
    let (model, assumed) = (&search.best.model, &search.best.model.assumed.tissue.layers);
    assert!(model.effects.is_empty() && model.free.thickness);
    for (k, off) in [(0, 5e-4), (1, -5e-4)] {
        let found = model.tissue.layers[k].thickness_m - assumed[k].thickness_m;
        assert!((found - off).abs() < 1e-4, "{found}");
    }
}

/// With a shift of 3 mm the next layer is a third thinner than assumed, whatever the errors of the thicknesses;
/// without a shift these are within the tolerances.
#[test]
fn boundary_shift_is_identified_when_a_thickness_leaves_its_tolerance() {
    let off = [0.06, -0.08, 0.07];
    let (mut search, prepared) = search_with_shift(3e-3, off);
    assert!(
        (0..3).any(|l| search.best.model.thickness_out_of_tolerance(l))
            && boundary_shift_models(&search.best.model).len() >= 4
    );
    let reached = search.best.residuals.nats;
    assert!(fix_geometry(&mut search, &prepared));
    let model = &search.best.model;
    assert_eq!((model.effects[0].info.id, model.effects[0].values[0]), ("boundary_shift", 1.0));
    assert!(!model.free.wide_thickness && (0..3).all(|l| !model.thickness_out_of_tolerance(l)));
    assert!(search.best.nats() < reached + 1.0, "{} for {reached}", search.best.nats());
    // Without the shift both the base law and the extended model are far off.
    assert!(!search.base.model.free.wide_thickness && search.base.nats() > reached + 100.0);
    // The shift is only as certain as the thicknesses.
    let covariance = crate::confidence_intervals::Covariance::new(
        &search.best,
        &search.data,
        &mut ChaCha8Rng::seed_from_u64(1),
    );
    let shift = covariance.effect_parameter(0, 1);
    assert!(shift.low < 3e-3 && 3e-3 < shift.high && shift.high - shift.low > 1e-3, "{shift:?}");
    let (mut search, prepared) = search_with_shift(0.0, off);
    assert!(
        (0..3).all(|l| !search.best.model.thickness_out_of_tolerance(l))
            && boundary_shift_models(&search.best.model).is_empty()
    );
    assert!(!fix_geometry(&mut search, &prepared));
}

/// The shift with the largest prior density of all thicknesses.
#[test]
fn shift_is_the_most_probable_one_given_all_thicknesses() {
    let mut m = model(&[46.0, -60.0, 0.0], &[]);
    m.free =
        FreeParameters { surface: false, thickness: true, wide_thickness: true, ..FreeParameters::default() };
    assert!(
        m.thickness_out_of_tolerance(0)
            && !m.thickness_out_of_tolerance(1)
            && !m.thickness_out_of_tolerance(2)
    );
    let all = boundary_shift_models(&m);
    // 20 and 30 mm with 10 %: 4.6 mm weigh by 1/4, -6 mm by 1/9.
    let shift = (4.6e-3 / 4.0 + 6e-3 / 9.0) / (1.0 / 4.0 + 1.0 / 9.0);
    for m in &all {
        assert_eq!(
            (m.effects[0].info.id, m.effects[0].values[0], m.free.wide_thickness),
            ("boundary_shift", 1.0, false)
        );
        assert!((m.effects[0].values[1] / shift - 1.0).abs() < 1e-12);
        let off = if m.free.thickness { 4.6e-3 - shift } else { 0.0 };
        assert!((m.tissue.layers[0].thickness_m - 0.02 - off).abs() < 1e-12);
    }
    assert!(all.iter().any(|m| m.free.thickness) && all.iter().any(|m| !m.free.thickness));
    // Both boundaries of a layer in the middle; none where one is shifted already.
    assert_eq!(
        boundary_shift_models(&model(&[0.0, 70.0, 0.0], &[]))
            .iter()
            .map(|m| m.effects[0].values[0])
            .sum::<f64>(),
        4.0 * 3.0
    );
    assert!(
        boundary_shift_models(&model(&[46.0, 0.0], &[BoundaryShift { layer: 1, shift_m: 1e-3 }.into()]))
            .is_empty()
    );
}
