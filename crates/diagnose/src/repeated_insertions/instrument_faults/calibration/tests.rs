use super::{remove_delay, remove_lag};
use crate::repeated_insertions::SegmentedRecording;
use crate::repeated_insertions::instrument_faults::{DetectedFault, InstrumentReport};
use std::collections::BTreeMap;
use stylet_record::Recording;
use stylet_tissue::{
    AnyEffect, DriveFriction, Effect, ForceBias, ForceDrift, ForceGain, LowPassLag, PeriodicInterference,
    TimeDelay,
};

/// Forces 3 k + 1 at times 0.1 s apart from 2 s on.
fn numbered(n: usize) -> Recording {
    let t: Vec<f64> = (0..n).map(|k| 2.0 + 0.1 * k as f64).collect();
    let z = (0..n).map(|k| 1e-3 * k as f64).collect();
    Recording::new(t, z, (0..n).map(|k| 3.0 * k as f64 + 1.0).collect()).expect("clean columns")
}

#[test]
fn removing_a_delay_shifts_the_force_and_truncates_the_end() {
    let r = numbered(30);
    for (delay_s, by) in [(0.3, 3), (0.34, 3), (0.36, 4), (0.04, 0), (0.06, 1)] {
        let out = remove_delay(&r, delay_s);
        let kept = 30 - (delay_s * 10.0 - 1e-9).ceil() as usize;
        assert_eq!(out.len(), kept, "{delay_s}");
        for i in 0..kept {
            assert_eq!(out.force_n[i], r.force_n[i + by], "{delay_s}, sample {i}");
            assert_eq!((out.time_s[i], out.position_m[i]), (r.time_s[i], r.position_m[i]));
        }
        assert_eq!(out.velocity_mps.len(), kept);
    }
    assert_eq!(remove_delay(&r, 0.0), r);
    assert_eq!(remove_delay(&r, -0.3), r);
    // Ties take the later sample.
    let quarters = Recording { time_s: (0..30).map(|k| 0.25 * f64::from(k)).collect(), ..r.clone() };
    assert_eq!(remove_delay(&quarters, 0.125).force_n[3], r.force_n[4]);
    assert_eq!(remove_delay(&r, 9.0).len(), 2);
}

#[test]
fn removing_a_lag_adds_slope_times_time_constant() {
    let mut r = numbered(30);
    let before = r.force_n.clone();
    remove_lag(&mut r, 0.25);
    // 3 N in 0.1 s: 30 N/s, at the ends too.
    for (f, b) in r.force_n.iter().zip(&before) {
        assert!((f - b - 0.25 * 30.0).abs() < 1e-9, "{f} {b}");
    }
    // Slope over three samples on either side: 14/28 per sample for 0 0 0 0 1 2 3.
    let mut bent = numbered(30);
    bent.force_n = (0..30).map(|k| f64::from((k - 15).max(0))).collect();
    remove_lag(&mut bent, 0.1);
    assert!((bent.force_n[15] - 14.0 / 28.0).abs() < 1e-9, "{}", bent.force_n[15]);
    assert!(bent.force_n[12].abs() < 1e-12 && (bent.force_n[18] - 4.0).abs() < 1e-9);
    let kept = bent.force_n.clone();
    remove_lag(&mut bent, 0.0);
    assert_eq!(bent.force_n, kept);
}

#[test]
fn spikes_below_two_per_cent_of_the_force_are_ignored() {
    let spikes = |size: f64| {
        let mut f: Vec<f64> = (0..600).map(|k| 10.0 + if k % 2 == 0 { 1e-3 } else { -1e-3 }).collect();
        for k in [100, 250, 400] {
            f[k] = 10.0 + size;
        }
        let t = (0..600).map(|k| 0.01 * f64::from(k)).collect();
        let r = Recording::new(t, vec![0.0; 600], f).expect("clean columns");
        let run = SegmentedRecording::new("one".to_owned(), r, 1);
        InstrumentReport::default().calibrate(&[&run]).artefacts.spikes.map(|s| s.count)
    };
    assert_eq!((spikes(0.2), spikes(0.21)), (None, Some(3)));
}

fn shows(all: Vec<AnyEffect>) -> InstrumentReport {
    let shown = all.into_iter().map(|e| DetectedFault {
        effect: e.id().to_owned(),
        parameters: BTreeMap::new(),
        max_force_n: 1.0,
        evidence: String::new(),
        effect_model: Some(e),
    });
    InstrumentReport { detected: shown.collect(), ..InstrumentReport::default() }
}

#[test]
fn drift_bias_and_gain_are_inverted_in_order() {
    let run = SegmentedRecording::new("one".to_owned(), numbered(40), 1);
    let (bias, gain, rate) = (0.7, 0.25, 0.4);
    let all: Vec<AnyEffect> = vec![
        ForceBias { force_n: bias }.into(),
        ForceGain { eps: gain }.into(),
        ForceDrift { rate_n_per_s: rate }.into(),
        PeriodicInterference { amplitude_n: 1.0, frequency_hz: 3.0, phase_rad: 0.0 }.into(),
        DriveFriction { force_n: 0.5 }.into(),
    ];
    let mut report = shows(all);
    let ids: Vec<&str> = report.correctable_effects().iter().map(Effect::id).collect();
    assert_eq!(ids, ["force_bias", "force_gain", "force_drift"], "tones and the drive stay");
    for (own, rate) in [(None, rate), (Some(-0.15), -0.15)] {
        report.drifts_n_per_s = vec![own];
        let out = report.calibrate(&[&run]);
        for (k, f) in out.recordings[0].recording.force_n.iter().enumerate() {
            let wanted = (3.0 * k as f64 + 1.0 - rate * 0.1 * k as f64 - bias) / (1.0 + gain);
            assert!((f - wanted).abs() < 1e-9, "{k}: {f} for {wanted}");
        }
    }
    let mut biased = shows(vec![ForceBias { force_n: bias }.into()]);
    biased.drifts_n_per_s = vec![Some(9.0)];
    let out = biased.calibrate(&[&run]);
    assert!((out.recordings[0].recording.force_n[20] - 61.0 + bias).abs() < 1e-12);
}

#[test]
fn delay_and_lag_are_inverted_first_and_the_limit_is_calibrated() {
    let mut r = numbered(60);
    r.force_n.iter_mut().for_each(|f| *f = f.min(100.0));
    let run = SegmentedRecording::new("one".to_owned(), r.clone(), 2);
    let report = shows(vec![
        TimeDelay { delay_s: 0.2 }.into(),
        LowPassLag { time_constant_s: 0.05 }.into(),
        ForceBias { force_n: 1.0 }.into(),
        ForceGain { eps: 0.1 }.into(),
    ]);
    let out = report.calibrate(&[&run]);
    assert_eq!(out.artefacts.limit_n, Some(100.0));
    assert!((out.recordings[0].limit_n.expect("a limit") - 90.0).abs() < 1e-9);
    assert_eq!(out.recordings[0].recording.len(), 58);
    assert_eq!(out.recordings[0].ruptures_s.len(), 2);
    let wanted = (3.0 * 12.0 + 1.0 + 0.05 * 30.0 - 1.0) / 1.1;
    assert!((out.recordings[0].recording.force_n[10] - wanted).abs() < 1e-9);
    let same = InstrumentReport::default().calibrate(&[&run]);
    assert_eq!(same.recordings[0].recording, r);
    assert_eq!(same.recordings[0].limit_n, Some(100.0));
}
