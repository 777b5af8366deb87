//! A force law of another form, which contains the base law of docs/reference/model.md.
//!
//! | ingredient | law | inactive |
//! |---|---|---|
//! | [`Bristles`] | the shaft as elements of at most 0.5 mm, each with friction of its own history: a share `beta` of `b v` is carried by bristles `p' = kappa v - (r kappa/(beta b) + 1/tau) p`, `kappa = beta b v_ref/delta`, `r = abs(v)/(abs(v) + v_c)`, so that steady sliding without creep is `beta b (v + v_c)`; `tau` is creep | `beta = 0` |
//! | [`Foundation`] | the active layer rests on a spring `G = K/phi` with a time constant: its far face yields by `u`, `f_K = K (x - u)`, `G tau u' = f_K - G u`, and it tears at `z - u` | `phi = 0` |
//! | [`Damage`] | puncture by damage that grows with force and time, `D' = (f_K/F)^n/tau`, rupture at 1 | absent |
//! | [`Tearing`] | a rupture in up to three steps, each after some more travel | one step |
//! | [`Membrane`] | an elastic sheet inside the tissue that breaks by the same damage, or at its force | absent |
//! | [`Bending`] | a bevelled tip pushed aside by a share of its force: `y = F L^3/(3 E I)`, the tip falls back by `3/5 y^2/L`, and the bent shaft rubs | absent |

use super::force_law::{ForceKnot, ForceLaw};
use super::motion_path::MotionState;
use super::tissue::Tissue;
use std::collections::VecDeque;

/// Largest length of a shaft element in m.
const ELEMENT_M: f64 = 5e-4;
/// Speed in m/s at which a bristle's travel is `delta`.
const V_REF_MPS: f64 = 2e-3;
/// Speed in m/s over which the bent shaft's rubbing changes sign.
const RUB_MPS: f64 = 2e-5;
/// Precision of rupture times in s.
const INSTANT_S: f64 = 1e-9;

/// Friction with a history along the shaft.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bristles {
    /// Share of the viscous friction, 0 to 1.
    pub share: f64,
    /// Travel over which it builds up, in m.
    pub delta_m: f64,
    /// Speed in m/s that dry friction adds to the sliding one.
    pub dry_mps: f64,
    /// Time constant of the creep in s; infinite for none.
    pub creep_s: f64,
}

/// Elastic foundation of a layer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Foundation {
    /// Stiffness of the layer over that of its foundation.
    pub softness: f64,
    /// Time constant in s; zero for none.
    pub lag_s: f64,
}

/// Puncture by damage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Damage {
    /// Exponent `n`.
    pub exponent: f64,
    /// Time constant in s.
    pub time_s: f64,
}

/// Rupture in steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tearing {
    /// Steps, one to three.
    pub steps: u32,
    /// Travel from step to step in m.
    pub travel_m: f64,
}

/// A sheet inside the tissue.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Membrane {
    /// Depth below the surface in m.
    pub depth_m: f64,
    /// Stiffness in N/m.
    pub stiffness_n_per_m: f64,
    /// Force at which it breaks in N.
    pub puncture_n: f64,
}

/// A needle that bends aside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bending {
    /// Lateral force over axial force at the tip.
    pub ratio: f64,
    /// Lateral compliance `L^3/(3 E I)` in m/N.
    pub compliance_m_per_n: f64,
    /// Free length `L` in m.
    pub length_m: f64,
    /// Friction coefficient of the bent shaft, both supports together.
    pub rubbing: f64,
}

/// Effects of the rich law; without any it is the base law.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RichEffects {
    /// Friction with a history.
    pub bristles: Option<Bristles>,
    /// Foundation springs.
    pub foundation: Option<Foundation>,
    /// Puncture by damage.
    pub damage: Option<Damage>,
    /// Rupture in steps.
    pub tearing: Option<Tearing>,
    /// A sheet.
    pub membrane: Option<Membrane>,
    /// A bending needle.
    pub bending: Option<Bending>,
}

struct Element {
    front: f64,
    length: f64,
    friction: f64,
}

/// Bristles of the covered shaft elements. All move at the needle's speed, so that a step is the same affine map `p -> e p + g` for every element.
/// The composition of these maps is stored (`scale`, `shift`), and each element stores its preimage.
struct Shaft {
    elements: Vec<Element>,
    /// Elements that are covered completely: (stored value, friction times length).
    full: Vec<(f64, f64)>,
    sum_stored: f64,
    sum_weight: f64,
    scale: f64,
    shift: f64,
    /// Bristle of the element at the tip, and how much of it is covered, 0 to 1.
    tip: f64,
    covered: f64,
}

impl Shaft {
    fn new(tissue: &Tissue) -> Self {
        let mut elements = Vec::new();
        for (i, layer) in tissue.layers.iter().enumerate() {
            let count = libm::ceil(layer.thickness_m / ELEMENT_M).max(1.0) as usize;
            let length = layer.thickness_m / count as f64;
            elements.extend((0..count).map(|k| Element {
                front: tissue.front_m(i) + k as f64 * length,
                length,
                friction: layer.friction_ns_per_m2,
            }));
        }
        Self {
            elements,
            full: Vec::new(),
            sum_stored: 0.0,
            sum_weight: 0.0,
            scale: 1.0,
            shift: 0.0,
            tip: 0.0,
            covered: 0.0,
        }
    }

    /// Maps every bristle by `p -> keep p + give`.
    fn relax(&mut self, keep: f64, give: f64) {
        self.scale *= keep;
        self.shift = keep * self.shift + give;
        self.tip = keep * self.tip + give;
        if self.scale < 1e-6 {
            self.sum_stored = 0.0;
            for (stored, weight) in &mut self.full {
                *stored = self.scale * *stored + self.shift;
                self.sum_stored += *stored * *weight;
            }
            self.scale = 1.0;
            self.shift = 0.0;
        }
    }

    /// Moves the tip to `z`: adds covered elements with bristles at rest, or removes uncovered ones.
    fn set_covered_length(&mut self, z: f64) {
        while let Some(e) = self.elements.get(self.full.len()) {
            let share = ((z - e.front) / e.length).clamp(0.0, 1.0);
            if share > self.covered {
                self.tip *= self.covered / share;
            }
            self.covered = share;
            if share < 1.0 {
                break;
            }
            let weight = e.friction * e.length;
            let stored = (self.tip - self.shift) / self.scale;
            self.full.push((stored, weight));
            self.sum_stored += stored * weight;
            self.sum_weight += weight;
            self.tip = 0.0;
            self.covered = 0.0;
        }
        while self.covered == 0.0
            && let Some(&(stored, weight)) = self.full.last()
            && let Some(e) = self.elements.get(self.full.len() - 1)
            && z < e.front + e.length
        {
            self.full.pop();
            self.sum_stored -= stored * weight;
            self.sum_weight -= weight;
            self.tip = self.scale * stored + self.shift;
            self.covered = ((z - e.front) / e.length).clamp(0.0, 1.0);
        }
    }

    /// Friction coefficient of the covered length in N s/m.
    fn viscous(&self) -> f64 {
        let e = self.elements.get(self.full.len());
        self.sum_weight + e.map_or(0.0, |e| e.friction * e.length * self.covered)
    }

    /// Sum of the bristles, weighted by friction.
    fn bristles(&self) -> f64 {
        let e = self.elements.get(self.full.len());
        self.scale * self.sum_stored
            + self.shift * self.sum_weight
            + e.map_or(0.0, |e| e.friction * e.length * self.covered * self.tip)
    }
}

#[derive(Clone, Copy, Default)]
struct LawState {
    t: f64,
    base: f64,
    v: f64,
    /// Tip.
    z: f64,
    /// Yield of the foundation under the active layer.
    yielded: f64,
    active_n: f64,
    damage: f64,
    membrane_gone: bool,
    membrane_damage: f64,
    deepest: f64,
    tip_n: f64,
    total: f64,
}

/// The rich law with its state.
pub struct RichWorld {
    layers: Vec<(f64, f64, f64, f64)>,
    surface: f64,
    with: RichEffects,
    shaft: Shaft,
    now: LawState,
    ruptures: Vec<f64>,
    released: Vec<f64>,
    /// Ruptures in progress: force released and position.
    torn: VecDeque<(f64, f64)>,
}

impl RichWorld {
    /// The law of a tissue with these effects.
    #[must_use]
    pub fn new(tissue: &Tissue, with: &RichEffects) -> Self {
        let layers = tissue
            .layers
            .iter()
            .enumerate()
            .map(|(i, l)| {
                let puncture = l.puncture_n.unwrap_or(f64::INFINITY);
                (tissue.front_m(i), tissue.front_m(i + 1), l.stiffness_n_per_m, puncture)
            })
            .collect();
        Self {
            layers,
            surface: tissue.surface_m,
            with: *with,
            shaft: Shaft::new(tissue),
            now: LawState::default(),
            ruptures: Vec::new(),
            released: Vec::new(),
            torn: VecDeque::new(),
        }
    }

    /// Axial retreat of the bending needle's tip in m.
    fn bending_retreat_m(&self) -> f64 {
        self.with.bending.map_or(0.0, |b| {
            let aside = b.ratio * self.now.tip_n * b.compliance_m_per_n;
            0.6 * aside * aside / b.length_m
        })
    }

    /// The state after a share `s` of the step of the base, without a rupture.
    fn state_at_share(&self, s: f64, dt: f64, base: f64, v: f64) -> LawState {
        let from = &self.now;
        let dt = dt * s;
        let mut to = LawState {
            t: from.t + dt,
            base: from.base + (base - from.base) * s,
            v: from.v + (v - from.v) * s,
            ..*from
        };
        to.z = to.base - self.bending_retreat_m();
        to.deepest = from.deepest.max(to.z);
        to.active_n = 0.0;
        if let Some(&(front, _, stiffness, puncture)) = self.layers.get(self.ruptures.len()) {
            let x = (to.z - front).max(0.0);
            if let Some(f) = self.with.foundation {
                let share = f.softness / (1.0 + f.softness);
                // In the middle of the step, for the second order.
                let middle = (0.5 * (from.z + to.z) - front).max(0.0);
                to.yielded = if f.lag_s > 0.0 {
                    let end = share * middle;
                    end + (from.yielded - end) * libm::exp(-dt * (1.0 + f.softness) / f.lag_s)
                } else {
                    share * x
                };
            }
            to.active_n = stiffness * (x - to.yielded).max(0.0);
            if let Some(d) = self.with.damage
                && puncture < f64::INFINITY
            {
                to.damage += damage_growth(&d, dt, from.active_n / puncture, to.active_n / puncture);
            }
        }
        if let (Some(m), Some(d)) = (self.with.membrane, self.with.damage) {
            let before = self.membrane_n(from) / m.puncture_n;
            to.membrane_damage += damage_growth(&d, dt, before, self.membrane_n(&to) / m.puncture_n);
        }
        to
    }

    fn membrane_n(&self, m: &LawState) -> f64 {
        match self.with.membrane {
            Some(x) if !m.membrane_gone => x.stiffness_n_per_m * (m.z - self.surface - x.depth_m).max(0.0),
            _ => 0.0,
        }
    }

    fn layer_gives_way(&self, m: &LawState) -> bool {
        self.layers.get(self.ruptures.len()).is_some_and(|&(_, far, _, puncture)| {
            let by_force = match self.with.damage {
                Some(_) => m.damage >= 1.0,
                None => m.active_n >= puncture,
            };
            by_force || m.z - m.yielded >= far
        })
    }

    fn membrane_gives_way(&self, m: &LawState) -> bool {
        self.with.membrane.is_some_and(|x| {
            !m.membrane_gone
                && match self.with.damage {
                    Some(_) => m.membrane_damage >= 1.0,
                    None => self.membrane_n(m) >= x.puncture_n,
                }
        })
    }

    fn gives_way(&self, m: &LawState) -> bool {
        self.layer_gives_way(m) || self.membrane_gives_way(m)
    }

    /// Accepts a state: updates the shaft and sums up the force.
    fn accept_state(&mut self, to: LawState) {
        let dt = to.t - self.now.t;
        if let Some(b) = self.with.bristles {
            let v = 0.5 * (self.now.v + to.v);
            let slip = v.abs() + b.dry_mps;
            // Without a dry part the bristles slide at any speed, at rest as well.
            let sliding = if b.dry_mps > 0.0 { v.abs() / slip } else { 1.0 };
            let stiff = V_REF_MPS / b.delta_m;
            let rate = stiff * sliding + 1.0 / b.creep_s;
            let keep = libm::exp(-rate * dt);
            let give = if rate * dt > 1e-9 { (1.0 - keep) * stiff * v / rate } else { stiff * v * dt };
            self.shaft.relax(keep, give);
        }
        self.now = to;
        self.shaft.set_covered_length(to.z);
        self.update_force();
    }

    fn update_force(&mut self) {
        let m = self.now;
        let mut tip = m.active_n + self.membrane_n(&m);
        if let Some(t) = self.with.tearing {
            for (released, at) in &self.torn {
                let done = 1.0 + libm::floor((m.deepest - at) / t.travel_m);
                tip += released * (1.0 - done / f64::from(t.steps)).max(0.0);
            }
        }
        let viscous = self.shaft.viscous();
        let friction = match self.with.bristles {
            Some(b) => (1.0 - b.share) * viscous * m.v + b.share * self.shaft.bristles(),
            None => viscous * m.v,
        };
        let rubbing =
            self.with.bending.map_or(0.0, |b| b.rubbing * b.ratio * tip * libm::tanh(m.v / RUB_MPS));
        self.now.tip_n = tip;
        self.now.total = tip + friction + rubbing;
    }

    fn rupture(&mut self) {
        let m = self.now;
        if self.membrane_gives_way(&m) {
            self.now.membrane_gone = true;
        }
        if self.layer_gives_way(&m) {
            if self.with.tearing.is_some_and(|t| t.steps > 1) {
                self.torn.push_back((m.active_n, m.z));
                self.now.deepest = m.z;
            }
            self.ruptures.push(m.t);
            self.now.damage = 0.0;
            self.now.yielded = 0.0;
            // Force of the next layer at this position.
            self.now.active_n = 0.0;
            self.now = self.state_at_share(0.0, 0.0, m.base, m.v);
            self.released.push(m.active_n - self.now.active_n);
        }
        self.update_force();
    }
}

/// Growth of damage over `dt` between two relative forces.
fn damage_growth(damage: &Damage, dt: f64, from: f64, to: f64) -> f64 {
    // Below 0.3 of the force, damage with an exponent of five or more is negligible.
    let power = |x: f64| if x < 0.3 { 0.0 } else { libm::pow(x, damage.exponent) };
    dt / damage.time_s * 0.5 * (power(from) + power(to))
}

impl ForceLaw for RichWorld {
    fn start(&mut self, at: &MotionState) -> f64 {
        self.now = LawState { t: at.t, base: at.z, v: at.v, z: at.z, deepest: at.z, ..LawState::default() };
        self.now = self.state_at_share(0.0, 0.0, at.z, at.v);
        self.shaft.set_covered_length(at.z);
        self.update_force();
        while self.gives_way(&self.now) {
            self.rupture();
        }
        self.now.total
    }

    fn advance(&mut self, to: &MotionState, knots: &mut Vec<ForceKnot>) {
        loop {
            let dt = to.t - self.now.t;
            let end = self.state_at_share(1.0, dt, to.z, to.v);
            if !self.gives_way(&end) {
                self.accept_state(LawState { t: to.t, ..end });
                break;
            }
            let (mut low, mut high, mut at) = (0.0, 1.0, end);
            while (high - low) * dt > INSTANT_S {
                let middle = 0.5 * (low + high);
                let m = self.state_at_share(middle, dt, to.z, to.v);
                if self.gives_way(&m) {
                    (high, at) = (middle, m);
                } else {
                    low = middle;
                }
            }
            self.accept_state(at);
            knots.push(ForceKnot { t: self.now.t, force_n: self.now.total });
            self.rupture();
            knots.push(ForceKnot { t: self.now.t, force_n: self.now.total });
        }
        knots.push(ForceKnot { t: self.now.t, force_n: self.now.total });
    }

    fn jump(&mut self, to: &MotionState, knots: &mut Vec<ForceKnot>) {
        self.now.base = to.z;
        self.now.v = to.v;
        self.update_force();
        knots.push(ForceKnot { t: self.now.t, force_n: self.now.total });
    }

    fn ruptures(&self) -> &[f64] {
        &self.ruptures
    }

    fn released_n(&self) -> &[f64] {
        &self.released
    }

    fn tip_n(&self) -> f64 {
        self.now.tip_n
    }
}
