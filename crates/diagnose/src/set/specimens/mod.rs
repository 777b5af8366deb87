//! Many specimens, each indented once and held: what each lacks, how well the rest of its hold is
//! predicted, and how the numbers scatter over the specimens.
//!
//! Every specimen is a material of its own, so that nothing is shared between them. A law is fitted to the
//! ramp and the first part of the hold; the rest of the hold took no part.

mod diagnosis;

use crate::set::first::{Insertion, pressed};
use rayon::prelude::*;
use serde::Serialize;
use std::sync::Arc;
use stylet_identify::blocks::Blocks;
use stylet_identify::fit::{Effort, fit};
use stylet_identify::model::{Choice, Model};
use stylet_identify::noise::Noise;
use stylet_identify::objective::{Data, residuals};
use stylet_identify::phases::noise_n;
use stylet_stats::{mean, median_of, rms, sd, student};
use stylet_tissue::{AnyEffect, Effect, NonlinearElasticity, PronyTerm, StressRelaxation, Tissue};

/// Share of the hold that is fitted.
const FITTED: f64 = 0.6;
/// An ingredient has to lower the mean error on the rest of the hold, or on all that was fitted, by this share,
const LEAST_GAIN: f64 = 0.1;
/// in at least this share of the specimens.
const LEAST_SHARE: f64 = 0.75;
/// Length of a block in s.
const BLOCK_S: f64 = 0.08;
/// What a law leaves counts as noise of so many times the sensor's, at least of this share of the largest force.
const NOISES: f64 = 3.0;
const NOISE_SHARE: f64 = 1e-3;
/// Shortest hold in s and fewest samples that tell a relaxation.
const LEAST_HOLD_S: f64 = 3.0;
const LEAST_SAMPLES: usize = 50;

/// How long a fit goes on.
const EFFORT: Effort = Effort { turns: 40, enough: 1e-3 };

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

/// One specimen: per rung the error on what was fitted and on the rest of the hold (N), and the law.
struct One {
    errors: Vec<(f64, f64)>,
    laws: Vec<Model>,
    /// Errors of the last law without its curvature.
    straight: (f64, f64),
}

/// The effect of a curved spring.
fn curvature() -> &'static str {
    NonlinearElasticity { kappa_per_m: 0.0 }.info().id
}

/// Relaxation with these terms (fraction, time constant in s).
fn relaxing(terms: &[(f64, f64)]) -> AnyEffect {
    let term = |&(fraction, time_constant_s): &(f64, f64)| PronyTerm { fraction, time_constant_s };
    StressRelaxation { terms: terms.iter().map(term).collect() }.into()
}

/// The rungs, each with the one before: what is called how, and where its fits start.
fn rungs() -> [(&'static str, Vec<AnyEffect>); 4] {
    [
        ("base law", Vec::new()),
        (
            curvature(),
            vec![
                NonlinearElasticity { kappa_per_m: 20.0 }.into(),
                NonlinearElasticity { kappa_per_m: 200.0 }.into(),
            ],
        ),
        (relaxing(&[]).info().id, vec![relaxing(&[(0.3, 0.7)]), relaxing(&[(0.3, 4.0)])]),
        (
            "stress_relaxation (second term)",
            vec![
                relaxing(&[(0.2, 0.3), (0.2, 2.5)]),
                relaxing(&[(0.2, 0.8), (0.2, 6.0)]),
                relaxing(&[(0.2, 0.6), (0.2, 25.0)]),
            ],
        ),
    ]
}

/// Looks at specimens one by one.
#[must_use]
pub fn look(believed: &Tissue, runs: &[Insertion]) -> Option<Specimens> {
    let mut unused = Vec::new();
    let mut punctured = Vec::new();
    let mut usable: Vec<&Insertion> = Vec::new();
    for run in runs {
        if run.ruptures_s.iter().any(|t| t.is_finite()) {
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
    let mut done: Vec<Rung> = Vec::new();
    let mut standing = 0;
    for (k, (name, effects)) in rungs().into_iter().enumerate() {
        let of = |j: usize, left_out: bool| {
            median_of(each.iter().map(|o| if left_out { o.errors[j].1 } else { o.errors[j].0 }))
        };
        let both = |o: &One, j: usize| o.errors[j].0 + o.errors[j].1;
        let better =
            each.iter().filter(|o| both(o, k) < both(o, standing)).count() as f64 / each.len() as f64;
        let gains = |left_out: bool| of(k, left_out) < (1.0 - LEAST_GAIN) * of(standing, left_out);
        let kept = k == 0 || ((gains(true) || gains(false)) && better >= LEAST_SHARE);
        done.push(Rung {
            step: name.to_owned(),
            effect: effects.first().map(|e| e.info().id.to_owned()),
            fitted_n: of(k, false),
            left_out_n: of(k, true),
            better,
            kept,
        });
        if kept {
            standing = k;
        }
    }
    // A ramp that is too fast shows its curvature only when the relaxation is known.
    let last = done.len() - 1;
    if standing == last {
        let both = |e: (f64, f64)| e.0 + e.1;
        let with = median_of(each.iter().map(|o| both(o.errors[last])));
        let without = median_of(each.iter().map(|o| both(o.straight)));
        let better = each.iter().filter(|o| both(o.errors[last]) < both(o.straight)).count() as f64;
        if let Some(rung) = done.iter_mut().find(|r| r.effect.as_deref() == Some(curvature())) {
            rung.kept |= with < (1.0 - LEAST_GAIN) * without && better >= LEAST_SHARE * each.len() as f64;
        }
    }
    let numbers = numbers(&each, standing);
    Some(Specimens { used: each.len(), unused, punctured, rungs: done, numbers })
}

/// Whether a recording is a ramp and a hold.
fn whole(run: &Insertion) -> Result<(), String> {
    let t = &run.recording.time_s;
    let hold = t[t.len() - 1] - t[run.phases.deepest];
    if run.recording.len() < LEAST_SAMPLES {
        return Err(format!("{} samples are too few", run.recording.len()));
    }
    if run.phases.back < run.recording.len() {
        return Err("the tool comes back".to_owned());
    }
    if hold < LEAST_HOLD_S {
        return Err(format!("held for {hold:.1} s only"));
    }
    Ok(())
}

fn one(believed: &Tissue, run: &Insertion) -> Option<One> {
    let r = &run.recording;
    let t = &r.time_s;
    let end = t[run.phases.deepest] + FITTED * (t[t.len() - 1] - t[run.phases.deepest]);
    let late: Vec<bool> = t.iter().map(|t| *t > end).collect();
    let largest = r.force_n.iter().fold(0.0_f64, |most, f| most.max(f.abs()));
    let noise = (NOISES * noise_n(&r.force_n)).max(NOISE_SHARE * largest);
    let on = |excluded: &[bool]| {
        Data::new(Arc::new(vec![Blocks::new(r, excluded, BLOCK_S)]), Noise::white(noise), noise)
    };
    let (first, all) = (on(&late), on(&vec![false; t.len()]));
    let mut out = One { errors: Vec::new(), laws: Vec::new(), straight: (0.0, 0.0) };
    let errors = |model: &Model| -> Option<(f64, f64)> {
        let left = residuals(model, &all)?;
        let b = all.blocks.first()?;
        let (mut before, mut after) = (Vec::new(), Vec::new());
        for (k, e) in left.e.first()?.iter().enumerate().filter(|(k, _)| b.used[*k]) {
            if 0.5 * (b.from_s[k] + b.to_s[k]) > end { after.push(*e) } else { before.push(*e) }
        }
        Some((rms(&before), rms(&after)))
    };
    let mut model = Model::base(Arc::new(pressed(believed, run)), 1);
    for (_, effects) in rungs() {
        let starts = if effects.is_empty() { vec![model.clone()] } else { Vec::new() };
        let with = |effect: &AnyEffect| {
            let choice = Choice::new(effect.info(), &effect.parameters());
            // Two terms take the place of one.
            let one = model.effects.iter().position(|c| c.info.id == choice.info.id);
            one.map_or_else(|| model.clone(), |k| model.without(k)).with(choice)
        };
        let fitted = starts
            .into_iter()
            .chain(effects.iter().map(with))
            .filter_map(|start| fit(&start, &first, EFFORT))
            .min_by(|a, b| a.nats().total_cmp(&b.nats()))?;
        out.errors.push(errors(&fitted.model)?);
        model = fitted.model.clone();
        out.laws.push(fitted.model);
    }
    if let Some(k) = model.effects.iter().position(|c| c.info.id == curvature()) {
        out.straight = errors(&fit(&model.without(k), &first, EFFORT)?.model)?;
    }
    Some(out)
}

/// The effects' numbers of the kept law over the specimens.
fn numbers(each: &[One], rung: usize) -> Vec<Over> {
    let Some(first) = each.first() else { return Vec::new() };
    let paths = first.laws[rung].effects.iter().flat_map(|c| c.info.parameters.iter());
    paths
        .map(|p| {
            let log = p.path.ends_with("time_constant_s");
            let all = stylet_stats::sorted(each.iter().filter_map(|o| value(&o.laws[rung], p.path)).map(
                |x| {
                    if log { libm::log(x) } else { x }
                },
            ));
            let n = all.len();
            let middle = mean(&all);
            let reach = student::quantile(0.975, (n.max(2) - 1) as f64) * sd(&all) / libm::sqrt(n as f64);
            let back = |x: f64| if log { libm::exp(x) } else { x };
            let at = |share: f64| back(stylet_stats::quantile_of_sorted(&all, share));
            Over {
                name: p.path.to_owned(),
                mean: back(middle),
                low: back(middle - reach),
                high: back(middle + reach),
                nine_of_ten: (at(0.05), at(0.95)),
            }
        })
        .collect()
}

/// A number of a law by its path. Terms come in no order: the fast one first.
fn value(law: &Model, path: &str) -> Option<f64> {
    let of = |path: &str| {
        law.effects.iter().find_map(|c| {
            let k = c.info.parameters.iter().position(|p| p.path == path)?;
            Some(c.values[k])
        })
    };
    let swapped = of("terms.0.time_constant_s")
        .zip(of("terms.1.time_constant_s"))
        .is_some_and(|(first, second)| first > second);
    match (swapped, path.strip_prefix("terms.0."), path.strip_prefix("terms.1.")) {
        (true, Some(rest), _) => of(&format!("terms.1.{rest}")),
        (true, _, Some(rest)) => of(&format!("terms.0.{rest}")),
        _ => of(path),
    }
}
