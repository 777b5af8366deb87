//! Whether the believed geometry stands as it is, and what explains it when it does not.
//!
//! Surface and thicknesses are free from the start and are no causes. When they come out as believed, they are fixed there:
//! that saves their numbers. A scale of the position moves every face in proportion, a shifted face trades one thickness
//! for the next: with the geometry free neither can be seen; that the free numbers fall into such a pattern by chance is what
//! the saved numbers are paid for. A thickness that is off by more than its tolerance is no belief that was a little wrong: that
//! costs what a moved face costs.

use crate::base_law_fit::PreparedRecordings;
use crate::effect_selection::Search;
use crate::model_comparison::{MIN_GAIN_NATS, bic_penalty, likelihood_gain};
use rayon::prelude::*;
use stylet_identify::fit::{Effort, Fit, fit, fit_if_below};
use stylet_identify::likelihood::FitData;
use stylet_identify::model::{EffectTerm, FreeParameters, Model};
use stylet_identify::update_event_times::update_event_times;
use stylet_tissue::{ChainStage, EffectInfo, Proposal, general_effects};

/// A pattern counts when the free numbers follow it to this share of its size.
const PATTERN: f64 = 0.2;
/// Thicknesses that have to follow a pattern together. One is in proportion to anything; that two which are off by some per cent are in
/// proportion, or off by as much as one another, as well as faces are told, happens by chance in one stack of thirty: more often than a
/// scale of the positions is wrong or a face elsewhere.
const TOGETHER: usize = 3;

/// Nats that the effects and the free geometry of a model cost.
fn price(m: &Model, data: &FitData) -> f64 {
    let geometry = usize::from(m.free.surface) + if m.free.thickness { m.layers() } else { 0 };
    let strained = usize::from((0..m.layers()).any(|l| m.thickness_out_of_tolerance(l)));
    bic_penalty(m.effect_parameter_count() + geometry + strained, data.compared_block_count())
        + MIN_GAIN_NATS * (m.effects.len() + strained) as f64
}

/// Nats of a fit with that price.
fn priced(f: &Fit, data: &FitData) -> f64 {
    f.nats() + price(&f.model, data)
}

/// A model with its geometry as believed, but for what stays free.
fn fixed(model: &Model, free: FreeParameters) -> Model {
    let mut m = Model { free, ..model.clone() };
    if !free.surface {
        m.tissue.surface_m = m.assumed.tissue.surface_m;
    }
    if !free.thickness {
        let believed = m.assumed.clone();
        for (l, b) in m.tissue.layers.iter_mut().zip(&believed.tissue.layers) {
            l.thickness_m = b.thickness_m;
        }
    }
    m
}

/// Fixes what is as believed; true when an effect came in for it.
pub fn fix_geometry(search: &mut Search, prepared: &PreparedRecordings) -> bool {
    let best = &search.best;
    let times = prepared.drop_times();
    let free = |surface, thickness| FreeParameters { surface, thickness, ..best.model.free };
    let mut tried: Vec<Model> = [free(false, false), free(true, false), free(false, true)]
        .into_iter()
        .filter(|f| (!f.surface || best.model.free.surface) && (!f.thickness || best.model.free.thickness))
        .map(|f| fixed(&best.model, f))
        .collect();
    for choice in patterns(&best.model, passed(&best.model, &search.data)) {
        for f in [free(false, false), free(true, false)] {
            tried.push(fixed(&in_its_scale(&best.model, &choice), f).with_effect(choice.clone()));
        }
    }
    tried.extend(unstrained(&best.model));
    let stands = priced(best, &search.data);
    let fits: Vec<Fit> = tried
        .into_par_iter()
        .filter_map(|m| {
            // Where the believed faces have the ruptures, not where the free ones had them.
            let mut start = m;
            update_event_times(&mut start, &search.data, &times);
            let first = fit(&start, &search.data, Effort::SHORT)?;
            let mut model = first.model;
            update_event_times(&mut model, &search.data, &times);
            let wanted = stands - price(&model, &search.data);
            fit_if_below(&model, &search.data, Effort::FULL, wanted)
        })
        .collect();
    let cheapest = |fits: &[&Fit]| {
        let cheaper = |a: &&&Fit, b: &&&Fit| priced(a, &search.data).total_cmp(&priced(b, &search.data));
        fits.iter().min_by(cheaper).map(|f| (*f).clone())
    };
    let (with, without): (Vec<&Fit>, Vec<&Fit>) =
        fits.iter().partition(|f| f.model.effects.len() > best.model.effects.len());
    let plain = cheapest(&without).filter(|f| priced(f, &search.data) < stands);
    let rival = plain.as_ref().unwrap_or(best);
    let told = cheapest(&with).filter(|f| {
        priced(f, &search.data) < priced(rival, &search.data)
            && without.iter().copied().chain([best]).all(|r| is_worth(f, r, &search.data))
    });
    let new = told.is_some();
    if let Some(f) = told.or(plain) {
        search.best = f;
    }
    if new {
        within_tolerance(search, prepared);
    }
    new
}

/// Where a moved face is told the base law is the one that may not move it.
fn within_tolerance(search: &mut Search, prepared: &PreparedRecordings) {
    let mut model = search.base.model.clone();
    model.free.wide_thickness = false;
    update_event_times(&mut model, &search.data, &prepared.drop_times());
    if let Some(f) = fit(&model, &search.data, Effort::FULL) {
        search.base = f;
    }
}

/// Whether a fit with an effect for the geometry is worth its price when all that it leaves is noise, however slow.
fn is_worth(f: &Fit, rival: &Fit, data: &FitData) -> bool {
    likelihood_gain(rival, f, data).exceeds(price(&f.model, data) - price(&rival.model, data))
}

/// A model with its geometry as unsure as it is believed to be: numbers whose intervals suppose faces that nobody measured are too
/// sure. Where an effect stands for moved faces they stay, for it is told by nothing else.
#[must_use]
pub fn free_geometry(model: &Model) -> Model {
    let moves =
        |i: &EffectInfo| matches!(i.proposal, Proposal::LayerFaces(_)) || i.stage == ChainStage::Position;
    let mut m = model.clone();
    if !m.effects.iter().any(|e| moves(e.info)) {
        m.free = FreeParameters { surface: true, thickness: true, ..m.free };
    }
    m
}

/// Where thicknesses are off by more than their tolerances: models in which a face was moved and the rest is as likely as it can be.
fn unstrained(model: &Model) -> Vec<Model> {
    let strained = |l: usize| model.thickness_out_of_tolerance(l);
    let taken = |i: &EffectInfo| model.effects.iter().any(|e| e.info.id == i.id);
    let moves = |i: &&EffectInfo| matches!(i.proposal, Proposal::LayerFaces(_)) && !taken(i);
    let (belief, layers) = (&model.assumed, &model.tissue.layers);
    // Off what is believed, in metres, and the weight of it.
    let off = |l: usize| {
        let believed = belief.tissue.layers[l].thickness_m;
        let sd = (belief.thickness_tolerance[l] * believed).max(1e-9);
        (layers[l].thickness_m - believed, 1.0 / (sd * sd))
    };
    let mut out = Vec::new();
    for info in general_effects().filter(moves) {
        for l in (1..model.layers()).filter(|l| strained(l - 1) || strained(*l)) {
            let ((front, wf), (back, wb)) = (off(l - 1), off(l));
            let shift = (wf * front - wb * back) / (wf + wb);
            let mut m = model.clone();
            m.tissue.layers[l - 1].thickness_m -= shift;
            m.tissue.layers[l].thickness_m += shift;
            let m = m.with_effect(EffectTerm::new(info, &[l as f64, shift]));
            let tried = [(false, false), (false, true), (true, false), (true, true)];
            for (surface, thickness) in tried.into_iter().filter(|t| model.free.surface || !t.0) {
                out.push(fixed(&m, FreeParameters { surface, thickness, wide_thickness: false, ..m.free }));
            }
        }
    }
    out
}

/// Whether the needle went beyond the last face in any recording, so that its thickness is told as the others are.
fn passed(model: &Model, data: &FitData) -> bool {
    let end = model.tissue.surface_m + model.tissue.layers.iter().map(|l| l.thickness_m).sum::<f64>();
    data.recordings.iter().any(|b| b.start_s.iter().any(|t| b.motion.at(*t).0 > end))
}

/// Stiffness and friction as they are where positions are `1 + eps` times what they were: a force over a depth, and over a depth and a
/// speed. A fit that begins with those of the scaled positions is far from its end, and may not find there.
fn in_its_scale(model: &Model, choice: &EffectTerm) -> Model {
    let mut m = model.clone();
    if choice.info.stage == ChainStage::Position {
        let scale = 1.0 + choice.values.first().copied().unwrap_or(0.0);
        for l in &mut m.tissue.layers {
            l.stiffness_n_per_m *= scale;
            l.friction_ns_per_m2 *= scale * scale;
        }
    }
    m
}

/// Effects that would move the faces as the free geometry has moved them; the last thickness counts where its face was passed. Two
/// thicknesses alone tell a moved face when it lies beyond what either is believed to, and no scale.
fn patterns(model: &Model, passed: bool) -> Vec<EffectTerm> {
    let believed = &model.assumed.tissue.layers;
    let off: Vec<f64> =
        model.tissue.layers.iter().zip(believed).map(|(l, b)| l.thickness_m - b.thickness_m).collect();
    let told = off.len().saturating_sub(usize::from(!passed));
    let tolerated = |l: usize, by: f64| by <= model.assumed.thickness_tolerance[l] * believed[l].thickness_m;
    let taken = |id: &str| model.effects.iter().any(|e| e.info.id == id);
    let mut out = Vec::new();
    for info in general_effects().filter(|i| !taken(i.id)) {
        match info.proposal {
            Proposal::LayerFaces(_) => {
                for l in 0..off.len().saturating_sub(1) {
                    let shift = off[l];
                    let others = (0..off.len()).filter(|k| *k != l && *k != l + 1);
                    let fits = (off[l + 1] + shift).abs() < PATTERN * shift.abs();
                    let by_chance = tolerated(l, shift.abs()) && tolerated(l + 1, shift.abs());
                    if shift.abs() > 2e-5
                        && fits
                        && (told >= TOGETHER || !by_chance)
                        && others.into_iter().all(|k| off[k].abs() < PATTERN * shift.abs())
                    {
                        out.push(EffectTerm::new(info, &[(l + 1) as f64, shift]));
                    }
                }
            }
            Proposal::LinearColumns(_) if info.stage == ChainStage::Position => {
                let ratios: Vec<f64> = off.iter().zip(believed).map(|(o, b)| o / b.thickness_m).collect();
                let mean = stylet_stats::mean(&ratios[..told]);
                if told >= TOGETHER
                    && mean.abs() > 1e-4
                    && ratios[..told].iter().all(|r| (r - mean).abs() < PATTERN * mean.abs())
                {
                    out.push(EffectTerm::new(info, &[mean]));
                }
            }
            _ => {}
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::{
        fix_geometry, fixed, free_geometry, in_its_scale, is_worth, passed, patterns, price, priced,
        unstrained,
    };
    use crate::base_law_fit::{PreparedRecordings, fit_base_law};
    use crate::effect_selection::Search;
    use crate::test_fixtures::{
        fit_from_truth, recordings_with_added_force, simulated_recordings, uniform_sequence,
    };
    use rand::SeedableRng;
    use rand::rngs::ChaCha8Rng;
    use std::sync::Arc;
    use stylet_identify::block_averages::{BLOCK_S, BlockAverages};
    use stylet_identify::fit::{Effort, fit};
    use stylet_identify::likelihood::{FitData, replay};
    use stylet_identify::model::{Assumptions, EffectTerm, FreeParameters, Model};
    use stylet_identify::noise::{Noise, NoiseSource};
    use stylet_record::Recording;
    use stylet_tissue::{
        AnyEffect, BoundaryShift, CoulombFriction, Effect, ForceDrift, ForceLaw, ForceLawState, Layer,
        PositionScale, Tissue,
    };

    /// Layers of 20, 30, 40 and so on mm, each off by so many tenths of a mm.
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
        let belief = Assumptions {
            tissue: Tissue { surface_m: 0.003, layers },
            known_effects: Vec::new(),
            tolerance: vec![0.3; off.len()],
            thickness_tolerance: vec![0.1; off.len()],
            surface_tolerance_m: 0.01,
        };
        let mut m = Model::base(Arc::new(belief), 1);
        m.tissue.surface_m = 0.004;
        m.tissue.layers.iter_mut().zip(off).for_each(|(l, o)| l.thickness_m += 1e-4 * o);
        m.effects = effects.iter().map(|e| EffectTerm::new(e.info(), &e.parameters())).collect();
        m
    }

    fn found(off: &[f64]) -> Vec<(&'static str, Vec<f64>)> {
        let round = |x: &f64| (x * 1e9).round() / 1e9;
        patterns(&model(off, &[]), true)
            .iter()
            .map(|c| (c.info.id, c.values.iter().map(round).collect()))
            .collect()
    }

    #[test]
    fn a_face_that_is_elsewhere_makes_one_layer_thicker_and_the_next_thinner() {
        assert_eq!(found(&[10.0, -9.0, 0.5]), [("boundary_shift", vec![1.0, 1e-3])]);
        assert_eq!(found(&[1.9, -10.0, 9.0]), [("boundary_shift", vec![2.0, -1e-3])]);
        // To a fifth of its size, from both sides, for the next layer and for the others.
        assert!(found(&[10.0, -8.1, 0.0]).len() == 1 && found(&[10.0, -7.9, 0.0]).is_empty());
        assert!(found(&[10.0, -11.9, 0.0]).len() == 1 && found(&[10.0, -12.1, 0.0]).is_empty());
        assert!(found(&[10.0, -10.0, 1.9]).len() == 1 && found(&[10.0, -10.0, 2.1]).is_empty());
        assert!(found(&[10.0, -10.0, 0.0, -1.9]).len() == 1 && found(&[10.0, -10.0, 0.0, -2.1]).is_empty());
        // Two hundredths of a millimetre are none.
        assert!(found(&[0.21, -0.21, 0.0]).len() == 1 && found(&[0.19, -0.19, 0.0]).is_empty());
        let taken = model(&[10.0, -9.0, 0.5], &[BoundaryShift { layer: 1, shift_m: 1e-3 }.into()]);
        assert!(patterns(&taken, true).is_empty());
        // Two thicknesses of 20 and 30 mm to 10 % are off by as much as one another by chance, unless that is beyond either.
        for (off, passed, told) in [
            (&[19.0, -19.0][..], true, 0),
            (&[21.0, -21.0], true, 1),
            (&[19.0, -19.0, 0.0], false, 0),
            (&[21.0, -21.0, 0.0], false, 1),
            (&[19.0, -19.0, 0.0], true, 1),
        ] {
            assert_eq!(patterns(&model(off, &[]), passed).len(), told, "{off:?} {passed}");
        }
    }

    #[test]
    fn a_wrong_scale_makes_every_layer_thicker_in_proportion_but_one_whose_end_was_not_reached() {
        // 20, 30, 40 and 50 mm, the last not passed.
        let found = |off: &[f64]| patterns(&model(off, &[]), false);
        // By 5, 4.2, 4.6 and 99 per cent.
        let all = found(&[10.0, 12.6, 18.4, 495.0]);
        assert_eq!(all.len(), 1);
        assert_eq!((all[0].info.id, all[0].values.len()), ("position_scale", 1));
        assert!((all[0].values[0] - 0.046).abs() < 1e-9, "{all:?}");
        // Each within a fifth of the mean.
        assert!(found(&[10.0, 12.2, 16.4, 0.0]).len() == 1 && found(&[10.0, 9.9, 18.0, 0.0]).is_empty());
        assert!(found(&[-10.0, -15.0, -20.0, 0.0]).len() == 1);
        // A ten-thousandth is none.
        assert!(found(&[0.021, 0.0315, 0.042, 0.0]).len() == 1);
        assert!(found(&[0.019, 0.0285, 0.038, 0.0]).is_empty());
        // One layer alone is in proportion to anything, and two are so by chance.
        assert!(found(&[10.0, 15.0, 0.0]).is_empty() && found(&[10.0, 0.0]).is_empty());
        assert!(found(&[10.0]).is_empty());
        // Where the last face was passed the last thickness counts as the others do.
        let with = |off: &[f64]| patterns(&model(off, &[]), true).len();
        assert!(with(&[10.0, 15.0]) == 0 && with(&[10.0]) == 0);
        assert!(with(&[10.0, 15.0, 20.0]) == 1 && with(&[10.0, 15.0, 10.0]) == 0);
        let taken = model(&[10.0, 15.0, 20.0], &[PositionScale { eps: 0.01 }.into()]);
        assert!(patterns(&taken, true).is_empty());
    }

    /// Thicknesses (m) whose differences, or their shares, are numbers without rounding.
    #[test]
    fn what_differs_by_just_as_much_as_is_allowed_follows_no_pattern() {
        let count = |believed: [f64; 3], here: [f64; 3]| {
            let mut m = model(&[0.0; 3], &[]);
            m.tissue.layers.iter_mut().zip(believed).for_each(|(l, d)| l.thickness_m = d);
            m.assumed = Arc::new(Assumptions { tissue: m.tissue.clone(), ..Assumptions::clone(&m.assumed) });
            m.tissue.layers.iter_mut().zip(here).for_each(|(l, d)| l.thickness_m = d);
            patterns(&m, true).len()
        };
        // A face that is elsewhere, for the next layer and for the others; a scale.
        let off = |by: [i32; 3]| count([0.25; 3], by.map(|k| 0.25 + f64::from(k) / 1024.0));
        assert_eq!((off([10, -9, 0]), off([10, -8, 0])), (1, 0));
        assert_eq!((off([10, -10, 1]), off([10, -10, 2])), (1, 0));
        assert_eq!((off([11, 9, 10]), off([12, 8, 10])), (1, 0));
        // Two hundredths of a millimetre, and a ten-thousandth.
        assert_eq!(count([2e-5, 0.25, 0.25], [4e-5, 0.25 - 2e-5, 0.25]), 0);
        assert_eq!(count([1e4; 3], [1e4 + 1.0; 3]), 0);
    }

    #[test]
    fn what_is_fixed_lies_where_it_is_believed() {
        let m = model(&[10.0, -9.0, 0.5], &[]);
        let free = |surface, thickness| FreeParameters {
            surface,
            thickness,
            recording_friction: true,
            ..FreeParameters::default()
        };
        let both = fixed(&m, free(false, false));
        assert_eq!((both.tissue.surface_m, &both.tissue.layers), (0.003, &m.assumed.tissue.layers));
        assert!(both.free.recording_friction && !both.free.surface);
        let surface = fixed(&m, free(true, false));
        assert_eq!((surface.tissue.surface_m, &surface.tissue.layers), (0.004, &m.assumed.tissue.layers));
        let thickness = fixed(&m, free(false, true));
        assert_eq!((thickness.tissue.surface_m, &thickness.tissue.layers), (0.003, &m.tissue.layers));
    }

    /// A needle that goes 30 mm in and comes back.
    fn there_and_back() -> FitData {
        let t: Vec<f64> = (0..4000).map(|k| f64::from(k) / 200.0).collect();
        let z = t.iter().map(|t| 3e-3 * (10.0 - (t - 10.0).abs())).collect();
        let r = Recording::new(t, z, vec![0.0; 4000]).expect("a recording");
        FitData::new(Arc::new(vec![BlockAverages::new(&r, &[], BLOCK_S)]), Noise::white(0.5), 0.0)
    }

    #[test]
    fn a_scale_of_the_positions_says_the_same_as_scaled_faces_with_coefficients_in_its_scale() {
        let data = there_and_back();
        let scale = EffectTerm::new(PositionScale { eps: 0.05 }.info(), &[0.05]);
        let mut faces = model(&[0.0, 0.0], &[]);
        faces.tissue.surface_m = 1.05 * 0.003;
        faces.tissue.layers.iter_mut().for_each(|l| l.thickness_m *= 1.05);
        let force = |m: &Model| replay(m, &data, 0).expect("a replay").force_n;
        let off = |m: Model| {
            let scaled = fixed(&m, FreeParameters::default()).with_effect(scale.clone());
            let differ =
                force(&faces).iter().zip(force(&scaled)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            differ / force(&faces).into_iter().fold(0.0, f64::max)
        };
        assert!(off(in_its_scale(&faces, &scale)) < 1e-9, "{}", off(in_its_scale(&faces, &scale)));
        assert!(off(faces.clone()) > 0.04, "{}", off(faces.clone()));
        // What moves no position has no scale.
        let friction = EffectTerm::new(CoulombFriction { c_n_per_m: 1.0 }.info(), &[1.0]);
        assert_eq!(in_its_scale(&faces, &friction).tissue, faces.tissue);
    }

    #[test]
    fn the_last_face_is_passed_where_the_needle_went_beyond_it() {
        let data = there_and_back();
        // 20 mm from 4 mm on; 20 and 30 mm.
        assert!(passed(&model(&[0.0], &[]), &data) && !passed(&model(&[0.0, 0.0], &[]), &data));
        // Beyond, not at it.
        assert!(passed(&model(&[59.0], &[]), &data) && !passed(&model(&[61.0], &[]), &data));
    }

    /// Half the logarithm of the number of blocks for every number, four nats for every effect.
    #[test]
    fn a_free_geometry_costs_its_numbers() {
        let t: Vec<f64> = (0..1000).map(|k| f64::from(k) / 100.0).collect();
        let z = t.iter().map(|t| 2e-3 * t).collect();
        let r = Recording::new(t, z, vec![0.0; 1000]).expect("a recording");
        let data = FitData::new(Arc::new(vec![BlockAverages::new(&r, &[], BLOCK_S)]), Noise::white(0.5), 0.0);
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
            assert!((price(&m, &data) - wanted).abs() < 1e-9, "{} for {wanted}", price(&m, &data));
        }
    }

    #[test]
    fn intervals_suppose_no_face_but_where_an_effect_stands_for_it() {
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

    /// Insertions all moved by so much, in a gel whose surface or thickness is free: whether tightening names an effect, and what stays free.
    fn tightened(moved_m: f64, surface: bool, thickness: bool) -> (bool, FreeParameters) {
        let runs = simulated_recordings(&[], &[[4e-3, moved_m], [5e-3, moved_m], [6e-3, moved_m]]);
        let f = fit_from_truth(&[], &runs.iter().collect::<Vec<_>>());
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
        let begun = fit(&model, &f.data, Effort::FULL).expect("a fit");
        let data = f.data.with_estimated_noise(&begun.residuals.residual_n, NoiseSource::Detrended);
        let begun = fit(&begun.model, &data, Effort::FULL).expect("a fit");
        let mut search = Search::for_tests(begun, data);
        (fix_geometry(&mut search, &prepared), search.best.model.free)
    }

    #[test]
    fn faces_that_came_out_as_believed_are_fixed_and_others_stay_free() {
        for (moved_m, surface) in [(0.0, false), (1e-3, true)] {
            let (named, free) = tightened(moved_m, true, true);
            assert_eq!((named, free.surface, free.thickness), (false, surface, false), "{moved_m}");
        }
        // What was not free is not made free.
        let (named, free) = tightened(1e-3, false, false);
        assert_eq!((named, free.surface, free.thickness), (false, false, false));
        // The one that is free is fixed beside it.
        for (surface, thickness) in [(true, false), (false, true)] {
            let (_, free) = tightened(0.0, surface, thickness);
            assert_eq!((free.surface, free.thickness), (false, false), "{surface}");
        }
    }

    #[test]
    fn an_effect_is_worth_its_price_when_it_gains_it_under_the_noise_that_it_leaves() {
        let drift: AnyEffect = ForceDrift { rate_n_per_s: 0.02 }.into();
        for (rate, worth) in [(0.02, true), (0.0, false)] {
            let runs =
                recordings_with_added_force(&[], &[[4e-3, 3e-4], [5e-3, -3e-4], [6e-3, 0.0]], |t| rate * t);
            let all: Vec<_> = runs.iter().collect();
            let (with, without) =
                (fit_from_truth(std::slice::from_ref(&drift), &all), fit_from_truth(&[], &all));
            assert_eq!(is_worth(&with.fit, &without.fit, &with.data), worth);
            // What saves its price is worth what it loses, and nothing gained is nothing.
            assert_eq!(is_worth(&without.fit, &with.fit, &with.data), !worth);
            assert!(!is_worth(&with.fit, &with.fit, &with.data));
            let f = &with.fit;
            // The drift's number, and a free surface and thickness.
            let wanted = f.nats() + 4.0 + 3.0 * 0.5 * (with.data.compared_block_count() as f64).ln();
            assert!((priced(f, &with.data) - wanted).abs() < 1e-9, "{} for {wanted}", priced(f, &with.data));
        }
    }

    /// Three layers whose first face lies so much deeper than believed, in insertions that are searched for what their geometry is.
    /// `off` are the shares by which the believed thicknesses are wrong beside.
    fn searched(shift_m: f64, off: [f64; 3]) -> (Search, PreparedRecordings) {
        let layer = |thickness_m, stiffness_n_per_m, puncture_n| Layer {
            name: String::new(),
            thickness_m,
            stiffness_n_per_m,
            friction_ns_per_m2: 9000.0,
            puncture_n,
        };
        let layers = vec![
            layer(0.0085, 150.0, Some(0.8)),
            layer(0.0092, 200.0, Some(1.1)),
            layer(0.0131, 170.0, None),
        ];
        let mut tissue = Tissue { surface_m: 0.0, layers };
        let law = ForceLaw::new(&tissue, &[BoundaryShift { layer: 1, shift_m }.into()]).expect("a law");
        let mut spread = uniform_sequence(5);
        let blocks = [0.004, 0.005, 0.0034].map(|speed| {
            let t: Vec<f64> =
                (0..(100.0 * 0.031 / speed) as usize).map(|k| f64::from(k as u32) / 100.0).collect();
            let z: Vec<f64> = t.iter().map(|t| speed * t - 0.002 + 3e-4 * (1.0 - (4.0 * t).cos())).collect();
            let mut state = ForceLawState::default();
            let f = t.iter().zip(&z).map(|(t, z)| {
                let v = speed + 12e-4 * (4.0 * t).sin();
                law.step(&mut state, *t, *z, v, |_| {}).total_n + 0.03 * (spread() - 0.5)
            });
            let f = f.collect();
            BlockAverages::new(&Recording::new(t, z, f).expect("a recording"), &[], BLOCK_S)
        });
        tissue.layers.iter_mut().zip(off).for_each(|(l, off)| l.thickness_m *= 1.0 + off);
        let belief = Assumptions {
            tissue,
            known_effects: Vec::new(),
            tolerance: vec![0.3; 3],
            thickness_tolerance: vec![0.1; 3],
            surface_tolerance_m: 0.002,
        };
        let prepared = PreparedRecordings::new(Arc::new(belief), blocks.to_vec(), 0.0);
        let (begun, data) = fit_base_law(&prepared).expect("a fit");
        (Search::for_tests(begun, data), prepared)
    }

    /// What one effect says with one number free thicknesses say with three.
    #[test]
    fn a_face_that_lies_elsewhere_is_named_where_free_thicknesses_cost_more() {
        let (mut search, prepared) = searched(1e-3, [0.0; 3]);
        assert!(fix_geometry(&mut search, &prepared));
        let model = &search.best.model;
        assert_eq!(
            (model.effects[0].info.id, model.free.surface, model.free.thickness),
            ("boundary_shift", false, false)
        );
        assert!((model.effects[0].values[1] - 1e-3).abs() < 2e-4, "{:?}", model.effects[0].values);
    }

    /// By 3 mm the next layer is a third thinner than believed, whatever else is wrong about the thicknesses; by none they are what a
    /// belief may be wrong about.
    #[test]
    fn a_face_is_named_where_a_thickness_would_be_off_by_more_than_its_tolerance() {
        let off = [0.06, -0.08, 0.07];
        let (mut search, prepared) = searched(3e-3, off);
        assert!(
            (0..3).any(|l| search.best.model.thickness_out_of_tolerance(l))
                && unstrained(&search.best.model).len() >= 4
        );
        let reached = search.best.residuals.nats;
        assert!(fix_geometry(&mut search, &prepared));
        let model = &search.best.model;
        assert_eq!((model.effects[0].info.id, model.effects[0].values[0]), ("boundary_shift", 1.0));
        assert!(!model.free.wide_thickness && (0..3).all(|l| !model.thickness_out_of_tolerance(l)));
        assert!(search.best.nats() < reached + 1.0, "{} for {reached}", search.best.nats());
        // The base law, that may not move it, is far off, and so is the law without the effect.
        assert!(!search.base.model.free.wide_thickness && search.base.nats() > reached + 100.0);
        // How far is only as sure as the thicknesses are.
        let spread = crate::confidence_intervals::Covariance::new(
            &search.best,
            &search.data,
            &mut ChaCha8Rng::seed_from_u64(1),
        );
        let shift = spread.effect_parameter(0, 1);
        assert!(shift.low < 3e-3 && 3e-3 < shift.high && shift.high - shift.low > 1e-3, "{shift:?}");
        let (mut search, prepared) = searched(0.0, off);
        assert!(
            (0..3).all(|l| !search.best.model.thickness_out_of_tolerance(l))
                && unstrained(&search.best.model).is_empty()
        );
        assert!(!fix_geometry(&mut search, &prepared));
    }

    /// As likely as it can be: the shift that leaves least of all thicknesses' priors.
    #[test]
    fn a_strained_thickness_is_shared_between_the_face_and_what_may_be_wrong() {
        let mut m = model(&[46.0, -60.0, 0.0], &[]);
        m.free = FreeParameters {
            surface: false,
            thickness: true,
            wide_thickness: true,
            ..FreeParameters::default()
        };
        assert!(
            m.thickness_out_of_tolerance(0)
                && !m.thickness_out_of_tolerance(1)
                && !m.thickness_out_of_tolerance(2)
        );
        let all = unstrained(&m);
        // 20 and 30 mm to 10 %: 4.6 mm weigh by 1/4, -6 mm by 1/9.
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
        // Both faces of a layer in the middle; none where one is moved already.
        assert_eq!(
            unstrained(&model(&[0.0, 70.0, 0.0], &[])).iter().map(|m| m.effects[0].values[0]).sum::<f64>(),
            4.0 * 3.0
        );
        assert!(
            unstrained(&model(&[46.0, 0.0], &[BoundaryShift { layer: 1, shift_m: 1e-3 }.into()])).is_empty()
        );
    }
}
