//! The search: one ingredient after another, each for what it buys on runs left out.

use crate::fit::{Effort, Fit, Spread, fit};
use crate::gain;
use crate::population::Population;
use crate::run::Run;
use crate::shape::{Frame, Ingredient, Shape};
use rayon::prelude::*;

/// Effects of the general library that are tried beside those that are read off several runs.
const GENERAL: [&str; 5] =
    ["asymmetric_friction", "coulomb_friction", "cutting_force", "soft_boundary", "incomplete_release"];
/// An ingredient has to lower the error on runs left out by this share.
pub const LEAST_GAIN: f64 = 0.01;
/// One that raises the error by less than this share when it is taken away again is not kept.
pub const LEAST_LOSS: f64 = 0.02;
/// At most so many.
const MOST: usize = 12;

/// One rival of a step.
#[derive(Clone, Debug)]
pub struct Tried {
    /// The ingredient.
    pub ingredient: Ingredient,
    /// Nats gained in the fit, all runs.
    pub nats: f64,
    /// Error of the mean prediction on the fitted runs (N).
    pub error_n: f64,
}

/// One step of the search.
#[derive(Clone, Debug)]
pub struct Step {
    /// Rivals, best first.
    pub tried: Vec<Tried>,
    /// The one that was taken, with the error on left-out runs before and after.
    pub taken: Option<Ingredient>,
    /// Error on left-out runs (N), after this step.
    pub left_out_n: f64,
}

/// What the search found.
#[derive(Clone, Debug)]
pub struct Ladder {
    /// The base law's fit.
    pub base: Fit,
    /// Error of the base law on left-out runs (N).
    pub base_left_out_n: f64,
    /// The steps.
    pub steps: Vec<Step>,
    /// The extended law's fit.
    pub best: Fit,
    /// Error of the extended law on left-out runs (N).
    pub left_out_n: f64,
    /// The ingredients that stayed, in the order of what each buys from the base law on, with the error on
    /// left-out runs (N) after it.
    pub path: Vec<(Ingredient, f64)>,
    /// Per ingredient the error on left-out runs (N) without it.
    pub without: Vec<(Ingredient, f64)>,
}

/// A fit of a form from what another fit found.
#[must_use]
pub fn refit(shape: &Shape, from: &Fit, runs: &[&Run], effort: Effort) -> Option<Fit> {
    let x = shape.start_from(&from.shape.numbers(), &from.x);
    fit(shape, x, Some(&from.own), runs, from.spread, effort)
}

/// From the base law to the extended one, each time by what then buys most.
fn path(
    base: &Fit,
    best: &Fit,
    left_out_n: f64,
    runs: &[&Run],
    folds: &[Vec<usize>],
) -> Vec<(Ingredient, f64)> {
    let effort = Effort { steps: 15, rounds: 1 };
    let mut standing = base.clone();
    let mut out: Vec<(Ingredient, f64)> = Vec::new();
    loop {
        let left: Vec<Ingredient> =
            best.shape.with.iter().copied().filter(|i| !standing.shape.has(*i)).collect();
        if let [last] = left[..] {
            out.push((last, left_out_n));
            return out;
        }
        let next = left
            .par_iter()
            .filter(|i| i.needs().is_none_or(|n| standing.shape.has(n)))
            .filter_map(|i| {
                let fitted = best_of(&standing.shape.plus(*i), &standing, runs, effort)?;
                let error = gain::quick(&fitted, runs, folds, Effort { steps: 3, rounds: 1 })?;
                Some((*i, fitted, error))
            })
            .min_by(|a, b| a.2.total_cmp(&b.2));
        let Some((ingredient, fitted, error)) = next else { return out };
        out.push((ingredient, error));
        standing = fitted;
    }
}

/// The better of a fit from where another stands and of one from scratch.
fn best_of(shape: &Shape, from: &Fit, runs: &[&Run], effort: Effort) -> Option<Fit> {
    let start: Vec<f64> = shape.numbers().iter().map(|n| n.start).collect();
    let long = Effort { steps: 30, rounds: 1 };
    let (warm, fresh) = rayon::join(
        || refit(shape, from, runs, effort),
        || {
            let rough = fit(shape, start, None, runs, from.spread, long)?;
            refit(shape, &rough, runs, effort)
        },
    );
    match (warm, fresh) {
        (Some(warm), Some(fresh)) => Some(if fresh.rms_n < warm.rms_n { fresh } else { warm }),
        (warm, fresh) => warm.or(fresh),
    }
}

/// Five groups with runs of every speed in each, or single runs when they are few.
#[must_use]
pub fn folds(runs: &[&Run]) -> Vec<Vec<usize>> {
    if runs.len() <= 6 {
        return (0..runs.len()).map(|i| vec![i]).collect();
    }
    let mut out = vec![Vec::new(); 5];
    let mut turn = 0;
    for (_, members) in gain::speeds(runs) {
        for i in members {
            out[turn % 5].push(i);
            turn += 1;
        }
    }
    out
}

fn candidates(shape: &Shape, runs: &[&Run]) -> Vec<Ingredient> {
    let several = gain::speeds(runs).len() > 1;
    let ruptures = runs.iter().any(|run| run.ruptures.iter().any(Option::is_some));
    let mut all =
        vec![Ingredient::Nonlinear, Ingredient::Relaxation, Ingredient::SecondTerm, Ingredient::PowerLaw];
    if ruptures {
        all.extend([Ingredient::Deeper, Ingredient::Presliding, Ingredient::Indentation]);
        if several {
            all.push(Ingredient::RatePuncture);
        }
    }
    all.extend(
        GENERAL
            .iter()
            .filter(|id| ruptures || !["soft_boundary", "incomplete_release", "cutting_force"].contains(*id))
            .filter_map(|id| stylet_tissue::info(id))
            .map(Ingredient::General),
    );
    all.retain(|i| {
        !shape.has(*i)
            && i.needs().is_none_or(|n| shape.has(n))
            && (*i != Ingredient::Deeper || (shape.layers() > 1 && !shape.has(Ingredient::Presliding)))
            // With presliding the layers hold the released force themselves.
            && !(i.id() == "incomplete_release" && shape.has(Ingredient::Presliding))
    });
    all
}

/// Searches from the base law.
pub fn climb(frame: Frame, runs: &[&Run], mut progress: impl FnMut(&str)) -> Option<Ladder> {
    let look = Effort { steps: 8, rounds: 1 };
    let settle = Effort { steps: 12, rounds: 2 };
    let again = Effort { steps: 3, rounds: 1 };
    let folds = folds(runs);
    let shape = Shape::base(frame);
    let start: Vec<f64> = shape.numbers().iter().map(|n| n.start).collect();
    let base = fit(&shape, start, None, runs, Spread::default(), Effort { steps: 20, rounds: 3 })?;
    let base_left_out_n = gain::quick(&base, runs, &folds, again)?;
    progress(&format!("base law: {base_left_out_n:.4} N on runs left out"));
    let mut standing = base.clone();
    let mut left_out_n = base_left_out_n;
    let mut steps: Vec<Step> = Vec::new();
    while steps.len() < MOST {
        let mut fits: Vec<(Tried, Fit)> = candidates(&standing.shape, runs)
            .par_iter()
            .filter_map(|ingredient| {
                let fitted = refit(&standing.shape.plus(*ingredient), &standing, runs, look)?;
                let population = Population::of(&fitted, runs);
                let sum: f64 = runs.iter().map(|run| gain::thin_error(&fitted, &population, run)).sum();
                let nats = standing.cost - fitted.cost;
                Some((Tried { ingredient: *ingredient, nats, error_n: sum / runs.len() as f64 }, fitted))
            })
            .collect();
        fits.sort_by(|a, b| a.0.error_n.total_cmp(&b.0.error_n));
        let mut taken = None;
        for (tried, fitted) in fits.iter().take(4) {
            progress(
                &fits
                    .iter()
                    .take(9)
                    .map(|t| format!("{} {:.3} ", t.0.ingredient.label(), t.0.error_n))
                    .collect::<String>(),
            );
            let Some(fitted) = best_of(&fitted.shape, fitted, runs, settle) else { continue };
            let Some(error) = gain::quick(&fitted, runs, &folds, again) else { continue };
            progress(&format!("  {} {:.4}", tried.ingredient.label(), error));
            if error < left_out_n * (1.0 - LEAST_GAIN) {
                taken = Some((tried.ingredient, fitted, error));
                break;
            }
        }
        let tried = fits.into_iter().map(|(tried, _)| tried).collect();
        let Some((ingredient, fitted, error)) = taken else {
            steps.push(Step { tried, taken: None, left_out_n });
            break;
        };
        progress(&format!("{}: {error:.4} N on runs left out", ingredient.label()));
        (standing, left_out_n) = (fitted, error);
        steps.push(Step { tried, taken: Some(ingredient), left_out_n });
    }
    // What later steps made superfluous goes again, the least useful first.
    let without = loop {
        let rest: Vec<(Ingredient, Fit, f64)> = standing
            .shape
            .with
            .iter()
            .filter_map(|ingredient| {
                let fitted = refit(&standing.shape.minus(*ingredient), &standing, runs, settle)?;
                let error = gain::quick(&fitted, runs, &folds, again)?;
                Some((*ingredient, fitted, error))
            })
            .collect();
        let least = rest.iter().min_by(|a, b| a.2.total_cmp(&b.2));
        match least {
            Some((ingredient, fitted, error)) if *error < left_out_n * (1.0 + LEAST_LOSS) => {
                progress(&format!("not needed any more: {}, {error:.4} N", ingredient.label()));
                (standing, left_out_n) = (fitted.clone(), *error);
            }
            _ => break rest.into_iter().map(|(ingredient, _, error)| (ingredient, error)).collect(),
        }
    };
    let path = path(&base, &standing, left_out_n, runs, &folds);
    Some(Ladder { base, base_left_out_n, steps, best: standing, left_out_n, path, without })
}
