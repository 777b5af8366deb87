//! What runs of one speed and stroke leave alike: what a law has not, learned from the others beside it.
//!
//! No law is finished. What it leaves of the others of a group has a mean and a scatter about it. The mean is added to what the law
//! predicts, by the share of its square that its own scatter does not explain (model discrepancy, Kennedy and O'Hagan 2001; shrinkage,
//! James and Stein 1961). Where the law leaves nothing alike that is nothing; where it is far off, law and left-over together are the
//! mean of the other runs. It is learned at one speed, says nothing of another, and names no cause.

use crate::repeated_insertions::population_prediction::{PredictedForce, Z90};
use crate::repeated_insertions::start_values::SegmentedRecording;
use stylet_stats::interpolate;

/// What is alike is judged over so many seconds to either side: residuals of a law stay alike for about one.
const REACH_S: f64 = 2.0;
/// A time (s) before and after everything.
const FAR_S: f64 = 1e4;

/// What the others of a group leave alike at every sample of a run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EmpiricalDiscrepancy {
    /// What the law lacks (N); zero where it lacks nothing that can be told from chance.
    pub mean_n: Vec<f64>,
    /// By how much the band about it is wider than the law's: what is added is no scatter any more, and is told no better than the others
    /// scatter.
    pub band_scale: Vec<f64>,
}

impl EmpiricalDiscrepancy {
    /// A prediction of the law with what it lacks.
    #[must_use]
    pub fn apply(&self, law: &PredictedForce) -> PredictedForce {
        let mut out = law.clone();
        for (i, (more, wider)) in self.mean_n.iter().zip(&self.band_scale).enumerate() {
            let mean = law.mean_n[i] + more;
            out.low_n[i] = mean - wider * (law.mean_n[i] - law.low_n[i]);
            out.high_n[i] = mean + wider * (law.high_n[i] - law.mean_n[i]);
            out.mean_n[i] = mean;
        }
        out
    }
}

/// Where an insertion is what: its motion begins, is deepest, goes back.
fn marks(run: &SegmentedRecording) -> [f64; 5] {
    let time_s = &run.recording.time_s;
    let at = |i: usize| time_s.get(i).or(time_s.last()).copied().unwrap_or(0.0);
    let (start, deepest, back) = (at(run.phases.start), at(run.phases.deepest), at(run.phases.retraction));
    [start - FAR_S, start, deepest, back, back + FAR_S]
}

/// What is left of the `others` of a group by the law that predicts `told` for `run`, each with the mean force (N) of that law.
#[must_use]
pub fn estimate_discrepancy(
    run: &SegmentedRecording,
    told: &PredictedForce,
    others: &[(&SegmentedRecording, Vec<f64>)],
) -> EmpiricalDiscrepancy {
    let n = others.len() as f64;
    if others.is_empty() || told.low_n.is_empty() || others.iter().any(|o| o.1.is_empty()) {
        return EmpiricalDiscrepancy::default();
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
        told.low_n.iter().zip(&told.high_n).map(|(low, high)| (high - low) / (2.0 * Z90)).collect();
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
    let mut out = EmpiricalDiscrepancy::default();
    for (i, t) in time_s.iter().enumerate() {
        let from = time_s.partition_point(|s| *s < t - REACH_S);
        let to = time_s.partition_point(|s| *s <= t + REACH_S);
        let (square, by_chance) = (squares[to] - squares[from], noises[to] - noises[from]);
        let share = if square > by_chance { 1.0 - by_chance / square } else { 0.0 };
        out.mean_n.push(share * mean[i]);
        // Another run scatters about the mean as these do, by what the mean is told with beside it.
        let ratio = if expected[i] > 0.0 { (n + 1.0) * noise[i] / expected[i].powi(2) } else { 1.0 };
        out.band_scale.push((1.0 - share + share * ratio).sqrt());
    }
    out
}

#[cfg(test)]
mod tests {
    use super::{Z90, estimate_discrepancy};
    use crate::repeated_insertions::SegmentedRecording;
    use crate::repeated_insertions::population_prediction::PredictedForce;
    use stylet_record::Recording;

    /// In by 20 mm from `start_s` on in 5 s, a rest of so many s, and back: the force is the position times 100 and so much more.
    fn run(start_s: f64, rest_s: f64, more_n: impl Fn(f64) -> f64) -> SegmentedRecording {
        let t: Vec<f64> = (0..800).map(|k| 0.02 * f64::from(k)).collect();
        let z = |t: f64| match t - start_s {
            x if x < 0.0 => 0.0,
            x if x < 5.0 => 0.004 * x,
            x if x < 5.0 + rest_s => 0.02,
            x => (0.02 - 0.008 * (x - 5.0 - rest_s)).max(0.0),
        };
        let z: Vec<f64> = t.iter().map(|t| z(*t)).collect();
        let f = z.iter().zip(&t).map(|(z, t)| 100.0 * z + more_n(*t)).collect();
        SegmentedRecording::new(String::new(), Recording::new(t, z, f).expect("clean columns"), 1)
    }

    /// A law that knows the position only, with a band of so many standard deviations (N).
    fn law(run: &SegmentedRecording, sd_n: f64) -> PredictedForce {
        let mean: Vec<f64> = run.recording.position_m.iter().map(|z| 100.0 * z).collect();
        let edge = |by: f64| mean.iter().map(|f| f + by * Z90 * sd_n).collect();
        PredictedForce { low_n: edge(-1.0), high_n: edge(1.0), mean_n: mean.clone() }
    }

    #[test]
    fn what_a_law_lacks_in_all_runs_of_a_speed_is_added_to_it() {
        let runs = [0.50, 0.52, 0.48, 0.50].map(|more| run(1.0, 2.0, |_| more));
        let others: Vec<_> = runs[1..].iter().map(|r| (r, law(r, 0.1).mean_n)).collect();
        let told = law(&runs[0], 0.1);
        let a = estimate_discrepancy(&runs[0], &told, &others);
        // Squares of three about their mean, and one more of a tenth of a newton: by chance a mean of 0.034 N.
        let by_chance = (0.02_f64 * 0.02 * 2.0 + 0.01) / 9.0;
        let share = 1.0 - by_chance / 0.25;
        for i in [10, 300, 700] {
            assert!((a.mean_n[i] - 0.5 * share).abs() < 1e-6, "{}", a.mean_n[i]);
            let both = a.apply(&told);
            assert!((both.mean_n[i] - told.mean_n[i] - a.mean_n[i]).abs() < 1e-12);
            // The band goes along: so far as it is trusted it is that of a run about the mean of three.
            let half = Z90 * ((1.0 - share) * 0.01 + share * 4.0 * by_chance).sqrt();
            assert!((both.high_n[i] - both.mean_n[i] - half).abs() < 1e-9);
            assert!((both.mean_n[i] - both.low_n[i] - half).abs() < 1e-9);
        }
    }

    #[test]
    fn what_differs_from_run_to_run_is_not_learned() {
        let runs = [0.1, 0.3, -0.3, 0.1, -0.1].map(|more| run(1.0, 2.0, |_| more));
        let others: Vec<_> = runs[1..].iter().map(|r| (r, law(r, 0.2).mean_n)).collect();
        let told = law(&runs[0], 0.2);
        let a = estimate_discrepancy(&runs[0], &told, &others);
        assert!(a.mean_n.iter().all(|m| *m == 0.0) && a.apply(&told).mean_n == told.mean_n);
        let both = a.apply(&told);
        assert!(both.high_n.iter().zip(&told.high_n).all(|(a, b)| (a - b).abs() < 1e-12));
        // Nobody to learn from.
        assert_eq!(estimate_discrepancy(&runs[0], &told, &[]).apply(&told).mean_n, told.mean_n);
    }

    /// A law with a band as wide as what it lacks: beside the others, which agree, a run is told better than that.
    #[test]
    fn a_band_does_not_keep_what_is_learned_as_scatter() {
        let runs = [0.50, 0.53, 0.47, 0.51, 0.49].map(|more| run(1.0, 2.0, |_| more));
        let others: Vec<_> = runs[1..].iter().map(|r| (r, law(r, 0.5).mean_n)).collect();
        let told = law(&runs[0], 0.5);
        let both = estimate_discrepancy(&runs[0], &told, &others).apply(&told);
        let width = |p: &PredictedForce| p.high_n[300] - p.low_n[300];
        assert!(width(&both) < 0.75 * width(&told), "{} of {}", width(&both), width(&told));
        // Others that scatter more than the law says make it wider, where they are trusted at all.
        let runs = [2.0, 2.6, 1.4, 2.5, 1.5].map(|more| run(1.0, 2.0, |_| more));
        let others: Vec<_> = runs[1..].iter().map(|r| (r, law(r, 0.1).mean_n)).collect();
        let told = law(&runs[0], 0.1);
        let both = estimate_discrepancy(&runs[0], &told, &others).apply(&told);
        assert!(width(&both) > 4.0 * width(&told), "{} of {}", width(&both), width(&told));
    }

    /// A bump half a second after the way back begins: the runs begin at other times and rest for other times.
    #[test]
    fn runs_are_laid_upon_each_other_where_they_begin_stand_and_go_back() {
        let bump = |back_s: f64| move |t: f64| if (t - back_s - 0.5).abs() < 0.3 { 1.0 } else { 0.0 };
        let here = run(1.0, 2.0, bump(8.0));
        let there = [(0.5, 3.0, 8.5), (1.5, 2.5, 9.0), (2.0, 2.0, 9.0)]
            .map(|(s, rest, back)| run(s, rest, bump(back)));
        let others: Vec<_> = there.iter().map(|r| (r, law(r, 0.05).mean_n)).collect();
        let a = estimate_discrepancy(&here, &law(&here, 0.05), &others);
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
        let others: Vec<_> = runs[1..].iter().map(|r| (r, law(r, 0.1).mean_n)).collect();
        let a = estimate_discrepancy(&runs[0], &law(&runs[0], 0.1), &others);
        assert!(a.mean_n.iter().all(|m| m.abs() < 1e-12));
    }
}
