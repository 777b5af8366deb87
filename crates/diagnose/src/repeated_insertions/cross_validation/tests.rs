use super::{
    HeldOutPrediction, Population, leave_one_out, leave_one_out_scores, leave_speed_out, population_without,
    refit_without, repeatability_floor, score_prediction, training_recordings,
};
use crate::repeated_insertions::SegmentedRecording;
use crate::repeated_insertions::empirical_discrepancy::estimate_discrepancy;
use crate::repeated_insertions::multistart_fit::SetFit;
use crate::repeated_insertions::population_prediction::{DRAWS, PredictedForce, predict_force};
use crate::test_fixtures;
use stylet_identify::model::{DayParameters, NO_RUPTURE};
use stylet_record::Recording;

/// Advance by 20 mm in 5 s, hold of 2 s, retraction; the force is the position times 100 plus `more_n`.
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
fn a_prediction_is_scored_over_all_samples_and_by_phase() {
    let mut r = run("a", 1.0, 0.0);
    r.ruptures_s = vec![3.0, NO_RUPTURE];
    let n = r.recording.len();
    let t = r.recording.time_s.clone();
    let mean: Vec<f64> = (0..n).map(|k| r.recording.force_n[k] - 0.1 - 0.001 * k as f64).collect();
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
    let half =
        score_prediction(&r, &PredictedForce { mean_n: mean[..300].to_vec(), ..PredictedForce::default() });
    let some: f64 = (0..300).map(square).sum();
    assert!((half.rmse_n - (some / 600.0).sqrt()).abs() < 1e-12 && half.coverage == 0.0);
    assert!(score_prediction(&r, &PredictedForce::default()).rmse_n.is_nan());
}

#[test]
fn predictions_are_clamped_at_the_saturation_limit() {
    let mut r = run("a", 1.0, 0.0);
    r.recording.force_n.iter_mut().for_each(|f| *f = f.clamp(-1.5, 1.5));
    r.limit_n = Some(1.5);
    let mean: Vec<f64> = run("a", 1.0, 0.0).recording.force_n;
    let (low, high) = (mean.iter().map(|f| f - 0.01).collect(), mean.iter().map(|f| f + 0.01).collect());
    let p = PredictedForce { mean_n: mean, low_n: low, high_n: high };
    let s = score_prediction(&r, &p);
    assert!(s.rmse_n < 1e-12 && s.coverage == 1.0, "{s:?}");
    // Corrected by a bias larger than itself.
    r.limit_n = Some(-1.5);
    assert_eq!(score_prediction(&r, &p), s);
    r.limit_n = None;
    assert!(score_prediction(&r, &p).rmse_n > 0.1 && score_prediction(&r, &p).coverage < 0.9);
}

#[test]
fn the_floor_is_the_mean_of_the_other_recordings_of_a_group() {
    let mut all = [run("a", 1.0, 0.3), run("b", 1.5, 0.5), run("c", 0.5, 1.0), run("d", 1.0, 9.0)];
    all[3].speed_mps *= 3.0;
    let refs: Vec<&SegmentedRecording> = all.iter().collect();
    let result = repeatability_floor(&refs);
    for (k, wanted) in [(0, 0.45), (1, 0.15), (2, 0.6)] {
        let (s, others) = result[k].as_ref().expect("others");
        assert_eq!(*others, 2);
        assert!((s.rmse_n - wanted).abs() < 0.02, "{k}: {}", s.rmse_n);
    }
    assert!(result[3].is_none(), "nobody is like it");
}

fn with_days(speeds: &[f64], days: &[usize], surfaces_m: &[f64]) -> (Vec<SegmentedRecording>, SetFit) {
    let all: Vec<[f64; 2]> = speeds.iter().map(|v| [*v, 0.0]).collect();
    let recordings = test_fixtures::simulated_recordings(&[], &all);
    let mut fitted = test_fixtures::fit_from_truth(&[], &recordings.iter().collect::<Vec<_>>());
    fitted.fit.model.day_of = days.to_vec();
    fitted.fit.model.days =
        surfaces_m.iter().map(|x| DayParameters { surface_m: *x, ..DayParameters::default() }).collect();
    (recordings, fitted)
}

#[test]
fn a_held_out_recording_uses_the_day_of_another_recording() {
    let (recordings, fitted) = with_days(&[0.008, 0.016, 0.008], &[1, 0, 1], &[4e-4, -2e-4]);
    let recordings: Vec<&SegmentedRecording> = recordings.iter().collect();
    let result = leave_one_out(&fitted, &recordings);
    for (r, day) in [(0, Some(1)), (1, None), (2, Some(1))] {
        let others = population_without(&fitted, &recordings, &[r], &[5]).expect("a fit");
        assert_eq!((others.recordings, others.model.days.len()), (2, 2));
        let wanted = predict_force(&others, recordings[r], day, DRAWS);
        assert_eq!(result[r].model_force_n, wanted.mean_n, "{r}");
        assert_eq!(result[r].model_score, score_prediction(recordings[r], &wanted), "{r}");
        let other = (day.is_some()).then(|| {
            let o = recordings[2 - r];
            (o, predict_force(&others, o, day, DRAWS).mean_n)
        });
        let both = estimate_discrepancy(recordings[r], &wanted, &Vec::from_iter(other)).apply(&wanted);
        assert_eq!(result[r].prediction.mean_n, both.mean_n, "{r}");
        assert_eq!(result[r].score, score_prediction(recordings[r], &both), "{r}");
        assert!(result[r].population.is_some());
    }
    assert_eq!(
        leave_one_out_scores(&fitted, &recordings),
        result.into_iter().map(|o| o.model_score).collect::<Vec<_>>()
    );
}

#[test]
fn a_whole_speed_is_held_out_if_there_is_another() {
    let (recordings, fitted) = with_days(&[0.008, 0.016, 0.008], &[], &[]);
    let recordings: Vec<&SegmentedRecording> = recordings.iter().collect();
    let result = leave_speed_out(&fitted, &recordings);
    for (r, group) in [(0, vec![0, 2]), (1, vec![1]), (2, vec![0, 2])] {
        let fit = refit_without(&fitted, &group, &[10, 6, 6, 6]).expect("a fit");
        let others = Population::from_fit(&fit, &training_recordings(&recordings, &group))
            .with_parameter_uncertainty(&fit);
        assert_eq!(others.recordings, 3 - group.len());
        assert_eq!(
            result[r],
            score_prediction(recordings[r], &predict_force(&others, recordings[r], None, DRAWS)),
            "{r}"
        );
    }
    let one = [recordings[0], recordings[2]];
    assert!(leave_speed_out(&fitted, &one).is_empty());
}

/// A prediction that could not be made is not one without error.
#[test]
fn without_a_prediction_there_is_no_score() {
    let scores = [
        score_prediction(&run("a", 1.0, 0.0), &PredictedForce::default()),
        HeldOutPrediction::default().score,
        HeldOutPrediction::default().model_score,
    ];
    for s in scores {
        assert!(s.rmse_n.is_nan() && s.coverage.is_nan(), "{s:?}");
    }
}
