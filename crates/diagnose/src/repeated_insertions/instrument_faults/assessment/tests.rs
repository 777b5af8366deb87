use super::{NEGLIGIBLE_SHARE, ReferenceRecordings, load_gain_error};
use crate::repeated_insertions::instrument_faults::air_baseline::{AirAnalysis, LinearTrend, consensus};
use crate::repeated_insertions::instrument_faults::instrument_report::InstrumentReport;
use crate::repeated_insertions::segmented_recording::SegmentedRecording;
use stylet_record::Recording;

fn still(f: Vec<f64>) -> Recording {
    let t = (0..f.len()).map(|k| 0.1 * k as f64).collect();
    Recording::new(t, vec![0.0; f.len()], f).expect("clean columns")
}

#[test]
fn a_known_load_gives_the_gain_unless_saturated() {
    let wobble = |k: usize| 1e-3 * ((k * 37) % 11) as f64;
    let f: Vec<f64> = (0..50).map(|k| 5.5 + wobble(k)).collect();
    let middle = stylet_stats::median(&mut f.clone());
    let gain = load_gain_error(&still(f.clone()), 5.0, 0.2, false).expect("a gain");
    assert!((gain - ((middle - 0.2) / 5.0 - 1.0)).abs() < 1e-12, "{gain}");
    // With a drift the first sample counts.
    let drifting: Vec<f64> = (0..50).map(|k| 5.5 + 0.03 * k as f64).collect();
    let gain = load_gain_error(&still(drifting), 5.0, 0.2, true).expect("a gain");
    assert!((gain - (5.3 / 5.0 - 1.0)).abs() < 1e-9, "{gain}");
    for sign in [1.0, -1.0] {
        for (count, result) in [(15, true), (16, false)] {
            let f = (0..50).map(|k| sign * if k < count { 6.0 } else { 5.5 + wobble(k) }).collect();
            assert_eq!(load_gain_error(&still(f), 5.0, 0.0, false).is_some(), result, "{count}");
        }
    }
}

#[test]
fn the_bias_comes_from_the_insertions_before_the_recording_in_air() {
    let line = |first_n: f64, rate_n_per_s: f64| LinearTrend { start_n: first_n, rate_n_per_s, sd_n: 0.013 };
    let lines = [line(0.31, 0.010), line(0.3, 0.011), line(0.32, 0.0102)];
    let air = AirAnalysis {
        trend: line(0.05, 0.02),
        ar1: 0.4,
        tone: Some((0.1, 7.0)),
        drive_friction_n: Some(0.2),
    };
    let mut only = InstrumentReport::default();
    only.set_baseline(None, Some(&lines), 20.0, 10.0);
    assert_eq!((only.bias_n, only.noise_n, only.ar1), (Some(0.31), Some(0.013), None));
    // A slope before contact is no drift of the recording.
    assert_eq!(only.drift_n, None);
    let mut both = InstrumentReport::default();
    both.set_baseline(Some(&air), Some(&lines), 20.0, 10.0);
    assert_eq!((both.bias_n, both.drift_n), (Some(0.31), Some(0.4)));
    assert_eq!((both.noise_n, both.ar1), (Some(0.013), Some(0.4)));
    assert_eq!((both.tone, both.drive_friction_n), (Some((0.1, 7.0)), Some(0.2)));
    // A negligible bias of the insertions does not replace that of the reference.
    let mut small = InstrumentReport::default();
    small.set_baseline(Some(&air), Some(&lines), 20.0, 20.0);
    assert_eq!(small.bias_n, Some(0.05));
    let just = line(NEGLIGIBLE_SHARE * 10.0, 0.01);
    small.set_baseline(Some(&air), Some(&[just; 3]), 20.0, 10.0);
    assert_eq!(small.bias_n, Some(0.05));
    let mut none = InstrumentReport::default();
    none.set_baseline(Some(&air), None, 20.0, 10.0);
    assert_eq!(none.bias_n, Some(0.05));
}

#[test]
fn faults_below_two_per_cent_of_the_force_are_excluded() {
    let mut report = InstrumentReport {
        gain: Some(-0.03),
        bias_n: Some(-0.19),
        drift_n: Some(0.21),
        tone: Some((0.25, 7.5)),
        drive_friction_n: Some(-0.22),
        ..InstrumentReport::default()
    };
    report.classify(10.0, 20.0, true, None);
    let excluded: Vec<(&str, f64)> =
        report.excluded.iter().map(|e| (e.effect.as_str(), e.max_force_n)).collect();
    assert_eq!(excluded, [("force_bias", 0.19)]);
    let detected: Vec<&str> = report.detected.iter().map(|e| e.effect.as_str()).collect();
    assert_eq!(detected, ["force_gain", "force_drift", "periodic_interference", "drive_friction"]);
    let of = |k: usize, path: &str| report.detected[k].parameters[path];
    assert!((report.detected[0].max_force_n - 0.3).abs() < 1e-12 && of(0, "eps").value == -0.03);
    assert!((of(1, "rate_n_per_s").value - 0.0105).abs() < 1e-12);
    assert_eq!((of(2, "amplitude_n").value, of(2, "frequency_hz").low), (0.25, 7.5));
    // The phase is not reported.
    assert_eq!(report.detected[2].parameters.len(), 2);
    assert!(report.detected[0].evidence.contains("-3.00 %"), "{}", report.detected[0].evidence);
    assert!(report.excluded[0].evidence.contains("-190.0 mN"), "{}", report.excluded[0].evidence);
    let cause = report.detected[3].cause();
    assert_eq!(
        (cause.effect.as_str(), cause.confidence, cause.parameters["force_n"].value),
        ("drive_friction", 0.99, -0.22)
    );
    let mut just = InstrumentReport { bias_n: Some(NEGLIGIBLE_SHARE * 10.0), ..InstrumentReport::default() };
    just.classify(10.0, 20.0, true, None);
    assert_eq!((just.detected.len(), just.excluded.len()), (1, 0));
    // Without a recording in air there is neither tone nor drive friction.
    report.classify(10.0, 20.0, false, None);
    assert_eq!(report.detected.len(), 2);
}

#[test]
fn insertions_are_assessed_without_reference_recordings() {
    let run = |k: usize, ahead_m: f64| {
        let t: Vec<f64> = (0..1000).map(|i| 0.02 * i as f64).collect();
        let z: Vec<f64> = t
            .iter()
            .map(|t| if *t < 12.0 { 0.002 * t - ahead_m } else { 0.024 - ahead_m - 0.004 * (t - 12.0) })
            .collect();
        let noise = |i: usize| 1e-3 * (((i * 7919 + 31 * k) % 101) as f64 / 101.0 - 0.5);
        let f = z.iter().enumerate().map(|(i, z)| 0.2 + 150.0 * z.max(0.0) + noise(i)).collect();
        SegmentedRecording::new(format!("{k}"), Recording::new(t, z, f).expect("clean columns"), 1)
    };
    let recordings: Vec<SegmentedRecording> = (0..3).map(|k| run(k, 0.008)).collect();
    let refs: Vec<&SegmentedRecording> = recordings.iter().collect();
    let report = InstrumentReport::assess(&ReferenceRecordings::default(), &refs, 0.0);
    assert!((report.bias_n.expect("a bias") - 0.2).abs() < 1e-3, "{report:?}");
    assert!(report.drift_n.expect("no drift").abs() < 1e-3, "{report:?}");
    assert_eq!(report.detected.iter().map(|s| s.effect.as_str()).collect::<Vec<_>>(), ["force_bias"]);
    assert_eq!(report.drifts_n_per_s.len(), 3);
    let f = (0..40).map(|k| 0.2 + 5.5 + 1e-3 * ((k * 37) % 11) as f64).collect();
    let weight = still(f);
    let references = ReferenceRecordings { load: Some((&weight, 5.0)), ..ReferenceRecordings::default() };
    let report = InstrumentReport::assess(&references, &refs, 0.0);
    assert!((report.gain.expect("a gain") - 0.1).abs() < 2e-3, "{:?}", report.gain);
    let bias = |which: &[&SegmentedRecording]| {
        InstrumentReport::assess(&ReferenceRecordings::default(), which, 0.0).bias_n
    };
    let (late, later) = (run(3, -0.001), run(4, -0.001));
    assert!(bias(&[refs[0], &late]).is_some() && bias(&refs[..1]).is_some());
    assert_eq!(bias(&[refs[0], &late, &later]), None);
}

/// Insertion from `ahead_m` before a surface at 0 and back within 20 s, with a drift in air (N/s).
fn drifting(k: usize, ahead_m: f64, rate_n_per_s: f64) -> SegmentedRecording {
    let t: Vec<f64> = (0..1000).map(|i| 0.02 * i as f64).collect();
    let at = |t: f64| if t < 12.0 { 0.002 * t - ahead_m } else { 0.024 - ahead_m - 0.004 * (t - 12.0) };
    let z: Vec<f64> = t.iter().map(|t| at(*t)).collect();
    let noise = |i: usize| 1e-3 * (((i * 7919 + 31 * k) % 101) as f64 / 101.0 - 0.5);
    let f = t
        .iter()
        .enumerate()
        .map(|(i, t)| 0.2 + rate_n_per_s * t + 150.0 * at(*t).max(0.0) + noise(i))
        .collect();
    SegmentedRecording::new(format!("{k}"), Recording::new(t, z, f).expect("clean columns"), 1)
}

#[test]
fn a_drift_needs_half_of_the_insertions() {
    let (run, deep) = (drifting(0, 0.008, 0.02), drifting(1, -0.001, 0.02));
    let drift = |with: usize, without: usize| {
        let all: Vec<&SegmentedRecording> =
            std::iter::repeat_n(&run, with).chain(std::iter::repeat_n(&deep, without)).collect();
        let report = InstrumentReport::assess(&ReferenceRecordings::default(), &all, 0.0);
        let rates: Vec<f64> = report.drifts_n_per_s.iter().copied().flatten().collect();
        if report.drift_n.is_some() {
            assert_eq!(report.drift_n, Some(consensus(&rates) * run.recording.duration_s()));
        }
        report.drift_n
    };
    // 20 mN/s over 19.98 s.
    for (with, without) in [(1, 0), (2, 0), (1, 1), (2, 2)] {
        let result = drift(with, without);
        assert_eq!(result.is_some(), with >= 1 && 2 * with >= (with + without).max(2));
        assert!(result.is_none_or(|d| (d - 0.3996).abs() < 0.01), "{result:?}");
    }
    assert_eq!((drift(1, 2), drift(2, 3)), (None, None));
}

#[test]
fn a_load_with_drift_is_read_at_its_start() {
    let f = (0..200).map(|k| 5.7 + 0.01 * f64::from(k) + 1e-3 * f64::from((k * 37) % 11)).collect();
    let weight = still(f);
    for (rate, level) in [(0.02, 5.5), (1e-3, 5.5 + 0.995)] {
        let run = drifting(0, 0.008, rate);
        let references = ReferenceRecordings { load: Some((&weight, 5.0)), ..ReferenceRecordings::default() };
        let report = InstrumentReport::assess(&references, &[&run, &run], 0.0);
        let gain = report.gain.expect("a gain");
        assert!((gain - (level / 5.0 - 1.0)).abs() < 4e-3, "{rate}: {gain}");
    }
}
