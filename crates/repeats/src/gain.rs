//! The gain on insertions that took no part: one run left out, one speed left out, and the floor.

use crate::fit::{Effort, Fit, fit};
use crate::population::Population;
use crate::predict::{self, Prediction};
use crate::run::Run;
use crate::stats::rms;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// One run predicted without it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LeftOut {
    /// Its name.
    pub run: String,
    /// Its speed in m/s.
    pub speed_mps: f64,
    /// Root mean square of measured less predicted force in N.
    pub rmse_n: f64,
    /// Share of its samples within the 90 % band.
    pub covered: f64,
}

/// Groups of runs of one speed (to within 10 %), slowest first, as indices.
#[must_use]
pub fn speeds(runs: &[&Run]) -> Vec<(f64, Vec<usize>)> {
    let mut order: Vec<usize> = (0..runs.len()).collect();
    order.sort_by(|a, b| runs[*a].speed_mps.total_cmp(&runs[*b].speed_mps));
    let mut out: Vec<(f64, Vec<usize>)> = Vec::new();
    for i in order {
        let v = runs[i].speed_mps;
        match out.last_mut() {
            Some((first, members)) if v < *first * 1.1 => members.push(i),
            _ => out.push((v, vec![i])),
        }
    }
    for (v, members) in &mut out {
        members.sort_unstable();
        *v = members.iter().map(|i| runs[*i].speed_mps).sum::<f64>() / members.len() as f64;
    }
    out
}

/// Refits a law without some runs, from where the fit with all of them stands.
#[must_use]
pub fn without(all: &Fit, runs: &[&Run], out: &[usize], effort: Effort) -> Option<(Fit, Population)> {
    let kept: Vec<usize> = (0..runs.len()).filter(|i| !out.contains(i)).collect();
    let some: Vec<&Run> = kept.iter().map(|i| runs[*i]).collect();
    let own: Vec<_> = kept.iter().map(|i| all.own[*i].clone()).collect();
    let fitted = fit(&all.shape, all.x.clone(), Some(&own), &some, all.spread, effort)?;
    let population = Population::of(&fitted, &some);
    Some((fitted, population))
}

/// A law fitted without a group, and the group's runs as it predicts them, with their places.
pub type Without = (Option<(Fit, Population)>, Vec<(usize, LeftOut, Prediction)>);

/// Predicts every run by laws fitted without its group. Returns the fits too, one per group.
#[must_use]
pub fn leave_out(all: &Fit, runs: &[&Run], groups: &[Vec<usize>], effort: Effort) -> Vec<Without> {
    groups
        .par_iter()
        .map(|group| {
            let Some((fitted, population)) = without(all, runs, group, effort) else {
                return (None, Vec::new());
            };
            let predicted = group
                .iter()
                .map(|i| {
                    let p = predict::predict(&fitted, &population, runs[*i]);
                    (*i, score(runs[*i], &p), p)
                })
                .collect();
            (Some((fitted, population)), predicted)
        })
        .collect()
}

/// Mean error (N) on runs left out in groups, without bands: what a step of the search looks at.
#[must_use]
pub fn quick(all: &Fit, runs: &[&Run], groups: &[Vec<usize>], effort: Effort) -> Option<f64> {
    let errors: Vec<Option<Vec<f64>>> = groups
        .par_iter()
        .map(|group| {
            let (fitted, population) = without(all, runs, group, effort)?;
            Some(group.iter().map(|i| thin_error(&fitted, &population, runs[*i])).collect())
        })
        .collect();
    let mut sum = 0.0;
    for errors in errors {
        sum += errors?.iter().sum::<f64>();
    }
    Some(sum / runs.len().max(1) as f64)
}

/// Error (N) of the mean prediction on the samples that fits look at.
#[must_use]
pub fn thin_error(fitted: &Fit, population: &Population, run: &Run) -> f64 {
    let mean = predict::mean(fitted, population, &run.thin, 32);
    let e: Vec<f64> = run.thin.f.iter().zip(&mean).map(|(f, m)| f - m).collect();
    rms(&e)
}

fn score(run: &Run, p: &Prediction) -> LeftOut {
    let f = &run.recording.force_n;
    let e: Vec<f64> = f.iter().zip(&p.mean).map(|(f, m)| f - m).collect();
    let inside = f.iter().zip(p.low.iter().zip(&p.high)).filter(|(f, (l, h))| *l <= *f && *f <= *h).count();
    LeftOut {
        run: run.name.clone(),
        speed_mps: run.speed_mps,
        rmse_n: if p.mean.is_empty() { f64::NAN } else { rms(&e) },
        covered: inside as f64 / f.len().max(1) as f64,
    }
}

/// The floor: the mean of the other runs of the same speed as the predictor, aligned at the start of the
/// motion, linear between their samples. `None` for a run without a fellow.
#[must_use]
pub fn floor(runs: &[&Run]) -> Vec<Option<f64>> {
    let groups = speeds(runs);
    (0..runs.len())
        .map(|i| {
            let group = groups.iter().find(|(_, members)| members.contains(&i))?;
            let others: Vec<&Run> = group.1.iter().filter(|j| **j != i).map(|j| runs[*j]).collect();
            if others.is_empty() {
                return None;
            }
            let run = runs[i];
            let start = run.start_s();
            let mut places = vec![0usize; others.len()];
            let e: Vec<f64> = run
                .recording
                .time_s
                .iter()
                .zip(&run.recording.force_n)
                .map(|(t, f)| {
                    let sum: f64 = others
                        .iter()
                        .zip(&mut places)
                        .map(|(other, place)| between(other, t - start + other.start_s(), place))
                        .sum();
                    f - sum / others.len() as f64
                })
                .collect();
            Some(rms(&e))
        })
        .collect()
}

/// Force of a run at a time, linear between samples, constant beyond its ends.
fn between(run: &Run, t: f64, place: &mut usize) -> f64 {
    let (time, force) = (&run.recording.time_s, &run.recording.force_n);
    while *place + 1 < time.len() && time[*place + 1] < t {
        *place += 1;
    }
    let (i, j) = (*place, (*place + 1).min(time.len() - 1));
    if i == j || t <= time[i] {
        return force[i];
    }
    let share = ((t - time[i]) / (time[j] - time[i])).clamp(0.0, 1.0);
    force[i] + share * (force[j] - force[i])
}
