//! The search: forward selection of effects by whitened likelihood, every rival fitted jointly with the
//! base parameters, then backward pruning and the simplest of nested models.

use crate::air;
use crate::fit::{Data, Fit, Residuals, fit, objective, residuals};
use crate::look::{Look, Seen};
use crate::model::{Choice, Model};
use crate::noise::{Noise, median};
use crate::refine::{refine, seed_punctures};
use crate::ruptures;
use crate::spectrum::{peaks, periodogram, sharpen};
use crate::starts::{self, Hints, Start};
use crate::thresholds;
use crate::track::{NEVER, Track};
use rayon::prelude::*;
use std::sync::Arc;
use stylet_tissue::{AnyEffect, Tissue};

/// Samples per second at which rivals are screened.
const SCREEN_HZ: f64 = 50.0;
/// Rivals fitted at full rate.
const FINALISTS: usize = 6;
/// A step of the recorded force of so many standard deviations of the noise hides it.
pub const COARSE_STEP: f64 = 1.5;
/// Above this frequency (Hz) an interference is not fitted on averages.
const FAST_HZ: f64 = 6.0;

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
    /// Per recording the instants (s) of clear drops that no layer's rupture took.
    pub spare: Vec<Vec<f64>>,
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
        let found = ruptures::find(&mut model, &tracks);
        let air = air::noise(&tracks, tissue.surface_m, least);
        let noise = air.unwrap_or_else(|| rough(&tracks, least));
        // Rounding to steps beyond the noise is no noise: it repeats itself wherever the force does.
        let coarse = step_n > COARSE_STEP * noise.marginal_n;
        let (air, noise, dead_n) = if coarse {
            let white = Noise::white(0.25 * step_n);
            (Some(white), white, 0.5 * step_n)
        } else {
            (air, noise, 0.0)
        };
        let q = (tracks.first().map_or(1.0, |t| t.sample_hz) / SCREEN_HZ).round().max(1.0) as usize;
        // The base law, which lacks whatever it lacks, moves ruptures but little.
        let near = found.reach.iter().map(|r| r.iter().map(|r| least_reach(*r)).collect()).collect();
        let mut data =
            Data { tracks: Arc::new(tracks), ruptures: found.instants, reach: Arc::new(near), dead_n, noise };
        seed_punctures(&mut model, &data);
        let coarse = data.blocks(q, noise.blocks(q));
        let first = fit(&model, &coarse, 8, 0.1)?;
        let fitted = refine(&first.model, &mut data, 3, 5, true)?;
        if air.is_none() {
            data.noise = own_noise(&fitted.model, &data, least).unwrap_or(noise);
        }
        let fitted = refine(&fitted.model, &mut data, 1, 4, false)?;
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
        while self.best.model.effects.len() < self.settings.most {
            progress(&format!("looking for effect {}", self.best.model.effects.len() + 1));
            let standing = self.best.clone();
            let taken = self.stage(&standing);
            if taken {
                self.enlarge();
            }
            if !taken || self.hopeless(2.0) {
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
            let best = found.into_iter().flatten().min_by(|a, b| a.nats.total_cmp(&b.nats));
            if let Some(best) =
                best.filter(|b| self.best.nats - b.nats > thresholds::SECOND_TERM + self.settings.margin)
            {
                self.best = best;
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

    /// The base model once more under the final noise; effects that then gain too little go.
    fn settle_base(&mut self) {
        if self.best.model.effects.is_empty() {
            self.base = self.best.clone();
            return;
        }
        let rivals = [self.best.clone()];
        let base = Candidate { nats: nats(&self.base.model, &self.data_of(&self.base)), ..self.base.clone() };
        self.base = self.refit_standing(&base, &rivals);
        let names = self.best.model.names();
        let needed = names.iter().map(|id| self.settings.needed(id)).fold(0.0, f64::max);
        if self.base.nats - self.best.nats < needed {
            self.best = self.base.clone();
            self.rivals.clear();
        }
    }

    /// Rivals that extend `standing`, fitted at full rate, best first; and what was screened.
    fn contest(&self, standing: &Candidate) -> (Vec<Candidate>, Vec<(&'static str, f64)>) {
        let data = self.data_of(standing);
        let coarse = data.blocks(self.q, data.noise.blocks(self.q));
        let Some(stood) = fit(&standing.model, &coarse, 4, 0.05) else { return (Vec::new(), Vec::new()) };
        let mut hints = self.hints(standing, &data);
        if let Some(look) = Look::new(&stood.model, &coarse) {
            hints.membranes = look.membranes(stood.model.assumed.surface_m, hints.depth_m);
        }
        let taken = standing.model.names();
        let all: Vec<Start> = starts::all(&hints)
            .into_iter()
            .filter(|s| {
                let fast = s.choice.info.id == "periodic_interference" && s.choice.values[1] > FAST_HZ;
                !fast && (!taken.contains(&s.choice.info.id) || s.choice.info.id == "periodic_interference")
            })
            .collect();
        let seen = looks(&stood.model, &data, &coarse, self.q, &all);
        // The two best starts of each effect, three of those with several basins.
        let mut chosen: Vec<&Seen> = Vec::new();
        let mut order: Vec<&Seen> = seen.iter().collect();
        order.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        for s in order {
            let id = s.start.choice.info.id;
            let most = match id {
                "boundary_shift" | "rate_dependent_puncture" | "position_scale" => 8,
                "hidden_membrane" | "respiration" | "low_pass_lag" | "soft_boundary" => 3,
                _ => 2,
            };
            if chosen.iter().filter(|c| c.start.choice.info.id == id).count() < most
                && (s.gain > 1.0 || moves_events(id))
            {
                chosen.push(s);
            }
        }
        // Two turns for all; the rest only for those that may still win.
        let begun: Vec<Option<Begun>> = chosen
            .par_iter()
            .map(|s| {
                let shifted = shift(&data, &s.start);
                let there = if s.start.lead_m == 0.0 && s.start.lead_s == 0.0 {
                    coarse.clone()
                } else {
                    shifted.blocks(self.q, shifted.noise.blocks(self.q))
                };
                let mut model = stood.model.with(s.start.choice.clone());
                seed_punctures(&mut model, &there);
                let f = fit(&model, &there, 2, 0.1)?;
                Some((f, there, shifted.ruptures))
            })
            .collect();
        let mut begun: Vec<Begun> = begun.into_iter().flatten().collect();
        if !taken.contains(&"hidden_membrane") {
            begun.extend(self.exchanged(&stood.model, &data));
        }
        begun.sort_by(|a, b| a.0.nats.total_cmp(&b.0.nats));
        let lead = begun.first().map_or(0.0, |b| stood.nats - b.0.nats);
        let mut kept = 0;
        begun.retain(|b| {
            let gain = stood.nats - b.0.nats;
            let keep = kept < 4 || (kept < 16 && gain > 0.3 * lead - 100.0);
            kept += usize::from(keep);
            keep
        });
        let fits: Vec<Option<(Fit, Vec<Vec<f64>>)>> = begun
            .par_iter()
            .map(|(f, there, ruptures)| Some((fit(&f.model, there, 6, 0.1)?, ruptures.clone())))
            .collect();
        let mut best: Vec<(Fit, Vec<Vec<f64>>)> = Vec::new();
        for found in fits.into_iter().flatten() {
            let id = found.0.model.names().last().copied();
            match best.iter_mut().find(|b| b.0.model.names().last().copied() == id) {
                Some(old) if old.0.nats > found.0.nats => *old = found,
                Some(_) => {}
                None => best.push(found),
            }
        }
        best.sort_by(|a, b| a.0.nats.total_cmp(&b.0.nats));
        let screened: Vec<(&'static str, f64)> = best
            .iter()
            .map(|b| (b.0.model.names().last().copied().unwrap_or(""), stood.nats - b.0.nats))
            .collect();
        best.truncate(FINALISTS);
        let lead = best.first().map_or(0.0, |b| stood.nats - b.0.nats);
        best.retain(|b| {
            let gain = stood.nats - b.0.nats;
            gain > 0.5 * lead - 40.0 && (gain > 2.5 || (gain > -400.0 && lead > 50.0))
        });
        let mut finalists: Vec<(Model, Vec<Vec<f64>>)> =
            best.into_iter().map(|(f, r)| (f.model, r)).collect();
        for c in self.sharp(standing, &data, lead > 30.0) {
            finalists.push((standing.model.with(c), standing.ruptures.clone()));
        }
        for start in self.fast_lines(standing, &data) {
            finalists.push((standing.model.with(start.choice), standing.ruptures.clone()));
        }
        let mut rivals: Vec<Candidate> = finalists
            .par_iter()
            .map(|(model, ruptures)| {
                let mut there = Data { ruptures: ruptures.clone(), ..data.clone() };
                let wide = matches!(
                    model.names().last().copied().unwrap_or(""),
                    "low_pass_lag" | "soft_boundary" | "time_delay" | "needle_compliance" | "respiration"
                );
                let f = refine(model, &mut there, if wide { 3 } else { 2 }, 5, wide)?;
                Some(Candidate { model: f.model, ruptures: there.ruptures, nats: f.nats })
            })
            .collect::<Vec<_>>()
            .into_iter()
            .flatten()
            .collect();
        rivals.sort_by(|a, b| a.fined().total_cmp(&b.fined()));
        // The same effect from two roads.
        let mut names: Vec<&str> = Vec::new();
        rivals.retain(|r| {
            let name = r.model.names().last().copied().unwrap_or("");
            let new = !names.contains(&name);
            names.push(name);
            new
        });
        (rivals, screened)
    }

    /// Membranes at drops that were taken for a layer's rupture, with that layer's at a drop that nobody took.
    fn exchanged(&self, stood: &Model, data: &Data) -> Vec<Begun> {
        let mut tried: Vec<(Choice, Data)> = Vec::new();
        let surface = stood.assumed.surface_m;
        for layer in 0..stood.assumed.layers.len() {
            let Some(other) = self.exchange_drops(data, layer) else { continue };
            // Where the membrane broke, and what it let go.
            let (mut depths, mut forces) = (Vec::new(), Vec::new());
            for (track, ruptures) in data.tracks.iter().zip(&data.ruptures) {
                let k = track.first_from(ruptures[layer]);
                if (4..track.len().saturating_sub(4)).contains(&k) {
                    depths.push(track.z[k] - surface);
                    forces.push(track.f[k - 3] - track.f[k + 2]);
                }
            }
            let (breaks, force) = (median(&mut depths), median(&mut forces).max(0.02));
            let there = Data { ruptures: other, ..data.clone() };
            for stretch in [1e-3, 4e-3, 12e-3] {
                let values = [breaks - stretch, force / stretch, force];
                if let Some(choice) = choice("hidden_membrane", &values).filter(|_| values[0] > 0.0) {
                    tried.push((choice, there.clone()));
                }
            }
        }
        let fits: Vec<Option<Begun>> = tried
            .into_par_iter()
            .map(|(choice, there)| {
                let coarse = there.blocks(self.q, there.noise.blocks(self.q));
                let mut model = stood.with(choice);
                seed_punctures(&mut model, &coarse);
                Some((fit(&model, &coarse, 4, 0.1)?, coarse, there.ruptures))
            })
            .collect();
        fits.into_iter().flatten().collect()
    }

    /// The ruptures with those of one layer at spare drops, the same depth in every recording; `None` when
    /// there are none.
    fn exchange_drops(&self, data: &Data, layer: usize) -> Option<Vec<Vec<f64>>> {
        const SAME_DEPTH_M: f64 = 2e-3;
        let mut depth: Option<f64> = None;
        let mut out = Vec::new();
        for ((track, ruptures), spare) in data.tracks.iter().zip(&data.ruptures).zip(&self.spare) {
            let mut new = ruptures.clone();
            let after = if layer > 0 { ruptures[layer - 1] } else { f64::NEG_INFINITY };
            let before = ruptures.get(layer + 1).copied().unwrap_or(NEVER);
            let z = |t: f64| track.z.get(track.first_from(t)).copied().unwrap_or(f64::INFINITY);
            let free = spare.iter().copied().filter(|t| *t > after && *t < before);
            let nearest = match depth {
                None => free.min_by(|a, b| a.total_cmp(b)),
                Some(d) => free.min_by(|a, b| (z(*a) - d).abs().total_cmp(&(z(*b) - d).abs())),
            };
            let at = nearest.filter(|t| depth.is_none_or(|d: f64| (z(*t) - d).abs() < SAME_DEPTH_M))?;
            depth = depth.or(Some(z(at)));
            new[layer] = at;
            out.push(new);
        }
        (!out.is_empty()).then_some(out)
    }

    /// One step of the forward selection; true when an effect was taken.
    fn stage(&mut self, standing: &Candidate) -> bool {
        let (mut rivals, screened) = self.contest(standing);
        let stood = standing.model.names();
        let mut stage = Stage { stood, screened, rivals: Vec::new(), needed: thresholds::LEAST, taken: None };
        if rivals.is_empty() {
            self.stages.push(stage);
            return false;
        }
        // The noise as the best model leaves it, for all rivals alike.
        let noise = (self.data.dead_n == 0.0)
            .then(|| own_noise(&rivals[0].model, &self.data_of(&rivals[0]), self.least_n()))
            .flatten();
        let before = self.data.noise;
        self.data.noise = noise.unwrap_or(before);
        let data = &self.data;
        let first = rivals[0].fined();
        let rescored: Vec<Option<Candidate>> = rivals
            .par_iter()
            .map(|r| {
                let mut there = Data { ruptures: r.ruptures.clone(), ..data.clone() };
                if r.fined() > first + 60.0 {
                    return Some(Candidate { nats: nats(&r.model, &there), ..r.clone() });
                }
                let f = refine(&r.model, &mut there, 0, 3, false)?;
                Some(Candidate { model: f.model, ruptures: there.ruptures, nats: f.nats })
            })
            .collect();
        rivals = rescored.into_iter().flatten().collect();
        rivals.sort_by(|a, b| a.fined().total_cmp(&b.fined()));
        let standing = self.refit_standing(standing, &rivals);
        for r in &rivals {
            let name = r.model.names().last().copied().unwrap_or("");
            stage.rivals.push((name, standing.nats - r.nats, r.model.extra() - standing.model.extra()));
        }
        let Some(best) = rivals.first().cloned() else {
            self.stages.push(stage);
            return false;
        };
        let best = self.polished(&simplest(&rivals, &best));
        stage.needed = self.settings.needed(best.model.names().last().copied().unwrap_or(""));
        let gain = standing.nats - best.nats;
        let taken = gain > stage.needed;
        if standing.model.effects.is_empty() {
            self.base = standing.clone();
        }
        if taken {
            stage.taken = best.model.names().last().copied();
            self.reference = best.fined();
            self.best = best;
            self.rivals = rivals;
        } else {
            self.best = standing;
        }
        self.stages.push(stage);
        taken
    }

    /// The standing model fitted anew under the present noise, from its own optimum and those of its
    /// best rivals.
    fn refit_standing(&self, standing: &Candidate, rivals: &[Candidate]) -> Candidate {
        let count = standing.model.effects.len();
        // A gain of thousands is no failure of the optimiser.
        let ahead = rivals.first().map_or(0.0, |r| standing.nats - r.nats);
        let more = if (4.0..2000.0).contains(&ahead) { 2 } else { 0 };
        let roads: Vec<(Model, Vec<Vec<f64>>)> =
            std::iter::once((standing.model.clone(), standing.ruptures.clone()))
                .chain(rivals.iter().take(more).map(|r| {
                    let mut model = r.model.clone();
                    model.effects.truncate(count);
                    (model, r.ruptures.clone())
                }))
                .collect();
        let fits: Vec<Option<Candidate>> = roads
            .par_iter()
            .map(|(model, ruptures)| {
                let mut there = Data { ruptures: ruptures.clone(), ..self.data.clone() };
                let f = refine(model, &mut there, 1, 2, false)?;
                Some(Candidate { model: f.model, ruptures: there.ruptures, nats: f.nats })
            })
            .collect();
        fits.into_iter()
            .flatten()
            .min_by(|a, b| a.nats.total_cmp(&b.nats))
            .unwrap_or_else(|| standing.clone())
    }

    /// With several effects: each in turn is taken out and contested anew.
    fn exchange(&mut self) {
        for index in 0..self.best.model.effects.len() {
            let Some(without) = self.refitted(&self.best.model.without(index), &self.best.ruptures) else {
                continue;
            };
            let (rivals, _) = self.contest(&without);
            let Some(first) = rivals.first() else { continue };
            let first = simplest(&rivals, first);
            if first.fined() < self.best.fined() - 0.5 {
                self.reference = first.fined();
                self.best = first;
                self.rivals = rivals;
            }
        }
    }

    /// The candidate fitted to the end.
    fn polished(&self, candidate: &Candidate) -> Candidate {
        let mut there = self.data_of(candidate);
        match refine(&candidate.model, &mut there, 3, 8, true) {
            Some(f) if f.nats < candidate.nats => {
                Candidate { model: f.model, ruptures: there.ruptures, nats: f.nats }
            }
            _ => candidate.clone(),
        }
    }

    fn refitted(&self, model: &Model, ruptures: &[Vec<f64>]) -> Option<Candidate> {
        let mut there = Data { ruptures: ruptures.to_vec(), ..self.data.clone() };
        let f = refine(model, &mut there, 2, 5, true)?;
        Some(Candidate { model: f.model, ruptures: there.ruptures, nats: f.nats })
    }

    /// Takes out what is not needed.
    fn prune(&mut self) {
        while self.best.model.effects.len() > 1 {
            let mut least: Option<(f64, Candidate)> = None;
            for index in 0..self.best.model.effects.len() {
                let id = self.best.model.effects[index].info.id;
                let Some(without) = self.refitted(&self.best.model.without(index), &self.best.ruptures)
                else {
                    continue;
                };
                let spare = without.nats - self.best.nats - self.settings.needed(id);
                if spare < 0.0 && least.as_ref().is_none_or(|l| spare < l.0) {
                    least = Some((spare, without));
                }
            }
            match least {
                Some((_, without)) => self.best = without,
                None => break,
            }
        }
    }

    fn hints(&self, standing: &Candidate, data: &Data) -> Hints {
        let layers = standing.model.assumed.layers.len();
        let surface = standing.model.assumed.surface_m;
        let deepest = data.tracks.iter().flat_map(|t| &t.z).fold(f64::NEG_INFINITY, |m, z| m.max(*z));
        let depth_m = (deepest - surface).max(0.0);
        let mut hints = Hints { layers, depth_m, force_n: self.force_n, ..Hints::default() };
        let spectrum = self.spectrum(standing, data);
        let mut lines: Vec<f64> = peaks(&spectrum.0, &spectrum.1, 0.04, 5)
            .into_iter()
            .map(|p| p.0)
            .filter(|f| *f <= FAST_HZ)
            .collect();
        self.sharpen(standing, data, &mut lines);
        hints.lines_hz = lines;
        hints.breath_hz = (0..64).map(|k| 0.05 + 0.0125 * f64::from(k)).collect();
        hints
    }

    /// Frequencies of peaks as exactly as all recordings together tell them.
    fn sharpen(&self, of: &Candidate, data: &Data, lines_hz: &mut [f64]) {
        let mut r = Residuals::default();
        if lines_hz.is_empty() || !residuals(&of.model, data, &mut r) {
            return;
        }
        let limit = 6.0 * data.noise.marginal_n;
        r.e.iter_mut().for_each(|e| *e = e.clamp(-limit, limit));
        let span = |t: &Track| t.t.last().zip(t.t.first()).map_or(0.0, |(b, a)| b - a);
        let span_s = data.tracks.iter().map(span).fold(1e-3, f64::max);
        lines_hz.par_iter_mut().for_each(|f| *f = sharpen(&data.tracks, &r.e, *f, span_s));
    }

    /// Periodogram of the whitened residuals, summed over the recordings.
    #[must_use]
    pub fn spectrum(&self, of: &Candidate, data: &Data) -> (Vec<f64>, Vec<f64>) {
        let mut r = Residuals::default();
        if !residuals(&of.model, data, &mut r) {
            return (Vec::new(), Vec::new());
        }
        let longest = data.tracks.iter().map(Track::len).max().unwrap_or(0);
        let mut sum: (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
        let mut from = 0;
        for track in data.tracks.iter() {
            let to = from + track.len();
            let w: Vec<f64> = r.w[from..to].iter().map(|w| w.clamp(-6.0, 6.0)).collect();
            let (f, p) = periodogram(&w, track.sample_hz, longest);
            if sum.1.is_empty() {
                sum = (f, p);
            } else {
                sum.1.iter_mut().zip(p).for_each(|(s, p)| *s += p);
            }
            from = to;
        }
        sum
    }

    /// Effects that show in the few samples after a rupture, which averages blur: a look at full rate.
    fn sharp(&self, standing: &Candidate, data: &Data, springs: bool) -> Vec<Choice> {
        const TRIED: [(&str, &[f64]); 4] = [
            ("low_pass_lag", &[3e-4, 1e-3, 3e-3, 1e-2]),
            ("time_delay", &[3e-4, 1e-3, 3e-3]),
            ("soft_boundary", &[1e-5, 5e-5, 2e-4]),
            ("needle_compliance", &[150.0, 500.0, 1500.0, 5000.0, 15e3, 50e3, 150e3]),
        ];
        let taken = standing.model.names();
        let stood = nats(&standing.model, data);
        let tried: Vec<(&'static str, f64)> = TRIED
            .iter()
            .filter(|(id, _)| !taken.contains(id) && (springs || *id != "needle_compliance"))
            .flat_map(|(id, values)| values.iter().map(|v| (*id, *v)))
            .collect();
        let found: Vec<Option<(f64, &'static str, f64)>> = tried
            .par_iter()
            .map(|&(id, value)| {
                let mut model = standing.model.with(choice(id, &[value])?);
                if id == "needle_compliance" {
                    seed_punctures(&mut model, data);
                }
                if id == "soft_boundary" {
                    // What a narrow boundary does lies within a sample of the rupture.
                    let mut there = data.clone();
                    crate::refine::retime(&model, &mut there, false, true);
                    return Some((nats(&model, &there), id, value));
                }
                Some((nats(&model, data), id, value))
            })
            .collect();
        let mut best: Vec<(f64, &'static str, f64)> = Vec::new();
        for f in found.into_iter().flatten() {
            match best.iter_mut().find(|b| b.1 == f.1) {
                Some(b) if f.0 < b.0 => *b = f,
                Some(_) => {}
                None => best.push(f),
            }
        }
        best.retain(|b| b.0 < stood - 3.0 || (springs && b.1 == "needle_compliance"));
        best.iter().filter_map(|b| choice(b.1, &[b.2])).collect()
    }

    /// Interferences too fast for averages.
    fn fast_lines(&self, standing: &Candidate, data: &Data) -> Vec<Start> {
        let (f, p) = self.spectrum(standing, data);
        // Not beside a line that stands already.
        let near = |hz: f64| {
            let lines = standing.model.effects.iter().filter(|e| e.info.id == "periodic_interference");
            lines.map(|e| e.values[1]).any(|own| (own - hz).abs() < 0.2)
        };
        let mut lines = peaks(&f, &p, FAST_HZ, 9);
        lines.retain(|l| !near(l.0));
        let Some(&(frequency, value)) = lines.first() else { return Vec::new() };
        if value < 14.0 {
            return Vec::new();
        }
        let mut frequency = [frequency];
        self.sharpen(standing, data, &mut frequency);
        let hints = Hints { lines_hz: frequency.to_vec(), ..Hints::default() };
        let Some(info) = stylet_tissue::info("periodic_interference") else { return Vec::new() };
        let Some(look) = Look::new(&standing.model, data) else { return Vec::new() };
        let mut work = Residuals::default();
        starts::of(info, &hints).iter().filter_map(|s| look.at(s, &mut work)).map(|s| s.start).collect()
    }
}

/// Whether an effect shows in the instants of ruptures, where a linear look sees little.
fn moves_events(id: &str) -> bool {
    matches!(
        id,
        "boundary_shift" | "position_scale" | "rate_dependent_puncture" | "needle_compliance" | "respiration"
    )
}

/// Looks at all starts, in parallel; those that come with other instants of rupture on data of their own.
fn looks(model: &Model, data: &Data, coarse: &Data, q: usize, all: &[Start]) -> Vec<Seen> {
    let plain: Vec<&Start> = all.iter().filter(|s| s.lead_m == 0.0 && s.lead_s == 0.0).collect();
    let mut seen: Vec<Seen> = Vec::new();
    if let Some(look) = Look::new(model, coarse) {
        let found: Vec<Option<Seen>> =
            plain.par_iter().map_init(Residuals::default, |work, s| look.at(s, work)).collect();
        seen.extend(found.into_iter().flatten());
    }
    let shifted: Vec<Option<Seen>> = all
        .par_iter()
        .filter(|s| s.lead_m != 0.0 || s.lead_s != 0.0)
        .map(|s| {
            let there = shift(data, s);
            let there = there.blocks(q, there.noise.blocks(q));
            Look::new(model, &there)?.at(s, &mut Residuals::default())
        })
        .collect();
    seen.extend(shifted.into_iter().flatten());
    seen
}

/// The data with ruptures moved back to where they were before the drops showed.
fn shift(data: &Data, start: &Start) -> Data {
    let mut out = data.clone();
    if start.lead_s == 0.0 && start.lead_m == 0.0 {
        return out;
    }
    for (track, ruptures) in data.tracks.iter().zip(&mut out.ruptures) {
        let mut previous = track.before(1);
        for r in ruptures.iter_mut().filter(|r| **r != NEVER) {
            let mut at = *r - start.lead_s;
            if start.lead_m > 0.0 {
                let mut k = track.first_from(*r).min(track.len() - 1);
                let edge = track.z[k] - start.lead_m;
                while k > 1 && track.z[k - 1] > edge {
                    k -= 1;
                }
                at = track.before(k);
            }
            *r = at.max(previous);
            previous = *r;
        }
    }
    out
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

/// Nested models: the simplest wins unless the larger gains what its further numbers must.
fn simplest(rivals: &[Candidate], best: &Candidate) -> Candidate {
    const NESTED: [(&str, &str); 3] = [
        ("stribeck_friction", "coulomb_friction"),
        ("presliding_friction", "coulomb_friction"),
        ("hidden_membrane", "boundary_shift"),
    ];
    let name = best.model.names().last().copied().unwrap_or("");
    for (larger, smaller) in NESTED {
        if name == larger {
            let small = rivals.iter().find(|r| r.model.names().last().copied() == Some(smaller));
            if let Some(small) = small.filter(|_| larger != "hidden_membrane") {
                let more = best.model.extra() - small.model.extra();
                if small.nats - best.nats < 3.0 + 2.0 * more as f64 {
                    return small.clone();
                }
            }
        }
    }
    best.clone()
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
