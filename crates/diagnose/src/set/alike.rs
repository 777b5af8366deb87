//! What runs of one speed and stroke leave alike: what a law has not, learned from the others beside it.
//!
//! No law is finished. What it leaves of the others of a group has a mean and a scatter about it. The mean is added to what the law
//! predicts, by the share of its square that its own scatter does not explain (model discrepancy, Kennedy and O'Hagan 2001; shrinkage,
//! James and Stein 1961). Where the law leaves nothing alike that is nothing; where it is far off, law and left-over together are the
//! mean of the other runs. It is learned at one speed, says nothing of another, and names no cause.

use crate::set::first::Insertion;
use crate::set::population::Prediction;
use stylet_stats::interpolate;

/// What is alike is judged over so many seconds to either side: residuals of a law stay alike for about one.
const REACH_S: f64 = 2.0;
/// Half the width of a normal 90 % band in standard deviations.
const HALF_BAND: f64 = 1.644_853_626_951_472_2;
/// A time (s) before and after everything.
const FAR_S: f64 = 1e4;

/// What the others of a group leave alike at every sample of a run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Alike {
    /// What the law lacks (N); zero where it lacks nothing that can be told from chance.
    pub mean_n: Vec<f64>,
    /// Standard deviation (N) that this is told with.
    pub sd_n: Vec<f64>,
}

impl Alike {
    /// A prediction of the law with what it lacks.
    #[must_use]
    pub fn beside(&self, law: &Prediction) -> Prediction {
        let mut out = law.clone();
        for (i, (more, sd)) in self.mean_n.iter().zip(&self.sd_n).enumerate() {
            let wider = |half: f64| half.hypot(HALF_BAND * sd);
            let mean = law.mean[i];
            out.mean[i] = mean + more;
            if let (Some(low), Some(high)) = (out.low.get_mut(i), out.high.get_mut(i)) {
                *low = out.mean[i] - wider(mean - *low);
                *high = out.mean[i] + wider(*high - mean);
            }
        }
        out
    }
}

/// Where an insertion is what: its motion begins, is deepest, goes back.
fn marks(run: &Insertion) -> [f64; 5] {
    let time_s = &run.recording.time_s;
    let at = |i: usize| time_s.get(i).or(time_s.last()).copied().unwrap_or(0.0);
    let (start, deepest, back) = (at(run.phases.start), at(run.phases.deepest), at(run.phases.back));
    [start - FAR_S, start, deepest, back, back + FAR_S]
}

/// What is left of the `others` of a group by the law that predicts `told` for `run`, each with the mean force (N) of that law.
#[must_use]
pub fn alike(run: &Insertion, told: &Prediction, others: &[(&Insertion, Vec<f64>)]) -> Alike {
    let n = others.len() as f64;
    if others.is_empty() || told.low.is_empty() || others.iter().any(|o| o.1.is_empty()) {
        return Alike::default();
    }
    let here = marks(run);
    let left: Vec<([f64; 5], &[f64], Vec<f64>)> = others
        .iter()
        .map(|(o, law_n)| {
            let limit_n = o.limit_n.unwrap_or(f64::INFINITY);
            let less = |(f, law): (&f64, &f64)| f - law.clamp(-limit_n, limit_n);
            let left = o.recording.force_n.iter().zip(law_n).map(less).collect();
            (marks(o), o.recording.time_s.as_slice(), left)
        })
        .collect();
    let time_s = &run.recording.time_s;
    let (mut mean, mut noise) = (Vec::with_capacity(time_s.len()), Vec::with_capacity(time_s.len()));
    for (i, t) in time_s.iter().enumerate() {
        let all: Vec<f64> =
            left.iter().map(|(there, time_s, e)| interpolate(time_s, e, interpolate(&here, there, *t))).collect();
        let m = all.iter().sum::<f64>() / n;
        // What the law expects of the scatter counts as one more recording.
        let expected = (told.high[i] - told.low[i]) / (2.0 * HALF_BAND);
        let square = all.iter().map(|e| (e - m).powi(2)).sum::<f64>() + expected * expected;
        mean.push(m);
        noise.push(square / n / n);
    }
    let sums = |of: &dyn Fn(usize) -> f64| {
        let mut sum = vec![0.0; time_s.len() + 1];
        (0..time_s.len()).for_each(|i| sum[i + 1] = sum[i] + of(i));
        sum
    };
    let (squares, noises) = (sums(&|i| mean[i] * mean[i]), sums(&|i| noise[i]));
    let mut out = Alike::default();
    for (i, t) in time_s.iter().enumerate() {
        let from = time_s.partition_point(|s| *s < t - REACH_S);
        let to = time_s.partition_point(|s| *s <= t + REACH_S);
        let (square, by_chance) = (squares[to] - squares[from], noises[to] - noises[from]);
        let share = if square > by_chance { 1.0 - by_chance / square } else { 0.0 };
        out.mean_n.push(share * mean[i]);
        out.sd_n.push((share * noise[i]).sqrt());
    }
    out
}
