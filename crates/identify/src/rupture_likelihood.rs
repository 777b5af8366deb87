//! Likelihood of a rupture time under the rupture condition of the model.
//!
//! A layer ruptures when its elastic force reaches the puncture force `F (1 + s_F n)` or the tip reaches the far interface displaced by
//! `s_z n'`, whichever comes first, with `n, n'` standard normal: two competing risks. With the upper tail `Q` of the normal distribution,
//! `u_F = (f_K(tau)/F - 1)/s_F` and `u_z = (z(tau) - far)/s_z`, the density of the rupture time `tau` is
//! `phi(u_F) u_F' Q(u_z) + phi(u_z) u_z' Q(u_F)`. The standard deviations `s_F^2 = sigma_F^2 + (f_K' h/F)^2/12` and
//! `s_z^2 = sigma_z^2 + (v h)^2/12` combine the scatter between recordings with the uniform timing error of a sampling interval `h`.

use crate::model::Scatter;

/// State of a layer in one recording, relative to its rupture conditions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RuptureEvent {
    /// Elastic force over puncture force minus one, at the rupture time; minus infinity without a puncture force.
    pub force_excess: f64,
    /// Tip position relative to the far interface in m.
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

/// Relative error of the force at rupture from rounding and interpolation of the motion.
const MIN_FORCE_SD: f64 = 1e-4;
/// Standard deviation (m) of the position at rupture from rounding and interpolation of the motion.
const MIN_DEPTH_SD_M: f64 = 1.5e-6;
/// Lower bound of the tip velocity (m/s) in the density; below it, a rupture time does not determine a depth.
const MIN_RATE_MPS: f64 = 2e-5;

/// Likelihood of one rupture, and the same as rows of a least-squares problem.
#[derive(Clone, Copy, Debug, Default)]
pub struct RuptureLikelihood {
    /// Residuals: rupture by force, by depth; survival by depth, by force.
    pub rows: [f64; 4],
    /// Negative log likelihood in nats.
    pub nats: f64,
    /// Square roots of the probabilities that the rupture is by force and by depth.
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
    /// Variance of a uniform distribution of unit width.
    const TWELFTH: f64 = 1.0 / 12.0;
    let force = event.force_excess_rate * event.sample_step_s;
    let place = event.depth_rate_mps * event.sample_step_s;
    (
        (scatter.rupture_force.powi(2) + force * force * TWELFTH + MIN_FORCE_SD * MIN_FORCE_SD).sqrt(),
        (scatter.rupture_depth_m.powi(2) + place * place * TWELFTH + MIN_DEPTH_SD_M * MIN_DEPTH_SD_M).sqrt(),
    )
}

/// Evaluates the likelihood of a rupture, or of its absence until the end of the recording.
#[must_use]
pub fn evaluate_rupture(event: &RuptureEvent, scatter: &Scatter) -> RuptureLikelihood {
    let (s_f, s_z) = rupture_sds(event, scatter);
    let has_force = event.has_puncture_force();
    let (u_f, u_z) = (event.force_excess / s_f, event.depth_excess_m.max(-1e3) / s_z);
    if !event.ruptured {
        let by_force = if has_force { neg_ln_survival(u_f) } else { 0.0 };
        let shares = [0.0; 2];
        let nats = by_force + neg_ln_survival(u_z);
        return RuptureLikelihood { rows: rows(event, u_f, u_z, shares), nats, shares };
    }
    let h = event.sample_step_s.max(1e-6);
    let rate_f = event.force_excess_rate.max(MIN_RATE_MPS / 0.01);
    let rate_z = event.depth_rate_mps.max(MIN_RATE_MPS);
    let b = ln_phi(u_z) + libm::log(rate_z * h / s_z) - if has_force { neg_ln_survival(u_f) } else { 0.0 };
    if !has_force {
        let shares = [0.0, 1.0];
        return RuptureLikelihood { rows: rows(event, u_f, u_z, shares), nats: -b, shares };
    }
    let a = ln_phi(u_f) + libm::log(rate_f * h / s_f) - neg_ln_survival(u_z);
    let most = a.max(b);
    let total = most + libm::log(libm::exp(a - most) + libm::exp(b - most));
    let shares = [libm::exp(0.5 * (a - total)), libm::exp(0.5 * (b - total))];
    RuptureLikelihood { rows: rows(event, u_f, u_z, shares), nats: -total, shares }
}

/// Residual rows of `event` with the risk shares and standard deviations of `at` held constant, for derivatives.
pub(crate) fn rupture_rows_at(event: &RuptureEvent, scatter: &Scatter, at: &RuptureEvent) -> [f64; 4] {
    let (s_f, s_z) = rupture_sds(at, scatter);
    let (u_f, u_z) = (event.force_excess / s_f, event.depth_excess_m.max(-1e3) / s_z);
    rows(at, u_f, u_z, evaluate_rupture(at, scatter).shares)
}

/// Residual rows for the standardised excesses, with the risks of `at` and their shares.
fn rows(at: &RuptureEvent, u_f: f64, u_z: f64, [w_f, w_z]: [f64; 2]) -> [f64; 4] {
    let survival = |u: f64| deviance_residual(neg_ln_survival(u));
    match (at.ruptured, at.has_puncture_force()) {
        (true, true) => [w_f * u_f, w_z * u_z, w_f * survival(u_z), w_z * survival(u_f)],
        (true, false) => [0.0, w_z * u_z, 0.0, 0.0],
        (false, true) => [0.0, 0.0, survival(u_z), survival(u_f)],
        (false, false) => [0.0, 0.0, survival(u_z), 0.0],
    }
}

/// Scatter of force and depth with the highest posterior, by alternating grid searches.
pub(crate) fn estimate_rupture_scatter(events: &[RuptureEvent], start: &Scatter) -> Scatter {
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

/// Prior on the scatter: about half a nat per factor e, above 5e-4 (force, relative) and 5e-6 m (depth).
#[must_use]
pub fn scatter_prior_nats(s: &Scatter) -> f64 {
    let of = |ratio: f64| 0.25 * libm::log(1.0 + ratio * ratio);
    of(s.rupture_force / 5e-4) + of(s.rupture_depth_m / 5e-6)
}

/// Trial values of the relative scatter of the force at rupture; spaced by about a factor of two.
pub const FORCE_SCATTER_GRID: [f64; 13] =
    [0.0, 5e-4, 1e-3, 2e-3, 4e-3, 7e-3, 0.012, 0.02, 0.033, 0.055, 0.09, 0.15, 0.3];
/// Trial values of the scatter of the depth at rupture in m; spaced by about a factor of two.
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
mod tests;
