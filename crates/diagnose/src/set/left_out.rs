//! Recordings and whole days left out, and the floor: another real insertion as the predictor.

use crate::set::first::{Insertion, groups};
use crate::set::fitted::{Fitted, settle};
use crate::set::population::{DRAWS, Part, Population, Prediction, part, predict};
use rayon::prelude::*;
use stylet_identify::model::NEVER;
use stylet_stats::interpolate;

/// Half of the window around a rupture, in s: what happens in it depends on when it comes.
const WINDOW_S: f64 = 0.5;
/// Numbers of [`Score::parts`].
pub const PARTS: [&str; 5] = ["loading", "puncture window", "cutting", "hold", "back"];

/// How well a recording is predicted.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Score {
    /// Root mean square over all samples in N.
    pub rmse_n: f64,
    /// Share of samples inside the 90 % band.
    pub covered: f64,
    /// Sum of squares (N²) and samples by part, in the order of [`PARTS`].
    pub parts: [(f64, f64); 5],
}

/// Scores a predicted force.
#[must_use]
pub fn score(run: &Insertion, p: &Prediction) -> Score {
    let r = &run.recording;
    let mut out = Score::default();
    let first = run.ruptures_s.iter().copied().fold(NEVER, f64::min);
    let (mut sum, mut inside) = (0.0, 0.0);
    let limit_n = run.limit_n.unwrap_or(f64::INFINITY);
    let shown = |f: f64| f.clamp(-limit_n, limit_n);
    for i in 0..r.len().min(p.mean.len()) {
        let e = r.force_n[i] - shown(p.mean[i]);
        sum += e * e;
        let within = |(l, h): (&f64, &f64)| shown(*l) <= r.force_n[i] && r.force_n[i] <= shown(*h);
        inside += f64::from(u8::from(p.low.get(i).zip(p.high.get(i)).is_some_and(within)));
        let t = r.time_s[i];
        let near = run.ruptures_s.iter().any(|at| (t - at).abs() < WINDOW_S);
        let k = match part(run, t, first) {
            _ if near => 1,
            Part::Loading => 0,
            Part::Cutting => 2,
            Part::Hold => 3,
            Part::Back => 4,
        };
        out.parts[k].0 += e * e;
        out.parts[k].1 += 1.0;
    }
    let n = r.len().max(1) as f64;
    out.rmse_n = if p.mean.is_empty() { f64::NAN } else { (sum / n).sqrt() };
    out.covered = inside / n;
    out
}

/// The fit again without some of the recordings, and what it says of insertions in general.
#[must_use]
pub fn without(all: &Fitted, runs: &[&Insertion], out: &[usize], rounds: &[usize]) -> Option<Population> {
    let kept: Vec<usize> = (0..runs.len()).filter(|r| !out.contains(r)).collect();
    let some: Vec<&Insertion> = kept.iter().map(|r| runs[*r]).collect();
    let drops: Vec<Vec<f64>> = kept.iter().map(|r| all.drops[*r].clone()).collect();
    let (fit, data) = settle(&all.fit.model.only(&kept), all.data.only(&kept), &drops, rounds)?;
    let fitted = Fitted { fit, data, drops, starts: all.starts };
    Some(Population::of(&fitted, &some))
}

/// A recording predicted by a fit without it.
#[derive(Clone, Debug, Default)]
pub struct Out {
    /// How well.
    pub score: Score,
    /// The prediction.
    pub prediction: Prediction,
    /// The law and its population without this recording; none when it cannot be fitted.
    pub population: Option<Population>,
}

/// Every recording predicted by a fit without it.
#[must_use]
pub fn one_left_out(all: &Fitted, runs: &[&Insertion]) -> Vec<Score> {
    runs_out(all, runs).into_iter().map(|o| o.score).collect()
}

/// The same with the predictions and the laws.
#[must_use]
pub fn runs_out(all: &Fitted, runs: &[&Insertion]) -> Vec<Out> {
    (0..runs.len())
        .into_par_iter()
        .map(|r| {
            let day_of = &all.fit.model.day_of;
            // A day is known when another recording was made on it.
            let day = day_of.get(r).copied().filter(|day| day_of.iter().filter(|d| *d == day).count() > 1);
            let Some(population) = without(all, runs, &[r], &[5]) else { return Out::default() };
            let prediction = predict(&population, runs[r], day, DRAWS);
            Out { score: score(runs[r], &prediction), prediction, population: Some(population) }
        })
        .collect()
}

/// Every recording predicted by a fit without its whole day (speed and stroke); empty when there is one day only.
#[must_use]
pub fn speeds_out(all: &Fitted, runs: &[&Insertion]) -> Vec<Score> {
    let groups = groups(runs);
    if groups.len() < 2 {
        return Vec::new();
    }
    let mut out = vec![Score::default(); runs.len()];
    let done: Vec<Vec<(usize, Score)>> = groups
        .par_iter()
        .map(|group| {
            let Some(p) = without(all, runs, group, &[10, 6]) else { return Vec::new() };
            group.iter().map(|r| (*r, score(runs[*r], &predict(&p, runs[*r], None, DRAWS)))).collect()
        })
        .collect();
    for (r, s) in done.into_iter().flatten() {
        out[r] = s;
    }
    out
}

/// The floor: the mean of the other insertions of one group as the predictor, aligned at the start of the motion. The mean
/// of `n` others scatters itself: without that inflation the floor is `sqrt(n/(n + 1))` of it.
#[must_use]
pub fn floor(runs: &[&Insertion]) -> Vec<Option<(Score, usize)>> {
    let groups = groups(runs);
    (0..runs.len())
        .map(|i| {
            let others: Vec<&Insertion> = groups
                .iter()
                .find(|g| g.contains(&i))?
                .iter()
                .filter(|j| **j != i)
                .map(|j| runs[*j])
                .collect();
            if others.is_empty() {
                return None;
            }
            let start = |r: &Insertion| r.recording.time_s[r.phases.start];
            let mean = runs[i].recording.time_s.iter().map(|t| {
                let at = |o: &Insertion| {
                    interpolate(&o.recording.time_s, &o.recording.force_n, t - start(runs[i]) + start(o))
                };
                others.iter().map(|o| at(o)).sum::<f64>() / others.len() as f64
            });
            let p = Prediction { mean: mean.collect(), ..Prediction::default() };
            Some((score(runs[i], &p), others.len()))
        })
        .collect()
}
