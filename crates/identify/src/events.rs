//! What a rupture says of the law: the law's own condition for it, as a datum.
//!
//! A layer gives way when its elastic force reaches the puncture force `F (1 + s_F n)` or the tip its far face displaced by
//! `s_z n'`, whichever comes first, `n, n'` standard normal: two competing risks. The density of the instant `tau` is
//! `phi(u_F) u_F' Q(u_z) + phi(u_z) u_z' Q(u_F)` with `u_F = (f_K(tau)/F - 1)/s_F`, `u_z = (z(tau) - far)/s_z` and `Q` the
//! upper tail of the normal distribution. It is smooth where the maximum of both is not. `s_F^2 = sigma_F^2 +
//! (f_K' h/F)^2/12` and `s_z^2 = sigma_z^2 + (v h)^2/12` hold the scatter between insertions and what a sampling step `h`
//! leaves open.

use crate::model::Scatter;

/// A layer and one recording: how near it was to giving way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Event {
    /// Force beyond the puncture force at the instant, relative to it; minus infinity without a puncture force.
    pub force: f64,
    /// Position beyond the far face in m.
    pub place_m: f64,
    /// Change of `force` per s.
    pub force_rate: f64,
    /// Change of `place_m` per s.
    pub place_rate: f64,
    /// Elastic force in N.
    pub elastic_n: f64,
    /// Whether the layer ruptured.
    pub ruptured: bool,
    /// Time between samples in s.
    pub step_s: f64,
}

impl Event {
    /// Before any sample.
    pub const UNSEEN: Self = Self {
        force: f64::NEG_INFINITY,
        place_m: f64::NEG_INFINITY,
        force_rate: 0.0,
        place_rate: 0.0,
        elastic_n: 0.0,
        ruptured: false,
        step_s: 0.0,
    };

    /// Whether a puncture force is known.
    fn has_force(&self) -> bool {
        self.force.is_finite()
    }
}

/// Relative error of a force at rupture that no sampling explains: rounding and interpolation of the motion.
const FORCE_FLOOR: f64 = 1e-4;
/// The same of a position, in m.
const PLACE_FLOOR_M: f64 = 1.5e-6;
/// Slowest speed in m/s at which an instant tells a place.
const SLOWEST_MPS: f64 = 2e-5;

/// Rows of a least-squares problem that stand for one event, and its negative logarithmic likelihood.
#[derive(Clone, Copy, Debug, Default)]
pub struct Judged {
    /// Residuals: by force, by place, not yet by place, not yet by force.
    pub rows: [f64; 4],
    /// Nats.
    pub nats: f64,
    /// Square roots of the shares of force and place.
    pub shares: [f64; 2],
}

/// `-ln Q(u)`, `Q` the upper tail of the normal distribution.
fn survived(u: f64) -> f64 {
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

/// `-ln Q` as a residual: its square is twice the nats.
fn root(nats: f64) -> f64 {
    (2.0 * nats.max(0.0)).sqrt()
}

/// Standard deviations of force (relative) and place (m).
#[must_use]
pub fn spreads(event: &Event, scatter: &Scatter) -> (f64, f64) {
    const TWELFTH: f64 = 1.0 / 12.0;
    let force = event.force_rate * event.step_s;
    let place = event.place_rate * event.step_s;
    (
        (scatter.force.powi(2) + force * force * TWELFTH + FORCE_FLOOR * FORCE_FLOOR).sqrt(),
        (scatter.place_m.powi(2) + place * place * TWELFTH + PLACE_FLOOR_M * PLACE_FLOOR_M).sqrt(),
    )
}

/// Judges an event.
#[must_use]
pub fn judge(event: &Event, scatter: &Scatter) -> Judged {
    let (s_f, s_z) = spreads(event, scatter);
    let has_force = event.has_force();
    let (u_f, u_z) = (event.force / s_f, event.place_m.max(-1e3) / s_z);
    if !event.ruptured {
        let (by_force, by_place) = (if has_force { survived(u_f) } else { 0.0 }, survived(u_z));
        return Judged {
            rows: [0.0, 0.0, root(by_place), root(by_force)],
            nats: by_force + by_place,
            shares: [0.0; 2],
        };
    }
    let h = event.step_s.max(1e-6);
    let rate_f = event.force_rate.max(SLOWEST_MPS / 0.01);
    let rate_z = event.place_rate.max(SLOWEST_MPS);
    let b = ln_phi(u_z) + libm::log(rate_z * h / s_z) - if has_force { survived(u_f) } else { 0.0 };
    if !has_force {
        return Judged { rows: rows(0.0, u_z, [0.0, 1.0], false), nats: -b, shares: [0.0, 1.0] };
    }
    let a = ln_phi(u_f) + libm::log(rate_f * h / s_f) - survived(u_z);
    let most = a.max(b);
    let total = most + libm::log(libm::exp(a - most) + libm::exp(b - most));
    let shares = [libm::exp(0.5 * (a - total)), libm::exp(0.5 * (b - total))];
    Judged { rows: rows(u_f, u_z, shares, true), nats: -total, shares }
}

/// Rows of an event with the shares of the two risks and the spreads as `at` has them: for derivatives.
#[must_use]
pub fn rows_like(event: &Event, scatter: &Scatter, at: &Event) -> [f64; 4] {
    let (s_f, s_z) = spreads(at, scatter);
    let [w_f, w_z] = judge(at, scatter).shares;
    let has_force = at.has_force();
    let (u_f, u_z) = (event.force / s_f, event.place_m.max(-1e3) / s_z);
    if at.ruptured {
        rows(u_f, u_z, [w_f, w_z], has_force)
    } else {
        [0.0, 0.0, root(survived(u_z)), if has_force { root(survived(u_f)) } else { 0.0 }]
    }
}

fn rows(u_f: f64, u_z: f64, [w_f, w_z]: [f64; 2], has_force: bool) -> [f64; 4] {
    if has_force {
        [w_f * u_f, w_z * u_z, w_f * root(survived(u_z)), w_z * root(survived(u_f))]
    } else {
        [0.0, w_z * u_z, 0.0, 0.0]
    }
}

/// The scatter of force and place under which events are likeliest, by golden section in each, in turn.
#[must_use]
pub fn scatter_of(events: &[Event], start: &Scatter) -> Scatter {
    let mut best = *start;
    let nats =
        |s: &Scatter| -> f64 { events.iter().map(|e| judge(e, s).nats).sum::<f64>() + scatter_prior(s) };
    if events.is_empty() {
        return best;
    }
    for _ in 0..2 {
        best.force = smallest(|x| nats(&Scatter { force: x, ..best }), &FORCE_GRID);
        best.place_m = smallest(|x| nats(&Scatter { place_m: x, ..best }), &PLACE_GRID);
    }
    best
}

/// Scatter has to be asked for: half a nat per factor e above the smallest.
#[must_use]
pub fn scatter_prior(s: &Scatter) -> f64 {
    let of = |ratio: f64| 0.25 * libm::log(1.0 + ratio * ratio);
    of(s.force / 5e-4) + of(s.place_m / 5e-6)
}

/// Scatters of the force (relative) that are tried.
pub const FORCE_GRID: [f64; 13] =
    [0.0, 5e-4, 1e-3, 2e-3, 4e-3, 7e-3, 0.012, 0.02, 0.033, 0.055, 0.09, 0.15, 0.3];
const PLACE_GRID: [f64; 12] =
    [0.0, 5e-6, 1e-5, 2e-5, 4e-5, 8e-5, 1.6e-4, 3.2e-4, 6.4e-4, 1.3e-3, 2.5e-3, 5e-3];

fn smallest(nats: impl Fn(f64) -> f64, grid: &[f64]) -> f64 {
    let mut best = (f64::INFINITY, 0.0);
    for x in grid {
        let value = nats(*x);
        if value < best.0 - 1e-9 {
            best = (value, *x);
        }
    }
    best.1
}
