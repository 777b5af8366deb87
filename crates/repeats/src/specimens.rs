//! Many specimens, each indented once and held: what each lacks, how well the rest of its hold is
//! predicted, and how the numbers scatter over the specimens.
//!
//! Every specimen is a material of its own, so that nothing is shared between them. A law is fitted to the
//! ramp and the first part of the hold; the rest of the hold took no part.

use crate::events;
use crate::fit::{Effort, Fit, Spread, fit};
use crate::forward;
use crate::frame::frame;
use crate::run::Run;
use crate::shape::{Ingredient, Shape};
use crate::stats::{mean_sd, median, rms, student_95};
use rayon::prelude::*;
use serde::Serialize;
use stylet_tissue::Tissue;

/// Share of the hold that is fitted.
const FITTED: f64 = 0.6;
/// An ingredient has to lower the mean error on the rest of the hold, or on all that was fitted, by this share,
const LEAST_GAIN: f64 = 0.1;
/// in at least this share of the specimens.
const LEAST_SHARE: f64 = 0.75;

/// A number over the specimens.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Over {
    /// Its name.
    pub name: String,
    /// Geometric mean (arithmetic for shares) with its 95 % interval.
    pub mean: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Values between which nine of ten specimens lie.
    pub nine_of_ten: (f64, f64),
}

/// One rung: the law after an ingredient.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Rung {
    /// What was added; `base law` at first.
    pub step: String,
    /// Effect.
    pub effect: Option<String>,
    /// Median error on what was fitted (N).
    pub fitted_n: f64,
    /// Median error on the rest of the hold (N).
    pub left_out_n: f64,
    /// Share of the specimens that it serves better, fitted and left out together.
    pub better: f64,
    /// Whether it was kept.
    pub kept: bool,
}

/// What the specimens show.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Specimens {
    /// Specimens used, and those that could not be.
    pub used: usize,
    /// Names of those that were left out, with the reason.
    pub unused: Vec<(String, String)>,
    /// Specimens whose force drops as at a puncture.
    pub punctured: Vec<String>,
    /// The rungs.
    pub rungs: Vec<Rung>,
    /// Numbers of the kept law.
    pub numbers: Vec<Over>,
}

struct One {
    fits: Vec<(f64, f64)>,
    last: Vec<Fit>,
}

/// The rungs, each with the one before.
const RUNGS: [(&str, &[Ingredient]); 4] = [
    ("base law", &[]),
    ("nonlinear_elasticity", &[Ingredient::Nonlinear]),
    ("stress_relaxation", &[Ingredient::Nonlinear, Ingredient::Relaxation]),
    (
        "stress_relaxation (second term)",
        &[Ingredient::Nonlinear, Ingredient::Relaxation, Ingredient::SecondTerm],
    ),
];

/// Looks at specimens one by one.
#[must_use]
pub fn look(believed: &Tissue, runs: &[Run]) -> Option<Specimens> {
    let mut unused = Vec::new();
    let mut punctured = Vec::new();
    let mut usable: Vec<&Run> = Vec::new();
    for run in runs {
        if run.ruptures.iter().any(Option::is_some) {
            punctured.push(run.name.clone());
        }
        match whole(run) {
            Ok(()) => usable.push(run),
            Err(why) => unused.push((run.name.clone(), why)),
        }
    }
    let each: Vec<One> = usable.par_iter().filter_map(|run| one(believed, run)).collect();
    if each.is_empty() {
        return None;
    }
    let mut rungs: Vec<Rung> = Vec::new();
    let mut standing = 0;
    for (k, (name, with)) in RUNGS.iter().enumerate() {
        let of = |j: usize, left_out: bool| {
            let mut all: Vec<f64> =
                each.iter().map(|o| if left_out { o.fits[j].1 } else { o.fits[j].0 }).collect();
            median(&mut all)
        };
        let both = |o: &One, j: usize| o.fits[j].0 + o.fits[j].1;
        let better =
            each.iter().filter(|o| both(o, k) < both(o, standing)).count() as f64 / each.len() as f64;
        let gains = |left_out: bool| of(k, left_out) < (1.0 - LEAST_GAIN) * of(standing, left_out);
        let kept = k == 0 || ((gains(true) || gains(false)) && better >= LEAST_SHARE);
        rungs.push(Rung {
            step: (*name).to_owned(),
            effect: with.last().map(|i| i.id().to_owned()),
            fitted_n: of(k, false),
            left_out_n: of(k, true),
            better,
            kept,
        });
        if kept {
            standing = k;
        }
    }
    let numbers = numbers(&each, standing);
    Some(Specimens { used: each.len(), unused, punctured, rungs, numbers })
}

/// Whether a recording is a ramp and a hold.
fn whole(run: &Run) -> Result<(), String> {
    let t = &run.recording.time_s;
    let hold = t[t.len() - 1] - t[run.phases.deepest];
    if run.recording.len() < 50 {
        return Err(format!("{} samples are too few", run.recording.len()));
    }
    if run.phases.back < run.recording.len() {
        return Err("the tool comes back".to_owned());
    }
    if hold < 3.0 {
        return Err(format!("held for {hold:.1} s only"));
    }
    Ok(())
}

fn one(believed: &Tissue, run: &Run) -> Option<One> {
    let t = &run.recording.time_s;
    let end = t[run.phases.deepest] + FITTED * (t[t.len() - 1] - t[run.phases.deepest]);
    let mut first = run.clone();
    let keep = first.thin.t.iter().position(|t| *t > end)?;
    for column in [&mut first.thin.t, &mut first.thin.z, &mut first.thin.v, &mut first.thin.f] {
        column.truncate(keep);
    }
    first.thin.ruptures.iter_mut().for_each(|r| *r = None);
    first.thin_first = first.thin.clone();
    first.ruptures.iter_mut().for_each(|r| *r = None);
    let frame = frame(believed, &[&first]);
    let noise = events::noise_n(&run.recording.force_n).max(1e-3 * frame.force_n);
    let spread = Spread { residual_n: 3.0 * noise, ..Spread::default() };
    let mut out = One { fits: Vec::new(), last: Vec::new() };
    for (_, with) in RUNGS {
        let shape = Shape { with: with.to_vec(), ..Shape::base(frame.clone()) };
        let x = match out.last.last() {
            Some(before) => shape.start_from(&before.shape.numbers(), &before.x),
            None => shape.numbers().iter().map(|n| n.start).collect(),
        };
        let fitted = fit(&shape, x, None, &[&first], spread, Effort { steps: 60, rounds: 1 })?;
        let mut force = Vec::new();
        let mut all = run.columns();
        all.ruptures.iter_mut().for_each(|r| *r = None);
        let mut at = Vec::new();
        if !forward::imposed(&fitted.shape, &fitted.x, &fitted.own[0], &all, &mut force, &mut at) {
            return None;
        }
        let (mut before, mut after) = (Vec::new(), Vec::new());
        for i in 0..all.t.len() {
            let e = all.f[i] - force[i];
            if all.t[i] > end { after.push(e) } else { before.push(e) }
        }
        out.fits.push((rms(&before), rms(&after)));
        out.last.push(fitted);
    }
    Some(out)
}

/// Relaxation and curvature of the kept law over the specimens.
fn numbers(each: &[One], rung: usize) -> Vec<Over> {
    let names: Vec<String> = each[0].last[rung].shape.numbers().iter().map(|n| n.name.clone()).collect();
    let wanted = |name: &str| name.starts_with("terms.") || name.ends_with("curvature");
    let two = names.iter().any(|n| n.starts_with("terms.1."));
    // Terms come in no order: the fast one first.
    let value = |o: &One, name: &str| {
        let of = |name: &str| {
            let fit = &o.last[rung];
            let numbers = fit.shape.numbers();
            let i = numbers.iter().position(|n| n.name == name)?;
            Some(numbers[i].value(fit.x[i]))
        };
        let swapped = two && of("terms.0.time_constant_s") > of("terms.1.time_constant_s");
        match (swapped, name.strip_prefix("terms.0."), name.strip_prefix("terms.1.")) {
            (true, Some(rest), _) => of(&format!("terms.1.{rest}")),
            (true, _, Some(rest)) => of(&format!("terms.0.{rest}")),
            _ => of(name),
        }
    };
    names
        .iter()
        .filter(|n| wanted(n))
        .map(|name| {
            let log = name.ends_with("time_constant_s");
            let mut all: Vec<f64> = each
                .iter()
                .filter_map(|o| value(o, name))
                .map(|x| if log { libm::log(x) } else { x })
                .collect();
            all.sort_unstable_by(f64::total_cmp);
            let (mean, sd) = mean_sd(&all);
            let reach = student_95(all.len().saturating_sub(1)) * sd / libm::sqrt(all.len() as f64);
            let back = |x: f64| if log { libm::exp(x) } else { x };
            let at = |share: f64| back(all[((all.len() - 1) as f64 * share).round() as usize]);
            Over {
                name: name.clone(),
                mean: back(mean),
                low: back(mean - reach),
                high: back(mean + reach),
                nine_of_ten: (at(0.05), at(0.95)),
            }
        })
        .collect()
}
