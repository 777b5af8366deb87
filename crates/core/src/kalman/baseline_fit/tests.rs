use super::*;
use crate::kalman::test_support::near;

/// Sums over 100 samples in air with 20 mN of noise, at a speed that changes: time and position are correlated by 0.57.
fn sums() -> Totals {
    Totals {
        weight: 250_000.0,
        time_s: 3.0,
        position_m: -0.004,
        force_n: 0.3,
        tt: 5e5,
        zz: 2.0,
        tz: 570.0,
        tf: 2e3,
        zf: 6.0,
        ff: 40.0,
    }
}

/// A history that began at 10 s, 30 mm above and 0.5 N, and evidence with a residual variance of `excess` times the noise.
fn history(excess: f64) -> (AirHistory, AirEvidence) {
    let mut history = AirHistory::new(1e-8);
    history.origin = Sample { time_s: 10.0, position_m: -0.03, velocity_mps: 0.002, force_n: 0.5 };
    let evidence = AirEvidence { excess, sample_weight: 2500.0, ..history.evaluate() };
    (history, evidence)
}

fn at(time_s: f64, position_m: f64) -> Sample {
    Sample { time_s, position_m, velocity_mps: 0.002, force_n: 9.0 }
}

/// `j p j'`, where `j` moves level, drift and line by `dt` and `dz`.
fn moved(p: &[[f64; 3]; 3], dt: f64, dz: f64) -> [[f64; 3]; 3] {
    let j = [[1.0, dt, dz], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let mut out = [[0.0; 3]; 3];
    for (r, row) in out.iter_mut().enumerate() {
        for (c, x) in row.iter_mut().enumerate() {
            *x = (0..3)
                .flat_map(|a| (0..3).map(move |b| (a, b)))
                .map(|(a, b)| j[r][a] * p[a][b] * j[c][b])
                .sum();
        }
    }
    out
}

/// Least squares about the means with independent priors of variance `prior` on the slopes: the solution and its covariance at `at`.
fn least_squares(t: &Totals, prior: [f64; 2], (dt, dz): (f64, f64)) -> ([f64; 3], [[f64; 3]; 3]) {
    let (a, b, c) = (t.tt + 1.0 / prior[0], t.tz, t.zz + 1.0 / prior[1]);
    let det = a * c - b * b;
    let p = [[1.0 / t.weight, 0.0, 0.0], [0.0, c / det, -b / det], [0.0, -b / det, a / det]];
    let drift = p[1][1] * t.tf + p[1][2] * t.zf;
    let line = p[2][1] * t.tf + p[2][2] * t.zf;
    ([t.force_n + 0.5 + drift * dt + line * dz, drift, line], moved(&p, dt, dz))
}

fn assert_near(found: &BaselineFit, (x, p): ([f64; 3], [[f64; 3]; 3])) {
    for (found, x) in found.x.iter().zip(x) {
        near(*found, x);
    }
    for (found, p) in found.p.iter().flatten().zip(p.iter().flatten()) {
        near(*found, *p);
    }
}

#[test]
fn level_drift_and_line_are_the_least_squares_estimate_with_a_prior_of_the_total_change() {
    for excess in [1.0, 2.5] {
        let (history, evidence) = history(excess);
        for (tf, zf) in [(2e3, 6.0), (-2e3, 6.0), (900.0, -7.0)] {
            let total = Totals { tf, zf, ..sums() };
            let scaled = total.scaled(1.0 / excess);
            let speed_mps = (total.zz / total.tt).sqrt();
            // All of the change is drift, or all of it is line.
            let (drift, line) = (tf / total.tt, zf / total.zz);
            for (form, prior) in [
                (Form::Drift, [drift * drift, (drift / speed_mps) * (drift / speed_mps)]),
                (Form::Line, [(line * speed_mps) * (line * speed_mps), line * line]),
            ] {
                // The means lie at 13 s and -34 mm.
                for (dt, dz) in [(0.0, 0.0), (4.0, 0.009), (-1.5, 0.003)] {
                    let fit = history.fit(&evidence, &total, form, &at(13.0 + dt, -0.034 + dz));
                    assert_near(&fit, least_squares(&scaled, prior, (dt, dz)));
                    near(fit.samples, 100.0);
                    assert_eq!((fit.time_s, fit.position_m), (13.0 + dt, -0.034 + dz));
                }
            }
        }
    }
}

#[test]
fn a_constant_baseline_is_the_mean() {
    let (history, evidence) = history(2.5);
    for (total, form) in [(sums(), Form::Constant), (Totals { tt: 0.0, ..sums() }, Form::Drift)] {
        let fit = history.fit(&evidence, &total, form, &at(15.0, -0.02));
        near(fit.x[0], 0.8);
        near(fit.p[0][0], 2.5 / 250_000.0);
        assert_eq!((fit.x[1], fit.x[2], fit.kind), (0.0, 0.0, BaselineKind::Constant));
        assert!(fit.p[1..].iter().flatten().all(|p| *p == 0.0));
        assert_eq!((fit.time_s, fit.position_m), (15.0, -0.02));
        near(fit.samples, 100.0);
    }
}

#[test]
fn a_needle_at_rest_shows_drift_alone() {
    let (history, evidence) = history(1.0);
    // Travels within the rounding of a position, and sums that rounding has made inconsistent.
    for (zz, tz) in [(0.0, 0.0), (4e-4, 0.0), (2.0, 1200.0)] {
        let total = Totals { zz, tz, ..sums() };
        let fit = history.fit(&evidence, &total, Form::Drift, &at(17.0, -0.03));
        let (drift, prior) = (2e3 / 5e5, 5e5 * 5e5 / 2e3 / 2e3);
        let variance = 1.0 / (5e5 + prior);
        near(fit.x[1], 2e3 * variance);
        near(fit.x[0], 0.8 + 4.0 * 2e3 * variance);
        near(fit.p[0][0], 1.0 / 250_000.0 + 16.0 * variance);
        near(fit.p[0][1], 4.0 * variance);
        near(fit.p[1][1], variance);
        assert_eq!((fit.x[2], fit.p[0][2], fit.p[1][2], fit.p[2][2]), (0.0, 0.0, 0.0, 0.0));
        assert!(fit.x[1] < drift);
        assert_eq!(fit.kind == BaselineKind::Drift, zz < 1.0);
    }
}

#[test]
fn drift_and_line_are_named_where_the_motion_separates_them() {
    use BaselineKind::{Drift, DriftOrLine, Line};
    let usual = sums();
    // Residual sums of squares 40 - tf²/tt and 40 - zf²/zz; half their difference has to exceed 3 nats.
    let cases = [
        (1.0, Totals { tf: 3e3, zf: 4.8, ..usual }, Drift),
        (1.0, Totals { tf: 3e3, zf: 4.9, ..usual }, DriftOrLine),
        (2.0, Totals { tf: 3e3, zf: 4.8, ..usual }, DriftOrLine),
        (2.0, Totals { tf: 3.6e3, zf: 4.8, ff: 50.0, ..usual }, Drift),
        (1.0, Totals { tf: 2e3, zf: 5.4, ..usual }, Line),
        (1.0, Totals { tf: 2e3, zf: 5.2, ..usual }, DriftOrLine),
        (1.0, Totals { tf: -3e3, zf: -4.8, ..usual }, Drift),
        // Squared correlation of 0.99 between time and position.
        (1.0, Totals { tf: 3e3, zf: 4.8, tz: 994.9, ..usual }, Drift),
        (1.0, Totals { tf: 3e3, zf: 4.8, tz: 995.1, ..usual }, DriftOrLine),
        (1.0, Totals { tf: 3e3, zf: 4.8, tz: -995.1, ..usual }, DriftOrLine),
        // A travel of 30 um per second is a travel, one of 28 um is none: zz/tt of 1e-9.
        (1.0, Totals { zz: 4.9e-4, tz: 0.0, tf: 2e3, zf: 0.0, ..usual }, Drift),
        (1.0, Totals { zz: 5.1e-4, tz: 0.0, tf: 2e3, zf: 0.06, ..usual }, DriftOrLine),
    ];
    for (n, (excess, total, kind)) in cases.into_iter().enumerate() {
        let (history, evidence) = history(excess);
        for form in [Form::Drift, Form::Line] {
            assert_eq!(history.fit(&evidence, &total, form, &at(13.0, -0.034)).kind, kind, "{n} as {form:?}");
        }
    }
}

#[test]
fn a_baseline_is_the_same_wherever_it_is_referred_to() {
    let p = [[4e-6, -1e-6, 3e-4], [-1e-6, 9e-6, -2e-3], [3e-4, -2e-3, 5.0]];
    let fit = BaselineFit {
        time_s: 2.0,
        position_m: -0.01,
        x: [0.3, 0.02, -12.0],
        p,
        kind: BaselineKind::Line,
        samples: 70.0,
    };
    for (dt, dz) in [(0.0, 0.0), (3.0, 0.004), (-2.0, 0.01), (1.0, -0.02)] {
        let moved_fit = fit.at(2.0 + dt, -0.01 + dz);
        assert_near(&moved_fit, ([0.3 + 0.02 * dt - 12.0 * dz, 0.02, -12.0], moved(&p, dt, dz)));
        near(fit.level_variance(dt, dz), moved(&p, dt, dz)[0][0]);
        assert_eq!((moved_fit.time_s, moved_fit.position_m), (2.0 + dt, -0.01 + dz));
        assert_eq!((moved_fit.kind, moved_fit.samples), (BaselineKind::Line, 70.0));
    }
    // Rounding makes no variance negative.
    let rounded = BaselineFit { p: [[1e-20, -1e-9, 0.0], [-1e-9, 0.0, 0.0], [0.0; 3]], ..fit };
    assert_eq!(rounded.level_variance(1.0, 0.0), 0.0);
}

/// 200 samples at a rippled speed with 20 mN of noise, a drift of 30 mN/s, and what is added over the count.
fn drifting(added_n: impl Fn(i32) -> f64) -> AirHistory {
    let mut history = AirHistory::new(1e-8);
    let mut position_m = -0.01;
    for k in 0..400 {
        let time_s = 0.005 * f64::from(k);
        position_m += 1e-5 * (1.0 + 0.8 * (4.0 * time_s).sin());
        let noise_n = 0.02 * (f64::from(k * 7919 % 1009) / 504.0 - 1.0);
        let force_n = 0.5 + 0.3 * time_s + noise_n + added_n(k);
        history.push(&Sample { time_s, position_m, velocity_mps: 0.002, force_n });
    }
    history
}

#[test]
fn behind_a_step_the_level_is_known_from_the_samples_since() {
    for size_n in [1.0, -0.7] {
        let history = drifting(|k| if k < 394 { 0.0 } else { size_n });
        let evidence = history.evaluate();
        assert!(evidence.step_nats() > DECISION_NATS && (evidence.step.size - size_n).abs() < 0.05);
        let now = at(1.995, -0.006);
        let fit = history.fit_behind_step(&evidence, &now);
        // Six samples behind the step; a fit to all 400 would claim more.
        let independent = evidence.step.sums.n / evidence.sample_weight;
        near(independent, 6.0);
        near(fit.p[0][0], evidence.excess / evidence.step.sums.n);
        let no_event = drifting(|_| size_n);
        let expected = no_event.fit_all_blocks(&no_event.evaluate(), &now);
        assert!(
            (fit.x[0] - expected.x[0]).abs() < 4.0 * fit.p[0][0].sqrt(),
            "{} for {}",
            fit.x[0],
            expected.x[0]
        );
        assert!((fit.x[1] - expected.x[1]).abs() < 0.02, "{} for {}", fit.x[1], expected.x[1]);
    }
}

#[test]
fn before_a_bend_the_baseline_is_that_of_air_and_named_only_if_significant() {
    let history = drifting(|k| 0.01 * f64::from((k - 360).max(0)));
    let evidence = history.evaluate();
    assert!(evidence.contact_nats() > DECISION_NATS && evidence.bend.form != Form::Constant);
    let now = at(1.995, -0.006);
    let fit = history.fit_before_bend(&evidence, &now);
    let air = drifting(|_| 0.0);
    let expected = air.fit_all_blocks(&air.evaluate(), &now);
    assert!((fit.x[0] - expected.x[0]).abs() < 0.01, "{} for {}", fit.x[0], expected.x[0]);
    assert!(fit.kind != BaselineKind::Constant && (340.0..=365.0).contains(&fit.samples), "{fit:?}");
    for (nats, named) in [(1.9, false), (2.1, true)] {
        let doubtful = AirEvidence { constant_bend_nats: evidence.bend.nats - nats, ..evidence };
        let found = history.fit_before_bend(&doubtful, &now);
        assert_eq!((found.x, found.p), (fit.x, fit.p));
        assert_eq!(found.kind != BaselineKind::Constant, named, "{nats} nats");
    }
}
