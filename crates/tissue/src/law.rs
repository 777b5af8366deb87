//! The base law with its effects: puncture and friction of layered tissue, sample by sample.
//!
//! State: the number of ruptured layers `r`; the active layer is `a = r + 1`. SPEC section 2:
//!
//! - elastic `f_K = K_a max(0, z - s_a)` (multi-layer model, supplement eq. 4);
//! - layer `a` ruptures when `f_K >= F_a` or `z >= s_a + d_a`, whichever comes first, and its
//!   `f_K` is gone at once;
//! - friction `f_B = v sum_i b_i l_i`, `l_i = clamp(z - s_i, 0, d_i)`;
//! - `f = f_K + f_B`; a ruptured layer stays ruptured when the needle comes back.

use crate::AnyEffect;
use crate::effect::{Effect, Memory, Moment, Place};
use crate::layer::Tissue;
use crate::slab::Slab;
use alloc::vec::Vec;

/// How many tissue effects one law can hold.
pub const MAX_EFFECTS: usize = 8;

/// More effects than [`MAX_EFFECTS`] were asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TooManyEffects {
    /// How many were asked for.
    pub asked: usize,
}

impl core::fmt::Display for TooManyEffects {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{} effects act on the tissue at once; at most {MAX_EFFECTS} can", self.asked)
    }
}

impl core::error::Error for TooManyEffects {}

/// The law: configuration only. Step it with a [`LawState`].
#[derive(Clone, Debug, PartialEq)]
pub struct Law {
    slabs: Vec<Slab>,
    effects: Vec<AnyEffect>,
}

/// What the law remembers between samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LawState {
    ruptured: usize,
    started: bool,
    time_s: f64,
    z_m: f64,
    elastic_n: f64,
    memory: [Memory; MAX_EFFECTS],
}

impl Default for LawState {
    fn default() -> Self {
        Self {
            ruptured: 0,
            started: false,
            time_s: 0.0,
            z_m: 0.0,
            elastic_n: 0.0,
            memory: [[0.0; 4]; MAX_EFFECTS],
        }
    }
}

impl LawState {
    /// Number of layers that have ruptured so far.
    #[must_use]
    pub fn ruptured(&self) -> usize {
        self.ruptured
    }
}

/// The force of one sample, with its ground truth.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TissueForce {
    /// Whole force at the needle's base, `f`, in N; positive resists insertion.
    pub total_n: f64,
    /// Elastic force `f_K` of the active layer in N.
    pub elastic_n: f64,
    /// Friction `f_B` along the whole shaft in N.
    pub friction_n: f64,
    /// Other forces at the tip (effects: cutting, incomplete release, ...) in N.
    pub tip_extra_n: f64,
    /// Cumulative friction of the ruptured layers, `D = sum b_j l_j`, in N s/m.
    pub cumulative_friction_ns_per_m: f64,
    /// What the tip feels, `f - D v`, in N: what enhancement is after.
    pub tip_n: f64,
    /// Active layer, 1-based; number of layers + 1 after the last rupture.
    pub active_layer: usize,
}

/// A layer gave way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rupture {
    /// Layer, 1-based.
    pub layer: usize,
    /// Instant in seconds, interpolated between the two samples around it.
    pub time_s: f64,
    /// Tip position at that instant in metres.
    pub position_m: f64,
    /// Elastic force that was released, in N.
    pub released_n: f64,
    /// True when the puncture force was reached, false when the far face was.
    pub by_force: bool,
}

impl Law {
    /// The law of a tissue with effects. Neutral effects and those that act outside the tissue
    /// (tool, sensor, recorded position) are left out.
    ///
    /// # Errors
    /// [`TooManyEffects`] when more than [`MAX_EFFECTS`] effects act on the tissue.
    pub fn new(tissue: &Tissue, effects: &[AnyEffect]) -> Result<Self, TooManyEffects> {
        let mut slabs = Slab::stack(tissue);
        let mut active: Vec<AnyEffect> =
            effects.iter().filter(|e| e.place() < Place::Tool && !e.is_neutral()).cloned().collect();
        active.sort_by_key(Effect::place);
        for effect in &active {
            effect.shape(&mut slabs);
        }
        active.retain(|e| e.place() > Place::Geometry);
        if active.len() > MAX_EFFECTS {
            return Err(TooManyEffects { asked: active.len() });
        }
        Ok(Self { slabs, effects: active })
    }

    /// The base law alone.
    #[must_use]
    pub fn base(tissue: &Tissue) -> Self {
        Self { slabs: Slab::stack(tissue), effects: Vec::new() }
    }

    /// The layers as placed in space, after geometric effects.
    #[must_use]
    pub fn slabs(&self) -> &[Slab] {
        &self.slabs
    }

    /// Advances to the sample at `time_s` with tip position `z_m` and velocity `v_mps`, reports
    /// ruptures (in order; more than one when a step crosses several faces) and returns the force.
    ///
    /// Time must not run backwards; a repeated time is a step of zero length.
    #[inline]
    pub fn step(
        &self,
        state: &mut LawState,
        time_s: f64,
        z_m: f64,
        v_mps: f64,
        mut on_rupture: impl FnMut(Rupture),
    ) -> TissueForce {
        let (mut z, mut v) = (z_m, v_mps);
        for effect in self.at(Place::Kinematics) {
            (z, v) = effect.1.relative(time_s, z, v);
        }
        if !state.started {
            state.started = true;
            state.time_s = time_s;
            state.z_m = z;
        }
        let dt = time_s - state.time_s;
        let elastic_n = self.load(state, dt, z, v, &mut on_rupture);
        let moment = Moment { time_s, dt_s: dt, z_m: z, v_mps: v, ruptured: state.ruptured };
        state.time_s = time_s;
        state.z_m = z;
        state.elastic_n = elastic_n;
        self.sum_up(state, &moment, elastic_n)
    }

    /// Elastic force of the active layer, after as many ruptures as this step brings.
    #[inline]
    fn load(
        &self,
        state: &mut LawState,
        dt: f64,
        z: f64,
        v: f64,
        on_rupture: &mut impl FnMut(Rupture),
    ) -> f64 {
        let mut done = 0.0; // share of the step that the ruptures so far have used up
        while let Some(slab) = self.slabs.get(state.ruptured) {
            let x = z - slab.front_m;
            let mut elastic = if x > 0.0 { slab.stiffness_n_per_m * x } else { 0.0 };
            let mut threshold = slab.puncture_n;
            if !self.effects.is_empty() {
                let x = x.max(0.0);
                elastic = self.shaped(state, (1.0 - done) * dt, slab, x, elastic);
                for effect in self.at(Place::Puncture) {
                    threshold = effect.1.puncture(threshold, v);
                }
            }
            let by_force = elastic >= threshold;
            if !by_force && z < slab.far_m() {
                return elastic;
            }
            let rupture = self.rupture(state, dt, z, elastic, threshold, done);
            done = if dt > 0.0 { (rupture.time_s - state.time_s) / dt } else { 1.0 };
            for (memory, effect) in self.effects.iter().enumerate() {
                effect.on_rupture(rupture.released_n, rupture.position_m, &mut state.memory[memory]);
            }
            state.ruptured += 1;
            state.elastic_n = 0.0;
            on_rupture(rupture);
        }
        0.0
    }

    /// The elastic force as the effects of shape and history leave it.
    fn shaped(&self, state: &mut LawState, dt: f64, slab: &Slab, x: f64, base: f64) -> f64 {
        let mut elastic = base;
        for effect in self.at(Place::Elastic) {
            elastic = effect.1.elastic(slab.stiffness_n_per_m, x, elastic);
        }
        for (index, effect) in self.at(Place::Relaxation) {
            elastic = effect.relax(dt, elastic, &mut state.memory[index]);
        }
        elastic
    }

    /// When and where within the step the active layer gave way.
    fn rupture(&self, state: &LawState, dt: f64, z: f64, elastic: f64, threshold: f64, done: f64) -> Rupture {
        let slab = &self.slabs[state.ruptured];
        let share = |from: f64, to: f64, at: f64| {
            if to > from { ((at - from) / (to - from)).clamp(0.0, 1.0) } else { 1.0 }
        };
        let at_face = if z >= slab.far_m() { share(state.z_m, z, slab.far_m()) } else { 2.0 };
        let at_force = if elastic >= threshold {
            // A layer entered within this step starts from its front face, not from the last sample.
            let entry = share(state.z_m, z, slab.front_m);
            let start = if state.z_m < slab.front_m { entry } else { 0.0 }.max(done);
            start + (1.0 - start) * share(state.elastic_n, elastic, threshold)
        } else {
            2.0
        };
        let by_force = at_force <= at_face;
        let at = at_force.min(at_face).max(done);
        Rupture {
            layer: state.ruptured + 1,
            time_s: state.time_s + at * dt,
            position_m: state.z_m + at * (z - state.z_m),
            released_n: if by_force { threshold.min(elastic) } else { elastic },
            by_force,
        }
    }

    /// Friction along the shaft, tip effects, and the ground truth that goes with them.
    #[inline]
    fn sum_up(&self, state: &mut LawState, moment: &Moment, elastic_n: f64) -> TissueForce {
        let mut inside = 0.0;
        let mut cumulative = 0.0;
        let mut local = 0.0;
        for (i, slab) in self.slabs.iter().enumerate() {
            let length = slab.inside_m(moment.z_m);
            inside += length;
            let share = slab.friction_ns_per_m2 * length;
            if i < state.ruptured {
                cumulative += share;
            } else {
                local += share;
            }
        }
        let mut velocity = moment.v_mps;
        for effect in self.at(Place::Friction) {
            velocity = effect.1.friction_velocity(velocity);
        }
        let mut friction_n = velocity * (cumulative + local);
        let mut tip_extra_n = 0.0;
        if !self.effects.is_empty() {
            for (index, effect) in self.effects.iter().enumerate() {
                let memory = &mut state.memory[index];
                match effect.place() {
                    Place::Friction => friction_n += effect.shaft_force(moment, inside, memory),
                    Place::Release | Place::Tip => {
                        tip_extra_n += effect.tip_force(moment, &self.slabs, memory);
                    }
                    _ => {}
                }
            }
        }
        let total_n = elastic_n + friction_n + tip_extra_n;
        TissueForce {
            total_n,
            elastic_n,
            friction_n,
            tip_extra_n,
            cumulative_friction_ns_per_m: cumulative,
            tip_n: total_n - cumulative * moment.v_mps,
            active_layer: state.ruptured + 1,
        }
    }

    #[inline]
    fn at(&self, place: Place) -> impl Iterator<Item = (usize, &AnyEffect)> {
        self.effects.iter().enumerate().filter(move |(_, e)| e.place() == place)
    }
}
