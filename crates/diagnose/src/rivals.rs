//! Effects that explain the data as well as a cause: its class.

use crate::judge::{cost, gain};
use crate::select::{Search, at_a_bound, extra};
use rayon::prelude::*;
use stylet_identify::fit::{Effort, Fit, fit_below};
use stylet_identify::model::Choice;

/// Rivals within so many nats of the best form one class.
pub const CLASS_NATS: f64 = 3.0;
/// A rival that was behind by more than this share of the gain when the cause was taken is no rival.
const FAR: f64 = 0.05;
/// ... unless it was behind by less than so many nats.
const NEAR_NATS: f64 = 25.0;
/// A rival that cannot come nearer than so many nats is not fitted to the end.
const OUT_OF_SIGHT: f64 = 40.0;

/// A rival of a cause: its name and by how many nats it is behind, numbers paid for (negative: ahead).
#[derive(Clone, Debug)]
pub struct Rival {
    /// Effect.
    pub name: &'static str,
    /// Nats behind.
    pub behind: f64,
    /// The effect with its values.
    pub choice: Choice,
}

/// The rivals of every cause of the best model. A rival that is ahead takes the cause's place.
pub fn rivals(search: &mut Search) -> Vec<Vec<Rival>> {
    let mut k = 0;
    let mut out: Vec<Vec<Rival>> = Vec::new();
    let mut swaps = 0;
    while k < search.best.model.effects.len() {
        let own = of(search, k);
        let ahead = own.iter().filter(|r| r.1 < -0.5).min_by(|a, b| a.1.total_cmp(&b.1));
        // More numbers have to be worth it when all that is left is noise.
        let worth = |f: &Fit| {
            f.model.effect_numbers() <= search.best.model.effect_numbers()
                || (!at_a_bound(f, k)
                    && gain(&search.best, f, &search.data) > extra(&search.best, f, &search.data))
        };
        if let Some((f, _)) = ahead.filter(|r| swaps < 3 && worth(&r.0)) {
            search.swap(k, f.clone());
            swaps += 1;
            (k, out) = (0, Vec::new());
            continue;
        }
        let name = |f: &Fit| f.model.effects[k].info.id;
        let rival = |(f, behind): &(Fit, f64)| Rival {
            name: name(f),
            behind: *behind,
            choice: f.model.effects[k].clone(),
        };
        out.push(own.iter().map(rival).collect());
        k += 1;
    }
    out
}

fn of(search: &Search, k: usize) -> Vec<(Fit, f64)> {
    let model = &search.best.model;
    let own = &model.effects[k];
    let stage = search.stages.iter().rev().find(|s| s.taken.is_some_and(|t| t.0 == own.info.id));
    let Some(stage) = stage else { return Vec::new() };
    let best = stage.rivals.iter().map(|r| r.1).fold(f64::NEG_INFINITY, f64::max);
    let tried: Vec<Choice> = stage
        .choices
        .iter()
        .zip(&stage.rivals)
        .filter(|(c, r)| {
            let close = best - r.1 < (FAR * best).max(NEAR_NATS);
            // A special case may have been behind only for what came into the model since.
            let special = c.info.nested_in.contains(&own.info.id);
            (close || special) && model.effects.iter().all(|e| e.info.id != c.info.id)
        })
        .map(|(c, _)| c.clone())
        .collect();
    let blocks = search.data.compared();
    let price = |f: &Fit| f.nats() + cost(f.model.effect_numbers(), blocks);
    let mine = price(&search.best);
    tried
        .into_par_iter()
        .filter_map(|choice| {
            let mut other = model.clone();
            other.effects[k] = choice;
            let wanted = mine + OUT_OF_SIGHT - cost(other.effect_numbers(), blocks);
            let f = fit_below(&other, &search.data, Effort::FULL, wanted)?;
            let behind = price(&f) - mine;
            // What holds the one named as a special case has to pay for its numbers, and did not.
            let nested = own.info.nested_in.contains(&f.model.effects[k].info.id);
            (!nested || behind < -0.5).then_some((f, behind))
        })
        .collect()
}
