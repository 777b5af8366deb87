//! Promise: from repeats of an insertion whose law is known, the study of a set finds that law's effects and the scatter between the
//! runs, and predicts runs that took no part as well as their fellows do; where the base law is the truth it names nothing.

mod drawn;
mod recorded;

use drawn::{Drawn, drawn, plain};
use stylet_diagnose::Verdict;
use stylet_diagnose::repeated_insertions::SegmentedRecording;
use stylet_diagnose::repeated_insertions::diagnose_set::{SetDiagnosis, diagnose_set};
use stylet_diagnose::repeated_insertions::instrument_faults::ReferenceRecordings;

fn look(runs: &[SegmentedRecording]) -> SetDiagnosis {
    let refs: Vec<&SegmentedRecording> = runs.iter().collect();
    diagnose_set("known", &drawn::believed(), &refs, &ReferenceRecordings::default(), |_| {})
        .expect("a study")
}

#[test]
#[ignore = "a minute"]
fn the_effects_of_a_known_law_are_found_with_the_scatter_between_runs() {
    let runs = drawn(&Drawn { seed: 7, shift_m: 0.0 });
    let s = look(&runs);
    let d = &s.diagnosis;
    let named: Vec<&str> = d.causes.iter().map(|c| c.effect.as_str()).collect();
    println!("{named:?} {:?}", s.report.mean);
    assert_eq!(d.verdict, Verdict::Named);
    for effect in ["shaft_slip", "release_depth"] {
        assert!(named.contains(&effect), "{effect}: {named:?}");
    }
    assert!(s.report.starts.0 >= 8, "{:?}", s.report.starts);
    // A run that took no part is predicted as well as by its fellows, or better.
    let m = &s.report.mean;
    assert!(m.with_discrepancy_n <= 1.1 * m.floor_n.expect("four of each speed"), "{m:?}");
    assert!(m.base_n > 1.5 * m.with_discrepancy_n, "{m:?}");
    assert!((0.7..=0.99).contains(&m.coverage), "{m:?}");
    // What was drawn is told apart from what is shared: 0.1 mm, 3 %.
    let p = &s.report.variability;
    assert!((3e-5..3e-4).contains(&p.surface_m), "{p:?}");
    assert!((0.01..0.09).contains(&p.friction), "{p:?}");
}

#[test]
fn where_the_base_law_is_the_truth_nothing_is_named() {
    let runs = plain(11);
    let s = look(&runs);
    let named: Vec<&str> = s.diagnosis.causes.iter().map(|c| c.effect.as_str()).collect();
    println!("{named:?} {:?}", s.report.mean);
    recorded(&s);
    assert_eq!(s.diagnosis.verdict, Verdict::None, "{named:?}");
    let m = &s.report.mean;
    assert!(m.with_discrepancy_n <= 1.1 * m.floor_n.expect("four of each speed"), "{m:?}");
}

/// All that was said and fitted, compared with `recorded_answers.txt` (see the test of that name).
fn recorded(s: &SetDiagnosis) {
    let mut told = recorded::AnswerLines::default();
    told.value("diagnosis", &serde_json::to_value(&s.diagnosis).expect("JSON"));
    told.value("repeats", &serde_json::to_value(&s.report).expect("JSON"));
    told.value("extended", &serde_json::to_value(&s.mean_scenario).expect("JSON"));
    for (name, law) in [
        ("base", Some(&s.candidates.base)),
        ("library", s.candidates.library.as_ref()),
        ("slip", s.candidates.slip.as_ref()),
    ] {
        let Some(law) = law else { continue };
        told.numbers(&format!("{name}.left out"), &law.errors_n);
        let model = &law.set_fit.fit.model;
        for (k, e) in model.effects.iter().enumerate() {
            told.numbers(&format!("{name}.{k}.{}", e.info.id), &e.values);
        }
        let layer = &model.tissue.layers[0];
        told.numbers(
            &format!("{name}.numbers"),
            &[
                model.tissue.surface_m,
                layer.stiffness_n_per_m,
                layer.friction_ns_per_m2,
                layer.puncture_n.unwrap_or(0.0),
            ],
        );
        told.numbers(&format!("{name}.instants"), &model.rupture_times_s.concat());
        let s = &model.scatter;
        told.numbers(
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
            told.column(&format!("out.{k}.{n}"), x);
        }
        told.numbers(&format!("out.{k}.parts"), &out.score.phase_squares.map(|p| p.0));
    }
    told.compare("recorded_answers.txt", "a set of repeats");
}
