//! Promise: from repeated recordings with a known model, the diagnosis finds its effects and the scatter
//! between recordings, and predicts held-out recordings at the repeatability floor; where the base law is
//! true it reports no cause.

use crate::answer_file;
use crate::simulated_recordings;

use simulated_recordings::{SimulatedSet, assumed_tissue, base_law_set, base_law_set_in, stick_slip_set};
use stylet_diagnose::Verdict;
use stylet_diagnose::repeated_insertions::SegmentedRecording;
use stylet_diagnose::repeated_insertions::diagnose_set::{SetDiagnosis, diagnose_set};
use stylet_diagnose::repeated_insertions::instrument_faults::ReferenceRecordings;
use stylet_tissue::Tissue;

fn diagnose(recordings: &[SegmentedRecording]) -> SetDiagnosis {
    diagnose_in(&assumed_tissue(), recordings)
}

fn diagnose_in(assumed: &Tissue, recordings: &[SegmentedRecording]) -> SetDiagnosis {
    let refs: Vec<&SegmentedRecording> = recordings.iter().collect();
    diagnose_set("known", assumed, None, &refs, &ReferenceRecordings::default(), &mut |_| {})
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
    let mut s = diagnose(&recordings);
    let named: Vec<&str> = s.diagnosis.causes.iter().map(|c| c.effect.as_str()).collect();
    println!("{named:?} {:?}", s.report.mean);
    compare_answers(&s);
    assert_eq!(s.diagnosis.verdict, Verdict::None, "{named:?}");
    let m = &s.report.mean;
    assert!(m.with_discrepancy_n <= 1.1 * m.floor_n.expect("four of each speed"), "{m:?}");

    // A scenario with these numbers is right; where one is far off, it is named, and no other.
    let mut scenario = s.mean_scenario.clone();
    s.compare_with_scenario(&scenario);
    assert_eq!(s.diagnosis.verdict, Verdict::None, "{:?}", s.diagnosis.findings);
    scenario.tissue.layers[0].friction_ns_per_m2 *= 3.0;
    s.compare_with_scenario(&scenario);
    let messages: Vec<&str> = s.diagnosis.findings.iter().map(|f| f.message.as_str()).collect();
    assert_eq!(s.diagnosis.verdict, Verdict::Parameters, "{messages:?}");
    assert!(
        messages.len() == 1
            && messages[0].starts_with("the assumed friction of layer 1 is 3 times too large"),
        "{messages:?}"
    );
}

#[test]
#[ignore = "half a minute"]
fn a_needle_that_leaves_the_tissue_has_no_cause() {
    let mut assumed = assumed_tissue();
    assumed.layers[0].thickness_m = 9e-3;
    let s = diagnose_in(&assumed, &base_law_set_in(&assumed, 12));
    let named: Vec<&str> = s.diagnosis.causes.iter().map(|c| c.effect.as_str()).collect();
    assert_eq!(s.diagnosis.verdict, Verdict::None, "{named:?} {:?}", s.report.mean);
}

/// Compares verdict, effects, parameters and held-out error with `recorded_answers.txt`.
fn compare_answers(s: &SetDiagnosis) {
    let mut answers = answer_file::AnswerLines::default();
    answers.diagnosis(&s.diagnosis);
    let (mean, spread) = (&s.report.mean, &s.report.variability);
    answers.numbers("held out", &[mean.base_n, mean.model_n, mean.with_discrepancy_n, mean.coverage]);
    answers.numbers("variability", &[spread.surface_m, spread.friction]);
    answers.compare("recorded_answers.txt", "repeated insertions, base law");
}
