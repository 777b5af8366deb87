//! A measured recording without ground truth: detections against the drops of the raw force, and the residual of the
//! retraction.

use crate::support::detection;
use std::cell::RefCell;
use stylet_core::{EnhanceConfig, Sample};
use stylet_record::Recording;
use stylet_score::{MeasuredRecording, MeasuredScore, ModelFrictionScore, Trace};

/// One sample per 0.5 s: in until 10 s, held until 12 s, back to the surface at 10 mm and out of it.
fn recording() -> Recording {
    let time_s: Vec<f64> = (0..=40).map(|i| 0.5 * f64::from(i)).collect();
    let position_m = time_s.iter().map(|t| 0.004 * t.min(10.0) - 0.005 * (t - 12.0).max(0.0)).collect();
    let force_n = time_s.iter().map(|t| if *t < 12.0 { 2.0 } else { -3.0 }).collect();
    Recording::new(time_s, position_m, force_n).expect("a recording")
}

fn scored(
    drops_s: &[f64],
    detections_s: &[f64],
    friction: Option<f64>,
) -> (MeasuredScore, Vec<(f64, usize)>) {
    let recording = recording();
    let trace = Trace {
        detections: detections_s.iter().enumerate().map(|(i, t)| detection(i + 1, *t)).collect(),
        enhanced_n: recording.time_s.iter().map(|t| if *t < 12.0 { 5.0 } else { 0.5 }).collect(),
        ..Trace::default()
    };
    let drops: Vec<usize> = drops_s.iter().map(|t| (2.0 * t) as usize).collect();
    let measured = MeasuredRecording {
        name: "gel 3",
        recording: &recording,
        drops: &drops,
        deepest: 20,
        retraction: 24,
        contact_m: 0.010,
    };
    let trace_len = recording.len();
    let received = RefCell::new(Vec::new());
    let online = MeasuredScore::evaluate(&measured, &trace, &EnhanceConfig::default(), || {
        let (friction, received) = (friction?, &received);
        Some(move |sample: &Sample, ruptures| {
            if received.borrow().len() < trace_len {
                received.borrow_mut().push((sample.time_s, ruptures));
            }
            friction
        })
    });
    (online, received.into_inner())
}

#[test]
fn a_drop_is_matched_from_fifty_milliseconds_before_to_one_second_after_it() {
    for (late_s, found) in [(-0.06, 0), (-0.04, 1), (0.3, 1), (0.9, 1), (1.1, 0)] {
        let (online, _) = scored(&[6.0], &[6.0 + late_s], None);
        assert_eq!((online.drops, online.found, online.false_insertion), (1, found, 1 - found), "{late_s}");
    }
}

#[test]
fn two_drops_cannot_share_a_detection_and_a_second_detection_is_false() {
    let (online, _) = scored(&[6.0, 6.5], &[6.6], None);
    assert_eq!((online.drops, online.found, online.false_insertion), (2, 1, 0));
    let (online, _) = scored(&[6.0, 6.5], &[6.1, 6.2, 6.6], None);
    assert_eq!((online.found, online.false_insertion), (2, 1));
}

#[test]
fn false_detections_are_counted_where_they_happen() {
    // The deepest sample is the first of the hold, and the turn the first of the retraction.
    let (online, received) =
        scored(&[3.0], &[1.0, 3.1, 9.9, 10.0, 11.0, 11.9, 12.0, 18.0, 19.0, 20.0], Some(0.0));
    assert_eq!(
        (online.found, online.false_insertion, online.false_hold, online.false_retraction),
        (1, 2, 3, 4)
    );
    // Layers count as punctured from each detection, true or false.
    assert_eq!(received.len(), 41);
    for (time_s, ruptures) in received {
        let detections = [1.0, 3.1, 9.9, 10.0, 11.0, 11.9, 12.0, 18.0, 19.0, 20.0];
        assert_eq!(ruptures, detections.iter().filter(|t| **t <= time_s).count(), "{time_s} s");
    }
}

#[test]
fn the_residual_during_retraction_is_measured_inside_the_tissue() {
    let (online, _) = scored(&[], &[], Some(-2.75));
    assert_eq!(online.recording, "gel 3");
    assert_eq!(
        (online.retraction_raw_n, online.retraction_enhanced_n, online.retraction_model_n),
        (3.0, 0.5, 0.25)
    );
    assert!(scored(&[], &[], None).0.retraction_model_n.is_nan());
}

#[test]
fn the_retraction_ends_at_the_surface() {
    let mut recording = recording();
    // At the surface (18 s) and outside there is no friction.
    assert_eq!(recording.time_s[36], 18.0);
    recording.position_m[36] = 0.010;
    for i in 36..recording.len() {
        recording.force_n[i] = 100.0;
    }
    let trace = Trace { enhanced_n: recording.force_n.clone(), ..Trace::default() };
    let measured = MeasuredRecording {
        name: "",
        recording: &recording,
        drops: &[],
        deepest: 20,
        retraction: 24,
        contact_m: 0.010,
    };
    assert_eq!(
        MeasuredScore::evaluate(&measured, &trace, &EnhanceConfig::default(), || None::<
            fn(&Sample, usize) -> f64,
        >)
        .retraction_raw_n,
        3.0
    );
}

/// At 2 mm/s in by 20 mm, a hold of 2 s, and back; friction relaxes from the hold force to a pull.
fn with_retraction() -> (Recording, Vec<f64>, usize) {
    let time_s: Vec<f64> = (0..2450).map(|i| 0.01 * f64::from(i)).collect();
    let position_m: Vec<f64> =
        time_s.iter().map(|t| -0.005 + 0.002 * t.min(12.5) - 0.002 * (t - 14.5).max(0.0)).collect();
    let back = time_s.iter().rposition(|t| *t <= 14.5).expect("a retraction");
    let friction = |i: usize| {
        if i < back { 0.0 } else { -1.5 + 3.5 * (-(position_m[back] - position_m[i]) / 2.5e-3).exp() }
    };
    let model: Vec<f64> = (0..time_s.len()).map(friction).collect();
    let force_n = (0..model.len()).map(|i| if i < back { 100.0 * position_m[i].max(0.0) } else { model[i] });
    let force_n = force_n.collect();
    (Recording::new(time_s, position_m, force_n).expect("a recording"), model, back)
}

#[test]
fn a_model_off_by_a_fifth_leaves_little_residual_and_keeps_a_pull() {
    let (recording, model, back) = with_retraction();
    let measured = MeasuredRecording {
        name: "",
        recording: &recording,
        drops: &[],
        deepest: 1250,
        retraction: back,
        contact_m: 0.001,
    };
    let of = |factor: f64| {
        let model = || {
            let mut left = model.iter();
            Some(move |_: &Sample, _| factor * left.next().copied().unwrap_or_default())
        };
        ModelFrictionScore::evaluate(&measured, &EnhanceConfig::default(), model).expect("a model")
    };
    let (exact, off) = (of(1.0), of(1.2));
    assert!(exact.residual_rms_n < 0.02 && exact.residual_max_n < 0.1, "{exact:?}");
    // Replayed without correction it would leave 0.2 of 1.2 N rms.
    assert!(off.residual_rms_n < 0.12 && off.residual_rms_n > exact.residual_rms_n, "{off:?}");
    for kept in [exact, off] {
        assert!((0.75..0.9).contains(&kept.pulse_kept), "{kept:?}");
        assert!((0.55..0.75).contains(&kept.step_kept), "{kept:?}");
    }
    let none = ModelFrictionScore::evaluate(&measured, &EnhanceConfig::default(), || {
        None::<fn(&Sample, usize) -> f64>
    });
    assert_eq!(none, None);
}
