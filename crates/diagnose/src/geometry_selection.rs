//! Selects the geometry: fixes surface and thicknesses that agree with the prior, or finds the effect that explains their deviation.
//!
//! Surface and thicknesses are free at first and are not causes. Where the estimates agree with the prior they are fixed, which saves their
//! penalty. A position scale changes all thicknesses in proportion, and a shifted boundary changes two neighbours by opposite amounts, so
//! neither is identifiable with a free geometry; their gain must exceed their penalty compared with the fixed geometry. A thickness outside
//! two tolerances is penalised like a shifted boundary; within the tolerances, two wrong thicknesses are no cause.

use crate::base_law_fit::{PreparedRecordings, with_updated_times};
use crate::model_comparison::{MIN_GAIN_NATS, bic_penalty};
use crate::selection_state::Search;
use stylet_identify::fit::{Effort, Fit, fit, fit_if_below};
use stylet_identify::likelihood::FitData;
use stylet_identify::model::{EffectTerm, FreeParameters, Model};
use stylet_stats::parallel::*;
use stylet_tissue::{ChainStage, EffectInfo, Proposal};

/// Largest deviation of the free thicknesses from the pattern of an effect, relative to the size of the pattern.
const PATTERN_TOLERANCE: f64 = 0.2;
/// Number of thicknesses that must have a common scale. One always does; two do by chance in one tissue of thirty, which is more frequent
/// than a wrong position scale.
const MIN_THICKNESSES: usize = 3;

/// Penalty (nats) of the effects and of the free geometry of a model.
fn penalty_nats(m: &Model, data: &FitData) -> f64 {
    let geometry = usize::from(m.free.surface) + if m.free.thickness { m.layers() } else { 0 };
    let out_of_tolerance = usize::from((0..m.layers()).any(|l| m.thickness_out_of_tolerance(l)));
    bic_penalty(m.effect_parameter_count() + geometry + out_of_tolerance, data.compared_block_count())
        + MIN_GAIN_NATS * (m.effects.len() + out_of_tolerance) as f64
}

/// Penalised objective of a fit in nats.
fn penalised_nats(f: &Fit, data: &FitData) -> f64 {
    f.nats() + penalty_nats(&f.model, data)
}

/// The model with its geometry at the prior, except for the free part.
fn with_fixed_geometry(model: &Model, free: FreeParameters) -> Model {
    let mut m = Model { free, ..model.clone() };
    if !free.surface {
        m.tissue.surface_m = m.assumed.tissue.surface_m;
    }
    if !free.thickness {
        let assumed = m.assumed.clone();
        for (l, b) in m.tissue.layers.iter_mut().zip(&assumed.tissue.layers) {
            l.thickness_m = b.thickness_m;
        }
    }
    m
}

/// Fixes the geometry that agrees with the prior; returns whether an effect was added that explains a deviation.
pub fn fix_geometry(search: &mut Search, prepared: &PreparedRecordings) -> bool {
    let best = &search.best;
    if best.model.assumed.is_geometry_guessed() {
        return false;
    }
    let times = prepared.drop_times();
    let free = |surface, thickness| FreeParameters { surface, thickness, ..best.model.free };
    let mut tried: Vec<Model> = [free(false, false), free(true, false), free(false, true)]
        .into_iter()
        .filter(|f| (!f.surface || best.model.free.surface) && (!f.thickness || best.model.free.thickness))
        .map(|f| with_fixed_geometry(&best.model, f))
        .collect();
    for choice in geometry_effects(&best.model, passed_last_boundary(&best.model, &search.data)) {
        for f in [free(false, false), free(true, false)] {
            tried.push(
                with_fixed_geometry(&with_scaled_coefficients(&best.model, &choice), f)
                    .with_effect(choice.clone()),
            );
        }
    }
    tried.extend(boundary_shift_models(&best.model));
    let current = penalised_nats(best, &search.data);
    let fits: Vec<Fit> = tried
        .into_par_iter()
        .filter_map(|m| {
            // Rupture times for the assumed boundaries instead of the free ones.
            let start = with_updated_times(m, &search.data, &times);
            let first = fit(&start, &search.data, Effort::SHORT)?;
            let model = with_updated_times(first.model, &search.data, &times);
            let wanted = current - penalty_nats(&model, &search.data);
            fit_if_below(&model, &search.data, Effort::FULL, wanted)
        })
        .collect();
    let best_of = |fits: &[&Fit]| {
        let by_penalised_nats = |a: &&&Fit, b: &&&Fit| {
            penalised_nats(a, &search.data).total_cmp(&penalised_nats(b, &search.data))
        };
        fits.iter().min_by(by_penalised_nats).map(|f| (*f).clone())
    };
    let (with_effect, without_effect): (Vec<&Fit>, Vec<&Fit>) =
        fits.iter().partition(|f| f.model.effects.len() > best.model.effects.len());
    let plain = best_of(&without_effect).filter(|f| penalised_nats(f, &search.data) < current);
    let reference = plain.as_ref().unwrap_or(best);
    let extended = best_of(&with_effect)
        .filter(|f| penalised_nats(f, &search.data) < penalised_nats(reference, &search.data));
    let effect_added = extended.is_some();
    if let Some(f) = extended.or(plain) {
        search.best = f;
    }
    if effect_added {
        constrain_base_law(search, prepared);
    }
    effect_added
}

/// Refits the base law with thicknesses within their tolerances, after a boundary shift was identified.
fn constrain_base_law(search: &mut Search, prepared: &PreparedRecordings) {
    let mut model = search.base.model.clone();
    model.free.wide_thickness = false;
    let model = with_updated_times(model, &search.data, &prepared.drop_times());
    if let Some(f) = fit(&model, &search.data, Effort::FULL) {
        search.base = f;
    }
}

/// The model with free geometry for confidence intervals, which would be too narrow with known boundaries. With an effect that moves
/// boundaries they stay fixed, because the effect would not be identifiable.
pub fn free_geometry(model: &Model) -> Model {
    let moves =
        |i: &EffectInfo| matches!(i.proposal, Proposal::LayerFaces(_)) || i.stage == ChainStage::Position;
    let mut m = model.clone();
    if !m.effects.iter().any(|e| moves(e.info)) {
        m.free = FreeParameters { surface: true, thickness: true, ..m.free };
    }
    m
}

/// Models with one boundary shifted, for thicknesses outside their tolerances; the shift has its most probable value.
fn boundary_shift_models(model: &Model) -> Vec<Model> {
    let out_of_tolerance = |l: usize| model.thickness_out_of_tolerance(l);
    let included = |i: &EffectInfo| model.effects.iter().any(|e| e.info.id == i.id);
    let moves = |i: &&EffectInfo| matches!(i.proposal, Proposal::LayerFaces(_)) && !included(i);
    let (prior, layers) = (&model.assumed, &model.tissue.layers);
    // Deviation from the prior in m, and its precision.
    let deviation = |l: usize| {
        let assumed = prior.tissue.layers[l].thickness_m;
        let sd = (prior.thickness_tolerance[l] * assumed).max(1e-9);
        (layers[l].thickness_m - assumed, 1.0 / (sd * sd))
    };
    let mut out = Vec::new();
    for info in prior.candidates().filter(moves) {
        for l in (1..model.layers()).filter(|l| out_of_tolerance(l - 1) || out_of_tolerance(*l)) {
            let ((front, wf), (back, wb)) = (deviation(l - 1), deviation(l));
            let shift = (wf * front - wb * back) / (wf + wb);
            let mut m = model.clone();
            m.tissue.layers[l - 1].thickness_m -= shift;
            m.tissue.layers[l].thickness_m += shift;
            let m = m.with_effect(EffectTerm::new(info, &[l as f64, shift]));
            let tried = [(false, false), (false, true), (true, false), (true, true)];
            for (surface, thickness) in tried.into_iter().filter(|t| model.free.surface || !t.0) {
                out.push(with_fixed_geometry(
                    &m,
                    FreeParameters { surface, thickness, wide_thickness: false, ..m.free },
                ));
            }
        }
    }
    out
}

/// Whether the needle passed the last boundary in any recording, so that the last thickness is determined.
fn passed_last_boundary(model: &Model, data: &FitData) -> bool {
    let end = model.tissue.surface_m + model.tissue.layers.iter().map(|l| l.thickness_m).sum::<f64>();
    data.recordings.iter().any(|b| b.start_s.iter().any(|t| b.motion.at(*t).0 > end))
}

/// Scales stiffness and friction for positions scaled by `1 + eps`; a fit from the unscaled values may not converge.
fn with_scaled_coefficients(model: &Model, choice: &EffectTerm) -> Model {
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

/// Effects that explain the deviations of the free thicknesses: a shifted boundary only outside the tolerance of a thickness, because two
/// wrong thicknesses within their tolerances are no cause; a scale of all positions, for which the last thickness counts if its boundary was
/// passed.
fn geometry_effects(model: &Model, passed_last_boundary: bool) -> Vec<EffectTerm> {
    let assumed = &model.assumed.tissue.layers;
    let deviation_m: Vec<f64> =
        model.tissue.layers.iter().zip(assumed).map(|(l, b)| l.thickness_m - b.thickness_m).collect();
    let tolerated = |l: usize, by: f64| by <= model.assumed.thickness_tolerance[l] * assumed[l].thickness_m;
    let included = |id: &str| model.effects.iter().any(|e| e.info.id == id);
    let mut out = Vec::new();
    for info in model.assumed.candidates().filter(|i| !included(i.id)) {
        match info.proposal {
            Proposal::LayerFaces(_) => {
                for l in 0..deviation_m.len().saturating_sub(1) {
                    let shift = deviation_m[l];
                    let others = (0..deviation_m.len()).filter(|k| *k != l && *k != l + 1);
                    let fits = (deviation_m[l + 1] + shift).abs() < PATTERN_TOLERANCE * shift.abs();
                    let is_tolerated =
                        tolerated(l, shift.abs()) && tolerated(l + 1, deviation_m[l + 1].abs());
                    if fits
                        && !is_tolerated
                        && others.into_iter().all(|k| deviation_m[k].abs() < PATTERN_TOLERANCE * shift.abs())
                    {
                        out.push(EffectTerm::new(info, &[(l + 1) as f64, shift]));
                    }
                }
            }
            Proposal::LinearColumns(_) if info.stage == ChainStage::Position => {
                let determined = deviation_m.len().saturating_sub(usize::from(!passed_last_boundary));
                let ratios: Vec<f64> =
                    deviation_m.iter().zip(assumed).map(|(o, b)| o / b.thickness_m).collect();
                let mean = stylet_stats::mean(&ratios[..determined]);
                if determined >= MIN_THICKNESSES
                    && mean.abs() > 1e-4
                    && ratios[..determined].iter().all(|r| (r - mean).abs() < PATTERN_TOLERANCE * mean.abs())
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
mod tests;
