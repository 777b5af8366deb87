//! What runs of one speed and stroke leave alike: what a law has not, learned from the others beside it.
//!
//! No law is finished. What it leaves of the others of a group has a mean and a scatter about it. The mean is added to what the law
//! predicts, by the share of its square that its own scatter does not explain (model discrepancy, Kennedy and O'Hagan 2001; shrinkage,
//! James and Stein 1961). Where the law leaves nothing alike that is nothing; where it is far off, law and left-over together are the
//! mean of the other runs. It is learned at one speed, says nothing of another, and names no cause.

use crate::set::first::Insertion;
use crate::set::population::{HALF_BAND, Prediction};
use stylet_stats::interpolate;

/// What is alike is judged over so many seconds to either side: residuals of a law stay alike for about one.
const REACH_S: f64 = 2.0;
/// A time (s) before and after everything.
const FAR_S: f64 = 1e4;

/// What the others of a group leave alike at every sample of a run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Alike {
    /// What the law lacks (N); zero where it lacks nothing that can be told from chance.
    pub mean_n: Vec<f64>,
    /// By how much the band about it is wider than the law's: what is added is no scatter any more, and is told no better than the others
    /// scatter.
    pub wider: Vec<f64>,
}

impl Alike {
    /// A prediction of the law with what it lacks.
    #[must_use]
    pub fn beside(&self, law: &Prediction) -> Prediction {
        let mut out = law.clone();
        for (i, (more, wider)) in self.mean_n.iter().zip(&self.wider).enumerate() {
            let mean = law.mean[i] + more;
            out.low[i] = mean - wider * (law.mean[i] - law.low[i]);
            out.high[i] = mean + wider * (law.high[i] - law.mean[i]);
            out.mean[i] = mean;
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
    // What the law expects of the scatter counts as one more recording.
    let expected: Vec<f64> =
        told.low.iter().zip(&told.high).map(|(low, high)| (high - low) / (2.0 * HALF_BAND)).collect();
    for (i, t) in time_s.iter().enumerate() {
        let all: Vec<f64> = left
            .iter()
            .map(|(there, time_s, e)| interpolate(time_s, e, interpolate(&here, there, *t)))
            .collect();
        let m = all.iter().sum::<f64>() / n;
        let square = all.iter().map(|e| (e - m).powi(2)).sum::<f64>() + expected[i] * expected[i];
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
        // Another run scatters about the mean as these do, by what the mean is told with beside it.
        let ratio = if expected[i] > 0.0 { (n + 1.0) * noise[i] / expected[i].powi(2) } else { 1.0 };
        out.wider.push((1.0 - share + share * ratio).sqrt());
    }
    out
}

#[cfg(test)]
mod tests {
    use super::{HALF_BAND, alike};
    use crate::set::Insertion;
    use crate::set::population::Prediction;
    use stylet_record::Recording;

    /// In by 20 mm from `start_s` on in 5 s, a rest of so many s, and back: the force is the position times 100 and so much more.
    fn run(start_s: f64, rest_s: f64, more_n: impl Fn(f64) -> f64) -> Insertion {
        let t: Vec<f64> = (0..800).map(|k| 0.02 * f64::from(k)).collect();
        let z = |t: f64| match t - start_s {
            x if x < 0.0 => 0.0,
            x if x < 5.0 => 0.004 * x,
            x if x < 5.0 + rest_s => 0.02,
            x => (0.02 - 0.008 * (x - 5.0 - rest_s)).max(0.0),
        };
        let z: Vec<f64> = t.iter().map(|t| z(*t)).collect();
        let f = z.iter().zip(&t).map(|(z, t)| 100.0 * z + more_n(*t)).collect();
        Insertion::new(String::new(), Recording::new(t, z, f).expect("clean columns"), 1)
    }

    /// A law that knows the position only, with a band of so many standard deviations (N).
    fn law(run: &Insertion, sd_n: f64) -> Prediction {
        let mean: Vec<f64> = run.recording.position_m.iter().map(|z| 100.0 * z).collect();
        let edge = |by: f64| mean.iter().map(|f| f + by * HALF_BAND * sd_n).collect();
        Prediction { low: edge(-1.0), high: edge(1.0), mean: mean.clone() }
    }

    #[test]
    fn what_a_law_lacks_in_all_runs_of_a_speed_is_added_to_it() {
        let runs = [0.50, 0.52, 0.48, 0.50].map(|more| run(1.0, 2.0, |_| more));
        let others: Vec<_> = runs[1..].iter().map(|r| (r, law(r, 0.1).mean)).collect();
        let told = law(&runs[0], 0.1);
        let a = alike(&runs[0], &told, &others);
        // Squares of three about their mean, and one more of a tenth of a newton: by chance a mean of 0.034 N.
        let by_chance = (0.02_f64 * 0.02 * 2.0 + 0.01) / 9.0;
        let share = 1.0 - by_chance / 0.25;
        for i in [10, 300, 700] {
            assert!((a.mean_n[i] - 0.5 * share).abs() < 1e-6, "{}", a.mean_n[i]);
            let both = a.beside(&told);
            assert!((both.mean[i] - told.mean[i] - a.mean_n[i]).abs() < 1e-12);
            // The band goes along: so far as it is trusted it is that of a run about the mean of three.
            let half = HALF_BAND * ((1.0 - share) * 0.01 + share * 4.0 * by_chance).sqrt();
            assert!((both.high[i] - both.mean[i] - half).abs() < 1e-9);
            assert!((both.mean[i] - both.low[i] - half).abs() < 1e-9);
        }
    }

    #[test]
    fn what_differs_from_run_to_run_is_not_learned() {
        let runs = [0.1, 0.3, -0.3, 0.1, -0.1].map(|more| run(1.0, 2.0, |_| more));
        let others: Vec<_> = runs[1..].iter().map(|r| (r, law(r, 0.2).mean)).collect();
        let told = law(&runs[0], 0.2);
        let a = alike(&runs[0], &told, &others);
        assert!(a.mean_n.iter().all(|m| *m == 0.0) && a.beside(&told).mean == told.mean);
        let both = a.beside(&told);
        assert!(both.high.iter().zip(&told.high).all(|(a, b)| (a - b).abs() < 1e-12));
        // Nobody to learn from.
        assert_eq!(alike(&runs[0], &told, &[]).beside(&told).mean, told.mean);
    }

    /// A law with a band as wide as what it lacks: beside the others, which agree, a run is told better than that.
    #[test]
    fn a_band_does_not_keep_what_is_learned_as_scatter() {
        let runs = [0.50, 0.53, 0.47, 0.51, 0.49].map(|more| run(1.0, 2.0, |_| more));
        let others: Vec<_> = runs[1..].iter().map(|r| (r, law(r, 0.5).mean)).collect();
        let told = law(&runs[0], 0.5);
        let both = alike(&runs[0], &told, &others).beside(&told);
        let width = |p: &Prediction| p.high[300] - p.low[300];
        assert!(width(&both) < 0.75 * width(&told), "{} of {}", width(&both), width(&told));
        // Others that scatter more than the law says make it wider, where they are trusted at all.
        let runs = [2.0, 2.6, 1.4, 2.5, 1.5].map(|more| run(1.0, 2.0, |_| more));
        let others: Vec<_> = runs[1..].iter().map(|r| (r, law(r, 0.1).mean)).collect();
        let told = law(&runs[0], 0.1);
        let both = alike(&runs[0], &told, &others).beside(&told);
        assert!(width(&both) > 4.0 * width(&told), "{} of {}", width(&both), width(&told));
    }

    /// A bump half a second after the way back begins: the runs begin at other times and rest for other times.
    #[test]
    fn runs_are_laid_upon_each_other_where_they_begin_stand_and_go_back() {
        let bump = |back_s: f64| move |t: f64| if (t - back_s - 0.5).abs() < 0.3 { 1.0 } else { 0.0 };
        let here = run(1.0, 2.0, bump(8.0));
        let there = [(0.5, 3.0, 8.5), (1.5, 2.5, 9.0), (2.0, 2.0, 9.0)]
            .map(|(s, rest, back)| run(s, rest, bump(back)));
        let others: Vec<_> = there.iter().map(|r| (r, law(r, 0.05).mean)).collect();
        let a = alike(&here, &law(&here, 0.05), &others);
        let at = |t: f64| a.mean_n[(t / 0.02) as usize];
        assert!(at(8.5) > 0.9 && at(8.0) < 0.1 && at(9.0) < 0.1, "{} {} {}", at(8.0), at(8.5), at(9.0));
    }

    #[test]
    fn what_a_sensor_cannot_show_is_not_what_the_law_lacks() {
        let mut runs = [0.0; 4].map(|more| run(1.0, 2.0, |_| more));
        for r in &mut runs {
            r.recording.force_n.iter_mut().for_each(|f| *f = f.min(1.5));
            r.limit_n = Some(1.5);
        }
        let others: Vec<_> = runs[1..].iter().map(|r| (r, law(r, 0.1).mean)).collect();
        let a = alike(&runs[0], &law(&runs[0], 0.1), &others);
        assert!(a.mean_n.iter().all(|m| m.abs() < 1e-12));
    }
}
