//! Likelihood of a rupture time from the law's own rupture condition.
//!
//! A layer ruptures when its elastic force reaches the puncture force `F (1 + s_F n)` or the tip reaches the
//! far interface displaced by
//! `s_z n'`, whichever comes first, with `n, n'` standard normal: two competing risks. The density of the rupture time `tau` is
//! `phi(u_F) u_F' Q(u_z) + phi(u_z) u_z' Q(u_F)` with `u_F = (f_K(tau)/F - 1)/s_F`, `u_z = (z(tau) - far)/s_z` and the normal upper tail
//! `Q`; unlike the maximum of both risks it is smooth. `s_F^2 = sigma_F^2 + (f_K' h/F)^2/12` and `s_z^2 = sigma_z^2 + (v h)^2/12`
//! combine the scatter between recordings with the uniform timing error of a sampling interval `h`.

use crate::model::Scatter;

/// State of a layer in one recording, relative to its rupture conditions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RuptureEvent {
    /// Elastic force over the puncture force, minus one, at the rupture time; minus infinity without a puncture
    /// force.
    pub force_excess: f64,
    /// Position beyond the far interface in m.
    pub depth_excess_m: f64,
    /// Rate of `force_excess` in 1/s.
    pub force_excess_rate: f64,
    /// Rate of `depth_excess_m` in m/s.
    pub depth_rate_mps: f64,
    /// Elastic force in N.
    pub elastic_n: f64,
    /// Whether the layer ruptured.
    pub ruptured: bool,
    /// Sampling interval in s.
    pub sample_step_s: f64,
}

impl RuptureEvent {
    /// State before the first sample.
    pub const INITIAL: Self = Self {
        force_excess: f64::NEG_INFINITY,
        depth_excess_m: f64::NEG_INFINITY,
        force_excess_rate: 0.0,
        depth_rate_mps: 0.0,
        elastic_n: 0.0,
        ruptured: false,
        sample_step_s: 0.0,
    };

    /// Whether the layer has a puncture force.
    fn has_puncture_force(&self) -> bool {
        self.force_excess.is_finite()
    }
}

/// Relative error of a force at rupture from rounding and interpolation of the motion.
const MIN_FORCE_SD: f64 = 1e-4;
/// The same for a position, in m.
const MIN_DEPTH_SD_M: f64 = 1.5e-6;
/// Lowest velocity in m/s at which a rupture time determines a depth.
const MIN_RATE_MPS: f64 = 2e-5;

/// Likelihood of one rupture, also as rows of a least-squares problem.
#[derive(Clone, Copy, Debug, Default)]
pub struct RuptureLikelihood {
    /// Residuals: by force, by depth, not yet by depth, not yet by force.
    pub rows: [f64; 4],
    /// Negative log likelihood in nats.
    pub nats: f64,
    /// Square roots of the shares of force and depth.
    pub shares: [f64; 2],
}

/// `-ln Q(u)` with the upper tail `Q` of the normal distribution.
fn neg_ln_survival(u: f64) -> f64 {
    if u < -8.0 {
        return 0.0;
    }
    if u > 25.0 {
        // Q(u) ~ phi(u)/u.
        return 0.5 * u * u + libm::log(u) + 0.918_938_533_204_672_7;
    }
    -libm::log(stylet_stats::normal::sf(u))
}

fn ln_phi(u: f64) -> f64 {
    -0.5 * u * u - 0.918_938_533_204_672_7
}

/// Converts nats to a residual whose square is twice the nats.
fn deviance_residual(nats: f64) -> f64 {
    (2.0 * nats.max(0.0)).sqrt()
}

/// Standard deviations of force (relative) and depth (m) at rupture.
#[must_use]
pub fn rupture_sds(event: &RuptureEvent, scatter: &Scatter) -> (f64, f64) {
    const TWELFTH: f64 = 1.0 / 12.0;
    let force = event.force_excess_rate * event.sample_step_s;
    let place = event.depth_rate_mps * event.sample_step_s;
    (
        (scatter.rupture_force.powi(2) + force * force * TWELFTH + MIN_FORCE_SD * MIN_FORCE_SD).sqrt(),
        (scatter.rupture_depth_m.powi(2) + place * place * TWELFTH + MIN_DEPTH_SD_M * MIN_DEPTH_SD_M).sqrt(),
    )
}

/// Evaluates the likelihood of a rupture, or of its absence.
#[must_use]
pub fn evaluate_rupture(event: &RuptureEvent, scatter: &Scatter) -> RuptureLikelihood {
    let (s_f, s_z) = rupture_sds(event, scatter);
    let has_force = event.has_puncture_force();
    let (u_f, u_z) = (event.force_excess / s_f, event.depth_excess_m.max(-1e3) / s_z);
    if !event.ruptured {
        let (by_force, by_place) = (if has_force { neg_ln_survival(u_f) } else { 0.0 }, neg_ln_survival(u_z));
        return RuptureLikelihood {
            rows: [0.0, 0.0, deviance_residual(by_place), deviance_residual(by_force)],
            nats: by_force + by_place,
            shares: [0.0; 2],
        };
    }
    let h = event.sample_step_s.max(1e-6);
    let rate_f = event.force_excess_rate.max(MIN_RATE_MPS / 0.01);
    let rate_z = event.depth_rate_mps.max(MIN_RATE_MPS);
    let b = ln_phi(u_z) + libm::log(rate_z * h / s_z) - if has_force { neg_ln_survival(u_f) } else { 0.0 };
    if !has_force {
        return RuptureLikelihood { rows: rows(0.0, u_z, [0.0, 1.0], false), nats: -b, shares: [0.0, 1.0] };
    }
    let a = ln_phi(u_f) + libm::log(rate_f * h / s_f) - neg_ln_survival(u_z);
    let most = a.max(b);
    let total = most + libm::log(libm::exp(a - most) + libm::exp(b - most));
    let shares = [libm::exp(0.5 * (a - total)), libm::exp(0.5 * (b - total))];
    RuptureLikelihood { rows: rows(u_f, u_z, shares, true), nats: -total, shares }
}

/// Residual rows of `event` with the risk shares and standard deviations of `at`: for derivatives.
#[must_use]
pub fn rupture_rows_at(event: &RuptureEvent, scatter: &Scatter, at: &RuptureEvent) -> [f64; 4] {
    let (s_f, s_z) = rupture_sds(at, scatter);
    let [w_f, w_z] = evaluate_rupture(at, scatter).shares;
    let has_force = at.has_puncture_force();
    let (u_f, u_z) = (event.force_excess / s_f, event.depth_excess_m.max(-1e3) / s_z);
    if at.ruptured {
        rows(u_f, u_z, [w_f, w_z], has_force)
    } else {
        [
            0.0,
            0.0,
            deviance_residual(neg_ln_survival(u_z)),
            if has_force { deviance_residual(neg_ln_survival(u_f)) } else { 0.0 },
        ]
    }
}

fn rows(u_f: f64, u_z: f64, [w_f, w_z]: [f64; 2], has_force: bool) -> [f64; 4] {
    if has_force {
        [
            w_f * u_f,
            w_z * u_z,
            w_f * deviance_residual(neg_ln_survival(u_z)),
            w_z * deviance_residual(neg_ln_survival(u_f)),
        ]
    } else {
        [0.0, w_z * u_z, 0.0, 0.0]
    }
}

/// Most likely scatter of force and depth, by alternating grid searches.
#[must_use]
pub fn estimate_rupture_scatter(events: &[RuptureEvent], start: &Scatter) -> Scatter {
    let mut best = *start;
    let nats = |s: &Scatter| -> f64 {
        events.iter().map(|e| evaluate_rupture(e, s).nats).sum::<f64>() + scatter_prior_nats(s)
    };
    if events.is_empty() {
        return best;
    }
    for _ in 0..2 {
        best.rupture_force =
            grid_minimizer(|x| nats(&Scatter { rupture_force: x, ..best }), &FORCE_SCATTER_GRID);
        best.rupture_depth_m =
            grid_minimizer(|x| nats(&Scatter { rupture_depth_m: x, ..best }), &DEPTH_SCATTER_GRID_M);
    }
    best
}

/// Prior on the scatter: half a nat per factor e above the smallest.
#[must_use]
pub fn scatter_prior_nats(s: &Scatter) -> f64 {
    let of = |ratio: f64| 0.25 * libm::log(1.0 + ratio * ratio);
    of(s.rupture_force / 5e-4) + of(s.rupture_depth_m / 5e-6)
}

/// Trial scatters of the force (relative).
pub const FORCE_SCATTER_GRID: [f64; 13] =
    [0.0, 5e-4, 1e-3, 2e-3, 4e-3, 7e-3, 0.012, 0.02, 0.033, 0.055, 0.09, 0.15, 0.3];
const DEPTH_SCATTER_GRID_M: [f64; 12] =
    [0.0, 5e-6, 1e-5, 2e-5, 4e-5, 8e-5, 1.6e-4, 3.2e-4, 6.4e-4, 1.3e-3, 2.5e-3, 5e-3];

fn grid_minimizer(nats: impl Fn(f64) -> f64, grid: &[f64]) -> f64 {
    let mut best = (f64::INFINITY, 0.0);
    for x in grid {
        let value = nats(*x);
        if value < best.0 - 1e-9 {
            best = (value, *x);
        }
    }
    best.1
}

#[cfg(test)]
mod tests {
    use super::{
        RuptureEvent, estimate_rupture_scatter, evaluate_rupture, grid_minimizer, ln_phi, neg_ln_survival,
        rupture_rows_at, rupture_sds, scatter_prior_nats,
    };
    use crate::model::Scatter;
    use stylet_stats::normal;

    fn scatter(force: f64, place_m: f64) -> Scatter {
        Scatter { rupture_force: force, rupture_depth_m: place_m, ..Scatter::default() }
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

    fn near(told: f64, wanted: f64) {
        assert!((told - wanted).abs() <= 1e-9 * wanted.abs().max(1e-12), "{told} for {wanted}");
    }

    #[test]
    fn rupture_sds_combine_scatter_sampling_and_rounding() {
        let (force, place) = rupture_sds(&BOTH, &scatter(0.02, 3e-5));
        near(force, (0.02_f64 * 0.02 + 0.0035 * 0.0035 / 12.0 + 1e-8).sqrt());
        near(place, (3e-5_f64 * 3e-5 + 2.5e-5 * 2.5e-5 / 12.0 + 2.25e-12).sqrt());
        let (force, place) = rupture_sds(&RuptureEvent::INITIAL, &scatter(0.0, 0.0));
        near(force, 1e-4);
        near(place, 1.5e-6);
    }

    #[test]
    fn survival_is_the_upper_tail_of_the_normal_distribution() {
        for u in [-8.0, -7.5, -3.1, -0.2, 0.0, 0.7, 2.4, 8.3, 19.7, 25.0] {
            near(neg_ln_survival(u), -libm::log(normal::sf(u)));
        }
        assert_eq!(neg_ln_survival(-8.1), 0.0);
        // Beyond by the first term of the asymptotic series; the second is smaller by the square of the
        // deviate.
        for u in [25.1, 27.3, 31.0] {
            near(neg_ln_survival(u), 0.5 * u * u + libm::log(u * core::f64::consts::TAU.sqrt()));
            assert!((neg_ln_survival(u) + libm::log(normal::sf(u))).abs() < 1.1 / (u * u), "{u}");
        }
        near(ln_phi(1.7), normal::ln_pdf(1.7));
        near(ln_phi(0.0), -0.5 * libm::log(core::f64::consts::TAU));
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
            let density = |k: usize| {
                libm::exp(-evaluate_rupture(&at(-0.8 + (k as f64 + 0.5) * dt, true), &s).nats) / 0.005
            };
            let until: f64 = (0..steps).map(density).sum::<f64>() * dt;
            let later = libm::exp(-evaluate_rupture(&at(-0.8 + steps as f64 * dt, false), &s).nats);
            assert!((until + later - 1.0).abs() < 1e-6, "{until} and {later} until {end}");
        }
        // Without a puncture force: by the far interface only.
        let alone =
            |t: f64, ruptured: bool| RuptureEvent { force_excess: f64::NEG_INFINITY, ..at(t, ruptured) };
        let steps = 8600;
        let density = |k: usize| {
            libm::exp(-evaluate_rupture(&alone(-0.8 + (k as f64 + 0.5) * dt, true), &s).nats) / 0.005
        };
        let until: f64 = (0..steps).map(density).sum::<f64>() * dt;
        let later = libm::exp(-evaluate_rupture(&alone(-0.8 + steps as f64 * dt, false), &s).nats);
        assert!((until + later - 1.0).abs() < 1e-6 && later > 0.3, "{until} and {later}");
    }

    #[test]
    fn residual_rows_are_deviates_weighted_by_risk_shares() {
        let s = scatter(0.02, 3e-4);
        let told = evaluate_rupture(&BOTH, &s);
        let (s_f, s_z) = rupture_sds(&BOTH, &s);
        let (u_f, u_z) = (0.03 / s_f, -4e-4 / s_z);
        let force = normal::ln_pdf(u_f) + libm::log(0.7 * 0.005 / s_f) + libm::log(normal::sf(u_z));
        let place = normal::ln_pdf(u_z) + libm::log(0.005 * 0.005 / s_z) + libm::log(normal::sf(u_f));
        let (force, place) = (libm::exp(force), libm::exp(place));
        near(told.nats, -libm::log(force + place));
        let shares = [force / (force + place), place / (force + place)].map(f64::sqrt);
        near(told.shares[0], shares[0]);
        near(told.shares[1], shares[1]);
        let tail = |u: f64| (-2.0 * libm::log(normal::sf(u))).sqrt();
        for (row, wanted) in told.rows.into_iter().zip([
            shares[0] * u_f,
            shares[1] * u_z,
            shares[0] * tail(u_z),
            shares[1] * tail(u_f),
        ]) {
            near(row, wanted);
        }
        assert_eq!(rupture_rows_at(&BOTH, &s, &BOTH), told.rows);
        // A layer that holds: neither by force nor by depth so far.
        let holds = RuptureEvent { ruptured: false, ..BOTH };
        let told = evaluate_rupture(&holds, &s);
        near(told.nats, -libm::log(normal::sf(u_f)) - libm::log(normal::sf(u_z)));
        assert_eq!(told.rows[..2], [0.0, 0.0]);
        near(told.rows[2], tail(u_z));
        near(told.rows[3], tail(u_f));
        assert_eq!(rupture_rows_at(&holds, &s, &holds), told.rows);
        // Without a puncture force only the depth counts.
        let plain = RuptureEvent { force_excess: f64::NEG_INFINITY, ..BOTH };
        let told = evaluate_rupture(&plain, &s);
        assert_eq!((told.shares, told.rows[0], told.rows[2], told.rows[3]), ([0.0, 1.0], 0.0, 0.0, 0.0));
        near(told.rows[1], u_z);
        near(told.nats, -normal::ln_pdf(u_z) - libm::log(0.005 * 0.005 / s_z));
        assert_eq!(rupture_rows_at(&plain, &s, &plain), told.rows);
        let plain = RuptureEvent { ruptured: false, ..plain };
        near(evaluate_rupture(&plain, &s).nats, -libm::log(normal::sf(u_z)));
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
        let told = rupture_rows_at(&moved, &s, &BOTH);
        near(told[0], shares[0] * 0.05 / s_f);
        near(told[1], shares[1] * -2e-4 / s_z);
        near(told[2], shares[0] * (2.0 * neg_ln_survival(-2e-4 / s_z)).sqrt());
        near(told[3], shares[1] * (2.0 * neg_ln_survival(0.05 / s_f)).sqrt());
        let far = RuptureEvent { depth_excess_m: f64::NEG_INFINITY, ..moved };
        near(rupture_rows_at(&far, &s, &BOTH)[1], shares[1] * -1e3 / s_z);
        near(
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
        near(rates(0.0, 0.0), rates(2e-3, 2e-5));
        assert!(rates(2.1e-3, 2e-5) < rates(2e-3, 2e-5) && rates(2e-3, 2.1e-5) < rates(2e-3, 2e-5));
        // A zero sampling interval counts as a microsecond.
        near(
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
        near(scatter_prior_nats(&scatter(5e-4, 0.0)), 0.25 * libm::log(2.0));
        near(scatter_prior_nats(&scatter(0.0, 1.5e-5)), 0.25 * libm::log(10.0));
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
            let told = estimate_rupture_scatter(&events, &scatter(0.3, 1e-3));
            assert_eq!((told.rupture_force, told.rupture_depth_m), (sd, 0.0), "{sd}");
        }
        for sd in [4e-5, 3.2e-4] {
            let of = |u: f64| RuptureEvent {
                force_excess: f64::NEG_INFINITY,
                depth_excess_m: u * sd * 1.1,
                depth_rate_mps: 0.001,
                ..BOTH
            };
            let events = deviates.map(of);
            let told = estimate_rupture_scatter(&events, &scatter(0.3, 1e-3));
            assert_eq!((told.rupture_force, told.rupture_depth_m), (0.0, sd), "{sd}");
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
}
