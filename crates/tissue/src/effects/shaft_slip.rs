use super::parameters::{LAYER, ParameterVector, layer_mut};
use crate::chain_stage::ChainStage;
use crate::effect::{Effect, EffectState, TipState, lag_weights, sgn};
use crate::effect_info::{EffectInfo, ParameterError, ParameterInfo};
use crate::layer_geometry::Slab;

/// Reference speed `v0` of the slip in m/s (1 mm/s).
const V0_MPS: f64 = 1e-3;
/// Speed in m/s below which the contact is at rest (0.1 mm/s).
const REST_MPS: f64 = 1e-4;
/// Travel in m over which the contact adapts to another speed (1 mm, a few contact widths: Dieterich 1979).
const RENEWAL_M: f64 = 1e-3;
/// Travel in m over which the contact ends at the release depth (0.2 mm, the edge of a tip).
const EDGE_M: f64 = 2e-4;
/// Longest travel in m of one implicit step: a tenth of the millimetres over which the contact loads.
const SUBSTEP_M: f64 = 1.5e-4;
/// Most implicit steps per sample.
const MAX_SUBSTEPS: f64 = 64.0;
/// Least share of the holding force that wear leaves.
const MIN_HOLD_SHARE: f64 = 0.2;
/// Smallest holding force in N.
const MIN_HOLD_N: f64 = 1e-3;
/// Most Newton iterations; two or three are typical.
const MAX_ITERATIONS: usize = 80;

/// A layer that adheres to the shaft, deforms, relaxes and slips by a power of the force.
///
/// `w` is the displacement of the layer's tissue from rest, positive when pushed in. Its force is that of a curved spring
/// with two relaxing terms,
///
/// `E = K w + b w |w|`, `q_j' = (g_j E - q_j)/tau_j`, `F = E - q_1 - q_2`.
///
/// - *Before the rupture* `w = max(0, z - s_i)`: `F` is the layer's elastic force.
/// - *At the rupture* `w` falls back so that `F = r C (v/v0)^a`, or stays when `F` is less; the `q_j` stay.
/// - *After the rupture* the shaft drags the tissue along and slips: `w' = z' - v0 sgn(F) (abs(F)/L)^m`, `v0` = 1 mm/s,
///   `L = C (v/v0)^a max(0.2, 1 - d s)` when pushed (`s`: slipped travel; `v`: speed, followed over a millimetre of travel
///   and kept at rest) and `L = S (v/v0)^a` when pulled.
///
/// Far below `L` nothing slips, which is presliding; steady sliding at speed `v` takes `F = L (v/v0)^(1/m)`: a large `m`
/// is dry friction, `m = 1` viscous, and the plateau has the net exponent `a + 1/m`. In a hold `F` creeps down by slip and
/// relaxation. When the tip comes back to where the layer releases the shaft (its front face, or `release_depth`), `F`
/// ends within 0.2 mm. The layer's viscous friction `b_i l_i v` is replaced.
///
/// Integrated implicitly, in steps of at most 0.15 mm, exact for steady sliding and for the relaxation
/// (`crates/tissue/tests/shaft_slip.rs`). `m`, `b`, `g_j`, `tau_j` have no effect without `C` and `S`.
///
/// Inactive: `C = 0` and `S = 0`. Signature: after a stop the force falls and then stays; after a reversal it follows travel over
/// millimetres; the sliding plateau hardly depends on speed. Source: power-law creep of dragged contacts (Persson 2000, section
/// 12; Norton's law) with Maxwell relaxation; fitted to insertions into skin and muscle phantoms.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct ShaftSlip {
    /// Layer `i`, 1-based; without such a layer the effect is inactive.
    pub layer: usize,
    /// Holding force `C` in N when pushed at 1 mm/s, zero or positive. Inactive: 0, with `pull_n` 0.
    pub push_n: f64,
    /// Holding force `S` in N when pulled at 1 mm/s, zero or positive.
    pub pull_n: f64,
    /// Share `r` of `push_n` right after the rupture, 0 to 2.
    pub retained_share: f64,
    /// Exponent `m` of the slip, 1 (viscous) to 200 (dry).
    pub exponent: f64,
    /// Wear `d`, relative loss of holding force per metre of slip, 0 to 1e4 1/m.
    pub wear_per_m: f64,
    /// Exponent `a` of the speed in the holding forces, -2 to 2; negative: weaker at higher speed.
    pub rate: f64,
    /// Curvature `b` of the spring in N/m², 0 to 1e9.
    pub curvature_n_per_m2: f64,
    /// Shares `g_j` of the spring's force that relax, each 0 to 1, together at most 1.
    pub fractions: [f64; 2],
    /// Time constants of these shares, `tau_j` in s, 0.001 to 10 000.
    pub time_constants_s: [f64; 2],
}

impl Default for ShaftSlip {
    /// The inactive effect.
    fn default() -> Self {
        Self {
            layer: 1,
            push_n: 0.0,
            pull_n: 0.0,
            retained_share: 1.0,
            exponent: 10.0,
            wear_per_m: 0.0,
            rate: 0.0,
            curvature_n_per_m2: 0.0,
            fractions: [0.0; 2],
            time_constants_s: [1.0, 10.0],
        }
    }
}

const FRACTION: ParameterInfo = ParameterInfo::shape("fractions.0", "", "share of the force that relaxes")
    .allowed(0.0, 1.0)
    .search(0.2, 0.0, 0.9);
/// Prior of `rate`: the plateau of three needles in a phantom is a power of speed with `rate + 1/exponent` = -0.13 to 0.14,
/// for exponents of 8 to 12.
const RATE_PRIOR: (f64, f64) = (-0.1, 0.1);
/// Index of the second relaxing share among the parameters.
const SECOND: usize = 9;
const TIME: ParameterInfo = ParameterInfo::shape("time_constants_s.0", "s", "its time constant")
    .allowed(1e-3, 1e4)
    .inactive(1.0)
    .search(1.0, 0.1, 6.0)
    .log();

static INFO: EffectInfo = EffectInfo {
    id: "shaft_slip",
    equation: "F = E - q1 - q2, E = K w + b w|w|, w' = z' - v0 sgn(F) (|F|/L)^m once broken, w = z - s_i before; F = r C at the rupture",
    source: "Power-law creep of dragged contacts (Persson 2000) with Maxwell relaxation; measured skin and muscle phantoms",
    signature: "A flat hold after a fast first fall, a reversal that takes millimetres, a plateau that hardly depends on speed.",
    stage: ChainStage::Friction,
    parameters: &[
        LAYER,
        ParameterInfo::strength("push_n", "N", "holding force when pushed at 1 mm/s").search(2.0, 0.05, 8.0),
        ParameterInfo::strength("pull_n", "N", "holding force when pulled at 1 mm/s").search(1.0, 0.05, 8.0),
        ParameterInfo::shape("retained_share", "", "share of the holding force right after the rupture")
            .allowed(0.0, 2.0)
            .inactive(1.0)
            .search(0.8, 0.0, 1.5),
        ParameterInfo::shape("exponent", "", "exponent of the slip in the force")
            .allowed(1.0, 200.0)
            .inactive(10.0)
            .search(10.0, 2.0, 30.0)
            .log(),
        ParameterInfo::shape("wear_per_m", "1/m", "relative loss of holding force per metre of slip")
            .allowed(0.0, 1e4)
            .search(50.0, 0.0, 400.0),
        ParameterInfo::shape("rate", "", "exponent of the speed in the holding forces")
            .allowed(-2.0, 2.0)
            .search(0.0, -0.5, 0.5)
            .measured_prior(RATE_PRIOR.0, RATE_PRIOR.1),
        ParameterInfo::shape("curvature_n_per_m2", "N/m2", "curvature of the spring")
            .allowed(0.0, 1e9)
            .search(3e4, 0.0, 3e5),
        FRACTION,
        ParameterInfo { path: "fractions.1", ..FRACTION },
        TIME,
        ParameterInfo { path: "time_constants_s.1", ..TIME }.inactive(10.0).search(10.0, 5.0, 60.0),
    ],
    ..EffectInfo::DEFAULTS
};

impl ParameterVector for ShaftSlip {
    fn values(&self) -> alloc::vec::Vec<f64> {
        let ([g1, g2], [t1, t2]) = (self.fractions, self.time_constants_s);
        alloc::vec![
            self.layer as f64,
            self.push_n,
            self.pull_n,
            self.retained_share,
            self.exponent,
            self.wear_per_m,
            self.rate,
            self.curvature_n_per_m2,
            g1,
            g2,
            t1,
            t2
        ]
    }
    fn from_values(values: &[f64]) -> Option<Self> {
        let [
            layer,
            push_n,
            pull_n,
            retained_share,
            exponent,
            wear_per_m,
            rate,
            curvature_n_per_m2,
            g1,
            g2,
            t1,
            t2,
        ] = *values
        else {
            return None;
        };
        let layer = libm::round(layer) as usize; // saturates, and NaN is zero, which is no layer
        let (fractions, time_constants_s) = ([g1, g2], [t1, t2]);
        Some(Self {
            layer,
            push_n,
            pull_n,
            retained_share,
            exponent,
            wear_per_m,
            rate,
            curvature_n_per_m2,
            fractions,
            time_constants_s,
        })
    }
    /// The second relaxing share relative to the rest after the first, so that both may be anywhere in 0 to 1.
    fn coordinates(&self) -> alloc::vec::Vec<f64> {
        let mut out = self.values();
        let left = 1.0 - self.fractions[0];
        out[SECOND] = if left > 0.0 { (self.fractions[1] / left).min(1.0) } else { 0.0 };
        out
    }
    fn from_coordinates(coordinates: &[f64]) -> Option<Self> {
        let mut out = Self::from_values(coordinates)?;
        out.fractions[1] *= 1.0 - out.fractions[0];
        Some(out)
    }
    fn check_together(&self) -> Result<(), ParameterError> {
        let [first, second] = self.fractions;
        if first + second > 1.0 {
            let allowed = (0.0, 1.0 - first);
            return Err(ParameterError { effect: INFO.id, path: "fractions.1", value: second, allowed });
        }
        Ok(())
    }
}

/// Index of the speed in the state.
const SPEED_INDEX: usize = 7;

/// Lets the speed of the contact follow that of the tip over the travel [`RENEWAL_M`].
fn follow_speed(contact_mps: &mut f64, tip: &TipState) {
    let now = tip.v_mps.abs();
    if *contact_mps <= 0.0 {
        *contact_mps = now;
    } else if now > REST_MPS {
        let share = -libm::expm1(-tip.dz_m.abs() / RENEWAL_M);
        *contact_mps *= libm::exp(share * libm::log(now / *contact_mps));
    }
}

/// State of the contact, in the order of [`EffectState`].
#[derive(Clone, Copy)]
struct Contact {
    /// Displacement in m.
    w_m: f64,
    /// Relaxed parts `q_j` of the force in N.
    q_n: [f64; 2],
    /// Spring force in N.
    spring_n: f64,
    /// Slipped travel while pushed, in m.
    slipped_m: f64,
    /// Force in N after the rupture.
    fall_n: f64,
    /// Whether the layer ruptured in this step, so that `fall_n` applies.
    ruptured: bool,
    /// Speed of the last motion in m/s.
    speed_mps: f64,
}

impl Contact {
    fn of(state: &EffectState) -> Self {
        let [w_m, q1, q2, spring_n, slipped_m, fall_n, ruptured, speed_mps] = *state;
        Self { w_m, q_n: [q1, q2], spring_n, slipped_m, fall_n, ruptured: ruptured != 0.0, speed_mps }
    }
    fn store(self, state: &mut EffectState) {
        *state = self.state();
    }
    fn state(self) -> EffectState {
        let ruptured = if self.ruptured { 1.0 } else { 0.0 };
        let [q1, q2] = self.q_n;
        [self.w_m, q1, q2, self.spring_n, self.slipped_m, self.fall_n, ruptured, self.speed_mps]
    }
}

/// The spring of a layer: `K w + b w |w|`.
#[derive(Clone, Copy)]
struct Spring {
    k_n_per_m: f64,
    b_n_per_m2: f64,
}

impl Spring {
    fn force(self, w: f64) -> f64 {
        w * (self.k_n_per_m + self.b_n_per_m2 * w.abs())
    }
    fn slope(self, w: f64) -> f64 {
        self.k_n_per_m + 2.0 * self.b_n_per_m2 * w.abs()
    }
    /// Displacement at a force; zero without a spring.
    fn at(self, force_n: f64) -> f64 {
        let (k, b, f) = (self.k_n_per_m, self.b_n_per_m2, force_n.abs());
        let root = k + libm::sqrt(k * k + 4.0 * b * f);
        if root > 0.0 { 2.0 * force_n / root } else { 0.0 }
    }
}

impl ShaftSlip {
    /// The factor `(v/v0)^a` on the holding forces.
    fn speed_factor(&self, speed_mps: f64) -> f64 {
        libm::exp(self.rate * libm::log(speed_mps.max(REST_MPS) / V0_MPS))
    }

    /// `(keep, ramp)` of both terms for a step; see [`lag_weights`].
    fn weights(&self, dt_s: f64) -> [(f64, f64); 2] {
        core::array::from_fn(|j| {
            if self.fractions[j] == 0.0 { (1.0, 0.0) } else { lag_weights(dt_s, self.time_constants_s[j]) }
        })
    }

    /// The relaxed parts at the end of a step in which the spring's force goes from `before` to `now`.
    fn relaxed(&self, q_n: [f64; 2], weights: [(f64, f64); 2], before: f64, now: f64) -> [f64; 2] {
        core::array::from_fn(|j| {
            let (g, (keep, ramp)) = (self.fractions[j], weights[j]);
            let end = g * before;
            end + keep * (q_n[j] - end) + ramp * g * (now - before)
        })
    }

    /// One implicit step after the rupture.
    fn implicit_step(&self, c: &mut Contact, spring: Spring, dt_s: f64, dz_m: f64, weights: [(f64, f64); 2]) {
        let speed_factor = self.speed_factor(c.speed_mps);
        let push = (self.push_n * speed_factor * (1.0 - self.wear_per_m * c.slipped_m).max(MIN_HOLD_SHARE))
            .max(MIN_HOLD_N);
        let pull = (self.pull_n * speed_factor).max(MIN_HOLD_N);
        let at_rest = self.relaxed(c.q_n, weights, c.spring_n, 0.0);
        let rest = at_rest[0] + at_rest[1];
        // q_j at the end is linear in the spring's force there.
        let retained_share = 1.0 - weights[0].1 * self.fractions[0] - weights[1].1 * self.fractions[1];
        // Slip in the step and its derivative with respect to the force.
        let slip = |force: f64| {
            let hold = if force >= 0.0 { push } else { pull };
            let ratio = force.abs() / hold;
            if ratio < 1e-30 || dt_s <= 0.0 {
                return (0.0, 0.0);
            }
            let size = dt_s * V0_MPS * libm::exp((self.exponent * libm::log(ratio)).min(300.0));
            (size.copysign(force), self.exponent * size / force.abs())
        };
        // w - w0 - dz + slip(F(w)) increases with w: Newton's method inside a bracket.
        let goal = c.w_m + dz_m;
        let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
        let mut w = c.w_m;
        let mut slipped = 0.0;
        for _ in 0..MAX_ITERATIONS {
            let force = spring.force(w) * retained_share - rest;
            let (s, ds) = slip(force);
            let residual = w - goal + s;
            slipped = s;
            let change = residual / (1.0 + ds * spring.slope(w) * retained_share);
            if change.abs() <= 1e-15 + 1e-13 * w.abs() {
                break;
            }
            *(if residual > 0.0 { &mut high } else { &mut low }) = w;
            w -= change;
            if !(w > low && w < high) {
                w = if low.is_finite() && high.is_finite() { 0.5 * (low + high) } else { goal };
            }
        }
        let now = spring.force(w);
        c.q_n = self.relaxed(c.q_n, weights, c.spring_n, now);
        c.slipped_m += slipped.max(0.0);
        (c.w_m, c.spring_n) = (w, now);
    }
}

impl Effect for ShaftSlip {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_inactive(&self) -> bool {
        self.push_n == 0.0 && self.pull_n == 0.0
    }
    fn has_state(&self) -> bool {
        true
    }
    fn scale_friction(&mut self, factor: f64) {
        self.push_n *= factor;
        self.pull_n *= factor;
    }
    fn modify_layers(&self, slabs: &mut [Slab]) {
        if let Some(slab) = layer_mut(slabs, self.layer) {
            slab.replaced_friction_share = 1.0;
            slab.curvature_n_per_m2 += self.curvature_n_per_m2;
        }
    }
    /// Before the rupture the layer relaxes as after it.
    fn relax_layer(&self, layer: usize, dt_s: f64, elastic_n: f64, state: &mut EffectState) -> f64 {
        if layer != self.layer {
            return elastic_n;
        }
        let mut c = Contact::of(state);
        if dt_s > 0.0 && (elastic_n != 0.0 || c.q_n != [0.0; 2] || c.spring_n != 0.0) {
            c.q_n = self.relaxed(c.q_n, self.weights(dt_s), c.spring_n, elastic_n);
        }
        c.spring_n = elastic_n;
        c.store(state);
        elastic_n - c.q_n[0] - c.q_n[1]
    }
    fn on_layer_rupture(&self, layer: usize, released_n: f64, state: &mut EffectState) {
        if layer == self.layer {
            let c = Contact::of(state);
            let fall_n = released_n.min(self.retained_share * self.push_n * self.speed_factor(c.speed_mps));
            Contact { fall_n, ruptured: true, slipped_m: 0.0, ..c }.store(state);
        }
    }
    fn layer_friction(
        &self,
        tip: &TipState,
        slabs: &[Slab],
        _sliding_mps: f64,
        state: &mut EffectState,
    ) -> f64 {
        let Some(slab) = self.layer.checked_sub(1).and_then(|i| slabs.get(i)) else { return 0.0 };
        follow_speed(&mut state[SPEED_INDEX], tip);
        if tip.ruptured < self.layer {
            return 0.0;
        }
        let spring = Spring { k_n_per_m: slab.stiffness_n_per_m, b_n_per_m2: slab.curvature_n_per_m2 };
        let end_m = if tip.v_mps < 0.0 { slab.release_m } else { slab.release_m.min(0.0) };
        let held = ((tip.z_m - slab.front_m - end_m) / EDGE_M).clamp(0.0, 1.0);
        if held == 0.0 {
            *state = Contact { speed_mps: state[SPEED_INDEX], ..Contact::of(&[0.0; 8]) }.state();
            return 0.0;
        }
        let mut c = Contact::of(state);
        if c.ruptured {
            // End of the step of the rupture.
            c.ruptured = false;
            c.w_m = spring.at(c.fall_n + c.q_n[0] + c.q_n[1]);
            c.spring_n = spring.force(c.w_m);
        } else if tip.dt_s > 0.0 || tip.dz_m != 0.0 {
            let steps = libm::ceil(tip.dz_m.abs() / SUBSTEP_M).clamp(1.0, MAX_SUBSTEPS);
            let (dt, dz) = (tip.dt_s / steps, tip.dz_m / steps);
            let weights = self.weights(dt);
            for _ in 0..steps as usize {
                self.implicit_step(&mut c, spring, dt, dz, weights);
            }
        }
        c.store(state);
        held * (c.spring_n - c.q_n[0] - c.q_n[1])
    }
}

impl ShaftSlip {
    /// Force in N of steady sliding at `v_mps`, without relaxation and wear.
    #[must_use]
    pub fn plateau_n(&self, v_mps: f64) -> f64 {
        if sgn(v_mps) == 0.0 {
            return 0.0;
        }
        let ln_v = libm::log(v_mps.abs() / V0_MPS);
        let slips = libm::exp(ln_v * (self.rate + 1.0 / self.exponent));
        if v_mps > 0.0 { self.push_n * slips } else { -self.pull_n * slips }
    }
}
