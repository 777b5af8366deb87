//! Whether the recordings can belong to the scenario at all.

use crate::diagnose::NamedRecording;
use crate::error::DiagnoseError;
use stylet_record::{MIN_SAMPLES, QualityKind, QualityNote, Recording};
use stylet_scenario::Scenario;
use stylet_tissue::{ForceLaw, replay};

/// Most layers: so many were seen to be told apart, with clean data and no cause named.
const MOST_LAYERS: usize = 40;

/// Among so many recordings one can be unlike the others ...
const FEWEST: usize = 3;
/// ... when its force is more than so many times theirs, or less than one of so many parts of it, each against what the law expects of its
/// motion.
const UNLIKE: f64 = 2.0;

/// Checks reach, units and signs; says how many times what the scenario expects each recording's force is (none where they do not go
/// together).
pub(crate) fn check_recordings(
    scenario: &Scenario,
    evidence: &[NamedRecording],
) -> Result<Vec<Option<f64>>, DiagnoseError> {
    if evidence.is_empty() {
        return Err(DiagnoseError::NoRecording);
    }
    let layers = scenario.tissue.layers.len();
    if layers > MOST_LAYERS {
        return Err(DiagnoseError::TooManyLayers { layers, most: MOST_LAYERS });
    }
    let (surface_m, end_m) = (scenario.tissue.surface_m, scenario.tissue.end_m());
    let mut times = Vec::with_capacity(evidence.len());
    for e in evidence {
        let r = &e.recording;
        let usable: Vec<usize> = (0..r.len()).filter(|i| whole(r, *i)).collect();
        let name = || e.name.clone();
        if usable.len() < MIN_SAMPLES {
            return Err(DiagnoseError::TooShort { name: name(), samples: usable.len(), least: MIN_SAMPLES });
        }
        let deepest_m = usable.iter().fold(f64::NEG_INFINITY, |m, &i| m.max(r.position_m[i]));
        let lowest_m = usable.iter().fold(f64::INFINITY, |m, &i| m.min(r.position_m[i]));
        let depth_m = end_m - surface_m;
        // The smallest depth of any use: a hundredth of the first layer.
        let first_m = scenario.tissue.layers.first().map_or(depth_m, |l| l.thickness_m);
        if lowest_m >= end_m && deepest_m - lowest_m <= 20.0 * depth_m {
            let offset_m = surface_m - lowest_m;
            return Err(DiagnoseError::BeginsBehind { name: name(), lowest_m, end_m, offset_m });
        }
        if deepest_m - surface_m > 20.0 * depth_m {
            let scale = if deepest_m > 2e4 * depth_m { 1e-6 } else { 1e-3 };
            let unit = if scale == 1e-3 { "millimetres" } else { "micrometres" };
            return Err(DiagnoseError::PositionUnit { name: name(), deepest: deepest_m, end_m, unit, scale });
        }
        if deepest_m - surface_m < 0.01 * first_m {
            let start_m = usable.first().map_or(deepest_m, |&i| r.position_m[i]);
            let remedy = if start_m - lowest_m > deepest_m - start_m && -lowest_m > surface_m + 0.1 * depth_m
            {
                "the position runs the other way: positive is into the tissue, give a column map with a negative scale"
            } else if deepest_m - lowest_m > 1e-9 && deepest_m - lowest_m < 2e-3 * depth_m {
                "its whole travel is a thousandth of the tissue: is the position in kilometres, or scaled twice?"
            } else {
                "is this the right scenario, and does position zero mean the same in both? a column map shifts it with \
                 position: (name: \"position_m\", offset: 0.01), or give the scenario the surface_m that the recording has"
            };
            return Err(DiagnoseError::NeverReaches { name: name(), deepest_m, surface_m, remedy });
        }
        times.push(force(scenario, e, &usable)?);
    }
    Ok(times)
}

/// Per recording a note when its force is not of the others' size, by what [`check`] says of all.
pub(crate) fn force_outlier_notes(times: &[Option<f64>]) -> Vec<Option<QualityNote>> {
    let note = |i: usize| {
        let own = times[i]?;
        let others: Vec<f64> =
            times.iter().enumerate().filter(|(j, _)| *j != i).filter_map(|(_, t)| *t).collect();
        let typical = (others.len() + 1 >= FEWEST).then(|| stylet_stats::median_of(others))?;
        if own < UNLIKE * typical && own * UNLIKE > typical {
            return None;
        }
        let message = format!(
            "it is not like the others: its force is {own:.2} times what the scenario expects of its motion, that of the others {typical:.2} \
             times; is it filed under the right tissue, needle and units? leave it out or put it right"
        );
        let numbers =
            [("force_ratio", own), ("others_force_ratio", typical)].map(|(name, x)| (name.to_owned(), x));
        Some(QualityNote {
            kind: QualityKind::OutlierRecording,
            message,
            numbers: numbers.into_iter().collect(),
            lines: Vec::new(),
            blocking: false,
        })
    };
    (0..times.len()).map(note).collect()
}

/// Compares the size and sign of the measured force with the believed law's; how many times it is, where the two go together.
fn force(scenario: &Scenario, e: &NamedRecording, usable: &[usize]) -> Result<Option<f64>, DiagnoseError> {
    let r = &e.recording;
    let Ok(law) = ForceLaw::new(&scenario.tissue, &scenario.effects) else { return Ok(None) };
    let mut believed = Vec::with_capacity(usable.len());
    replay(
        &law,
        usable.iter().map(|&i| (r.time_s[i], r.position_m[i], r.velocity_mps[i])),
        |_| {},
        |f| believed.push(f.total_n),
    );
    let mean: f64 = usable.iter().map(|&i| r.force_n[i]).sum::<f64>() / usable.len() as f64;
    let expected: f64 = believed.iter().sum::<f64>() / believed.len() as f64;
    let (mut ff, mut bb, mut fb) = (0.0, 0.0, 0.0);
    for (&i, b) in usable.iter().zip(&believed) {
        let (f, b) = (r.force_n[i] - mean, b - expected);
        ff += f * f;
        bb += b * b;
        fb += f * b;
    }
    let (measured, law_n) = (ff.sqrt(), bb.sqrt());
    let correlation = fb / (measured * law_n).max(1e-300);
    let ratio = measured / law_n.max(1e-300);
    let wrong = |what: String, scale: f64| Err(DiagnoseError::Force { name: e.name.clone(), what, scale });
    if correlation < -0.5 {
        return wrong(
            "the force runs the other way: it should be positive when it resists the insertion".to_owned(),
            -1.0,
        );
    }
    if correlation.abs() > 0.5 && ratio > 100.0 {
        return wrong(
            format!("the force is {ratio:.0} times what the scenario expects: is it in millinewtons?"),
            1e-3,
        );
    }
    if correlation.abs() > 0.5 && ratio < 0.01 {
        return wrong(
            format!("the force is {ratio:.1e} of what the scenario expects: is it in kilonewtons?"),
            1e3,
        );
    }
    Ok((correlation > 0.5).then_some(ratio))
}

/// Whether a sample is all finite numbers.
fn whole(r: &Recording, i: usize) -> bool {
    [&r.time_s, &r.position_m, &r.velocity_mps, &r.force_n].iter().all(|x| x[i].is_finite())
}

/// The recording without samples that are not finite.
pub(crate) fn drop_non_finite(r: &Recording) -> Recording {
    let kept: Vec<usize> = (0..r.len()).filter(|i| whole(r, *i)).collect();
    if kept.len() == r.len() {
        return r.clone();
    }
    let pick = |x: &[f64]| kept.iter().map(|i| x[*i]).collect::<Vec<f64>>();
    Recording {
        time_s: pick(&r.time_s),
        position_m: pick(&r.position_m),
        velocity_mps: pick(&r.velocity_mps),
        force_n: pick(&r.force_n),
        velocity_measured: r.velocity_measured,
        ..Recording::default()
    }
}

/// A remark on samples that are not finite: they are cut out.
pub(crate) fn non_finite_note(r: &Recording) -> Option<QualityNote> {
    let bad: Vec<usize> = (0..r.len()).filter(|i| !whole(r, *i)).collect();
    let first = *bad.first()?;
    let message = format!(
        "{} sample(s) are not finite numbers, the first is number {}: they were cut out",
        bad.len(),
        first + 1
    );
    let numbers =
        [("count".to_owned(), bad.len() as f64), ("first".to_owned(), first as f64)].into_iter().collect();
    Some(QualityNote { kind: QualityKind::Gaps, message, numbers, lines: Vec::new(), blocking: false })
}

#[cfg(test)]
mod tests {
    use super::{check_recordings, drop_non_finite, force_outlier_notes, non_finite_note};
    use crate::diagnose::NamedRecording;
    use crate::error::DiagnoseError;
    use stylet_record::Recording;
    use stylet_scenario::Scenario;
    use stylet_tissue::{ForceLaw, ForceLawState, Layer, Tissue};

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

    /// From one position to another and half the way back, with the force that the law expects.
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
        NamedRecording {
            name: "a.csv".to_owned(),
            recording: Recording { force_n: f, ..r },
            notes: Vec::new(),
        }
    }

    fn judged(e: &NamedRecording) -> Result<Vec<Option<f64>>, DiagnoseError> {
        check_recordings(&scenario(), std::slice::from_ref(e))
    }

    fn said(e: &NamedRecording) -> String {
        judged(e).map_or_else(|e| e.to_string(), |t| format!("{t:?}"))
    }

    #[test]
    fn a_recording_of_the_law_itself_is_once_what_is_expected() {
        let times = judged(&moved(0.0, 0.04)).expect("it belongs together");
        assert!((times[0].expect("a number") - 1.0).abs() < 1e-6, "{times:?}");
        let mut e = moved(0.0, 0.04);
        e.recording.force_n.iter_mut().for_each(|f| *f = 2.6 * *f + 0.4);
        assert!((judged(&e).expect("a gain")[0].expect("a number") - 2.6).abs() < 1e-6);
        // A force that has nothing to do with the motion says nothing.
        e.recording.force_n = (0..600).map(|k| if k % 2 == 0 { 0.1 } else { -0.1 }).collect();
        assert_eq!(judged(&e).expect("no unit is wrong"), vec![None]);
    }

    #[test]
    fn units_and_signs_of_the_force_are_told_from_both_sides() {
        let scaled = |by: f64| {
            let mut e = moved(0.0, 0.04);
            e.recording.force_n.iter_mut().for_each(|f| *f *= by);
            said(&e)
        };
        assert!(scaled(99.0).starts_with('['), "{}", scaled(99.0));
        let text = scaled(101.0);
        assert!(text.contains("is 101 times") && text.contains("scale: 0.001"), "{text}");
        assert!(scaled(0.0101).starts_with('['), "{}", scaled(0.0101));
        let text = scaled(0.0099);
        assert!(text.contains("9.9e-3 of what") && text.contains("scale: 1000"), "{text}");
        assert!(scaled(-1.0).contains("the force runs the other way") && scaled(-1.0).contains("scale: -1"));
        // Only a force that goes with the law's is judged: with noise eight times its size nothing does.
        let mut e = moved(0.0, 0.04);
        let size = stylet_stats::sd(&e.recording.force_n);
        for (k, f) in e.recording.force_n.iter_mut().enumerate() {
            *f = 200.0 * (*f + 8.0 * size * if k % 2 == 0 { 1.0 } else { -1.0 });
        }
        assert_eq!(said(&e), "[None]");
        e.recording.force_n.iter_mut().for_each(|f| *f *= -1e-5);
        assert_eq!(said(&e), "[None]");
    }

    #[test]
    fn a_needle_has_to_reach_a_hundredth_of_the_first_layer() {
        assert!(said(&moved(0.0, SURFACE_M + 2.1e-4)).starts_with('['));
        let text = said(&moved(0.0, SURFACE_M + 1.9e-4));
        assert!(
            text.contains("never reaches") && text.contains("0.010190 m") && text.contains("offset"),
            "{text}"
        );
        // Less than a thousandth of the tissue's way in all.
        let text = said(&moved(0.0, 9e-5));
        assert!(text.contains("kilometres"), "{text}");
        assert!(!said(&moved(0.0, 1.1e-4)).contains("kilometres"));
        // The way out is the larger one, and goes beyond the surface's mirror image by a tenth of the depth of 50 mm.
        for (start, lowest, other) in [(0.0, -0.0151, true), (0.0, -0.0149, false), (-0.014, -0.0151, false)]
        {
            let mut e = moved(0.0, 1e-3);
            let z: Vec<f64> = (0..600).map(|k| start + (lowest - start) * f64::from(k) / 599.0).collect();
            e.recording.position_m = z;
            // Forward by as much as the lowest position is below the start.
            if start < 0.0 {
                e.recording.position_m[300] = 0.005;
            }
            let text = said(&e);
            assert_eq!(text.contains("the position runs the other way"), other, "{start} {lowest}: {text}");
        }
    }

    #[test]
    fn positions_of_another_unit_or_behind_the_tissue_are_told_from_both_sides() {
        // Twenty depths of 50 mm beyond the surface.
        let text = said(&moved(0.0, 1.0 + SURFACE_M - 1e-3));
        assert!(!text.contains("looks like"), "{text}");
        let text = said(&moved(0.0, 1.0 + SURFACE_M + 1e-3));
        assert!(text.contains("millimetres") && text.contains("scale: 0.001"), "{text}");
        assert!(said(&moved(0.0, 999.0)).contains("millimetres"));
        let text = said(&moved(0.0, 1001.0));
        assert!(text.contains("micrometres") && text.contains("scale: 0.000001"), "{text}");
        // The tissue ends at 60 mm.
        assert!(!said(&moved(0.0599, 0.07)).contains("behind"));
        let text = said(&moved(0.0601, 0.07));
        assert!(text.contains("begins behind the tissue") && text.contains("offset: -0.050"), "{text}");
        assert!(said(&moved(0.0601, 1.0600)).contains("behind"));
        assert!(said(&moved(0.0601, 1.0610)).contains("millimetres"));
    }

    #[test]
    fn forty_layers_are_told_apart_and_four_samples_are_too_few() {
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
            // Usable ones lie deep in the tissue, where they say something.
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
            let short =
                matches!(judged(&e), Err(DiagnoseError::TooShort { samples, .. }) if samples == usable);
            assert_eq!(short, !enough, "{usable}: {}", said(&e));
        }
    }

    #[test]
    fn one_recording_of_twice_or_half_the_others_force_is_unlike_them() {
        let seen = |times: &[f64]| -> Vec<bool> {
            force_outlier_notes(&times.iter().map(|t| Some(*t)).collect::<Vec<_>>())
                .iter()
                .map(Option::is_some)
                .collect()
        };
        assert_eq!(seen(&[1.0, 1.2, 2.19]), [false, false, false]);
        // The others' median is 1.1.
        assert_eq!(seen(&[1.0, 1.2, 2.2]), [false, false, true]);
        assert_eq!(seen(&[1.0, 1.2, 0.56]), [false, false, false]);
        assert_eq!(seen(&[1.0, 1.2, 0.55]), [false, false, true]);
        // Two say nothing of each other.
        assert_eq!(seen(&[1.0, 9.0]), [false, false]);
        // Nor does one that does not go with the law, nor is it told.
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
    fn samples_that_are_no_numbers_are_cut_out_and_told() {
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
        assert!(
            note.message.contains("4 sample(s)") && note.message.contains("number 8:"),
            "{}",
            note.message
        );
        assert_eq!((note.numbers["count"], note.numbers["first"], note.blocking), (4.0, 7.0, false));
    }
}
