use super::{
    RuptureEvent, estimate_rupture_scatter, evaluate_rupture, grid_minimizer, ln_phi, neg_ln_survival,
    rupture_rows_at, rupture_sds, scatter_prior_nats,
};
use crate::model::Scatter;
use stylet_stats::normal;

fn scatter(force: f64, place_m: f64) -> Scatter {
    Scatter { rupture_force: force, rupture_depth_m: place_m, ..Default::default() }
}

/// A ruptured layer with its force 3 % above the threshold, 0.4 mm before the far interface.
const BOTH: RuptureEvent = RuptureEvent {
    force_excess: 0.03,
    depth_excess_m: -4e-4,
    force_excess_rate: 0.7,
    depth_rate_mps: 0.005,
    elastic_n: 1.3,
    ruptured: true,
    sample_step_s: 0.005,
};

fn assert_close(actual: f64, expected: f64) {
    assert!((actual - expected).abs() <= 1e-9 * expected.abs().max(1e-12), "{actual} for {expected}");
}

#[test]
fn rupture_sds_combine_scatter_sampling_and_rounding() {
    let (force, place) = rupture_sds(&BOTH, &scatter(0.02, 3e-5));
    assert_close(force, (0.02_f64 * 0.02 + 0.0035 * 0.0035 / 12.0 + 1e-8).sqrt());
    assert_close(place, (3e-5_f64 * 3e-5 + 2.5e-5 * 2.5e-5 / 12.0 + 2.25e-12).sqrt());
    let (force, place) = rupture_sds(&RuptureEvent::INITIAL, &scatter(0.0, 0.0));
    assert_close(force, 1e-4);
    assert_close(place, 1.5e-6);
}

#[test]
fn survival_is_the_upper_tail_of_the_normal_distribution() {
    for u in [-8.0, -7.5, -3.1, -0.2, 0.0, 0.7, 2.4, 8.3, 19.7, 25.0] {
        assert_close(neg_ln_survival(u), -libm::log(normal::sf(u)));
    }
    assert_eq!(neg_ln_survival(-8.1), 0.0);
    // Beyond by the first term of the asymptotic series; the second is smaller by the square of the
    // deviate.
    for u in [25.1, 27.3, 31.0] {
        assert_close(neg_ln_survival(u), 0.5 * u * u + libm::log(u * core::f64::consts::TAU.sqrt()));
        assert!((neg_ln_survival(u) + libm::log(normal::sf(u))).abs() < 1.1 / (u * u), "{u}");
    }
    assert_close(ln_phi(1.7), normal::ln_pdf(1.7));
    assert_close(ln_phi(0.0), -0.5 * libm::log(core::f64::consts::TAU));
}

/// The probabilities of all rupture times and of no rupture sum to one.
#[test]
fn competing_risks_form_a_probability_distribution_of_the_rupture_time() {
    let s = scatter(0.06, 4e-4);
    // The tip reaches the far interface 0.06 s after the force reaches its threshold.
    let (place_rate, force_rate) = (0.005, 0.8);
    let at = |t: f64, ruptured: bool| RuptureEvent {
        force_excess: force_rate * t,
        depth_excess_m: place_rate * (t - 0.06),
        force_excess_rate: force_rate,
        depth_rate_mps: place_rate,
        elastic_n: 1.0,
        ruptured,
        sample_step_s: 0.005,
    };
    let dt = 1e-4;
    for end in [-0.05, 0.02, 0.09, 0.6] {
        let steps = ((end + 0.8) / dt) as usize;
        let density =
            |k: usize| libm::exp(-evaluate_rupture(&at(-0.8 + (k as f64 + 0.5) * dt, true), &s).nats) / 0.005;
        let until: f64 = (0..steps).map(density).sum::<f64>() * dt;
        let later = libm::exp(-evaluate_rupture(&at(-0.8 + steps as f64 * dt, false), &s).nats);
        assert!((until + later - 1.0).abs() < 1e-6, "{until} and {later} until {end}");
    }
    // Without a puncture force: by the far interface only.
    let alone = |t: f64, ruptured: bool| RuptureEvent { force_excess: f64::NEG_INFINITY, ..at(t, ruptured) };
    let steps = 8600;
    let density =
        |k: usize| libm::exp(-evaluate_rupture(&alone(-0.8 + (k as f64 + 0.5) * dt, true), &s).nats) / 0.005;
    let until: f64 = (0..steps).map(density).sum::<f64>() * dt;
    let later = libm::exp(-evaluate_rupture(&alone(-0.8 + steps as f64 * dt, false), &s).nats);
    assert!((until + later - 1.0).abs() < 1e-6 && later > 0.3, "{until} and {later}");
}

#[test]
fn residual_rows_are_deviates_weighted_by_risk_shares() {
    let s = scatter(0.02, 3e-4);
    let actual = evaluate_rupture(&BOTH, &s);
    let (s_f, s_z) = rupture_sds(&BOTH, &s);
    let (u_f, u_z) = (0.03 / s_f, -4e-4 / s_z);
    let force = normal::ln_pdf(u_f) + libm::log(0.7 * 0.005 / s_f) + libm::log(normal::sf(u_z));
    let place = normal::ln_pdf(u_z) + libm::log(0.005 * 0.005 / s_z) + libm::log(normal::sf(u_f));
    let (force, place) = (libm::exp(force), libm::exp(place));
    assert_close(actual.nats, -libm::log(force + place));
    let shares = [force / (force + place), place / (force + place)].map(f64::sqrt);
    assert_close(actual.shares[0], shares[0]);
    assert_close(actual.shares[1], shares[1]);
    let tail = |u: f64| (-2.0 * libm::log(normal::sf(u))).sqrt();
    for (row, expected) in actual.rows.into_iter().zip([
        shares[0] * u_f,
        shares[1] * u_z,
        shares[0] * tail(u_z),
        shares[1] * tail(u_f),
    ]) {
        assert_close(row, expected);
    }
    assert_eq!(rupture_rows_at(&BOTH, &s, &BOTH), actual.rows);
    // A layer that holds: neither by force nor by depth so far.
    let holds = RuptureEvent { ruptured: false, ..BOTH };
    let actual = evaluate_rupture(&holds, &s);
    assert_close(actual.nats, -libm::log(normal::sf(u_f)) - libm::log(normal::sf(u_z)));
    assert_eq!(actual.rows[..2], [0.0, 0.0]);
    assert_close(actual.rows[2], tail(u_z));
    assert_close(actual.rows[3], tail(u_f));
    assert_eq!(rupture_rows_at(&holds, &s, &holds), actual.rows);
    // Without a puncture force only the depth counts.
    let plain = RuptureEvent { force_excess: f64::NEG_INFINITY, ..BOTH };
    let actual = evaluate_rupture(&plain, &s);
    assert_eq!((actual.shares, actual.rows[0], actual.rows[2], actual.rows[3]), ([0.0, 1.0], 0.0, 0.0, 0.0));
    assert_close(actual.rows[1], u_z);
    assert_close(actual.nats, -normal::ln_pdf(u_z) - libm::log(0.005 * 0.005 / s_z));
    assert_eq!(rupture_rows_at(&plain, &s, &plain), actual.rows);
    let plain = RuptureEvent { ruptured: false, ..plain };
    assert_close(evaluate_rupture(&plain, &s).nats, -libm::log(normal::sf(u_z)));
    assert_eq!(evaluate_rupture(&plain, &s).rows[3], 0.0);
    assert_eq!(rupture_rows_at(&plain, &s, &plain), evaluate_rupture(&plain, &s).rows);
}

/// For derivatives the shares and standard deviations stay fixed.
#[test]
fn rows_for_derivatives_keep_shares_and_standard_deviations() {
    let s = scatter(0.02, 3e-4);
    let (s_f, s_z) = rupture_sds(&BOTH, &s);
    let shares = evaluate_rupture(&BOTH, &s).shares;
    let moved = RuptureEvent {
        force_excess: 0.05,
        depth_excess_m: -2e-4,
        force_excess_rate: 3.0,
        depth_rate_mps: 0.1,
        ..BOTH
    };
    let actual = rupture_rows_at(&moved, &s, &BOTH);
    assert_close(actual[0], shares[0] * 0.05 / s_f);
    assert_close(actual[1], shares[1] * -2e-4 / s_z);
    assert_close(actual[2], shares[0] * (2.0 * neg_ln_survival(-2e-4 / s_z)).sqrt());
    assert_close(actual[3], shares[1] * (2.0 * neg_ln_survival(0.05 / s_f)).sqrt());
    let far = RuptureEvent { depth_excess_m: f64::NEG_INFINITY, ..moved };
    assert_close(rupture_rows_at(&far, &s, &BOTH)[1], shares[1] * -1e3 / s_z);
    assert_close(
        evaluate_rupture(&far, &s).nats,
        -ln_phi(0.05 / rupture_sds(&far, &s).0) - libm::log(3.0 * 0.005 / rupture_sds(&far, &s).0),
    );
}

/// A needle that hardly moves or retracts carries no more information than at the lowest velocity.
#[test]
fn rates_are_bounded_below_at_20_um_per_second() {
    let s = scatter(0.02, 3e-4);
    let rates = |force_rate: f64, place_rate: f64| {
        evaluate_rupture(
            &RuptureEvent {
                force_excess_rate: force_rate,
                depth_rate_mps: place_rate,
                sample_step_s: 0.0,
                ..BOTH
            },
            &s,
        )
        .nats
    };
    assert_close(rates(0.0, 0.0), rates(2e-3, 2e-5));
    assert!(rates(2.1e-3, 2e-5) < rates(2e-3, 2e-5) && rates(2e-3, 2.1e-5) < rates(2e-3, 2e-5));
    // A zero sampling interval counts as a microsecond.
    assert_close(
        rates(2e-3, 2e-5),
        evaluate_rupture(
            &RuptureEvent { force_excess_rate: 2e-3, depth_rate_mps: 2e-5, sample_step_s: 1e-6, ..BOTH },
            &s,
        )
        .nats,
    );
}

#[test]
fn the_scatter_prior_is_half_a_nat_per_factor_e() {
    assert_close(scatter_prior_nats(&scatter(5e-4, 0.0)), 0.25 * libm::log(2.0));
    assert_close(scatter_prior_nats(&scatter(0.0, 1.5e-5)), 0.25 * libm::log(10.0));
    let e = |x: f64| scatter_prior_nats(&scatter(x * 1.0, 0.0));
    assert!((e(core::f64::consts::E) - e(1.0) - 0.5).abs() < 1e-6);
}

/// Ruptures with deviates of known size: the estimate is the nearest grid value.
#[test]
fn the_estimated_scatter_is_the_nearest_grid_value() {
    let deviates = [-1.6, -1.0, -0.6, -0.3, -0.1, 0.1, 0.3, 0.6, 1.0, 1.6];
    for sd in [0.004, 0.02, 0.09] {
        let of = |u: f64| RuptureEvent {
            force_excess: u * sd * 1.1,
            depth_excess_m: -0.01,
            force_excess_rate: 0.2,
            ..BOTH
        };
        let events = deviates.map(of);
        let actual = estimate_rupture_scatter(&events, &scatter(0.3, 1e-3));
        assert_eq!((actual.rupture_force, actual.rupture_depth_m), (sd, 0.0), "{sd}");
    }
    for sd in [4e-5, 3.2e-4] {
        let of = |u: f64| RuptureEvent {
            force_excess: f64::NEG_INFINITY,
            depth_excess_m: u * sd * 1.1,
            depth_rate_mps: 0.001,
            ..BOTH
        };
        let events = deviates.map(of);
        let actual = estimate_rupture_scatter(&events, &scatter(0.3, 1e-3));
        assert_eq!((actual.rupture_force, actual.rupture_depth_m), (0.0, sd), "{sd}");
    }
    // Unchanged without ruptures.
    assert_eq!(estimate_rupture_scatter(&[], &scatter(0.3, 1e-3)), scatter(0.3, 1e-3));
}

#[test]
fn of_equal_minima_the_first_is_taken() {
    let grid = [0.0, 1.0, 2.0, 3.0, 4.0];
    assert_eq!(grid_minimizer(|x| (x - 2.2).powi(2), &grid), 2.0);
    assert_eq!(grid_minimizer(|x| if x < 1.5 { 1.0 } else { 1.0 - 5e-10 }, &grid), 0.0);
    assert_eq!(grid_minimizer(|x| if x < 1.5 { 1.0 } else { 1.0 - 2e-9 }, &grid), 2.0);
}
