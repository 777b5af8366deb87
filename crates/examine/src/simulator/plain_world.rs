//! The plain law: the equations of docs/reference/model.md.
//!
//! Within a step everything but ruptures is integrated exactly or to second order; a rupture is located within the step by
//! bisection of its condition, so that its time does not depend on the step.

use super::effect::Effect;
use super::force_law::{ForceKnot, ForceLaw};
use super::motion_path::MotionState;
use super::tissue::Tissue;

/// `sgn` is zero below this speed in m/s (docs/reference/model.md).
pub const DEAD_BAND_MPS: f64 = 1e-5;
/// Reference speed of power law and rate-dependent puncture in m/s (docs/reference/model.md).
const V0_MPS: f64 = 1e-3;
/// Precision of rupture times in s.
const INSTANT_S: f64 = 1e-9;
/// Tolerance in N of the force balance of a compliant needle.
const BALANCE_N: f64 = 1e-9;

/// Sign with the dead band.
#[must_use]
pub fn sgn(v: f64) -> f64 {
    if v > DEAD_BAND_MPS {
        1.0
    } else if v < -DEAD_BAND_MPS {
        -1.0
    } else {
        0.0
    }
}

struct Slab {
    front: f64,
    far: f64,
    stiffness: f64,
    friction: f64,
    puncture: f64,
}

/// Parameters of the active effects of the tissue.
#[derive(Default)]
struct ActiveEffects {
    kappa: f64,
    prony: [(f64, f64); 2],
    relaxes: bool,
    coulomb: f64,
    stribeck: Option<(f64, f64, f64)>,
    dahl: Option<(f64, f64)>,
    asymmetry: f64,
    exponent: f64,
    cutting: f64,
    kept: f64,
    alpha: f64,
    membrane: Option<(f64, f64, f64)>,
    width: f64,
    respiration: Option<(f64, f64, f64)>,
    spring: Option<f64>,
    /// Share of the elastic force lost on unloading, and the change of force over which the branches switch.
    hysteresis: Option<(f64, f64)>,
}

/// State of the law.
#[derive(Clone, Copy, Default)]
struct LawState {
    t: f64,
    /// Tip position and velocity relative to the tissue.
    z: f64,
    v: f64,
    /// Base relative to the tissue.
    base: f64,
    base_v: f64,
    /// Elastic force before relaxation, its relaxed parts, and what is left.
    elastic: f64,
    relaxed: [f64; 2],
    /// Distance from the loading branch: 0 on it, 2 on the unloading branch.
    unloaded: f64,
    /// Elastic force of the loading branch.
    loading_n: f64,
    active_n: f64,
    /// State of the Dahl friction.
    bristle: f64,
    deepest: f64,
    /// Tip force retained at the last rupture.
    kept: f64,
    membrane_gone: bool,
    total: f64,
    /// Tip one step before, and the length of that step; for the tip's speed.
    before: Option<(f64, f64)>,
}

/// The plain law with its state.
pub struct PlainWorld {
    slabs: Vec<Slab>,
    effects: ActiveEffects,
    state: LawState,
    ruptures: Vec<f64>,
    released: Vec<f64>,
    /// Releases in progress: force and position.
    soft: Vec<(f64, f64)>,
    /// Time step, and the decay factors for it.
    decay: (f64, [f64; 2]),
}

impl PlainWorld {
    /// The law of a tissue with its effects; those of tool, sensor and position are ignored.
    #[must_use]
    pub fn new(tissue: &Tissue, effects: &[Effect]) -> Self {
        let mut slabs: Vec<Slab> = tissue
            .layers
            .iter()
            .enumerate()
            .map(|(i, l)| Slab {
                front: tissue.front_m(i),
                far: tissue.front_m(i + 1),
                stiffness: l.stiffness_n_per_m,
                friction: l.friction_ns_per_m2,
                puncture: l.puncture_n.unwrap_or(f64::INFINITY),
            })
            .collect();
        let mut active = ActiveEffects { exponent: 1.0, ..ActiveEffects::default() };
        for effect in effects {
            match *effect {
                Effect::NonlinearElasticity { kappa_per_m } => active.kappa += kappa_per_m,
                Effect::StressRelaxation { terms } => {
                    active.prony = terms;
                    active.relaxes = terms.iter().any(|t| t.0 != 0.0);
                }
                Effect::CoulombFriction { c_n_per_m } => active.coulomb += c_n_per_m,
                Effect::StribeckFriction { c_n_per_m, c_static_n_per_m, v_stribeck_mps } => {
                    active.stribeck = Some((c_n_per_m, c_static_n_per_m, v_stribeck_mps));
                }
                Effect::PreslidingFriction { c_n_per_m, delta_m } => active.dahl = Some((c_n_per_m, delta_m)),
                Effect::AsymmetricFriction { eps } => active.asymmetry = eps,
                Effect::PowerLawFriction { exponent } => active.exponent = exponent,
                Effect::CuttingForce { force_n } => active.cutting = force_n,
                Effect::IncompleteRelease { fraction } => active.kept = fraction,
                Effect::RateDependentPuncture { alpha } => active.alpha = alpha,
                Effect::HiddenMembrane { depth_m, stiffness_n_per_m, puncture_n } => {
                    active.membrane = Some((tissue.surface_m + depth_m, stiffness_n_per_m, puncture_n));
                }
                Effect::BoundaryShift { layer, shift_m } if layer >= 1 && layer < slabs.len() => {
                    slabs[layer - 1].far += shift_m;
                    slabs[layer].front += shift_m;
                }
                Effect::SoftBoundary { width_m } => active.width = width_m,
                Effect::Respiration { amplitude_m, frequency_hz, phase_rad } => {
                    active.respiration =
                        Some((amplitude_m, core::f64::consts::TAU * frequency_hz, phase_rad));
                }
                Effect::LoadingHysteresis { fraction, reversal_n } => {
                    active.hysteresis = Some((fraction, reversal_n));
                }
                Effect::NeedleCompliance { stiffness_n_per_m } => active.spring = Some(stiffness_n_per_m),
                _ => {}
            }
        }
        Self {
            slabs,
            effects: active,
            state: LawState::default(),
            ruptures: Vec::new(),
            released: Vec::new(),
            soft: Vec::new(),
            decay: (-1.0, [1.0; 2]),
        }
    }

    /// Depth and speed of the base relative to the tissue.
    fn relative(&self, p: &MotionState) -> (f64, f64) {
        match self.effects.respiration {
            None => (p.z, p.v),
            Some((amplitude, w, phase)) => {
                let (sin, cos) = libm::sincos(w * p.t + phase);
                (p.z - amplitude * sin, p.v - amplitude * w * cos)
            }
        }
    }

    fn elastic(&self, z: f64) -> f64 {
        let Some(slab) = self.slabs.get(self.ruptures.len()) else { return 0.0 };
        let x = (z - slab.front).max(0.0);
        slab.stiffness * x * (1.0 + self.effects.kappa * x)
    }

    /// Friction coefficient and length of needle inside.
    fn shaft(&self, z: f64) -> (f64, f64) {
        let (mut viscous, mut inside) = (0.0, 0.0);
        for slab in &self.slabs {
            if z <= slab.front {
                break;
            }
            let l = z.min(slab.far) - slab.front;
            viscous += slab.friction * l;
            inside += l;
        }
        (viscous, inside)
    }

    /// The state after `dt` with the tip at `z`, moving at `v`, without a rupture.
    fn state_after(&mut self, dt: f64, z: f64, v: f64) -> LawState {
        let from = self.state;
        let mut to = LawState { t: from.t + dt, z, v, deepest: from.deepest.max(z), ..from };
        to.elastic = self.elastic(z);
        to.loading_n = to.elastic;
        if let Some((fraction, reversal)) = self.effects.hysteresis {
            let change = to.loading_n - from.loading_n;
            let keep = libm::exp(-change.abs() / reversal);
            to.unloaded = from.unloaded * keep + if change < 0.0 { 2.0 * (1.0 - keep) } else { 0.0 };
            to.elastic *= 1.0 - 0.5 * fraction * to.unloaded;
        }
        to.active_n = to.elastic;
        if self.effects.relaxes {
            if (dt - self.decay.0).abs() > 1e-9 * dt {
                self.decay = (
                    dt,
                    self.effects.prony.map(|(_, tau)| if tau > 0.0 { libm::exp(-dt / tau) } else { 0.0 }),
                );
            }
            for (k, &(g, tau)) in self.effects.prony.iter().enumerate() {
                if g == 0.0 || dt <= 0.0 {
                    to.active_n -= to.relaxed[k];
                    continue;
                }
                // Exact for an elastic force that is linear within the step.
                let keep = self.decay.1[k];
                let ramp = 1.0 - (1.0 - keep) * tau / dt;
                to.relaxed[k] = keep * from.relaxed[k]
                    + g * ((1.0 - keep) * from.elastic + ramp * (to.elastic - from.elastic));
                to.active_n -= to.relaxed[k];
            }
        }
        let (viscous, inside) = self.shaft(z);
        if let Some((_, delta)) = self.effects.dahl
            && inside > 0.0
        {
            let (s, travel) = (sgn(v), z - from.z);
            to.bristle = if s == 0.0 {
                (from.bristle + travel / delta).clamp(-1.0, 1.0)
            } else {
                s + (from.bristle - s) * libm::exp(-travel.abs() / delta)
            };
        }
        if v < -DEAD_BAND_MPS {
            to.kept = 0.0;
        }
        to.total = self.total(&to, viscous, inside);
        to
    }

    fn total(&self, m: &LawState, viscous: f64, inside: f64) -> f64 {
        let effects = &self.effects;
        let s = sgn(m.v);
        let mut slip = m.v;
        if effects.exponent != 1.0 {
            slip = if s == 0.0 { 0.0 } else { s * V0_MPS * libm::pow(m.v.abs() / V0_MPS, effects.exponent) };
        }
        let mut force = m.active_n + slip * viscous * (1.0 + effects.asymmetry * s);
        if inside > 0.0 {
            let mut dry = effects.coulomb * s;
            if let Some((c, rest, v_s)) = effects.stribeck
                && s != 0.0
            {
                let x = m.v / v_s;
                dry += s * (c + (rest - c) * libm::exp(-x * x));
            }
            if let Some((c, _)) = effects.dahl {
                dry += c * m.bristle;
            }
            force += dry * inside;
        }
        if effects.cutting != 0.0 && s > 0.0 && self.is_cutting(m.z) {
            force += effects.cutting;
        }
        if let Some((depth, stiffness, _)) = effects.membrane
            && !m.membrane_gone
        {
            force += stiffness * (m.z - depth).max(0.0);
        }
        force += m.kept;
        for (released, at) in &self.soft {
            force += released * (1.0 - (m.deepest - at) / effects.width).max(0.0);
        }
        force
    }

    /// Whether the tip is inside a layer that was punctured or needs no puncture.
    fn is_cutting(&self, z: f64) -> bool {
        let at = self.slabs.iter().position(|s| z >= s.front && z < s.far);
        at.is_some_and(|i| i < self.ruptures.len() || self.slabs[i].puncture == f64::INFINITY)
    }

    fn threshold(&self, puncture: f64, v: f64) -> f64 {
        if self.effects.alpha == 0.0 || puncture == f64::INFINITY {
            return puncture;
        }
        let speed = v.abs().max(0.1 * V0_MPS);
        puncture * (1.0 + self.effects.alpha * libm::log(speed / V0_MPS)).max(0.1)
    }

    fn layer_gives_way(&self, m: &LawState) -> bool {
        self.slabs
            .get(self.ruptures.len())
            .is_some_and(|s| m.z >= s.far || m.active_n >= self.threshold(s.puncture, m.v))
    }

    fn membrane_gives_way(&self, m: &LawState) -> bool {
        self.effects
            .membrane
            .is_some_and(|(depth, k, f)| !m.membrane_gone && k > 0.0 && k * (m.z - depth) >= f)
    }

    /// The state after a share `s` of the step of the base.
    fn state_at_share(&mut self, s: f64, dt: f64, base: f64, base_v: f64) -> LawState {
        let from = self.state;
        let (z, v) = (from.base + (base - from.base) * s, from.base_v + (base_v - from.base_v) * s);
        let mut to = match self.effects.spring {
            None => self.state_after(dt * s, z, v),
            Some(spring) => self.balanced(dt * s, z, spring),
        };
        to.base = z;
        to.base_v = v;
        to
    }

    /// Tip position of a compliant needle, where the law's force equals that of the spring. The tip's speed is the slope of
    /// its position by the second-order backward formula, after a jump by the first-order one.
    fn balanced(&mut self, dt: f64, base: f64, spring: f64) -> LawState {
        let from = self.state;
        let dt = dt.max(1e-12);
        let (lead, rest) = match from.before {
            Some((z, h)) => {
                let w = dt / h;
                let old = w * w / (1.0 + w);
                ((1.0 + 2.0 * w) / (1.0 + w), (1.0 + w) * from.z - old * z)
            }
            None => (1.0, from.z),
        };
        let speed = |z: f64| (lead * z - rest) / dt;
        let guess = (from.z + from.v * dt).clamp(from.z - 1e-3, from.z + 1e-3);
        let (viscous, inside) = self.shaft(guess);
        let slab = self.slabs.get(self.ruptures.len()).map_or(0.0, |s| s.stiffness);
        let slope = spring + slab + (viscous + self.effects.coulomb * inside * 1e-3) * lead / dt;
        let eval = |this: &mut Self, z: f64| {
            let m = this.state_after(dt, z, speed(z));
            let off = m.total - spring * (base - z);
            (m, off)
        };
        let (mut m, mut off) = eval(self, guess);
        let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
        let (mut z, mut z_old, mut off_old) = (guess, f64::NAN, f64::NAN);
        for _ in 0..60 {
            if off.abs() < BALANCE_N || high - low < 1e-14 {
                break;
            }
            if off > 0.0 {
                high = high.min(z);
            } else {
                low = low.max(z);
            }
            let chord = (off - off_old) / (z - z_old);
            let step = if chord.is_finite() && chord > 0.1 * spring { off / chord } else { off / slope };
            let mut next = z - step;
            if !(next > low && next < high) {
                next = match (low.is_finite(), high.is_finite()) {
                    (true, true) => 0.5 * (low + high),
                    (true, false) => low + 2.0 * step.abs(),
                    _ => high - 2.0 * step.abs(),
                };
            }
            (z_old, off_old) = (z, off);
            z = next;
            (m, off) = eval(self, z);
        }
        // Within the dead band the law's force jumps: the needle sticks, and friction balances the spring.
        m.total = spring * (base - m.z);
        m.before = Some((from.z, dt));
        m
    }

    fn gives_way(&self, m: &LawState) -> bool {
        self.layer_gives_way(m) || self.membrane_gives_way(m)
    }

    /// Ruptures what has reached its limit in the present state.
    fn rupture(&mut self) {
        let m = self.state;
        if self.membrane_gives_way(&m) {
            self.state.membrane_gone = true;
        }
        if self.layer_gives_way(&m) {
            let kept = self.effects.kept * m.active_n;
            if self.effects.kept != 0.0 {
                self.state.kept = kept;
            }
            if self.effects.width > 0.0 {
                self.soft.retain(|(_, at)| m.deepest - at < self.effects.width);
                self.soft.push((m.active_n - kept, m.z));
                self.state.deepest = m.z;
            }
            self.ruptures.push(m.t);
            self.state.relaxed = [0.0; 2];
            self.state.elastic = self.elastic(m.z);
            (self.state.unloaded, self.state.loading_n) = (0.0, self.state.elastic);
            self.state.active_n = self.state.elastic;
            self.released.push(m.active_n - kept - self.state.active_n);
        }
        self.state.before = None;
        if self.effects.spring.is_none() {
            let (viscous, inside) = self.shaft(m.z);
            self.state.total = self.total(&self.state, viscous, inside);
        }
    }
}

impl ForceLaw for PlainWorld {
    fn start(&mut self, at: &MotionState) -> f64 {
        let (z, v) = self.relative(at);
        self.state = LawState { t: at.t, z, v, base: z, base_v: v, deepest: z, ..LawState::default() };
        self.state.elastic = self.elastic(z);
        self.state.loading_n = self.state.elastic;
        self.state.active_n = self.state.elastic;
        while self.gives_way(&self.state) {
            self.rupture();
        }
        let (viscous, inside) = self.shaft(z);
        self.state.total =
            if self.effects.spring.is_some() { 0.0 } else { self.total(&self.state, viscous, inside) };
        self.state.total
    }

    fn advance(&mut self, to: &MotionState, knots: &mut Vec<ForceKnot>) {
        let (base, base_v) = self.relative(to);
        loop {
            let dt = to.t - self.state.t;
            let end = self.state_at_share(1.0, dt, base, base_v);
            if !self.gives_way(&end) {
                self.state = LawState { t: to.t, ..end };
                break;
            }
            let (mut low, mut high, mut at) = (0.0, 1.0, end);
            while (high - low) * dt > INSTANT_S {
                let middle = 0.5 * (low + high);
                let m = self.state_at_share(middle, dt, base, base_v);
                if self.gives_way(&m) {
                    (high, at) = (middle, m);
                } else {
                    low = middle;
                }
            }
            self.state = at;
            knots.push(ForceKnot { t: self.state.t, force_n: self.state.total });
            self.rupture();
            knots.push(ForceKnot { t: self.state.t, force_n: self.state.total });
        }
        knots.push(ForceKnot { t: self.state.t, force_n: self.state.total });
    }

    fn jump(&mut self, to: &MotionState, knots: &mut Vec<ForceKnot>) {
        let (base, base_v) = self.relative(to);
        self.state.base = base;
        self.state.base_v = base_v;
        self.state.before = None;
        if self.effects.spring.is_none() {
            let m = self.state_after(0.0, base, base_v);
            self.state = LawState { base, base_v, ..m };
            while self.gives_way(&self.state) {
                self.rupture();
            }
        }
        knots.push(ForceKnot { t: self.state.t, force_n: self.state.total });
    }

    fn ruptures(&self) -> &[f64] {
        &self.ruptures
    }

    fn released_n(&self) -> &[f64] {
        &self.released
    }

    fn tip_n(&self) -> f64 {
        // No length of needle inside: no friction.
        self.total(&self.state, 0.0, 0.0)
    }
}
