//! Promise: a moving zero of the sensor moves neither the contact nor the stiffness, and what was followed is reported with an interval.

use crate::support::{enhance, gels, insertion, last_estimates, stylet};
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use std::f64::consts::TAU;
use stylet_core::{BaselineKind, Sample};

const SEEDS: u64 = 12;

/// Insertions from 8 mm above the tissue at a rippled speed, with a force (N) added over time and position.
fn insertions(disturbance_n: impl Fn(&Sample) -> f64) -> Vec<Vec<Sample>> {
    let speed_mps = |t: f64| 0.0023 * (1.0 + 0.4 * (TAU * 0.3 * t).sin());
    let one = |seed| {
        let mut samples = insertion(&gels(), -0.008, 32.0, 200.0, 0.02, seed, speed_mps).samples;
        samples.iter_mut().for_each(|s| s.force_n += disturbance_n(s));
        samples
    };
    (0..SEEDS).map(one).collect()
}

/// Insertions whose contact and first stiffness lie in their 99.9 % intervals; every contact has to be within 0.5 mm.
fn right(insertions: &[Vec<Sample>]) -> usize {
    let truth = gels().layers[0].stiffness_n_per_m;
    let is_right = |samples: &&Vec<Sample>| {
        let outputs = enhance(&stylet(), samples);
        let last = outputs.last().expect("an output");
        let contact_m = last.contact_m.expect("a contact");
        assert!(contact_m.abs() < 5e-4, "{contact_m}");
        let estimates = last_estimates(&outputs);
        let first = estimates.iter().find(|e| e.layer == 1).expect("a first layer");
        let off = first.stiffness_n_per_m - truth;
        assert!(off.abs() < 0.1 * truth, "{first:?}");
        contact_m.abs() < 3.3 * last.contact_sd_m && off.abs() < 3.3 * first.stiffness_sd
    };
    insertions.iter().filter(is_right).count()
}

#[test]
fn contact_and_stiffness_lie_in_their_intervals_whatever_the_zero_does() {
    let start_m = -0.008;
    let count = |disturbance_n: &dyn Fn(&Sample) -> f64| right(&insertions(disturbance_n));
    let found = [
        ("none", count(&|_| 0.0)),
        ("drift", count(&|s| 0.02 * s.time_s)),
        ("drift down", count(&|s| -0.02 * s.time_s)),
        ("line", count(&|s| 12.0 * (s.position_m - start_m))),
        ("step", count(&|s| if s.time_s < 1.5 { 1.0 } else { 0.0 })),
    ];
    assert!(found.iter().all(|f| f.1 as u64 >= SEEDS - 2), "of {SEEDS}: {found:?}");
}

#[test]
fn the_baseline_that_was_followed_is_reported() {
    let start_m = -0.008;
    type Case<'a> = (&'a dyn Fn(&Sample) -> f64, [f64; 2], bool);
    let cases: [Case; 3] = [
        (&|_| 0.0, [0.0, 0.0], false),
        (&|s| 0.03 * s.time_s, [0.03, 0.0], true),
        (&|s| 18.0 * (s.position_m - start_m), [0.0, 18.0], true),
    ];
    for (disturbance_n, slopes, moves) in cases {
        let mut right = 0;
        for samples in insertions(disturbance_n) {
            let outputs = enhance(&stylet(), &samples);
            let at = outputs.iter().position(|o| o.contact_m.is_some()).expect("a contact");
            let baseline = outputs[at].baseline;
            assert_eq!(baseline.kind != BaselineKind::Constant, moves, "{baseline:?}");
            // At a nearly constant speed only the sum of both slopes is known well.
            let speed_mps = 0.0023;
            let change = |drift: f64, line: f64| drift + line * speed_mps;
            let found = change(baseline.drift_n_per_s, baseline.line_n_per_m);
            right += u64::from((found - change(slopes[0], slopes[1])).abs() < 0.008);
            for (x, truth, sd) in [
                (baseline.drift_n_per_s, slopes[0], baseline.sd[1]),
                (baseline.line_n_per_m, slopes[1], baseline.sd[2]),
            ] {
                assert!((x - truth).abs() <= 4.0 * sd, "{x} +- {sd}, not {truth}");
            }
        }
        assert!(right >= SEEDS - 2, "{slopes:?}: {right} of {SEEDS}");
    }
}

/// Insertions from 20 mm above the tissue with slow noise of 20 mN, which a drift or a small step of the zero makes look like a contact.
fn doubtful(seed: u64) -> (Vec<Sample>, impl Fn(f64) -> f64) {
    let data = insertion(&gels(), -0.02, 25.0, 200.0, 0.0, seed, |t| 0.0025 * (1.0 + 0.3 * (2.0 * t).sin()));
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let (slope, step_n, step_s) =
        (rng.random_range(0.04..0.08), rng.random_range(0.025..0.05), rng.random_range(0.5..1.0));
    let drifts = seed.is_multiple_of(2);
    let rho = if drifts { 0.9 } else { 0.0 };
    let zero_n = move |t: f64| match t {
        t if drifts => slope * t,
        t if t > step_s => step_n,
        _ => 0.0,
    };
    let mut samples = data.samples;
    let mut slow_n = 0.0;
    for s in &mut samples {
        let w: f64 = StandardNormal.sample(&mut rng);
        slow_n = rho * slow_n + 0.02 * (1.0_f64 - rho * rho).sqrt() * w;
        s.force_n += slow_n + zero_n(s.time_s);
    }
    (samples, zero_n)
}

#[test]
fn a_contact_that_turns_out_to_be_a_moving_zero_is_cancelled_and_the_true_one_found() {
    let (mut cancelled, mut near, mut ruptures, mut off_n) = (0, 0, 0, Vec::new());
    for seed in 0..60 {
        let (samples, zero_n) = doubtful(seed);
        let outputs = enhance(&stylet(), &samples);
        let cancels = |k: &usize| outputs[k - 1].contact_m.is_some() && outputs[*k].contact_m.is_none();
        let Some(k) = (1..outputs.len()).find(cancels) else { continue };
        cancelled += 1;
        assert!(samples[k].position_m < 0.0, "seed {seed}: cancelled in tissue");
        let out = &outputs[k];
        assert_eq!((out.contact_sd_m, out.contact_probability, out.ruptures), (0.0, 0.0, 0), "seed {seed}");
        off_n.push((out.baseline.offset_n - zero_n(samples[k].time_s)).abs());
        let last = outputs.last().expect("outputs");
        near += usize::from(last.contact_m.is_some_and(|m| m.abs() < 5e-4));
        ruptures += usize::from(last.ruptures == 1);
    }
    assert!(cancelled >= 8, "{cancelled} cancelled");
    // What was taken for a load is the zero.
    let known = off_n.iter().filter(|off| **off < 0.015).count();
    assert!(known * 10 >= cancelled * 8, "zero known within 15 mN after {known} of {cancelled}: {off_n:?}");
    assert!(near * 10 >= cancelled * 9, "{near} of {cancelled} true contacts found");
    assert!(ruptures * 10 >= cancelled * 9, "{ruptures} of {cancelled} with the one rupture");
}
