//! Promise: recordings that cannot belong to the scenario are refused with a message that states the fault and the
//! remedy; gaps in a recording are tolerated.

use stylet_diagnose::{DiagnoseError, Diagnosis, NamedRecording, Options, Verdict, diagnose};
use stylet_examine::{Hide, Plan};
use stylet_record::Recording;
use stylet_scenario::Scenario;

/// A simulated case in which nothing is hidden: the assumed scenario and four recordings.
fn case() -> (Scenario, Vec<Recording>) {
    let plan = Plan { hide: vec![Hide::Clean], cases: 1, seed: 3, ..Plan::default() };
    let question = stylet_examine::make_case(&plan.cases()[0]).expect("a case").question;
    let assumed = Scenario::parse(&question.name, question.assumed_ron.as_deref().expect("a scenario"))
        .expect("a scenario");
    (assumed, question.recordings.into_iter().map(|named| named.recording).collect())
}

fn with(change: impl Fn(&mut Recording)) -> Result<Diagnosis, DiagnoseError> {
    let (assumed, simulated) = case();
    let mut recording = simulated[2].clone();
    change(&mut recording);
    let recordings = [NamedRecording { name: "a.csv".to_owned(), recording, notes: Vec::new() }];
    diagnose(&assumed, &recordings, &Options::default(), |_| {}).map(|e| e.diagnosis)
}

fn message(change: impl Fn(&mut Recording)) -> String {
    with(change).err().map(|e| e.to_string()).unwrap_or_default()
}

#[test]
fn needle_that_never_reaches_the_tissue_is_refused() {
    let text = message(|r| r.position_m.iter_mut().for_each(|z| *z -= 0.2));
    assert!(text.contains("a.csv") && text.contains("never reaches the tissue"), "{text}");
}

#[test]
fn positions_in_millimetres_are_recognised() {
    let text = message(|r| r.position_m.iter_mut().for_each(|z| *z *= 1e3));
    assert!(text.contains("millimetres") && text.contains("0.001"), "{text}");
}

#[test]
fn forces_in_millinewtons_and_of_the_wrong_sign_are_recognised() {
    let text = message(|r| r.force_n.iter_mut().for_each(|f| *f *= 1e3));
    assert!(text.contains("millinewtons") && text.contains("0.001"), "{text}");
    let text = message(|r| r.force_n.iter_mut().for_each(|f| *f *= -1.0));
    assert!(text.contains("runs the other way") && text.contains("-1"), "{text}");
}

#[test]
fn positions_of_the_wrong_sign_are_recognised() {
    let text = message(|r| r.position_m.iter_mut().for_each(|z| *z = -*z - 0.02));
    assert!(text.contains("runs the other way"), "{text}");
}

#[test]
fn one_sample_or_none_that_is_a_number_is_too_little() {
    let text = message(|r| {
        for c in [&mut r.time_s, &mut r.position_m, &mut r.velocity_mps, &mut r.force_n] {
            c.truncate(1);
        }
    });
    assert!(text.contains("1 usable sample"), "{text}");
    let text = message(|r| r.force_n.iter_mut().for_each(|f| *f = f64::NAN));
    assert!(text.contains("0 usable sample"), "{text}");
    let none = diagnose(&case().0, &[], &Options::default(), |_| {});
    assert!(matches!(none.err(), Some(DiagnoseError::NoRecording)));
}

#[test]
fn gap_in_a_recording_is_tolerated() {
    let found = with(|r| {
        for i in 3000..3100 {
            r.force_n[i] = f64::NAN;
        }
        for c in [&mut r.time_s, &mut r.position_m, &mut r.velocity_mps, &mut r.force_n] {
            c.drain(4500..4620);
        }
    })
    .expect("a diagnosis");
    assert_eq!(found.verdict, Verdict::None, "{:?}", found.causes);
    assert!(
        found.data_quality.iter().any(|q| q.note.message.contains("not finite")),
        "{:?}",
        found.data_quality
    );
}

#[test]
fn recordings_at_different_rates_are_fitted_together() {
    let (assumed, simulated) = case();
    let one = simulated[0].clone();
    let mut half = simulated[2].clone();
    for c in [&mut half.time_s, &mut half.position_m, &mut half.velocity_mps, &mut half.force_n] {
        let mut keep = false;
        c.retain(|_| {
            keep = !keep;
            keep
        });
    }
    let recordings: Vec<NamedRecording> = [("a.csv", one), ("b.csv", half)]
        .into_iter()
        .map(|(name, recording)| NamedRecording { name: name.to_owned(), recording, notes: Vec::new() })
        .collect();
    let found = diagnose(&assumed, &recordings, &Options::default(), |_| {}).expect("a diagnosis").diagnosis;
    assert_eq!(found.verdict, Verdict::None, "{:?}", found.causes);
}

#[test]
fn result_does_not_depend_on_the_number_of_threads() {
    let (assumed, simulated) = case();
    let recordings =
        [NamedRecording { name: "a.csv".to_owned(), recording: simulated[2].clone(), notes: Vec::new() }];
    let json = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        let found = pool
            .install(|| diagnose(&assumed, &recordings, &Options::default(), |_| {}).map(|e| e.diagnosis));
        serde_json::to_string(&found.expect("a diagnosis")).expect("JSON")
    };
    assert_eq!(json(1), json(3));
}
