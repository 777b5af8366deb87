//! Promise: from recordings simulated with a known model with random effects, the fit recovers that model
//! and a surface shift between days, predicts held-out recordings at the repeatability floor, and is
//! bitwise independent of the number of threads.

use crate::answer_file;
use crate::simulated_recordings;

use rand::{SeedableRng, rngs::ChaCha8Rng};
use simulated_recordings::{EXPONENT, SHIFT_M, SimulatedSet, assumed_tissue, stick_slip_set};
use stylet_diagnose::repeated_insertions::cross_validation::{leave_one_out_scores, repeatability_floor};
use stylet_diagnose::repeated_insertions::multistart_fit::{SetFit, draw_starts, multistart_fit};
use stylet_diagnose::repeated_insertions::{SegmentedRecording, segmented_recording};
use stylet_record::sensor_artefacts::SensorArtefacts;

fn fit(recordings: &[SegmentedRecording], threads: usize) -> SetFit {
    let recordings: Vec<&SegmentedRecording> = recordings.iter().collect();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    pool.install(|| {
        multistart_fit(
            &draw_starts(&assumed_tissue(), &recordings, 4, &mut rng),
            &recordings,
            &SensorArtefacts::default(),
        )
    })
    .into_iter()
    .next()
    .expect("a fit")
}

#[test]
fn a_simulated_set_recovers_its_model_and_the_surface_shift() {
    let all = stick_slip_set(&SimulatedSet { seed: 7, ..SimulatedSet::default() });
    let recordings: Vec<&SegmentedRecording> = all.iter().collect();
    assert_eq!(
        segmented_recording::group_by_speed_and_stroke(&recordings),
        vec![vec![0, 1, 2, 3], vec![4, 5, 6, 7]]
    );
    assert!(recordings.iter().all(|r| r.ruptures_s[0].is_finite()), "every recording shows its rupture");
    let found = fit(&all, 2);
    assert!(found.rms_n() < 0.05, "{} N residual", found.rms_n());
    let model = &found.fit.model;
    let slip = &model.effects[0];
    let of = |path: &str| {
        let k = slip.info.parameters.iter().position(|p| p.path == path).expect("a parameter");
        slip.values[k]
    };
    assert!((of("push_n") / 1.8 - 1.0).abs() < 0.1, "{}", of("push_n"));
    assert!((of("pull_n") / 1.1 - 1.0).abs() < 0.1, "{}", of("pull_n"));
    assert!((of("exponent") / EXPONENT - 1.0).abs() < 0.35, "{}", of("exponent"));
    let shift = model.days[1].surface_m - model.days[0].surface_m;
    assert!((shift - SHIFT_M).abs() < 3e-4, "the surface is shifted by {shift} m");
    let mut answers = answer_file::AnswerLines::default();
    for (k, e) in model.effects.iter().enumerate() {
        answers.numbers(&format!("{k}.{}", e.info.id), &e.values);
    }
    answers.numbers("surfaces", &model.days.iter().map(|d| d.surface_m).collect::<Vec<_>>());
    answers.numbers("frictions", &model.days.iter().map(|d| d.ln_friction).collect::<Vec<_>>());
    // Leave-one-out error at the repeatability floor.
    let scores = leave_one_out_scores(&found, &recordings);
    let floors: Vec<f64> =
        repeatability_floor(&recordings).into_iter().flatten().map(|f| f.0.rmse_n).collect();
    for (k, s) in scores.iter().enumerate() {
        answers.numbers(&format!("run {k}"), &[s.rmse_n, s.coverage, floors[k]]);
    }
    answers.compare("recorded_answers.txt", "repeated insertions, stick-slip");
    let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len() as f64;
    let errors: Vec<f64> = scores.iter().map(|s| s.rmse_n).collect();
    assert!(floors.len() == 8 && mean(&errors) < 1.1 * mean(&floors), "{errors:?} {floors:?}");
}

#[test]
fn the_fit_is_independent_of_the_number_of_threads() {
    let some: Vec<SegmentedRecording> = stick_slip_set(&SimulatedSet { seed: 8, ..SimulatedSet::default() })
        .into_iter()
        .skip(1)
        .step_by(4)
        .collect();
    let (one, many) = (fit(&some, 1), fit(&some, 3));
    assert_eq!(one.fit.residuals.residual_n, many.fit.residuals.residual_n);
    assert_eq!(one.starts, many.starts);
}
