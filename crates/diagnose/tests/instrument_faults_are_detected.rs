//! Promise: instrument faults are detected without a tissue model (delay, lag, bias, gain, drift), and
//! nothing is detected in a faultless instrument.

use crate::simulated_recordings;

use simulated_recordings::{SimulatedSet, assumed_tissue, stick_slip_set};
use stylet_diagnose::repeated_insertions::SegmentedRecording;
use stylet_diagnose::repeated_insertions::instrument_faults::{InstrumentReport, ReferenceRecordings};
use stylet_record::Recording;

/// Recordings recordings_with changed forces.
fn recordings_with(change: impl Fn(&Recording) -> Vec<f64>) -> Vec<SegmentedRecording> {
    stick_slip_set(&SimulatedSet { seed: 31, shift_m: 0.0 })
        .into_iter()
        .map(|run| {
            let mut recording = run.recording.clone();
            recording.force_n = change(&run.recording);
            SegmentedRecording::new(run.name, recording, 1)
        })
        .collect()
}

fn assess(recordings: &[SegmentedRecording]) -> InstrumentReport {
    let refs: Vec<&SegmentedRecording> = recordings.iter().collect();
    InstrumentReport::assess(&ReferenceRecordings::default(), &refs, assumed_tissue().surface_m)
}

fn detected(instrument: &InstrumentReport) -> Vec<&str> {
    instrument.detected.iter().map(|s| s.effect.as_str()).collect()
}

#[test]
fn a_faultless_instrument_is_not_corrected() {
    let recordings = recordings_with(|r| r.force_n.clone());
    let report = assess(&recordings);
    assert!(report.detected.is_empty(), "{:?}", report.detected);
    let corrected = report.calibrate(&recordings.iter().collect::<Vec<_>>());
    for (a, b) in corrected.recordings.iter().zip(&recordings) {
        assert_eq!(a.recording, b.recording);
    }
}

#[test]
fn a_delay_and_a_lag_are_distinguished() {
    let late_s = 0.3;
    let late = assess(&recordings_with(|r| {
        let at = |t: f64| r.time_s.partition_point(|x| *x < t).min(r.len() - 1);
        r.time_s.iter().map(|t| r.force_n[at(t - late_s)]).collect()
    }));
    assert_eq!(detected(&late), ["time_delay"]);
    assert!((late.delay_s.expect("a delay") - late_s).abs() < 0.05, "{late:?}");

    let rounded = |r: &Recording| {
        let mut y = r.force_n[0];
        let mut out = Vec::with_capacity(r.len());
        for (i, f) in r.force_n.iter().enumerate() {
            let dt = if i > 0 { r.time_s[i] - r.time_s[i - 1] } else { 0.0 };
            y += (f - y) * (1.0 - (-dt / late_s).exp());
            out.push(y);
        }
        out
    };
    let recordings = recordings_with(rounded);
    let slow = assess(&recordings);
    assert_eq!(detected(&slow), ["low_pass_lag"]);
    assert!((slow.lag_s.expect("a lag") - late_s).abs() < 0.15, "{slow:?}");
}

#[test]
fn a_force_in_air_gives_the_bias_and_a_load_the_gain() {
    let biased = recordings_with(|r| r.force_n.iter().map(|f| 1.1 * f + 0.3).collect());
    let refs: Vec<&SegmentedRecording> = biased.iter().collect();
    let t: Vec<f64> = (0..400).map(|k| 0.01 * f64::from(k)).collect();
    let wobble = |k: usize| 1e-3 * ((k * 7919) % 101) as f64 / 101.0;
    let of = |level: f64| {
        let f = (0..t.len()).map(|k| 1.1 * level + 0.3 + wobble(k)).collect();
        Recording::new(t.clone(), vec![0.0; t.len()], f).expect("clean columns")
    };
    let (air, load) = (of(0.0), of(5.0));
    let checks = ReferenceRecordings { air: Some(&air), load: Some((&load, 5.0)) };
    let report = InstrumentReport::assess(&checks, &refs, assumed_tissue().surface_m);
    assert_eq!(detected(&report), ["force_gain", "force_bias"], "{report:?}");
    assert!((report.gain.expect("a gain") - 0.1).abs() < 0.005);
    let clean = recordings_with(|r| r.force_n.clone());
    for (a, b) in report.calibrate(&refs).recordings.iter().zip(&clean) {
        for (a, b) in a.recording.force_n.iter().zip(&b.recording.force_n) {
            assert!((a - b).abs() < 0.01 + 0.005 * b.abs(), "{a} is not {b}");
        }
    }
}

#[test]
fn a_soft_stop_of_the_drive_is_no_lag() {
    let ramp_s = 0.4;
    let speed = |t: f64| match t {
        t if t < 10.0 => 2e-3,
        t if t < 10.0 + ramp_s => 2e-3 * (1.0 - (t - 10.0) / ramp_s),
        t if t < 14.0 => 0.0,
        t if t < 14.0 + ramp_s => -2e-3 * (t - 14.0) / ramp_s,
        t if t < 22.0 => -2e-3,
        _ => 0.0,
    };
    let recordings: Vec<SegmentedRecording> = (0..4)
        .map(|run| {
            let mut noise = 17 + run;
            let (mut z, mut t, mut out) = (0.0, 0.0, (Vec::new(), Vec::new(), Vec::new()));
            while t < 23.0 {
                noise = (noise * 1_103_515_245_u64 + 12_345) % 2_147_483_648;
                let white = 0.02 * (noise as f64 / 2_147_483_648.0 - 0.5);
                out.0.push(t);
                out.1.push(z);
                out.2.push(200.0 * f64::max(z - 0.004, 0.0) + white);
                z += 0.01 * speed(t);
                t += 0.01;
            }
            let recording = Recording::new(out.0, out.1, out.2).expect("clean columns");
            SegmentedRecording::new(format!("run {run}"), recording, 1)
        })
        .collect();
    assert!(assess(&recordings).detected.is_empty(), "{:?}", assess(&recordings).detected);
}

/// A drift in N/s lasts longer in a long recording; a drift per recording is corrected recordings_with each
/// recording's own rate.
#[test]
fn a_drift_is_corrected_per_recording() {
    let (rate_n_per_s, whole_n) = (0.01, 0.4);
    let elapsed = |r: &Recording, t: f64| t - r.time_s[0];
    let by_time = recordings_with(|r| {
        r.time_s.iter().zip(&r.force_n).map(|(t, f)| f + rate_n_per_s * elapsed(r, *t)).collect()
    });
    let by_recording = recordings_with(|r| {
        let share = |t: f64| elapsed(r, t) / r.duration_s();
        r.time_s.iter().zip(&r.force_n).map(|(t, f)| f + whole_n * share(*t)).collect()
    });
    let t: Vec<f64> = (0..400).map(|k| 0.01 * f64::from(k)).collect();
    let f = (0..t.len()).map(|k| rate_n_per_s * t[k] + 1e-3 * ((k * 7919) % 101) as f64 / 101.0).collect();
    let air = Recording::new(t.clone(), vec![0.0; t.len()], f).expect("clean columns");
    let checks = ReferenceRecordings { air: Some(&air), load: None };
    let clean = recordings_with(|r| r.force_n.clone());
    for recordings in [by_time, by_recording] {
        let refs: Vec<&SegmentedRecording> = recordings.iter().collect();
        let report = InstrumentReport::assess(&checks, &refs, assumed_tissue().surface_m);
        assert_eq!(detected(&report), ["force_drift"], "{report:?}");
        for (a, b) in report.calibrate(&refs).recordings.iter().zip(&clean) {
            for (a, b) in a.recording.force_n.iter().zip(&b.recording.force_n) {
                assert!((a - b).abs() < 0.03, "{a} is not {b}");
            }
        }
    }
}
