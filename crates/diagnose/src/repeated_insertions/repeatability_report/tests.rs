use super::{
    ReportInputs, SpeedReport, floor_correction, mean_report, phase_reports, recording_reports, speed_report,
    variability,
};
use crate::repeated_insertions::cross_validation::{HeldOutPrediction, PredictionScore};
use crate::repeated_insertions::data_quality_notes::data_quality;
use crate::repeated_insertions::scored_model::{ModelFamily, ScoredModel};
use crate::repeated_insertions::segmented_recording::SegmentedRecording;
use crate::test_fixtures::{assumed_layers, simulated_recordings, unmeasured_candidate};
use stylet_identify::model::{DayParameters, NO_RUPTURE, RecordingParameters};
use stylet_identify::rupture_likelihood::RuptureEvent;
use stylet_record::{QualityKind, QualityNote};

fn score(rmse_n: f64, covered: f64) -> PredictionScore {
    PredictionScore { rmse_n, coverage: covered, ..PredictionScore::default() }
}

fn out(rmse_n: f64, covered: f64) -> HeldOutPrediction {
    let law = score(rmse_n, covered);
    HeldOutPrediction { score: law.clone(), model_score: law, ..HeldOutPrediction::default() }
}

/// Three recordings, two of them at one speed.
struct Fixture {
    recordings: Vec<SegmentedRecording>,
    law: ScoredModel,
    out: Vec<HeldOutPrediction>,
    base_out: Vec<HeldOutPrediction>,
    speed_out: Vec<PredictionScore>,
    base_speed_out: Vec<PredictionScore>,
    floors: Vec<Option<(PredictionScore, usize)>>,
}

fn fixture() -> Fixture {
    let recordings = simulated_recordings(&[], &[[0.008, 0.0], [0.004, 0.0], [0.0082, 0.0]]);
    let mut law = unmeasured_candidate(ModelFamily::Library, &[], &[0.1; 3], 0.0);
    let model = &mut law.set_fit.fit.model;
    let layers = assumed_layers(&[[0.02, 100.0, 1000.0]; 2]);
    (model.tissue, model.assumed) = (layers.tissue.clone(), layers);
    model.per_recording = [(3e-4, 0.05), (-2e-4, -0.1), (0.0, 0.2)]
        .map(|(surface_m, friction)| RecordingParameters {
            surface_m,
            ln_friction: friction,
            ..RecordingParameters::default()
        })
        .to_vec();
    model.days = vec![
        DayParameters { surface_m: 1e-3, ln_friction: 0.3 },
        DayParameters { surface_m: -5e-3, ln_friction: 0.02 },
    ];
    model.day_of = vec![1, 0, 1];
    model.rupture_times_s = vec![vec![2.0, NO_RUPTURE], vec![1.0, 3.0], vec![NO_RUPTURE, NO_RUPTURE]];
    Fixture {
        recordings,
        law,
        out: vec![out(0.1, 0.9), out(0.2, 0.8), out(0.4, 0.6)],
        base_out: vec![out(0.5, 0.0), out(0.7, 0.0), out(1.1, 0.0)],
        speed_out: vec![score(1.0, 0.5), score(2.0, 0.3), score(4.0, 0.1)],
        base_speed_out: vec![score(10.0, 0.0), score(20.0, 0.0), score(40.0, 0.0)],
        floors: vec![Some((score(0.3, 0.0), 1)), None, Some((score(0.5, 0.0), 3))],
    }
}

fn with<T>(m: &Fixture, section: impl Fn(&ReportInputs) -> T) -> T {
    let recordings: Vec<&SegmentedRecording> = m.recordings.iter().collect();
    section(&ReportInputs {
        recordings: &recordings,
        model: &m.law,
        held_out: &m.out,
        base_held_out: &m.base_out,
        held_out_speeds: Some(&m.speed_out),
        base_held_out_speeds: Some(&m.base_speed_out),
        floors: &m.floors,
    })
}

#[test]
fn a_recording_is_reported_with_its_random_effects_and_ruptures() {
    let mut m = fixture();
    let event = |elastic_n: f64| RuptureEvent { elastic_n, ..RuptureEvent::INITIAL };
    m.law.set_fit.fit.residuals.ruptures = vec![vec![event(1.5), event(9.0)], vec![event(1.1), event(2.2)]];
    let result = with(&m, recording_reports);
    assert_eq!(result.iter().map(|r| r.name.as_str()).collect::<Vec<_>>(), ["run 0", "run 1", "run 2"]);
    for (r, shift_m, friction) in [(0, -4.7e-3, 0.07_f64), (1, 8e-4, 0.2), (2, -5e-3, 0.22)] {
        assert!((result[r].surface_shift_m - shift_m).abs() < 1e-15, "{r}: {}", result[r].surface_shift_m);
        assert!((result[r].friction - friction.exp()).abs() < 1e-12, "{r}: {}", result[r].friction);
        assert_eq!(
            (result[r].speed_mps, &result[r].releases_m),
            (m.recordings[r].speed_mps, &m.recordings[r].releases_m)
        );
    }
    assert_eq!(
        result.iter().map(|r| r.puncture_n.clone()).collect::<Vec<_>>(),
        [vec![Some(1.5), None], vec![Some(1.1), Some(2.2)], vec![None, None]]
    );
    let errors: Vec<_> =
        result.iter().map(|r| (r.base_n, r.with_discrepancy_n, r.coverage, r.floor_n)).collect();
    assert_eq!(errors, [(0.5, 0.1, 0.9, Some(0.3)), (0.7, 0.2, 0.8, None), (1.1, 0.4, 0.6, Some(0.5))]);
}

#[test]
fn speeds_average_recordings_and_the_mean_averages_speeds() {
    let m = fixture();
    let fast = with(&m, |s| speed_report(0.0081, &[0, 2], s));
    let near = |a: Option<f64>, b: f64| assert!((a.expect("a number") - b).abs() < 1e-12, "{a:?} for {b}");
    assert_eq!((fast.speed_mps, fast.recordings), (0.0081, 2));
    near(fast.floor_n, 0.4);
    near(fast.floor_unbiased_n, 0.5 * (0.3 / 2.0_f64.sqrt() + 0.5 / (4.0_f64 / 3.0).sqrt()));
    near(Some(floor_correction(4)), 0.8_f64.sqrt());
    near(Some(fast.base_n), 0.8);
    near(Some(fast.with_discrepancy_n), 0.25);
    near(Some(fast.coverage), 0.75);
    near(fast.held_out_speed_n, 2.5);
    near(fast.held_out_speed_coverage, 0.3);
    near(fast.base_held_out_speed_n, 25.0);
    let slow = with(&m, |s| {
        speed_report(
            0.004,
            &[1],
            &ReportInputs { held_out_speeds: Some(&[]), base_held_out_speeds: None, ..*s },
        )
    });
    assert_eq!((slow.floor_n, slow.floor_unbiased_n), (None, None));
    assert_eq!(
        (slow.held_out_speed_n, slow.held_out_speed_coverage, slow.base_held_out_speed_n),
        (None, None, None)
    );
    let all =
        mean_report(&[fast.clone(), SpeedReport { floor_n: Some(0.8), coverage: 0.25, ..fast.clone() }]);
    near(all.floor_n, 0.6);
    near(Some(all.coverage), 0.5);
    assert_eq!(
        (all.floor_unbiased_n, all.base_n, all.with_discrepancy_n, all.held_out_speed_n),
        (fast.floor_unbiased_n, fast.base_n, fast.with_discrepancy_n, fast.held_out_speed_n)
    );
    assert_eq!(
        (all.held_out_speed_coverage, all.base_held_out_speed_n),
        (fast.held_out_speed_coverage, fast.base_held_out_speed_n)
    );
    let all = mean_report(&[fast, slow]);
    assert_eq!((all.floor_n, all.floor_unbiased_n, all.held_out_speed_n), (None, None, None));
    near(Some(all.base_n), 0.75);
    near(Some(all.with_discrepancy_n), 0.225);
}

#[test]
fn phases_are_pooled_over_recordings() {
    let mut m = fixture();
    m.out[0].model_score.phase_squares = [(16.0, 1.0); 5];
    m.out[0].score.phase_squares = [(8.0, 2.0), (0.0, 0.0), (1.0, 4.0), (0.0, 0.0), (3.0, 1.0)];
    m.out[2].score.phase_squares = [(1.0, 7.0), (0.0, 0.0), (0.0, 0.0), (0.0, 5.0), (0.0, 0.0)];
    m.floors[0] = Some((
        PredictionScore {
            phase_squares: [(2.0, 4.0), (9.0, 9.0), (0.0, 0.0), (4.0, 1.0), (0.0, 0.0)],
            ..PredictionScore::default()
        },
        2,
    ));
    m.floors[2] = Some((
        PredictionScore {
            phase_squares: [(7.0, 5.0), (9.0, 9.0), (0.0, 0.0), (0.0, 0.0), (0.0, 0.0)],
            ..PredictionScore::default()
        },
        2,
    ));
    assert!(with(&m, phase_reports).iter().all(|p| p.model_n == 4.0));
    let result: Vec<(&str, Option<f64>, f64)> =
        with(&m, phase_reports).iter().map(|p| (p.phase, p.floor_n, p.with_discrepancy_n)).collect();
    assert_eq!(
        result,
        [
            ("loading", Some(1.0), 1.0),
            ("cutting", None, 0.5),
            ("hold", Some(2.0), 0.0),
            ("retraction", None, 3.0_f64.sqrt())
        ]
    );
}

#[test]
fn only_free_random_effects_are_reported() {
    let mut m = fixture();
    for (run, (ruptures, releases)) in m.recordings.iter_mut().zip([
        (vec![1.0, 2.0], vec![Some(0.010), None]),
        (vec![1.0, NO_RUPTURE], vec![Some(0.012), None]),
        (vec![NO_RUPTURE, NO_RUPTURE], vec![None, Some(0.02)]),
    ]) {
        (run.ruptures_s, run.releases_m) = (ruptures, releases);
    }
    let scatter = &mut m.law.set_fit.fit.model.scatter;
    (scatter.surface_m, scatter.ln_friction, scatter.rupture_force) = (1e-4, 0.02, 0.07);
    (scatter.day_surface_m, scatter.day_ln_friction) = (3e-4, 0.04);
    let result = with(&m, variability);
    assert_eq!(
        (result.surface_m, result.friction, result.puncture, result.day_surface_m, result.day_friction),
        (0.0, 0.0, 0.07, 0.0, 0.0)
    );
    assert_eq!(result.drops, [2, 1]);
    let (middle, sd) = result.release_positions_m[0].expect("two releases");
    assert!((middle - 0.011).abs() < 1e-15 && (sd - 0.002 / 2.0_f64.sqrt()).abs() < 1e-15, "{sd}");
    assert_eq!(result.release_positions_m[1], Some((0.02, 0.0)));
    m.recordings[2].releases_m[1] = None;
    assert_eq!(with(&m, variability).release_positions_m[1], None);
    let free = &mut m.law.set_fit.fit.model.free;
    (free.recording_surface, free.recording_friction, free.day_surface, free.day_friction) =
        (true, true, true, true);
    let result = with(&m, variability);
    assert_eq!(
        (result.surface_m, result.friction, result.day_surface_m, result.day_friction),
        (1e-4, 0.02, 3e-4, 0.04)
    );
}

#[test]
fn data_quality_lists_speeds_then_recordings() {
    let mut m = fixture();
    m.recordings[1].notes = vec![QualityNote {
        kind: QualityKind::Jitter,
        message: "a remark".to_owned(),
        numbers: Default::default(),
        lines: Vec::new(),
        blocking: false,
    }];
    // A gap of half a second during the advance.
    let r = &m.recordings[2].recording;
    let kept = |x: &[f64]| -> Vec<f64> {
        x.iter().enumerate().filter(|(k, _)| !(26..50).contains(k)).map(|(_, x)| *x).collect()
    };
    let gapped = stylet_record::Recording::new(kept(&r.time_s), kept(&r.position_m), kept(&r.force_n));
    let speed_mps = m.recordings[2].speed_mps;
    m.recordings[2] = SegmentedRecording {
        speed_mps,
        ..SegmentedRecording::new("run 2".to_owned(), gapped.expect("clean columns"), 1)
    };
    let recordings: Vec<&SegmentedRecording> = m.recordings.iter().collect();
    let result = data_quality(&recordings);
    let named: Vec<&str> = result.iter().map(|q| q.recording.as_str()).collect();
    assert_eq!(named[2..], ["run 0", "run 1", "run 1", "run 2"]);
    assert!(named[0] == "all at 4.00 mm/s" && named[1].starts_with("all at 8."), "{named:?}");
    assert_eq!(result[3].note.message, "a remark");
    let slow = &result[0].note.numbers;
    for (name, wanted) in
        [("speed_mps", 0.004), ("sample_hz", 50.0), ("largest_gap_s", 0.02), ("stroke_m", 0.016)]
    {
        assert!((slow[name] - wanted).abs() < 1e-9 + 1e-6 * wanted, "{name}: {}", slow[name]);
    }
    let fast = &result[1].note.numbers;
    assert!((fast["largest_gap_s"] - 0.5).abs() < 1e-9, "{fast:?}");
    let hz = |r: &SegmentedRecording| (r.recording.len() - 1) as f64 / r.recording.duration_s();
    assert!(
        (fast["sample_hz"] - 0.5 * (hz(&m.recordings[0]) + hz(&m.recordings[2]))).abs() < 1e-9,
        "{fast:?}"
    );
    let message = &result[1].note.message;
    assert!(
        message.starts_with("2 recording(s) at 8.") && message.contains("largest gap 500 ms"),
        "{message}"
    );
    assert!(message.ends_with("stroke 16.0 mm"), "{message}");
    let mut moved = m.recordings[1].clone();
    moved.recording.position_m.iter_mut().for_each(|z| *z += 0.002);
    let moved_result = data_quality(&[&moved]);
    assert!((moved_result[0].note.numbers["stroke_m"] - 0.016).abs() < 1e-6, "{moved_result:?}");
    assert!(result[0].note.message.contains("rate 50.0 Hz"), "{}", result[0].note.message);
}
