//! Promise: a set of repeated insertions is explained by one law with numbers of each run's and each day's own. From insertions drawn
//! with a known law the fit finds that law, a surface that is shifted on one day, and predicts an insertion that took no part as well as
//! the insertions scatter; whatever the number of threads, with the same bits.

mod drawn;
mod recorded;

use drawn::{Drawn, EXPONENT, SHIFT_M, believed};
use rand::{SeedableRng, rngs::ChaCha8Rng};
use stylet_diagnose::repeated_insertions::cross_validation::{leave_one_out_scores, repeatability_floor};
use stylet_diagnose::repeated_insertions::multistart_fit::{SetFit, draw_starts, multistart_fit};
use stylet_diagnose::repeated_insertions::{SegmentedRecording, start_values};
use stylet_record::sensor_artefacts::SensorArtefacts;

fn drawn(seed: u64) -> Vec<SegmentedRecording> {
    drawn::drawn(&Drawn { seed, ..Drawn::default() })
}

fn fit(runs: &[SegmentedRecording], threads: usize) -> SetFit {
    let runs: Vec<&SegmentedRecording> = runs.iter().collect();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    pool.install(|| {
        multistart_fit(&draw_starts(&believed(), &runs, 4, &mut rng), &runs, &SensorArtefacts::default())
    })
    .into_iter()
    .next()
    .expect("a fit")
}

#[test]
fn a_drawn_set_gives_its_law_back_and_the_surface_that_is_shifted_on_one_day() {
    let all = drawn(7);
    let runs: Vec<&SegmentedRecording> = all.iter().collect();
    assert_eq!(start_values::group_by_speed_and_stroke(&runs), vec![vec![0, 1, 2, 3], vec![4, 5, 6, 7]]);
    assert!(runs.iter().all(|r| r.ruptures_s[0].is_finite()), "every run shows its rupture");
    let found = fit(&all, 2);
    assert!(found.rms_n() < 0.05, "{} N left", found.rms_n());
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
    let mut told = recorded::AnswerLines::default();
    for (k, e) in model.effects.iter().enumerate() {
        told.numbers(&format!("{k}.{}", e.info.id), &e.values);
    }
    told.numbers("surfaces", &model.days.iter().map(|d| d.surface_m).collect::<Vec<_>>());
    told.numbers("frictions", &model.days.iter().map(|d| d.ln_friction).collect::<Vec<_>>());
    told.numbers(
        "own",
        &model
            .per_recording
            .iter()
            .flat_map(|o| [o.surface_m, o.ln_friction, o.varying[0]])
            .collect::<Vec<_>>(),
    );
    told.numbers("instants", &model.rupture_times_s.concat());
    told.numbers("left", &[found.rms_n(), found.starts.0 as f64, found.starts.1 as f64]);
    // Without the run itself: no worse than another insertion as the predictor.
    let scores = leave_one_out_scores(&found, &runs);
    let floors: Vec<f64> = repeatability_floor(&runs).into_iter().flatten().map(|f| f.0.rmse_n).collect();
    for (k, s) in scores.iter().enumerate() {
        told.numbers(&format!("run {k}"), &[s.rmse_n, s.coverage, floors[k]]);
    }
    told.compare("recorded_answers.txt", "a law that slips");
    let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len() as f64;
    let errors: Vec<f64> = scores.iter().map(|s| s.rmse_n).collect();
    assert!(floors.len() == 8 && mean(&errors) < 1.1 * mean(&floors), "{errors:?} {floors:?}");
}

#[test]
fn the_fit_of_a_set_does_not_depend_on_the_number_of_threads() {
    let some: Vec<SegmentedRecording> = drawn(8).into_iter().skip(1).step_by(4).collect();
    let (one, many) = (fit(&some, 1), fit(&some, 3));
    assert_eq!(one.fit.residuals.residual_n, many.fit.residuals.residual_n);
    assert_eq!(one.starts, many.starts);
}
