//! Rivals: every effect from its best starts, screened on averages, the best fitted at full rate.

use super::{Begun, Candidate, FAST_HZ, FINALISTS, Search, nats};
use crate::fit::{Data, Fit, Residuals, fit, fit_from, objective};
use crate::look::{Look, Seen};
use crate::model::Model;
use crate::refine::{refine, seed_punctures};
use crate::starts::{self, Start};
use crate::track::NEVER;
use rayon::prelude::*;

/// Share of the best rival's gain by which another may be behind after its first fit, if other instants of
/// rupture may bring it much, and if not.
const FAR_BEHIND: [f64; 2] = [0.15, 0.05];
/// Share of the needed gain that an effect which does not care for instants of rupture shows at once, and
/// after two turns.
const PROMISING: f64 = 0.3;
const BEGINNING: f64 = 0.15;
/// Nats behind, besides so many times what the best start promises, at which a start whose one number is a time,
/// a width or a spring is not worth a fit. (Of 516 that were 3000 behind in forty drawn cases one came back, and that
/// one is within the second bound.)
const BEYOND: (f64, f64) = (3000.0, 5.0);
/// Nats behind the standing model at which an effect that costs much to fit is given up after two turns.
const GIVEN_UP: f64 = 1000.0;

/// Whether an effect moves its ruptures far, or between samples.
fn wide(id: &str) -> bool {
    matches!(id, "low_pass_lag" | "soft_boundary" | "time_delay" | "needle_compliance" | "respiration")
}

/// Effects with one number that their ruptures follow; far from its best they are thousands of nats behind.
fn is_measured(id: &str) -> bool {
    matches!(id, "low_pass_lag" | "soft_boundary" | "time_delay" | "needle_compliance")
}

/// A model to be fitted at full rate and its ruptures.
type Finalist = (Model, Vec<Vec<f64>>);

impl Search {
    /// Rivals that extend `standing`, fitted at full rate, best first; and what was screened. Those far behind
    /// `incumbent` nats are not fitted to the end.
    pub(super) fn contest(
        &self,
        standing: &Candidate,
        incumbent: f64,
    ) -> (Vec<Candidate>, Vec<(&'static str, f64)>) {
        let data = self.data_of(standing);
        let coarse = data.blocks(self.q, data.noise.blocks(self.q));
        let Some(stood) = fit(&standing.model, &coarse, 4, 0.05) else { return (Vec::new(), Vec::new()) };
        let spectrum = self.spectrum(standing, &data);
        let mut hints = self.hints(&stood.model, &spectrum, &coarse);
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
            let same = |c: &&&Seen| c.start.choice.info.id == id;
            let twice = chosen.iter().filter(same).any(|c| c.start.is_same(&s.start));
            if !twice && chosen.iter().filter(same).count() < most && (s.gain > 1.0 || moves_events(id)) {
                chosen.push(s);
            }
        }
        let promised = seen.iter().map(|s| s.gain).fold(0.0, f64::max);
        let worth_a_fit = stood.nats + BEYOND.0 + BEYOND.1 * promised;
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
                let mut model = stood.model.clone();
                if let Some(numbers) = &s.given_way {
                    model.set(&model.slots(), numbers);
                }
                let mut model = model.with(s.start.choice.clone());
                let at = seed_punctures(&mut model, &there)?;
                if is_measured(s.start.choice.info.id) && objective(&model, &at) > worth_a_fit {
                    return None;
                }
                let f = fit_from(&model, &there, at, 2, 0.1)?;
                Some((f, there, shifted.ruptures))
            })
            .collect();
        let mut begun: Vec<Begun> = begun.into_iter().flatten().collect();
        begun.extend(self.exchanged(&stood.model, &data));
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
            let id = found.0.model.last_name();
            match best.iter_mut().find(|b| b.0.model.last_name() == id) {
                Some(old) if old.0.nats > found.0.nats => *old = found,
                Some(_) => {}
                None => best.push(found),
            }
        }
        best.sort_by(|a, b| a.0.nats.total_cmp(&b.0.nats));
        let screened: Vec<(&'static str, f64)> =
            best.iter().map(|b| (b.0.model.last_name(), stood.nats - b.0.nats)).collect();
        best.truncate(FINALISTS);
        let lead = best.first().map_or(0.0, |b| stood.nats - b.0.nats);
        best.retain(|b| {
            let gain = stood.nats - b.0.nats;
            gain > 0.5 * lead - 40.0 && (gain > 2.5 || (gain > -400.0 && lead > 50.0))
        });
        let mut finalists: Vec<Finalist> = best.into_iter().map(|(f, r)| (f.model, r)).collect();
        for c in self.sharp(standing, &data, &coarse, (lead > 30.0).then_some(worth_a_fit)) {
            finalists.push((standing.model.with(c), standing.ruptures.clone()));
        }
        for start in self.fast_lines(standing, &data, &spectrum) {
            finalists.push((standing.model.with(start.choice), standing.ruptures.clone()));
        }
        let finalists = self.better_starts(&data, finalists);
        let refined = |c: &Candidate, rounds: usize, turns: usize| {
            let mut there = Data { ruptures: c.ruptures.clone(), ..data.clone() };
            let f = refine(&c.model, &mut there, rounds, turns, wide(c.model.last_name()))?;
            Some(Candidate { model: f.model, ruptures: there.ruptures, nats: f.nats })
        };
        // Fitted with the ruptures where they are; only those not far behind go on to move them.
        let first: Vec<Option<Candidate>> = finalists
            .into_par_iter()
            .map(|(model, ruptures)| {
                let begun = Candidate { model, ruptures, nats: f64::INFINITY };
                let id = begun.model.last_name();
                let least = match id {
                    "needle_compliance" => -GIVEN_UP,
                    id if wide(id) || moves_events(id) => return refined(&begun, 0, 5),
                    id => BEGINNING * self.settings.needed(id),
                };
                let begun = refined(&begun, 0, 2)?;
                if standing.nats - begun.nats < least { Some(begun) } else { refined(&begun, 0, 5) }
            })
            .collect();
        let first: Vec<Candidate> = first.into_iter().flatten().collect();
        let ahead = first.iter().map(|r| r.nats).fold(standing.nats.min(incumbent), f64::min);
        let rivals: Vec<Option<Candidate>> = first
            .into_par_iter()
            .map(|c| {
                let id = c.model.last_name();
                let by_instants = wide(id) || moves_events(id);
                let far = FAR_BEHIND[usize::from(!by_instants)] * (standing.nats - ahead) + 100.0;
                let gain = standing.nats - c.nats;
                let promising = by_instants || gain > PROMISING * self.settings.needed(id);
                if !promising || c.nats > ahead + far {
                    Some(c)
                } else {
                    refined(&c, if wide(id) { 3 } else { 2 }, 5)
                }
            })
            .collect();
        let mut rivals: Vec<Candidate> = rivals.into_iter().flatten().collect();
        rivals.retain(|r| !r.model.last_vanishes());
        rivals.sort_by(|a, b| a.fined().total_cmp(&b.fined()));
        // The same effect from two roads.
        let mut names: Vec<&str> = Vec::new();
        rivals.retain(|r| {
            let name = r.model.last_name();
            let new = !names.contains(&name);
            names.push(name);
            new
        });
        (rivals, screened)
    }

    /// Of two starts of the same effect the one that fits better as it stands; interferences have lines of
    /// their own.
    fn better_starts(&self, data: &Data, finalists: Vec<Finalist>) -> Vec<Finalist> {
        let fits =
            |(model, ruptures): &Finalist| nats(model, &Data { ruptures: ruptures.clone(), ..data.clone() });
        let mut kept: Vec<Finalist> = Vec::new();
        for new in finalists {
            let id = new.0.last_name();
            let same = |k: &Finalist| k.0.last_name() == id && id != "periodic_interference";
            match kept.iter_mut().find(|k| same(k)) {
                Some(old) if fits(&new) < fits(old) => *old = new,
                Some(_) => {}
                None => kept.push(new),
            }
        }
        kept
    }
}

/// Whether an effect shows in the instants of ruptures, where a linear look sees little.
pub(super) fn moves_events(id: &str) -> bool {
    matches!(
        id,
        "boundary_shift" | "position_scale" | "rate_dependent_puncture" | "needle_compliance" | "respiration"
    )
}

/// Looks at all starts, in parallel; those that come with other instants of rupture on data of their own.
pub(super) fn looks(model: &Model, data: &Data, coarse: &Data, q: usize, all: &[Start]) -> Vec<Seen> {
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
pub(crate) fn shift(data: &Data, start: &Start) -> Data {
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
