use super::*;
use stylet_tissue::{ForceLawState, Layer, Tissue};

const SURFACE_M: f64 = 0.01;

/// Two layers of 20 and 30 mm that begin at 10 mm.
fn scenario() -> Scenario {
    let layer = |d: f64, k: f64| Layer {
        name: String::new(),
        thickness_m: d,
        stiffness_n_per_m: k,
        friction_ns_per_m2: 5000.0,
        puncture_n: None,
    };
    let mut s: Scenario = stylet_scenario::parse(
        "a scenario",
        r#"(name: "a", tissue: (surface_m: 0.0, layers: []), motion: Recorded)"#,
    )
    .expect("a scenario");
    s.tissue = Tissue { surface_m: SURFACE_M, layers: vec![layer(0.02, 100.0), layer(0.03, 150.0)] };
    s
}

/// From one position to another and a quarter of the way back, with the force of the model.
fn moved(from_m: f64, to_m: f64) -> NamedRecording {
    let t: Vec<f64> = (0..600).map(|k| 0.01 * f64::from(k)).collect();
    let z: Vec<f64> = t
        .iter()
        .map(|t| {
            if *t < 4.0 {
                from_m + (to_m - from_m) * t / 4.0
            } else {
                to_m + (from_m - to_m) * 0.25 * (t - 4.0)
            }
        })
        .collect();
    let s = scenario();
    let law = ForceLaw::new(&s.tissue, &[]).expect("a law");
    let (mut state, r) =
        (ForceLawState::default(), Recording::new(t, z, vec![0.0; 600]).expect("clean columns"));
    let f = (0..600)
        .map(|i| law.step(&mut state, r.time_s[i], r.position_m[i], r.velocity_mps[i], |_| {}).total_n)
        .collect();
    NamedRecording { name: "a.csv".to_owned(), recording: Recording { force_n: f, ..r }, notes: Vec::new() }
}

fn checked(e: &NamedRecording) -> Result<Vec<Option<f64>>, DiagnoseError> {
    check_recordings(&scenario(), std::slice::from_ref(e))
}

fn message(e: &NamedRecording) -> String {
    checked(e).map_or_else(|e| e.to_string(), |t| format!("{t:?}"))
}

#[test]
fn force_ratio_of_a_simulated_recording_is_one() {
    let ratios = checked(&moved(0.0, 0.04)).expect("it belongs together");
    assert!((ratios[0].expect("a number") - 1.0).abs() < 1e-6, "{ratios:?}");
    let mut e = moved(0.0, 0.04);
    e.recording.force_n.iter_mut().for_each(|f| *f = 2.6 * *f + 0.4);
    assert!((checked(&e).expect("a gain")[0].expect("a number") - 2.6).abs() < 1e-6);
    // A force that does not correlate with the motion has no ratio.
    e.recording.force_n = (0..600).map(|k| if k % 2 == 0 { 0.1 } else { -0.1 }).collect();
    assert_eq!(checked(&e).expect("no unit is wrong"), vec![None]);
}

#[test]
fn wrong_units_and_signs_of_the_force_are_refused() {
    let scaled = |by: f64| {
        let mut e = moved(0.0, 0.04);
        e.recording.force_n.iter_mut().for_each(|f| *f *= by);
        message(&e)
    };
    assert!(scaled(99.0).starts_with('['), "{}", scaled(99.0));
    let text = scaled(101.0);
    assert!(text.contains("is 101 times") && text.contains("scale: 0.001"), "{text}");
    assert!(scaled(0.0101).starts_with('['), "{}", scaled(0.0101));
    let text = scaled(0.0099);
    assert!(text.contains("9.9e-3 of what") && text.contains("scale: 1000"), "{text}");
    assert!(scaled(-1.0).contains("the force runs the other way") && scaled(-1.0).contains("scale: -1"));
    // Only a force that correlates with the model's is checked: with noise eight times its size it does not.
    let mut e = moved(0.0, 0.04);
    let size = stylet_stats::sd(&e.recording.force_n);
    for (k, f) in e.recording.force_n.iter_mut().enumerate() {
        *f = 200.0 * (*f + 8.0 * size * if k % 2 == 0 { 1.0 } else { -1.0 });
    }
    assert_eq!(message(&e), "[None]");
    e.recording.force_n.iter_mut().for_each(|f| *f *= -1e-5);
    assert_eq!(message(&e), "[None]");
}

#[test]
fn needle_must_reach_a_hundredth_of_the_first_layer() {
    assert!(message(&moved(0.0, SURFACE_M + 2.1e-4)).starts_with('['));
    let text = message(&moved(0.0, SURFACE_M + 1.9e-4));
    assert!(
        text.contains("never reaches") && text.contains("0.010190 m") && text.contains("offset"),
        "{text}"
    );
    // Less than a thousandth of the depth of the tissue in all.
    let text = message(&moved(0.0, 9e-5));
    assert!(text.contains("kilometres"), "{text}");
    assert!(!message(&moved(0.0, 1.1e-4)).contains("kilometres"));
    // The motion out is the larger one, and goes beyond the mirror image of the surface by a tenth of the depth of
    // 50 mm.
    for (start, lowest, other) in [(0.0, -0.0151, true), (0.0, -0.0149, false), (-0.014, -0.0151, false)] {
        let mut e = moved(0.0, 1e-3);
        let z: Vec<f64> = (0..600).map(|k| start + (lowest - start) * f64::from(k) / 599.0).collect();
        e.recording.position_m = z;
        // Forward by as much as the lowest position is below the start.
        if start < 0.0 {
            e.recording.position_m[300] = 0.005;
        }
        let text = message(&e);
        assert_eq!(text.contains("the position runs the other way"), other, "{start} {lowest}: {text}");
    }
}

#[test]
fn positions_in_another_unit_or_behind_the_tissue_are_refused() {
    // Twenty depths of 50 mm beyond the surface.
    let text = message(&moved(0.0, 1.0 + SURFACE_M - 1e-3));
    assert!(!text.contains("looks like"), "{text}");
    let text = message(&moved(0.0, 1.0 + SURFACE_M + 1e-3));
    assert!(text.contains("millimetres") && text.contains("scale: 0.001"), "{text}");
    assert!(message(&moved(0.0, 999.0)).contains("millimetres"));
    let text = message(&moved(0.0, 1001.0));
    assert!(text.contains("micrometres") && text.contains("scale: 0.000001"), "{text}");
    // The tissue ends at 60 mm.
    assert!(!message(&moved(0.0599, 0.07)).contains("behind"));
    let text = message(&moved(0.0601, 0.07));
    assert!(text.contains("begins behind the tissue") && text.contains("offset: -0.050"), "{text}");
    assert!(message(&moved(0.0601, 1.0600)).contains("behind"));
    assert!(message(&moved(0.0601, 1.0610)).contains("millimetres"));
}

#[test]
fn more_than_forty_layers_and_too_few_samples_are_refused() {
    let mut s = scenario();
    let e = moved(0.0, 0.04);
    let one = s.tissue.layers[0].clone();
    s.tissue.layers = vec![one.clone(); 40];
    assert!(check_recordings(&s, std::slice::from_ref(&e)).is_ok());
    s.tissue.layers.push(one);
    let text =
        check_recordings(&s, std::slice::from_ref(&e)).err().map(|e| e.to_string()).unwrap_or_default();
    assert!(text.contains("41 layers") && text.contains("up to 40"), "{text}");
    assert!(matches!(check_recordings(&scenario(), &[]), Err(DiagnoseError::NoRecording)));
    let least = stylet_record::MIN_SAMPLES;
    for (usable, enough) in [(least, true), (least - 1, false)] {
        let mut e = moved(0.0, 0.04);
        // The usable samples lie deep in the tissue.
        for k in 0..600 {
            if !(100..100 + usable).contains(&k) {
                let column = [
                    &mut e.recording.time_s,
                    &mut e.recording.position_m,
                    &mut e.recording.velocity_mps,
                    &mut e.recording.force_n,
                ];
                column.into_iter().nth(1 + k % 3).expect("four columns")[k] = f64::NAN;
            }
        }
        let short = matches!(checked(&e), Err(DiagnoseError::TooShort { samples, .. }) if samples == usable);
        assert_eq!(short, !enough, "{usable}: {}", message(&e));
    }
}

#[test]
fn recording_with_twice_or_half_the_force_of_the_others_gets_a_note() {
    let is_outlier = |ratios: &[f64]| -> Vec<bool> {
        force_outlier_notes(&ratios.iter().map(|t| Some(*t)).collect::<Vec<_>>())
            .iter()
            .map(Option::is_some)
            .collect()
    };
    assert_eq!(is_outlier(&[1.0, 1.2, 2.19]), [false, false, false]);
    // The others' median is 1.1.
    assert_eq!(is_outlier(&[1.0, 1.2, 2.2]), [false, false, true]);
    assert_eq!(is_outlier(&[1.0, 1.2, 0.56]), [false, false, false]);
    assert_eq!(is_outlier(&[1.0, 1.2, 0.55]), [false, false, true]);
    // Two recordings cannot tell which of them is the outlier.
    assert_eq!(is_outlier(&[1.0, 9.0]), [false, false]);
    // A recording without a ratio neither counts nor gets a note.
    assert!(force_outlier_notes(&[Some(1.0), None, Some(9.0)]).iter().all(Option::is_none));
    let notes = force_outlier_notes(&[Some(1.0), None, Some(1.2), Some(1.1), Some(4.4)]);
    assert_eq!(notes.iter().map(Option::is_some).collect::<Vec<_>>(), [false, false, false, false, true]);
    let note = notes[4].as_ref().expect("a note");
    assert!(
        note.message.contains("is 4.40 times") && note.message.contains("others 1.10 times"),
        "{}",
        note.message
    );
    assert_eq!((note.numbers["force_ratio"], note.numbers["others_force_ratio"]), (4.4, 1.1));
}

#[test]
fn samples_that_are_not_finite_are_removed_and_noted() {
    let mut r = moved(0.0, 0.04).recording;
    assert_eq!(drop_non_finite(&r), r);
    assert!(non_finite_note(&r).is_none());
    r.time_s[7] = f64::NAN;
    r.position_m[11] = f64::INFINITY;
    r.velocity_mps[13] = f64::NAN;
    r.force_n[17] = f64::NEG_INFINITY;
    let cut = drop_non_finite(&r);
    assert_eq!(cut.len(), 596);
    assert_eq!(
        (cut.time_s[7], cut.force_n[7], cut.position_m[9]),
        (r.time_s[8], r.force_n[8], r.position_m[10])
    );
    assert_eq!((cut.velocity_mps[11], cut.velocity_measured), (r.velocity_mps[14], r.velocity_measured));
    let note = non_finite_note(&r).expect("a note");
    assert!(note.message.contains("4 sample(s)") && note.message.contains("number 8:"), "{}", note.message);
    assert_eq!((note.numbers["count"], note.numbers["first"], note.blocking), (4.0, 7.0, false));
}
