//! Whether the believed geometry stands as it is, and what explains it when it does not.
//!
//! Surface and thicknesses are free from the start and are no causes. When they come out as believed, they are fixed there:
//! that saves their numbers. A scale of the position moves every face in proportion, a shifted face trades one thickness
//! for the next: with the geometry free neither can be seen; that the free numbers fall into such a pattern by chance is what
//! the saved numbers are paid for.

use crate::base::Prepared;
use crate::judge::{LEAST, cost, gain};
use crate::select::Search;
use rayon::prelude::*;
use stylet_identify::fit::{Effort, Fit, fit, fit_below};
use stylet_identify::model::{Choice, Free, Model};
use stylet_identify::objective::Data;
use stylet_identify::retime::retime;
use stylet_tissue::{EffectInfo, Place, Proposal, library};

/// A pattern counts when the free numbers follow it to this share of its size.
const PATTERN: f64 = 0.2;

/// Nats that the effects and the free geometry of a model cost.
fn price(m: &Model, data: &Data) -> f64 {
    let geometry = usize::from(m.free.surface) + if m.free.thickness { m.layers() } else { 0 };
    cost(m.effect_numbers() + geometry, data.compared()) + LEAST * m.effects.len() as f64
}

/// Nats of a fit with that price.
fn priced(f: &Fit, data: &Data) -> f64 {
    f.nats() + price(&f.model, data)
}

/// A model with its geometry as believed, but for what stays free.
fn fixed(model: &Model, free: Free) -> Model {
    let mut m = Model { free, ..model.clone() };
    if !free.surface {
        m.tissue.surface_m = m.belief.tissue.surface_m;
    }
    if !free.thickness {
        let believed = m.belief.clone();
        for (l, b) in m.tissue.layers.iter_mut().zip(&believed.tissue.layers) {
            l.thickness_m = b.thickness_m;
        }
    }
    m
}

/// Fixes what is as believed; true when an effect came in for it.
pub fn tighten(search: &mut Search, prepared: &Prepared) -> bool {
    let best = &search.best;
    let times = prepared.drop_times();
    let free = |surface, thickness| Free { surface, thickness, ..best.model.free };
    let mut tried: Vec<Model> = [free(false, false), free(true, false), free(false, true)]
        .into_iter()
        .filter(|f| (!f.surface || best.model.free.surface) && (!f.thickness || best.model.free.thickness))
        .map(|f| fixed(&best.model, f))
        .collect();
    for choice in patterns(&best.model) {
        for f in [free(false, false), free(true, false)] {
            tried.push(fixed(&best.model, f).with(choice.clone()));
        }
    }
    let stands = priced(best, &search.data);
    let fits: Vec<Fit> = tried
        .into_par_iter()
        .filter_map(|m| {
            // Where the believed faces have the ruptures, not where the free ones had them.
            let mut start = m;
            retime(&mut start, &search.data, &times);
            let first = fit(&start, &search.data, Effort::SHORT)?;
            let mut model = first.model;
            retime(&mut model, &search.data, &times);
            let wanted = stands - price(&model, &search.data);
            fit_below(&model, &search.data, Effort::FULL, wanted)
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
    new
}

/// Whether a fit with an effect for the geometry is worth its price when all that it leaves is noise, however slow.
fn is_worth(f: &Fit, rival: &Fit, data: &Data) -> bool {
    gain(rival, f, data) > price(&f.model, data) - price(&rival.model, data)
}

/// A model with its geometry as unsure as it is believed to be: numbers whose intervals suppose faces that nobody measured are too
/// sure. Where an effect stands for moved faces they stay, for it is told by nothing else.
#[must_use]
pub fn unsure(model: &Model) -> Model {
    let moves = |i: &EffectInfo| matches!(i.proposal, Proposal::Faces(_)) || i.place == Place::Position;
    let mut m = model.clone();
    if !m.effects.iter().any(|e| moves(e.info)) {
        m.free = Free { surface: true, thickness: true, ..m.free };
    }
    m
}

/// Effects that would move the faces as the free geometry has moved them.
fn patterns(model: &Model) -> Vec<Choice> {
    let believed = &model.belief.tissue.layers;
    let off: Vec<f64> =
        model.tissue.layers.iter().zip(believed).map(|(l, b)| l.thickness_m - b.thickness_m).collect();
    let taken = |id: &str| model.effects.iter().any(|e| e.info.id == id);
    let mut out = Vec::new();
    for info in library().filter(|i| !taken(i.id)) {
        match info.proposal {
            Proposal::Faces(_) => {
                for l in 0..off.len().saturating_sub(1) {
                    let shift = off[l];
                    let others = (0..off.len()).filter(|k| *k != l && *k != l + 1);
                    let fits = (off[l + 1] + shift).abs() < PATTERN * shift.abs();
                    if shift.abs() > 2e-5
                        && fits
                        && others.into_iter().all(|k| off[k].abs() < PATTERN * shift.abs())
                    {
                        out.push(Choice::new(info, &[(l + 1) as f64, shift]));
                    }
                }
            }
            Proposal::Columns(_) if info.place == Place::Position => {
                let ratios: Vec<f64> = off.iter().zip(believed).map(|(o, b)| o / b.thickness_m).collect();
                let reached = ratios.len().max(2) - 1;
                let mean = ratios[..reached.min(ratios.len())].iter().sum::<f64>()
                    / reached.min(ratios.len()).max(1) as f64;
                // One thickness alone is in proportion to anything.
                if reached > 1
                    && mean.abs() > 1e-4
                    && ratios[..reached.min(ratios.len())]
                        .iter()
                        .all(|r| (r - mean).abs() < PATTERN * mean.abs())
                {
                    out.push(Choice::new(info, &[mean]));
                }
            }
            _ => {}
        }
    }
    out
}
