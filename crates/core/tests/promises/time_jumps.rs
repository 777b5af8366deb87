//! Promise: a wrong time stamp costs one sample, a new clock costs four and restarts the algorithm, and every output says whether
//! its sample was used and why not.

use crate::support;
use stylet_core::config::Algorithm;
use stylet_core::{EnhanceConfig, Enhancer, Output, Sample, UnusedReason};

const ALGORITHMS: [Algorithm; 3] = [Algorithm::Paper, Algorithm::Literal, Algorithm::Stylet];

fn core(algorithm: Algorithm) -> Enhancer<Vec<Sample>> {
    let config = EnhanceConfig { algorithm, ..EnhanceConfig::paper() };
    Enhancer::new(config, 0.0, vec![Sample::default(); 10_000])
}

fn text(out: &Output) -> String {
    format!("{out:?}")
}

#[test]
fn one_stamp_far_in_the_future_or_past_is_ignored_and_changes_nothing_else() {
    let samples = support::constant(0.02, 1).samples;
    for algorithm in ALGORITHMS {
        for outlier in [1e9, -1e9, f64::MAX, 1e300, -5.0] {
            let (mut plain, mut disturbed) = (core(algorithm), core(algorithm));
            for (k, sample) in samples.iter().enumerate() {
                if k % 1000 == 500 {
                    let out = disturbed.step(Sample { time_s: outlier, ..*sample });
                    assert_eq!((out.used, out.unused_reason), (false, Some(UnusedReason::TimeJump)));
                    assert!(out.detection.is_none() && out.estimate.is_none() && !out.restarted);
                }
                let (a, b) = (plain.step(*sample), disturbed.step(*sample));
                assert_eq!(text(&a), text(&b), "{algorithm:?}, sample {k} after {outlier} s");
            }
        }
    }
}

#[test]
fn a_new_clock_restarts_the_algorithm_with_its_fifth_sample() {
    let samples = support::constant(0.02, 1).samples;
    for algorithm in ALGORITHMS {
        for start_s in [-1e6, -40.0, 1e5, 1.7e9] {
            let mut core_under_test = core(algorithm);
            let before = samples.iter().map(|s| core_under_test.step(*s)).last();
            assert!(before.is_some_and(|out| out.ruptures > 0), "{algorithm:?}");
            let mut fresh = core(algorithm);
            for (k, sample) in samples.iter().enumerate() {
                let sample = Sample { time_s: sample.time_s + start_s, ..*sample };
                let out = core_under_test.step(sample);
                let expected = if k < 4 {
                    Output {
                        used: false,
                        unused_reason: Some(UnusedReason::TimeJump),
                        ..before.unwrap_or_default()
                    }
                } else {
                    Output { restarted: k == 4, ..fresh.step(sample) }
                };
                assert_eq!(text(&out), text(&expected), "{algorithm:?}, sample {k} from {start_s} s");
            }
        }
    }
}

#[test]
fn batches_restart_as_single_steps_do() {
    let first = support::constant(0.02, 1).samples;
    let mut samples = first.clone();
    samples.extend(first.iter().map(|s| Sample { time_s: s.time_s - 7.0, ..*s }));
    samples.extend(first.iter().map(|s| Sample { time_s: s.time_s + 1e7, ..*s }));
    for k in (313..samples.len()).step_by(313) {
        samples[k].time_s = if k % 2 == 0 { 1e12 } else { -1e12 };
    }
    for algorithm in ALGORITHMS {
        let brief = |out: &Output| {
            let event = (out.detection, out.estimate, out.contact_m, out.ruptures);
            (out.used, out.unused_reason, out.restarted, out.enhanced_n.to_bits(), event)
        };
        let mut single = core(algorithm);
        let expected: Vec<_> = samples.iter().map(|s| brief(single.step_brief(*s))).collect();
        assert_eq!(expected.iter().filter(|e| e.2).count(), 2, "{algorithm:?} restarts");
        for length in [1, 63, 64, 65, 1000, samples.len()] {
            let mut batch = core(algorithm);
            let mut found = Vec::new();
            for piece in samples.chunks(length) {
                batch.run(piece, |out| found.push(brief(out)));
            }
            assert!(found == expected, "{algorithm:?} in batches of {length}");
        }
    }
}

#[test]
fn every_ignored_sample_has_its_reason_and_every_used_one_has_none() {
    let good = Sample { time_s: 1.0, position_m: 0.0, velocity_mps: 0.002, force_n: 0.1 };
    let cases = [
        (Sample { time_s: f64::NAN, ..good }, UnusedReason::NotFinite),
        (Sample { force_n: f64::INFINITY, ..good }, UnusedReason::NotFinite),
        (Sample { position_m: 1e4, ..good }, UnusedReason::OutOfRange),
        (Sample { force_n: -1e7, ..good }, UnusedReason::OutOfRange),
        (good, UnusedReason::NotLater),
        (Sample { time_s: 0.5, ..good }, UnusedReason::NotLater),
        (Sample { time_s: -0.5, ..good }, UnusedReason::TimeJump),
        (Sample { time_s: 2.5, ..good }, UnusedReason::TimeJump),
    ];
    for algorithm in ALGORITHMS {
        for (sample, reason) in cases {
            let mut core = core(algorithm);
            let first = core.step(good);
            assert_eq!((first.used, first.unused_reason), (true, None));
            let out = core.step(sample);
            assert_eq!((out.used, out.unused_reason), (false, Some(reason)), "{algorithm:?} {sample:?}");
            assert!(!reason.message().is_empty());
            let next = core.step(Sample { time_s: 1.005, ..good });
            assert_eq!((next.used, next.unused_reason, next.restarted), (true, None, false));
        }
    }
}

#[test]
fn a_restart_allocates_nothing() {
    let samples = support::constant(0.02, 1).samples;
    for algorithm in ALGORITHMS {
        let mut core = core(algorithm);
        let mut restarts = 0;
        let counted = allocation_counter::measure(|| {
            for round in 0..5 {
                for sample in &samples {
                    let time_s = sample.time_s - 1e3 * f64::from(round);
                    restarts += usize::from(core.step(Sample { time_s, ..*sample }).restarted);
                }
            }
        });
        assert_eq!((restarts, counted.count_total), (4, 0), "{algorithm:?}");
    }
}
