//! The base law with its effects: puncture and friction of layered tissue, sample by sample.
//!
//! State: the number of ruptured layers `r`; the active layer is `a = r + 1`. SPEC section 2:
//!
//! - elastic `f_K = K_a max(0, z - s_a)` (multi-layer model, supplement eq. 4);
//! - layer `a` ruptures when `f_K >= F_a` or `z >= s_a + d_a`, whichever comes first, and its
//!   `f_K` is gone at once;
//! - friction `f_B = v sum_i b_i l_i`, `l_i = clamp(z - s_i, 0, d_i)`;
//! - `f = f_K + f_B`; a ruptured layer stays ruptured when the needle comes back.
//!
//! Effects stand in the order of the chain, and each place of the chain knows its range of them, so
//! that a hook asks only those that answer it.

use crate::AnyEffect;
use crate::effect::{ChainStage, Effect, EffectState, TipState};
use crate::force::{Rupture, TissueForce};
use crate::force_law_state::{EffectStates, ForceLawState};
use crate::layer::Tissue;
use crate::layer_geometry::Slab;
use crate::rupture_policy::{CriterionRuptures, RuptureCriterion, RupturePolicy};
use alloc::vec::Vec;

/// How many tissue effects one law can hold.
pub const MAX_EFFECTS: usize = 16;

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
pub struct ForceLaw {
    pub(crate) slabs: Vec<Slab>,
    /// In the order of the chain.
    effects: Vec<AnyEffect>,
    /// Effects of a place are those from its entry to the next one's.
    first: [u8; PLACES + 1],
    /// Stiffness in N/m of the needle, infinite when it is rigid.
    pub(crate) needle_n_per_m: f64,
    /// Some effect uses its memory.
    pub(crate) has_state: bool,
    /// The force may jump where the velocity changes sign.
    pub(crate) force_may_jump: bool,
    /// Nothing but the base law: rigid needle, no effect.
    plain: bool,
}

/// Places up to and with [`Place::Tip`].
const PLACES: usize = ChainStage::Tip as usize + 1;

impl ForceLaw {
    /// The law of a tissue with effects. Neutral effects and those that act outside the tissue
    /// (tool, sensor, recorded position) are left out.
    ///
    /// # Errors
    /// [`TooManyEffects`] when more than [`MAX_EFFECTS`] effects act on the tissue.
    pub fn new(tissue: &Tissue, effects: &[AnyEffect]) -> Result<Self, TooManyEffects> {
        let mut law = Self::base(tissue);
        let mut active: Vec<AnyEffect> =
            effects.iter().filter(|e| e.place() < ChainStage::Tool && !e.is_neutral()).cloned().collect();
        active.sort_by_key(|e| (e.place(), e.rank()));
        for effect in &active {
            effect.shape(&mut law.slabs);
        }
        let springs = active.iter().filter_map(|e| match e {
            AnyEffect::NeedleCompliance(spring) => Some(1.0 / spring.stiffness_n_per_m),
            _ => None,
        });
        law.needle_n_per_m = 1.0 / springs.fold(0.0, |sum, spring| sum + spring);
        active.retain(|e| e.place() > ChainStage::Geometry && !matches!(e, AnyEffect::NeedleCompliance(_)));
        if active.len() > MAX_EFFECTS {
            return Err(TooManyEffects { asked: active.len() });
        }
        for (place, first) in law.first.iter_mut().enumerate() {
            *first = active.partition_point(|e| (e.place() as usize) < place) as u8;
        }
        law.has_state = active.iter().any(Effect::remembers);
        law.force_may_jump = active.iter().any(|e| e.place() >= ChainStage::Release);
        law.plain = active.is_empty()
            && law.needle_n_per_m == f64::INFINITY
            && law.slabs.iter().all(|slab| slab.is_plain());
        law.effects = active;
        Ok(law)
    }

    /// The base law alone.
    #[must_use]
    pub fn base(tissue: &Tissue) -> Self {
        Self {
            slabs: Slab::stack(tissue),
            effects: Vec::new(),
            first: [0; PLACES + 1],
            needle_n_per_m: f64::INFINITY,
            has_state: false,
            force_may_jump: false,
            plain: true,
        }
    }

    /// The layers as placed in space, after geometric effects.
    #[must_use]
    pub fn slabs(&self) -> &[Slab] {
        &self.slabs
    }

    /// Whether the tip is where the needle's base says and no layer is felt before its front: no effect moves the one
    /// against the other or looks at the layers ahead.
    #[must_use]
    pub fn tip_follows_base(&self) -> bool {
        let moves = [ChainStage::Kinematics, ChainStage::Tip, ChainStage::Release]
            .iter()
            .any(|p| !self.at(*p).is_empty());
        !moves && !self.has_compliant_needle()
    }

    /// Whether the needle gives.
    #[must_use]
    pub fn has_compliant_needle(&self) -> bool {
        self.needle_n_per_m < f64::INFINITY
    }

    /// The velocity in m/s that multiplies `sum b_i l_i` when the tip moves at `v_mps`: itself, unless an
    /// effect changes the viscous friction.
    #[must_use]
    #[inline]
    pub fn viscous_velocity(&self, v_mps: f64) -> f64 {
        let (mut velocity, mut factor) = (v_mps, 1.0);
        for effect in self.at(ChainStage::Friction) {
            velocity = effect.friction_velocity(velocity);
            factor *= effect.friction_factor(v_mps);
        }
        velocity * factor
    }

    /// Advances to the sample at `time_s` with tip position `z_m` and velocity `v_mps`, reports
    /// ruptures (in order; more than one when a step crosses several faces) and returns the force.
    ///
    /// Time must not run backwards; a repeated time, or one that does run backwards, is a step of
    /// zero length. A sample that is not finite gives a force that is not a number and changes
    /// nothing in the state. Positions of ruptures are relative to the tissue.
    #[inline]
    pub fn step(
        &self,
        state: &mut ForceLawState,
        time_s: f64,
        z_m: f64,
        v_mps: f64,
        mut on_rupture: impl FnMut(Rupture),
    ) -> TissueForce {
        self.step_with_policy(state, time_s, z_m, v_mps, &mut CriterionRuptures(&mut on_rupture))
    }

    /// [`Law::step`] for many samples, each `[time_s, z_m, v_mps]`; `hear` is told the force of each.
    #[inline]
    pub fn run(
        &self,
        state: &mut ForceLawState,
        samples: impl Iterator<Item = [f64; 3]>,
        mut on_rupture: impl FnMut(Rupture),
        mut hear: impl FnMut(&TissueForce),
    ) {
        if !self.plain {
            return samples.for_each(|[t, z, v]| hear(&self.step(state, t, z, v, &mut on_rupture)));
        }
        for [time_s, z_m, v_mps] in samples {
            if (time_s + z_m + v_mps).is_finite() {
                hear(&self.step_plain(state, time_s, z_m, v_mps, &mut CriterionRuptures(&mut on_rupture)));
            } else {
                hear(&TissueForce::not_finite(state.ruptured + 1));
            }
        }
    }

    /// [`Law::step`] with somebody who decides on ruptures.
    #[inline]
    pub(crate) fn step_with_policy(
        &self,
        state: &mut ForceLawState,
        time_s: f64,
        z_m: f64,
        v_mps: f64,
        breaking: &mut impl RupturePolicy,
    ) -> TissueForce {
        if self.plain && (time_s + z_m + v_mps).is_finite() {
            self.step_plain(state, time_s, z_m, v_mps, breaking)
        } else {
            self.step_with_effects(state, time_s, z_m, v_mps, breaking)
        }
    }

    /// The law with all its effects. Kept out of line, so that the base law
    /// alone stays small enough to be inlined.
    #[inline(never)]
    pub(crate) fn step_with_effects(
        &self,
        state: &mut ForceLawState,
        time_s: f64,
        z_m: f64,
        v_mps: f64,
        breaking: &mut impl RupturePolicy,
    ) -> TissueForce {
        if !(time_s + z_m + v_mps).is_finite() {
            return TissueForce::not_finite(state.ruptured + 1);
        }
        let (mut z, mut v) = (z_m, v_mps);
        for effect in self.at(ChainStage::Kinematics) {
            (z, v) = effect.relative(time_s, z, v);
        }
        if !state.started {
            state.begin(time_s, z, v);
        }
        let time_s = time_s.max(state.time_s);
        let dt = time_s - state.time_s;
        if self.needle_n_per_m < f64::INFINITY {
            return self.step_compliant_needle(state, time_s, z, breaking);
        }
        let elastic_n = self.load(state, dt, z, v, breaking);
        self.rupture_membranes(state, z);
        self.settle(state, time_s, z, v, elastic_n)
    }

    /// The base law alone: the same operations as with effects, with nothing asked of the chain.
    #[inline]
    fn step_plain(
        &self,
        state: &mut ForceLawState,
        time_s: f64,
        z: f64,
        v: f64,
        breaking: &mut impl RupturePolicy,
    ) -> TissueForce {
        if !state.started {
            state.begin(time_s, z, v);
        }
        let time_s = if time_s > state.time_s { time_s } else { state.time_s };
        let mut elastic_n = 0.0;
        let mut done = 0.0;
        while let Some(slab) = self.slabs.get(state.ruptured) {
            let x = z - slab.front_m;
            elastic_n = slab.stiffness_n_per_m * if x > 0.0 { x } else { 0.0 };
            let strain = RuptureCriterion {
                layer: state.ruptured + 1,
                elastic_n,
                puncture_n: slab.puncture_n,
                tip_m: z,
                far_m: slab.far_m(),
            };
            if !breaking.ruptures(&strain) {
                break;
            }
            let dt = time_s - state.time_s;
            let rupture = Self::rupture(state, slab, dt, z, elastic_n, slab.puncture_n, done);
            done = if dt > 0.0 { (rupture.time_s - state.time_s) / dt } else { 1.0 };
            state.ruptured += 1;
            state.elastic_n = 0.0;
            elastic_n = 0.0;
            breaking.on_rupture(rupture);
        }
        state.time_s = time_s;
        state.z_m = z;
        state.v_mps = v;
        state.elastic_n = elastic_n;
        let (behind, ahead) = self.slabs.split_at(state.ruptured.min(self.slabs.len()));
        let along = |slabs: &[Slab]| {
            let mut sum = 0.0;
            for slab in slabs {
                sum += slab.friction_ns_per_m2 * slab.length_inside_m(z);
            }
            sum
        };
        let (cumulative, local) = (along(behind), along(ahead));
        let friction_n = v * (cumulative + local);
        let total_n = elastic_n + friction_n;
        TissueForce {
            total_n,
            elastic_n,
            friction_n,
            tip_extra_n: 0.0,
            cumulative_friction_ns_per_m: cumulative,
            tip_n: total_n - cumulative * v,
            active_layer: state.ruptured + 1,
        }
    }

    /// Elastic force of the active layer, after as many ruptures as this step brings.
    #[inline]
    fn load(
        &self,
        state: &mut ForceLawState,
        dt: f64,
        z: f64,
        v: f64,
        breaking: &mut impl RupturePolicy,
    ) -> f64 {
        let mut done = 0.0; // share of the step that the ruptures so far have used up
        while let Some(slab) = self.slabs.get(state.ruptured) {
            let elastic =
                self.layer_elastic_force(state.ruptured, slab, (1.0 - done) * dt, z, &mut state.effects);
            match self.try_rupture(state, slab, dt, (z, v), elastic, done, breaking) {
                None => return elastic,
                Some(rupture) => {
                    done = if dt > 0.0 { (rupture.time_s - state.time_s) / dt } else { 1.0 };
                }
            }
        }
        0.0
    }

    /// Elastic force of a layer as the effects of shape and history leave it.
    #[inline]
    pub(crate) fn layer_elastic_force(
        &self,
        index: usize,
        slab: &Slab,
        dt: f64,
        z: f64,
        memory: &mut EffectStates,
    ) -> f64 {
        let x = z - slab.front_m;
        let x = slab.indentation_m(if x > 0.0 { x } else { 0.0 });
        let mut elastic = slab.stiffness_n_per_m * x;
        if slab.is_curved() || !self.effects.is_empty() {
            for effect in self.at(ChainStage::Elastic) {
                elastic = effect.elastic(slab.stiffness_n_per_m, x, elastic);
            }
            elastic += slab.stiffness_n_per_m * x * slab.kappa_per_m * x + slab.curvature_n_per_m2 * x * x;
            for (effect, memory) in self.effects_with_state(ChainStage::Relaxation, memory) {
                elastic = effect.relax(dt, elastic, memory);
            }
            for (effect, memory) in self.effects_with_state(ChainStage::Friction, memory) {
                elastic = effect.press(index + 1, dt, elastic, memory);
            }
        }
        elastic
    }

    /// The rupture of the active layer, if its elastic force or the tip's position bring it.
    /// `done` is the share of the step that is over.
    #[inline]
    #[allow(clippy::too_many_arguments, reason = "one step, taken apart")]
    pub(crate) fn try_rupture(
        &self,
        state: &mut ForceLawState,
        slab: &Slab,
        dt: f64,
        (z, v): (f64, f64),
        elastic: f64,
        done: f64,
        breaking: &mut impl RupturePolicy,
    ) -> Option<Rupture> {
        let mut threshold = slab.puncture_n;
        let layer = state.ruptured + 1;
        for (effect, memory) in self.effects_with_state(ChainStage::Puncture, &mut state.effects) {
            threshold = effect.puncture(threshold, v);
            threshold = effect.endure(layer, (1.0 - done) * dt, elastic, threshold, memory);
        }
        let strain = RuptureCriterion {
            layer: state.ruptured + 1,
            elastic_n: elastic,
            puncture_n: threshold,
            tip_m: z,
            far_m: slab.rupture_position_m(),
        };
        if !breaking.ruptures(&strain) {
            return None;
        }
        let rupture = Self::rupture(state, slab, dt, z, elastic, threshold, done);
        for (effect, memory) in self.effects_with_state(ChainStage::Relaxation, &mut state.effects) {
            effect.on_rupture(rupture.released_n, rupture.position_m, memory);
        }
        let mut released = rupture.released_n;
        for (effect, memory) in self.effects_with_state(ChainStage::Release, &mut state.effects) {
            effect.on_rupture(released, rupture.position_m, memory);
            released -= effect.withheld(released);
        }
        for (effect, memory) in self.effects_with_state(ChainStage::Friction, &mut state.effects) {
            effect.on_layer_rupture(rupture.layer, released, memory);
        }
        state.ruptured += 1;
        state.elastic_n = 0.0;
        breaking.on_rupture(rupture);
        Some(rupture)
    }

    /// When and where within the step the active layer gave way, and what it released.
    #[cold]
    fn rupture(
        state: &ForceLawState,
        slab: &Slab,
        dt: f64,
        z: f64,
        elastic: f64,
        threshold: f64,
        done: f64,
    ) -> Rupture {
        let share = |from: f64, to: f64, at: f64| {
            if to > from { ((at - from) / (to - from)).clamp(0.0, 1.0) } else { 1.0 }
        };
        // A layer entered within this step starts from its front face, not from the last sample.
        let entry = share(state.z_m, z, slab.front_m);
        let start = if state.z_m < slab.front_m { entry } else { 0.0 }.max(done);
        let far = slab.rupture_position_m();
        let at_face = if z >= far { share(state.z_m, z, far).max(done) } else { 2.0 };
        let at_force = if elastic >= threshold {
            start + (1.0 - start) * share(state.elastic_n, elastic, threshold)
        } else {
            2.0
        };
        let by_force = at_force <= at_face;
        // Imposed ruptures may come without either: at the end of the step.
        let at = at_force.min(at_face).min(1.0);
        Rupture {
            layer: state.ruptured + 1,
            time_s: state.time_s + at * dt,
            position_m: state.z_m + at * (z - state.z_m),
            released_n: if by_force {
                threshold.min(elastic)
            } else {
                state.elastic_n + (elastic - state.elastic_n) * share(start, 1.0, at)
            },
            by_force,
        }
    }

    /// Whether something that the layers do not know breaks with the tip at `z`.
    #[inline]
    pub(crate) fn rupture_membranes(&self, state: &mut ForceLawState, z: f64) -> bool {
        let mut any = false;
        for (effect, memory) in self.effects_with_state(ChainStage::Tip, &mut state.effects) {
            any |= effect.breaks(z, &self.slabs, memory);
        }
        any
    }

    /// Friction and tip forces at the end of a step, which the state remembers.
    #[inline]
    fn settle(&self, state: &mut ForceLawState, time_s: f64, z: f64, v: f64, elastic_n: f64) -> TissueForce {
        let moment = state.tip_state(time_s, z, v);
        state.store(&moment, elastic_n);
        self.total_force(&moment, elastic_n, &mut state.effects)
    }

    /// Friction along the shaft, tip effects, and the ground truth that goes with them.
    #[inline]
    pub(crate) fn total_force(
        &self,
        moment: &TipState,
        elastic_n: f64,
        memory: &mut EffectStates,
    ) -> TissueForce {
        let along = |slabs: &[Slab], back_mps: f64| {
            let (mut sum, mut inside) = (0.0, 0.0);
            for slab in slabs {
                let length = slab.contact_length_m(moment.z_m, back_mps);
                inside += length;
                sum += slab.friction_ns_per_m2 * length * (1.0 - slab.replaced_friction_share);
            }
            (sum, inside)
        };
        let (behind, ahead) = self.slabs.split_at(moment.ruptured.min(self.slabs.len()));
        let (mut cumulative, passed) = along(behind, moment.v_mps);
        let (mut local, active) = along(ahead, 0.0);
        let inside = passed + active;
        let mut velocity = moment.v_mps;
        let mut tip_extra_n = 0.0;
        let mut dry_n = 0.0;
        let mut grip_n = 0.0;
        if self.force_may_jump {
            let mut factor = 1.0;
            for (effect, memory) in self.effects_with_state(ChainStage::Release, memory) {
                tip_extra_n += effect.tip_force(moment, &self.slabs, memory);
            }
            for (effect, memory) in self.effects_with_state(ChainStage::Friction, memory) {
                velocity = effect.friction_velocity(velocity);
                factor *= effect.friction_factor(moment.v_mps);
                dry_n += effect.shaft_force(moment, inside, memory);
            }
            for (effect, memory) in self.effects_with_state(ChainStage::Tip, memory) {
                tip_extra_n += effect.tip_force(moment, &self.slabs, memory);
            }
            for (effect, memory) in self.effects_with_state(ChainStage::Friction, memory) {
                grip_n += effect.grip(moment, &self.slabs, velocity * factor, memory);
            }
            cumulative *= factor;
            local *= factor;
        }
        let friction_n = velocity * (cumulative + local) + dry_n + grip_n;
        let total_n = elastic_n + friction_n + tip_extra_n;
        // Dry friction goes with the length inside.
        let behind_n = if inside > 0.0 { dry_n * passed / inside } else { 0.0 };
        TissueForce {
            total_n,
            elastic_n,
            friction_n,
            tip_extra_n,
            cumulative_friction_ns_per_m: cumulative,
            // All friction of the passed layers along the shaft: viscous, dry and presliding, and what holds it.
            tip_n: total_n - cumulative * velocity - behind_n - grip_n,
            active_layer: moment.ruptured + 1,
        }
    }

    /// The effects of a place.
    #[inline]
    fn at(&self, place: ChainStage) -> &[AnyEffect] {
        self.effects.get(self.range(place)).unwrap_or(&[])
    }

    /// The effects of a place, each with its memory.
    #[inline]
    pub(crate) fn effects_with_state<'a>(
        &'a self,
        place: ChainStage,
        memory: &'a mut EffectStates,
    ) -> impl Iterator<Item = (&'a AnyEffect, &'a mut EffectState)> {
        let range = self.range(place);
        let memory = memory.get_mut(range.clone()).unwrap_or(&mut []);
        self.effects.get(range).unwrap_or(&[]).iter().zip(memory)
    }

    #[inline]
    fn range(&self, place: ChainStage) -> core::ops::Range<usize> {
        let place = (place as usize).min(PLACES - 1);
        usize::from(self.first[place])..usize::from(self.first[place + 1])
    }
}
