//! What is taken, exchanged and pruned of the rivals.

use super::{Candidate, Search, Stage, nats, own_noise};
use crate::fit::Data;
use crate::model::Model;
use crate::profile;
use crate::refine::refine;
use crate::thresholds;
use rayon::prelude::*;

/// A rival is fitted to the end from this share of the needed gain on.
const POLISHED: f64 = 0.4;
/// Share of the needed gain below which nothing is made of the best rival.
const HARDLY: f64 = 0.3;
/// Nats that a model without an effect lacks after two turns when nothing replaces it.
const INDISPENSABLE: f64 = 3000.0;
/// Share of its gain by which an effect must be ahead of its rivals not to be contested again.
const NEAR: f64 = 0.15;

impl Search {
    /// One step of the forward selection; true when an effect was taken.
    pub(super) fn stage(&mut self, standing: &Candidate) -> bool {
        let (mut rivals, screened) = self.contest(standing, f64::INFINITY);
        let stood = standing.model.names();
        let mut stage = Stage { stood, screened, rivals: Vec::new(), needed: thresholds::LEAST, taken: None };
        if rivals.is_empty() {
            self.stages.push(stage);
            return false;
        }
        if standing.nats - rivals[0].nats < HARDLY * self.settings.needed(rivals[0].model.last_name()) {
            stage.rivals = told(standing, &rivals);
            stage.needed = self.settings.needed(rivals[0].model.last_name());
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
        self.settle_close(&mut rivals);
        let mut standing = self.refit_standing(standing, &rivals);
        // What scattered punctures would explain as well is no gain of any effect's.
        standing = self.forgiving(&standing);
        rivals = rivals.par_iter().map(|r| self.forgiving(r)).collect();
        rivals.sort_by(|a, b| a.fined().total_cmp(&b.fined()));
        stage.rivals = told(&standing, &rivals);
        let Some(best) = rivals.first().cloned() else {
            self.stages.push(stage);
            return false;
        };
        let best = simplest(&rivals, &best);
        stage.needed = self.settings.needed(best.model.last_name());
        let near = standing.nats - best.nats > POLISHED * stage.needed;
        let best = if near { self.levelled(self.polished(&best)) } else { best };
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

    /// Rivals whose numbers hang on the instants of ruptures are far from their best at first: two of them that are
    /// close are compared at the bottom of their profiles.
    fn settle_close(&self, rivals: &mut Vec<Candidate>) {
        const CLOSE: f64 = 100.0;
        let near = rivals.first().map_or(0.0, |r| r.fined() + CLOSE);
        let close =
            |r: &Candidate| r.fined() < near && r.model.effects.last().is_some_and(profile::is_coupled);
        if rivals.iter().filter(|r| close(r)).count() < 2 {
            return;
        }
        rivals.par_iter_mut().filter(|r| close(r)).for_each(|r| *r = profile::settled(self, r).0);
        rivals.sort_by(|a, b| a.fined().total_cmp(&b.fined()));
    }

    /// The standing model fitted anew under the present noise, from its own optimum and those of its
    /// best rivals.
    pub(super) fn refit_standing(&self, standing: &Candidate, rivals: &[Candidate]) -> Candidate {
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
    pub(super) fn exchange(&mut self) {
        let count = self.best.model.effects.len();
        for index in 0..count {
            if index + 1 == count && self.alone() {
                continue;
            }
            let Some(without) = self.refitted(&self.best.model.without(index), &self.best.ruptures) else {
                continue;
            };
            let (rivals, _) = self.contest(&without, self.best.nats);
            let Some(first) = rivals.first() else { continue };
            let first = simplest(&rivals, first);
            if first.fined() < self.best.fined() - 0.5 {
                self.reference = first.fined();
                self.best = first;
                self.rivals = rivals;
            }
        }
    }

    /// Whether the effect taken last had no rival anywhere near.
    fn alone(&self) -> bool {
        let gained = self.stages.iter().rev().find(|s| s.taken.is_some()).and_then(|s| s.rivals.first());
        let own = self.best.model.last_name();
        let others = self.rivals.iter().filter(|r| r.model.last_name() != own);
        let near = self.reference + NEAR * gained.map_or(0.0, |g| g.1) + 100.0;
        gained.is_some_and(|g| g.0 == own) && others.map(Candidate::fined).all(|nats| nats > near)
    }

    /// The candidate fitted to the end.
    pub(super) fn polished(&self, candidate: &Candidate) -> Candidate {
        let mut there = self.data_of(candidate);
        match refine(&candidate.model, &mut there, 3, 8, true) {
            Some(f) if f.nats < candidate.nats => {
                Candidate { model: f.model, ruptures: there.ruptures, nats: f.nats }
            }
            _ => candidate.clone(),
        }
    }

    pub(super) fn refitted(&self, model: &Model, ruptures: &[Vec<f64>]) -> Option<Candidate> {
        self.fitted(model, ruptures, 2, 5)
    }

    /// The model fitted from these ruptures, which are moved in so many rounds.
    fn fitted(&self, model: &Model, ruptures: &[Vec<f64>], rounds: usize, turns: usize) -> Option<Candidate> {
        let mut there = Data { ruptures: ruptures.to_vec(), ..self.data.clone() };
        let f = refine(model, &mut there, rounds, turns, rounds > 0)?;
        Some(Candidate { model: f.model, ruptures: there.ruptures, nats: f.nats })
    }

    /// Takes out what is not needed.
    pub(super) fn prune(&mut self) {
        while self.best.model.effects.len() > 1 {
            let mut least: Option<(f64, Candidate)> = None;
            let raw = nats(&self.best.model, &self.data_of(&self.best));
            self.best = self.forgiving(&Candidate { nats: raw, ..self.best.clone() });
            for index in 0..self.best.model.effects.len() {
                let id = self.best.model.effects[index].info.id;
                let model = self.best.model.without(index);
                let quick = self.fitted(&model, &self.best.ruptures, 0, 2);
                if quick.is_some_and(|c| self.forgiving(&c).nats > self.best.nats + INDISPENSABLE) {
                    continue;
                }
                let Some(without) = self.refitted(&model, &self.best.ruptures) else {
                    continue;
                };
                let without = self.forgiving(&without);
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
}

/// Effect, nats gained and further numbers of every rival.
fn told(standing: &Candidate, rivals: &[Candidate]) -> Vec<(&'static str, f64, usize)> {
    let one = |r: &Candidate| {
        (r.model.last_name(), standing.nats - r.nats, r.model.extra() - standing.model.extra())
    };
    rivals.iter().map(one).collect()
}

/// Nested models: the simplest wins unless the larger gains what its further numbers must.
pub(super) fn simplest(rivals: &[Candidate], best: &Candidate) -> Candidate {
    const NESTED: [(&str, &str); 3] = [
        ("stribeck_friction", "coulomb_friction"),
        ("presliding_friction", "coulomb_friction"),
        ("hidden_membrane", "boundary_shift"),
    ];
    let name = best.model.last_name();
    for (larger, smaller) in NESTED {
        if name == larger {
            let small = rivals.iter().find(|r| r.model.last_name() == smaller);
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
