//! Promise: from repeated recordings with a known model, the diagnosis finds its effects and the scatter
//! between recordings, and predicts held-out recordings at the repeatability floor; where the base law is
//! true it reports no cause.

mod answer_file;
mod simulated_recordings;

use simulated_recordings::{SimulatedSet, assumed_tissue, base_law_set, stick_slip_set};
use stylet_diagnose::Verdict;
use stylet_diagnose::repeated_insertions::SegmentedRecording;
use stylet_diagnose::repeated_insertions::diagnose_set::{SetDiagnosis, diagnose_set};
use stylet_diagnose::repeated_insertions::instrument_faults::ReferenceRecordings;

fn diagnose(recordings: &[SegmentedRecording]) -> SetDiagnosis {
    let refs: Vec<&SegmentedRecording> = recordings.iter().collect();
    diagnose_set("known", &assumed_tissue(), &refs, &ReferenceRecordings::default(), |_| {})
        .expect("a diagnosis")
}

#[test]
#[ignore = "a minute"]
fn the_effects_of_a_known_model_and_the_scatter_are_found() {
    let recordings = stick_slip_set(&SimulatedSet { seed: 7, shift_m: 0.0 });
    let s = diagnose(&recordings);
    let d = &s.diagnosis;
    let named: Vec<&str> = d.causes.iter().map(|c| c.effect.as_str()).collect();
    println!("{named:?} {:?}", s.report.mean);
    assert_eq!(d.verdict, Verdict::Named);
    for effect in ["shaft_slip", "release_depth"] {
        assert!(named.contains(&effect), "{effect}: {named:?}");
    }
    assert!(s.report.starts.0 >= 8, "{:?}", s.report.starts);
    let m = &s.report.mean;
    assert!(m.with_discrepancy_n <= 1.1 * m.floor_n.expect("four of each speed"), "{m:?}");
    assert!(m.base_n > 1.5 * m.with_discrepancy_n, "{m:?}");
    assert!((0.7..=0.99).contains(&m.coverage), "{m:?}");
    // True scatter: 0.1 mm and 3 %.
    let p = &s.report.variability;
    assert!((3e-5..3e-4).contains(&p.surface_m), "{p:?}");
    assert!((0.01..0.09).contains(&p.friction), "{p:?}");
}

#[test]
fn a_true_base_law_has_no_cause() {
    let recordings = base_law_set(11);
    let s = diagnose(&recordings);
    let named: Vec<&str> = s.diagnosis.causes.iter().map(|c| c.effect.as_str()).collect();
    println!("{named:?} {:?}", s.report.mean);
    compare_answers(&s);
    assert_eq!(s.diagnosis.verdict, Verdict::None, "{named:?}");
    let m = &s.report.mean;
    assert!(m.with_discrepancy_n <= 1.1 * m.floor_n.expect("four of each speed"), "{m:?}");
}

/// Compares all results with `recorded_answers.txt`.
fn compare_answers(s: &SetDiagnosis) {
    let mut answers = answer_file::AnswerLines::default();
    answers.value("diagnosis", &serde_json::to_value(&s.diagnosis).expect("JSON"));
    answers.value("repeats", &serde_json::to_value(&s.report).expect("JSON"));
    answers.value("extended", &serde_json::to_value(&s.mean_scenario).expect("JSON"));
    for (name, candidate) in [
        ("base", Some(&s.candidates.base)),
        ("library", s.candidates.library.as_ref()),
        ("slip", s.candidates.slip.as_ref()),
    ] {
        let Some(candidate) = candidate else { continue };
        answers.numbers(&format!("{name}.left out"), &candidate.errors_n);
        let model = &candidate.set_fit.fit.model;
        for (k, e) in model.effects.iter().enumerate() {
            answers.numbers(&format!("{name}.{k}.{}", e.info.id), &e.values);
        }
        let layer = &model.tissue.layers[0];
        answers.numbers(
            &format!("{name}.numbers"),
            &[
                model.tissue.surface_m,
                layer.stiffness_n_per_m,
                layer.friction_ns_per_m2,
                layer.puncture_n.unwrap_or(0.0),
            ],
        );
        answers.numbers(&format!("{name}.instants"), &model.rupture_times_s.concat());
        let s = &model.scatter;
        answers.numbers(
            &format!("{name}.scatter"),
            &[
                s.rupture_force,
                s.rupture_depth_m,
                s.surface_m,
                s.ln_friction,
                s.day_surface_m,
                s.day_ln_friction,
            ],
        );
    }
    for (k, out) in s.held_out.iter().enumerate() {
        let p = &out.prediction;
        for (n, x) in [("mean", &p.mean_n), ("low", &p.low_n), ("high", &p.high_n)] {
            answers.column(&format!("out.{k}.{n}"), x);
        }
        answers.numbers(&format!("out.{k}.parts"), &out.score.phase_squares.map(|p| p.0));
    }
    answers.compare("recorded_answers.txt", "repeated insertions, base law");
}
