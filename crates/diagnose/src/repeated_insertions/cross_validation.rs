//! Recordings and whole days left out, and the floor: another real insertion as the predictor.

use crate::repeated_insertions::empirical_discrepancy::estimate_discrepancy;
use crate::repeated_insertions::multistart_fit::{SetFit, fit_with_noise_updates};
use crate::repeated_insertions::population_prediction::{
    DRAWS, InsertionPhase, Population, PredictedForce, phase_at, predict_force,
};
use crate::repeated_insertions::start_values::{SegmentedRecording, group_by_speed_and_stroke};
use rayon::prelude::*;
use stylet_identify::model::NO_RUPTURE;
use stylet_stats::interpolate;

/// Half of the window around a rupture, in s: what happens in it depends on when it comes.
const WINDOW_S: f64 = 0.5;
/// Numbers of [`Score::parts`].
pub const PHASE_NAMES: [&str; 5] = ["loading", "puncture window", "cutting", "hold", "back"];

/// How well a recording is predicted.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PredictionScore {
    /// Root mean square over all samples in N.
    pub rmse_n: f64,
    /// Share of samples inside the 90 % band.
    pub coverage: f64,
    /// Sum of squares (N²) and samples by part, in the order of [`PARTS`].
    pub phase_squares: [(f64, f64); 5],
}

/// Scores a predicted force.
#[must_use]
pub fn score_prediction(run: &SegmentedRecording, p: &PredictedForce) -> PredictionScore {
    let r = &run.recording;
    let mut out = PredictionScore::default();
    let first = run.ruptures_s.iter().copied().fold(NO_RUPTURE, f64::min);
    let (mut sum, mut inside) = (0.0, 0.0);
    let limit_n = run.limit_n.unwrap_or(f64::INFINITY);
    let shown = |f: f64| f.clamp(-limit_n, limit_n);
    for i in 0..r.len().min(p.mean_n.len()) {
        let e = r.force_n[i] - shown(p.mean_n[i]);
        sum += e * e;
        let within = |(l, h): (&f64, &f64)| shown(*l) <= r.force_n[i] && r.force_n[i] <= shown(*h);
        inside += f64::from(u8::from(p.low_n.get(i).zip(p.high_n.get(i)).is_some_and(within)));
        let t = r.time_s[i];
        let near = run.ruptures_s.iter().any(|at| (t - at).abs() < WINDOW_S);
        let k = match phase_at(run, t, first) {
            _ if near => 1,
            InsertionPhase::Loading => 0,
            InsertionPhase::Cutting => 2,
            InsertionPhase::Hold => 3,
            InsertionPhase::Retraction => 4,
        };
        out.phase_squares[k].0 += e * e;
        out.phase_squares[k].1 += 1.0;
    }
    let n = r.len().max(1) as f64;
    out.rmse_n = if p.mean_n.is_empty() { f64::NAN } else { (sum / n).sqrt() };
    out.coverage = inside / n;
    out
}

/// The recordings that stay when some are left out.
#[must_use]
pub fn training_recordings<'a>(
    runs: &[&'a SegmentedRecording],
    out: &[usize],
) -> Vec<&'a SegmentedRecording> {
    (0..runs.len()).filter(|r| !out.contains(r)).map(|r| runs[r]).collect()
}

/// The fit again without some of the recordings.
#[must_use]
pub fn refit_without(all: &SetFit, out: &[usize], rounds: &[usize]) -> Option<SetFit> {
    let kept: Vec<usize> = (0..all.drop_times_s.len()).filter(|r| !out.contains(r)).collect();
    let drops: Vec<Vec<f64>> = kept.iter().map(|r| all.drop_times_s[*r].clone()).collect();
    let (fit, data) =
        fit_with_noise_updates(&all.fit.model.subset(&kept), all.data.subset(&kept), &drops, rounds)?;
    Some(SetFit { fit, data, drop_times_s: drops, starts: all.starts })
}

/// The same, and what it says of insertions in general.
#[must_use]
pub fn population_without(
    all: &SetFit,
    runs: &[&SegmentedRecording],
    out: &[usize],
    rounds: &[usize],
) -> Option<Population> {
    Some(Population::from_fit(&refit_without(all, out, rounds)?, &training_recordings(runs, out)))
}

/// A recording predicted by a fit without it.
#[derive(Clone, Debug, Default)]
pub struct HeldOutPrediction {
    /// How well, by the law together with what the others of its speed and stroke leave alike.
    pub score: PredictionScore,
    /// That prediction.
    pub prediction: PredictedForce,
    /// How well by the law alone.
    pub model_score: PredictionScore,
    /// Mean force (N) of the law alone.
    pub model_force_n: Vec<f64>,
    /// The law and its population without this recording; none when it cannot be fitted.
    pub population: Option<Population>,
}

/// Every recording predicted by a fit without it; by the law alone.
#[must_use]
pub fn leave_one_out_scores(all: &SetFit, runs: &[&SegmentedRecording]) -> Vec<PredictionScore> {
    leave_one_out(all, runs).into_iter().map(|o| o.model_score).collect()
}

/// Every recording predicted without it, by the law alone and together with what the others of its group leave alike.
#[must_use]
pub fn leave_one_out(all: &SetFit, runs: &[&SegmentedRecording]) -> Vec<HeldOutPrediction> {
    let groups = group_by_speed_and_stroke(runs);
    let one = |r: usize| {
        let day_of = &all.fit.model.day_of;
        // A day is known when another recording was made on it.
        let day = day_of.get(r).copied().filter(|day| day_of.iter().filter(|d| *d == day).count() > 1);
        let population = population_without(all, runs, &[r], &[5])?;
        let by_law = |r: usize| predict_force(&population, runs[r], day, DRAWS);
        let told = by_law(r);
        let law = score_prediction(runs[r], &told);
        let group = groups.iter().find(|g| g.contains(&r)).map_or(&[][..], Vec::as_slice);
        let others: Vec<(&SegmentedRecording, Vec<f64>)> =
            group.iter().filter(|o| **o != r).map(|o| (runs[*o], by_law(*o).mean_n)).collect();
        let prediction = estimate_discrepancy(runs[r], &told, &others).apply(&told);
        let law_n = told.mean_n;
        Some(HeldOutPrediction {
            score: score_prediction(runs[r], &prediction),
            prediction,
            model_score: law,
            model_force_n: law_n,
            population: Some(population),
        })
    };
    (0..runs.len()).into_par_iter().map(|r| one(r).unwrap_or_default()).collect()
}

/// Every recording predicted by a fit without its whole day (speed and stroke); empty when there is one day only.
#[must_use]
pub fn leave_speed_out(all: &SetFit, runs: &[&SegmentedRecording]) -> Vec<PredictionScore> {
    let groups = group_by_speed_and_stroke(runs);
    if groups.len() < 2 {
        return Vec::new();
    }
    let mut out = vec![PredictionScore::default(); runs.len()];
    let done: Vec<Vec<(usize, PredictionScore)>> = groups
        .par_iter()
        .map(|group| {
            let Some(fit) = refit_without(all, group, &[10, 6, 6, 6]) else { return Vec::new() };
            let p = Population::from_fit(&fit, &training_recordings(runs, group))
                .with_parameter_uncertainty(&fit);
            group
                .iter()
                .map(|r| (*r, score_prediction(runs[*r], &predict_force(&p, runs[*r], None, DRAWS))))
                .collect()
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
pub fn repeatability_floor(runs: &[&SegmentedRecording]) -> Vec<Option<(PredictionScore, usize)>> {
    let groups = group_by_speed_and_stroke(runs);
    (0..runs.len())
        .map(|i| {
            let others: Vec<&SegmentedRecording> = groups
                .iter()
                .find(|g| g.contains(&i))?
                .iter()
                .filter(|j| **j != i)
                .map(|j| runs[*j])
                .collect();
            if others.is_empty() {
                return None;
            }
            let start = |r: &SegmentedRecording| r.recording.time_s[r.phases.start];
            let mean = runs[i].recording.time_s.iter().map(|t| {
                let at = |o: &SegmentedRecording| {
                    interpolate(&o.recording.time_s, &o.recording.force_n, t - start(runs[i]) + start(o))
                };
                others.iter().map(|o| at(o)).sum::<f64>() / others.len() as f64
            });
            let p = PredictedForce { mean_n: mean.collect(), ..PredictedForce::default() };
            Some((score_prediction(runs[i], &p), others.len()))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::{
        Population, leave_one_out, leave_one_out_scores, leave_speed_out, population_without, refit_without,
        repeatability_floor, score_prediction, training_recordings,
    };
    use crate::repeated_insertions::SegmentedRecording;
    use crate::repeated_insertions::empirical_discrepancy::estimate_discrepancy;
    use crate::repeated_insertions::multistart_fit::SetFit;
    use crate::repeated_insertions::population_prediction::{DRAWS, PredictedForce, predict_force};
    use crate::test_fixtures;
    use stylet_identify::model::{DayParameters, NO_RUPTURE};
    use stylet_record::Recording;

    /// In by 20 mm in 5 s, a rest of 2 s, and back; the force is the position times 100 and so much more.
    fn run(name: &str, start_s: f64, more_n: f64) -> SegmentedRecording {
        let t: Vec<f64> = (0..600).map(|k| 0.02 * f64::from(k)).collect();
        let z = t.iter().map(|t| {
            let t = t - start_s;
            if t < 0.0 {
                0.0
            } else if t < 5.0 {
                0.004 * t
            } else if t < 7.0 {
                0.02
            } else {
                (0.02 - 0.008 * (t - 7.0)).max(0.0)
            }
        });
        let z: Vec<f64> = z.collect();
        let f = z.iter().map(|z| 100.0 * z + more_n).collect();
        SegmentedRecording::new(name.to_owned(), Recording::new(t, z, f).expect("clean columns"), 1)
    }

    #[test]
    fn a_prediction_is_scored_over_all_samples_and_by_part() {
        let mut r = run("a", 1.0, 0.0);
        r.ruptures_s = vec![3.0, NO_RUPTURE];
        let n = r.recording.len();
        let t = r.recording.time_s.clone();
        let mean: Vec<f64> = (0..n).map(|k| r.recording.force_n[k] - 0.1 - 0.001 * k as f64).collect();
        // Inside in every third sample, at the edges, too.
        let low: Vec<f64> = (0..n).map(|k| r.recording.force_n[k] - [0.0, 0.3, -0.1][k % 3]).collect();
        let high: Vec<f64> = (0..n).map(|k| r.recording.force_n[k] + [0.0, -0.1, 0.3][k % 3]).collect();
        let s = score_prediction(&r, &PredictedForce { mean_n: mean.clone(), low_n: low, high_n: high });
        let square = |k: usize| (0.1 + 0.001 * k as f64).powi(2);
        let all: f64 = (0..n).map(square).sum();
        assert!((s.rmse_n - (all / n as f64).sqrt()).abs() < 1e-12);
        assert!((s.coverage - 200.0 / 600.0).abs() < 1e-12, "{}", s.coverage);
        let (deepest, back) = (t[r.phases.deepest], t[r.phases.retraction]);
        let mut parts = [(0.0, 0.0); 5];
        for k in 0..n {
            let at = t[k];
            let p = match at {
                x if (x - 3.0).abs() < 0.5 => 1,
                x if x >= back => 4,
                x if x > deepest => 3,
                x if x >= 3.0 => 2,
                _ => 0,
            };
            parts[p].0 += square(k);
            parts[p].1 += 1.0;
        }
        for (s, w) in s.phase_squares.iter().zip(parts) {
            assert!((s.0 - w.0).abs() < 1e-9 && s.1 == w.1, "{s:?} {w:?}");
        }
        assert!(parts.iter().all(|p| p.1 > 10.0));
        // Half of a prediction scores half of the samples over all of them; none is no number.
        let half = score_prediction(
            &r,
            &PredictedForce { mean_n: mean[..300].to_vec(), ..PredictedForce::default() },
        );
        let some: f64 = (0..300).map(square).sum();
        assert!((half.rmse_n - (some / 600.0).sqrt()).abs() < 1e-12 && half.coverage == 0.0);
        assert!(score_prediction(&r, &PredictedForce::default()).rmse_n.is_nan());
    }

    #[test]
    fn what_a_sensor_cannot_show_is_not_asked_of_a_prediction() {
        let mut r = run("a", 1.0, 0.0);
        r.recording.force_n.iter_mut().for_each(|f| *f = f.clamp(-1.5, 1.5));
        r.limit_n = Some(1.5);
        let mean: Vec<f64> = run("a", 1.0, 0.0).recording.force_n;
        let (low, high) = (mean.iter().map(|f| f - 0.01).collect(), mean.iter().map(|f| f + 0.01).collect());
        let p = PredictedForce { mean_n: mean, low_n: low, high_n: high };
        let s = score_prediction(&r, &p);
        assert!(s.rmse_n < 1e-12 && s.coverage == 1.0, "{s:?}");
        r.limit_n = None;
        assert!(score_prediction(&r, &p).rmse_n > 0.1 && score_prediction(&r, &p).coverage < 0.9);
    }

    /// The others of a group are aligned where their motion begins.
    #[test]
    fn the_floor_is_the_mean_of_the_others_of_one_speed() {
        let mut all = [run("a", 1.0, 0.3), run("b", 1.5, 0.5), run("c", 0.5, 1.0), run("d", 1.0, 9.0)];
        all[3].speed_mps *= 3.0;
        let refs: Vec<&SegmentedRecording> = all.iter().collect();
        let told = repeatability_floor(&refs);
        for (k, wanted) in [(0, 0.45), (1, 0.15), (2, 0.6)] {
            let (s, others) = told[k].as_ref().expect("others");
            assert_eq!(*others, 2);
            // Beyond the ends the others stay where they were.
            assert!((s.rmse_n - wanted).abs() < 0.02, "{k}: {}", s.rmse_n);
        }
        assert!(told[3].is_none(), "nobody is like it");
    }

    /// The set, the days of its runs and the surfaces (m) of these days.
    fn with_days(speeds: &[f64], days: &[usize], surfaces_m: &[f64]) -> (Vec<SegmentedRecording>, SetFit) {
        let all: Vec<[f64; 2]> = speeds.iter().map(|v| [*v, 0.0]).collect();
        let runs = test_fixtures::simulated_recordings(&[], &all);
        let mut fitted = test_fixtures::fit_from_truth(&[], &runs.iter().collect::<Vec<_>>());
        fitted.fit.model.day_of = days.to_vec();
        fitted.fit.model.days =
            surfaces_m.iter().map(|x| DayParameters { surface_m: *x, ..DayParameters::default() }).collect();
        (runs, fitted)
    }

    #[test]
    fn a_run_left_out_is_predicted_on_its_day_where_another_one_was_made_on_it() {
        let (runs, fitted) = with_days(&[0.008, 0.016, 0.008], &[1, 0, 1], &[4e-4, -2e-4]);
        let runs: Vec<&SegmentedRecording> = runs.iter().collect();
        let told = leave_one_out(&fitted, &runs);
        for (r, day) in [(0, Some(1)), (1, None), (2, Some(1))] {
            let others = population_without(&fitted, &runs, &[r], &[5]).expect("a fit");
            assert_eq!((others.recordings, others.model.days.len()), (2, 2));
            let wanted = predict_force(&others, runs[r], day, DRAWS);
            assert_eq!(told[r].model_force_n, wanted.mean_n, "{r}");
            assert_eq!(told[r].model_score, score_prediction(runs[r], &wanted), "{r}");
            // Beside it stands what the other run of its speed leaves, where there is one.
            let other = (day.is_some()).then(|| {
                let o = runs[2 - r];
                (o, predict_force(&others, o, day, DRAWS).mean_n)
            });
            let both = estimate_discrepancy(runs[r], &wanted, &Vec::from_iter(other)).apply(&wanted);
            assert_eq!(told[r].prediction.mean_n, both.mean_n, "{r}");
            assert_eq!(told[r].score, score_prediction(runs[r], &both), "{r}");
            assert!(told[r].population.is_some());
        }
        assert_eq!(
            leave_one_out_scores(&fitted, &runs),
            told.into_iter().map(|o| o.model_score).collect::<Vec<_>>()
        );
    }

    #[test]
    fn a_whole_speed_is_left_out_where_there_is_another_one() {
        let (runs, fitted) = with_days(&[0.008, 0.016, 0.008], &[], &[]);
        let runs: Vec<&SegmentedRecording> = runs.iter().collect();
        let told = leave_speed_out(&fitted, &runs);
        for (r, group) in [(0, vec![0, 2]), (1, vec![1]), (2, vec![0, 2])] {
            let fit = refit_without(&fitted, &group, &[10, 6, 6, 6]).expect("a fit");
            let others = Population::from_fit(&fit, &training_recordings(&runs, &group))
                .with_parameter_uncertainty(&fit);
            assert_eq!(others.recordings, 3 - group.len());
            assert_eq!(
                told[r],
                score_prediction(runs[r], &predict_force(&others, runs[r], None, DRAWS)),
                "{r}"
            );
        }
        let one = [runs[0], runs[2]];
        assert!(leave_speed_out(&fitted, &one).is_empty());
    }
}
