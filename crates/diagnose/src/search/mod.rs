//! The search: forward selection of effects by whitened likelihood, every rival fitted jointly with the
//! base parameters, then backward pruning and the simplest of nested models.

mod clues;
mod contest;
mod level;
mod membrane;
mod scatter;
mod select;
mod smeared;

pub(crate) use contest::shift;

use crate::air;
use crate::fit::{Data, Fit, Residuals, objective, residuals};
use crate::model::{Choice, Model};
use crate::noise::{Noise, median};
use crate::refine::{fit_seeded, refine};
use crate::ruptures;
use crate::thresholds;
use crate::track::Track;
use rayon::prelude::*;
use std::sync::Arc;
use stylet_tissue::{AnyEffect, Tissue};

/// Samples per second at which rivals are screened.
const SCREEN_HZ: f64 = 50.0;
/// Rivals fitted at full rate.
const FINALISTS: usize = 6;
/// A step of the recorded force of so many standard deviations of what is recorded in air hides the noise. Below,
/// the noise makes the rounding independent of the force (Widrow 1961), and it counts as noise.
pub const COARSE_STEP: f64 = 3.0;
/// Above this frequency (Hz) an interference is not fitted on averages.
const FAST_HZ: f64 = 6.0;

/// Nats more that every effect must gain when rounding hides the noise: what is left then has no known colour.
const ROUNDED: f64 = 25.0;
/// Beyond two effects nothing is sought where what is left looks like noise by this p-value.
const NOISE_ALONE_P: f64 = 0.1;
/// How far (s) the base law may move a rupture at a clear drop.
const BASE_MOVES_S: f64 = 0.12;

/// The reach of the base law.
fn least_reach(reach_s: f64) -> f64 {
    if reach_s.is_finite() { reach_s.min(BASE_MOVES_S) } else { reach_s }
}

/// Settings of the search.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Nats that every effect must gain beyond [`thresholds::needed`].
    pub margin: f64,
    /// Most effects at once.
    pub most: usize,
}

impl Default for Settings {
    fn default() -> Self {
        Self { margin: 0.0, most: 3 }
    }
}

impl Settings {
    /// Nats that an effect must gain.
    #[must_use]
    pub fn needed(&self, id: &str) -> f64 {
        thresholds::needed(id) + self.margin
    }
}

/// A model fitted at full rate, with the ruptures it wants.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// The model.
    pub model: Model,
    /// Instants (s) of ruptures per recording and layer.
    pub ruptures: Vec<Vec<f64>>,
    /// Objective in nats.
    pub nats: f64,
}

impl Candidate {
    /// Nats with a fine for each number beyond the first of an effect: what rivals are compared by.
    #[must_use]
    pub fn fined(&self) -> f64 {
        self.nats + (self.model.extra() - self.model.effects.len()) as f64
    }
}

/// What one stage of the selection tried.
#[derive(Clone, Debug)]
pub struct Stage {
    /// Effects that stood before.
    pub stood: Vec<&'static str>,
    /// Effect and nats gained on averages, all that were fitted.
    pub screened: Vec<(&'static str, f64)>,
    /// Effect and nats gained at full rate.
    pub rivals: Vec<(&'static str, f64, usize)>,
    /// Nats that were needed by the best.
    pub needed: f64,
    /// The effect taken, if any.
    pub taken: Option<&'static str>,
}

/// A fit under way on averages: the fit, its data, the ruptures at full rate.
type Begun = (Fit, Data, Vec<Vec<f64>>);

/// Everything that the search works on and finds.
pub struct Search {
    /// Full-rate data with the noise as known so far and the base model's ruptures.
    pub data: Data,
    /// Settings.
    pub settings: Settings,
    /// The base model.
    pub base: Candidate,
    /// The best model.
    pub best: Candidate,
    /// Rivals of the last effect taken, best first, the best included.
    pub rivals: Vec<Candidate>,
    /// What was tried.
    pub stages: Vec<Stage>,
    /// The noise in air, if it could be told.
    pub air: Option<Noise>,
    /// Block length of the screening.
    pub q: usize,
    /// Largest force.
    pub force_n: f64,
    /// Fined nats of the effect taken last, under the noise by which its rivals were judged.
    pub reference: f64,
    /// Per recording the instants (s) of drops that no layer's rupture took, and whether they are clear.
    pub spare: Vec<Vec<(f64, bool)>>,
}

impl Search {
    /// Fits the base model.
    #[must_use]
    pub fn base(
        tissue: &Tissue,
        tolerance: f64,
        given: &[AnyEffect],
        tracks: Vec<Track>,
        step_n: f64,
        settings: Settings,
    ) -> Option<Self> {
        let mut model = Model::base(tissue, tolerance, given);
        let force_n = tracks.iter().flat_map(|t| &t.f).fold(0.0_f64, |m, f| m.max(f.abs()));
        let least = 1e-4 * force_n.max(1e-9);
        let mut found = ruptures::find(&mut model, &tracks, ruptures::SHARP);
        let air = air::noise(&tracks, tissue.surface_m, least, 0.0);
        let noise = air.unwrap_or_else(|| rough(&tracks, least));
        smeared::tried(&mut model, &mut found, &tracks, noise);
        // Rounding to steps beyond the noise is no noise: it repeats itself wherever the force does.
        let coarse = step_n > COARSE_STEP * noise.marginal_n;
        let (air, noise, dead_n) = if coarse {
            let dead_n = 0.5 * step_n;
            let beyond = air::noise(&tracks, tissue.surface_m, least, dead_n);
            let noise = beyond.filter(|n| n.marginal_n > 0.5 * dead_n).unwrap_or(Noise::white(0.5 * dead_n));
            (Some(noise), noise, dead_n)
        } else {
            (air, noise, 0.0)
        };
        let q = (tracks.first().map_or(1.0, |t| t.sample_hz) / SCREEN_HZ).round().max(1.0) as usize;
        // The base law, which lacks whatever it lacks, moves ruptures but little.
        let near = found.reach.iter().map(|r| r.iter().map(|r| least_reach(*r)).collect()).collect();
        let mut data =
            Data { tracks: Arc::new(tracks), ruptures: found.instants, reach: Arc::new(near), dead_n, noise };
        let coarse = data.blocks(q, noise.blocks(q));
        let first = fit_seeded(model, &coarse, 8, 0.1)?;
        let fitted = refine(&first.model, &mut data, 3, 5, true)?;
        if air.is_none() {
            data.noise = own_noise(&fitted.model, &data, least).unwrap_or(noise);
        }
        let fitted = refine(&fitted.model, &mut data, 1, 4, false)?;
        let margin = settings.margin + if dead_n > 0.0 { ROUNDED } else { 0.0 };
        let settings = Settings { margin, ..settings };
        data.reach = Arc::new(found.reach);
        let base = Candidate { model: fitted.model, ruptures: data.ruptures.clone(), nats: fitted.nats };
        Some(Self {
            settings,
            best: base.clone(),
            base,
            rivals: Vec::new(),
            stages: Vec::new(),
            air,
            q,
            force_n,
            data,
            reference: 0.0,
            spare: found.spare,
        })
    }

    /// The data with a candidate's ruptures.
    #[must_use]
    pub fn data_of(&self, candidate: &Candidate) -> Data {
        Data { ruptures: candidate.ruptures.clone(), ..self.data.clone() }
    }

    /// The smallest noise worth thinking of.
    #[must_use]
    pub fn least_n(&self) -> f64 {
        1e-4 * self.force_n.max(1e-9)
    }

    /// Runs the whole selection.
    pub fn run(&mut self, mut progress: impl FnMut(&str)) {
        self.base = self.levelled(self.base.clone());
        self.best = self.base.clone();
        while self.best.model.effects.len() < self.settings.most {
            progress(&format!("looking for effect {}", self.best.model.effects.len() + 1));
            let standing = self.best.clone();
            let taken = self.stage(&standing);
            if taken {
                self.enlarge();
                let uncrossed = self.unveiled(self.uncrossed(self.best.clone()));
                self.best = crate::profile::settled(self, &uncrossed).0;
            }
            if !taken || (self.best.model.effects.len() > 1 && (self.hopeless(2.0) || self.nothing_left())) {
                break;
            }
        }
        if self.best.model.effects.len() > 1 && !self.hopeless(0.3) {
            progress("pruning");
            self.exchange();
            self.prune();
        }
        self.settle_base();
    }

    /// Effects with a larger variant (a second time constant) get it when it gains what its numbers must.
    fn enlarge(&mut self) {
        for index in 0..self.best.model.effects.len() {
            let own = self.best.model.effects[index].clone();
            let (Some(larger), &[fraction, tau]) = (own.info.larger, own.values.as_slice()) else { continue };
            let found: Vec<Option<Candidate>> = [8.0, 3.0, 0.3, 0.12]
                .par_iter()
                .map(|ratio| {
                    let mut model = self.best.model.clone();
                    let mut terms = [[0.7 * fraction, tau], [0.3 * fraction, ratio * tau]];
                    terms.sort_by(|a, b| a[1].total_cmp(&b[1]));
                    model.effects[index] = Choice::new(larger, terms.as_flattened());
                    self.refitted(&model, &self.best.ruptures)
                })
                .collect();
            let found = found.into_iter().flatten().min_by(|a, b| a.nats.total_cmp(&b.nats));
            let Some(two) = found.filter(|two| two.nats < self.best.nats) else { continue };
            // What more turns of the optimiser would have gained without it does not count.
            let mut one = two.model.clone();
            one.effects[index] = own;
            let one = self.refitted(&one, &two.ruptures).filter(|one| one.nats < self.best.nats);
            if let Some(one) = one {
                self.best = one;
            }
            if self.best.nats - two.nats > thresholds::SECOND_TERM + self.settings.margin {
                self.best = two;
            }
        }
    }

    /// Whether structure remains that is larger by `ratio` than what the effects taken explain: no
    /// further effect of the library will make a cause of them.
    fn hopeless(&self, ratio: f64) -> bool {
        let data = self.data_of(&self.best);
        let left = crate::leftover::test(&self.best.model, &data);
        let base = nats(&self.base.model, &self.data_of(&self.base));
        left.p_value < 1e-20 && left.nats > ratio * (base - self.best.nats)
    }

    /// Whether what the effects taken leave looks like noise alone.
    fn nothing_left(&self) -> bool {
        crate::leftover::test(&self.best.model, &self.data_of(&self.best)).p_value > NOISE_ALONE_P
    }

    /// The base model once more under the final noise; effects that then gain too little go.
    fn settle_base(&mut self) {
        if self.best.model.effects.is_empty() {
            self.base = self.best.clone();
            return;
        }
        let rivals = [self.best.clone()];
        let base = Candidate { nats: nats(&self.base.model, &self.data_of(&self.base)), ..self.base.clone() };
        self.base = self.refit_standing(&base, &rivals);
        let judged = |c: &Candidate| {
            let nats = nats(&c.model, &self.data_of(c));
            self.forgiving(&Candidate { nats, ..c.clone() }).nats
        };
        let (base, best) = (judged(&self.base), judged(&self.best));
        let names = self.best.model.names();
        let needed = names.iter().map(|id| self.settings.needed(id)).fold(0.0, f64::max);
        if base - best < needed {
            self.best = self.base.clone();
            self.rivals.clear();
        }
    }
}

/// The noise that a model leaves over all its samples.
#[must_use]
pub fn own_noise(model: &Model, data: &Data, least_n: f64) -> Option<Noise> {
    let mut r = Residuals::default();
    if !residuals(model, data, &mut r) {
        return None;
    }
    let mut parts: Vec<(&Track, &[f64])> = Vec::new();
    let mut from = 0;
    for track in data.tracks.iter() {
        parts.push((track, &r.e[from..from + track.len()]));
        from += track.len();
    }
    Noise::estimate(&parts, |_, _| true, least_n)
}

/// White noise from the differences of neighbouring samples.
fn rough(tracks: &[Track], least_n: f64) -> Noise {
    let mut d: Vec<f64> =
        tracks.iter().flat_map(|t| t.f.windows(3).map(|w| (w[0] - 2.0 * w[1] + w[2]).abs())).collect();
    Noise::white((median(&mut d) * 1.4826 / 6.0_f64.sqrt()).max(least_n))
}

/// The objective of a model under data, without a fit.
#[must_use]
pub fn nats(model: &Model, data: &Data) -> f64 {
    let mut r = Residuals::default();
    if residuals(model, data, &mut r) { objective(model, &r) } else { f64::INFINITY }
}

/// A choice by its id.
#[must_use]
pub fn choice(id: &str, values: &[f64]) -> Option<Choice> {
    stylet_tissue::info(id).map(|info| Choice::new(info, values))
}
