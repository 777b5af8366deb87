//! The force law of layered tissue: base law and effects, sample by sample.
//!
//! State: the number of ruptured layers `r`; the active layer is `a = r + 1`. Base law (docs/reference/model.md, Base law;
//! multi-layer model, supplement eq. 4):
//!
//! - elastic force `f_K = K_a max(0, z - s_a)`;
//! - layer `a` ruptures when `f_K >= F_a` or `z >= s_a + d_a`, whichever comes first, and its `f_K` is released at once;
//! - friction `f_B = v sum_i b_i l_i`, `l_i = clamp(z - s_i, 0, d_i)`;
//! - `f = f_K + f_B`; a ruptured layer stays ruptured in retraction.
//!
//! Effects are sorted and indexed by stage, so that a hook is called only for the effects that may override it.

use crate::chain_stage::ChainStage;
use crate::effect::{Effect, EffectState, InsertionState, TipState};
use crate::effects::AnyEffect;
use crate::force::{Rupture, TissueForce};
use crate::force_law_state::{EffectStates, ForceLawState, MAX_EFFECTS};
use crate::layer::Tissue;
use crate::layer_geometry::Slab;
use crate::rupture_policy::{CriterionRuptures, ImposedRuptures, RuptureCriterion, RupturePolicy};
use alloc::vec::Vec;

/// More tissue effects than [`MAX_EFFECTS`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TooManyEffects {
    /// Number of active tissue effects.
    pub effect_count: usize,
}

impl core::fmt::Display for TooManyEffects {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(
            f,
            "{} effects act on the tissue at once; at most {MAX_EFFECTS} are possible",
            self.effect_count
        )
    }
}

impl core::error::Error for TooManyEffects {}

/// Force law of a tissue with effects: configuration only, stepped with a [`ForceLawState`].
#[derive(Clone, Debug, PartialEq)]
pub struct ForceLaw {
    pub(crate) slabs: Vec<Slab>,
    /// Sorted by stage.
    effects: Vec<AnyEffect>,
    /// Index of the first effect of each stage.
    first: [u8; TISSUE_STAGES + 1],
    /// Stiffness in N/m of the needle, infinite when it is rigid.
    pub(crate) needle_n_per_m: f64,
    /// Whether some effect has a state.
    pub(crate) has_state: bool,
    /// Whether the force may jump where the velocity changes sign.
    pub(crate) force_may_jump: bool,
    /// Base law only: rigid needle, no effect.
    plain: bool,
}

/// Number of stages up to [`ChainStage::Tip`], which act on the tissue.
const TISSUE_STAGES: usize = ChainStage::Tip as usize + 1;

impl ForceLaw {
    /// The force law of a tissue with effects. Inactive effects and those that act outside the tissue (tool, sensor,
    /// recorded position) are left out.
    ///
    /// # Errors
    /// [`TooManyEffects`] when more than [`MAX_EFFECTS`] effects act on the tissue.
    pub fn new(tissue: &Tissue, effects: &[AnyEffect]) -> Result<Self, TooManyEffects> {
        let mut law = Self::base(tissue);
        let mut active: Vec<AnyEffect> =
            effects.iter().filter(|e| e.stage() < ChainStage::Tool && !e.is_inactive()).cloned().collect();
        active.sort_by_key(|e| (e.stage(), e.rank()));
        for effect in &active {
            effect.modify_layers(&mut law.slabs);
        }
        let springs = active.iter().filter_map(|e| match e {
            AnyEffect::NeedleCompliance(spring) => Some(1.0 / spring.stiffness_n_per_m),
            _ => None,
        });
        law.needle_n_per_m = 1.0 / springs.fold(0.0, |sum, spring| sum + spring);
        active.retain(|e| e.stage() > ChainStage::Geometry && !matches!(e, AnyEffect::NeedleCompliance(_)));
        if active.len() > MAX_EFFECTS {
            return Err(TooManyEffects { effect_count: active.len() });
        }
        for (stage, first) in law.first.iter_mut().enumerate() {
            *first = active.partition_point(|e| (e.stage() as usize) < stage) as u8;
        }
        law.has_state = active.iter().any(Effect::has_state);
        law.force_may_jump = active.iter().any(|e| e.stage() >= ChainStage::Release);
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
            first: [0; TISSUE_STAGES + 1],
            needle_n_per_m: f64::INFINITY,
            has_state: false,
            force_may_jump: false,
            plain: true,
        }
    }

    /// The layers in space, after geometric effects.
    #[must_use]
    pub fn slabs(&self) -> &[Slab] {
        &self.slabs
    }

    /// Whether the tip follows the needle's base and no layer acts in front of its face: no effect moves the tip against
    /// the base or adds a force at the tip.
    #[must_use]
    pub fn tip_follows_base(&self) -> bool {
        let moves = [ChainStage::Kinematics, ChainStage::Tip, ChainStage::Release]
            .iter()
            .any(|p| !self.effects_at(*p).is_empty());
        !moves && !self.has_compliant_needle()
    }

    /// Whether the needle is compliant.
    #[must_use]
    pub fn has_compliant_needle(&self) -> bool {
        self.needle_n_per_m < f64::INFINITY
    }

    /// The velocity in m/s that multiplies `sum b_i l_i` when the tip moves at `v_mps`: `v_mps` itself, unless an effect
    /// changes the viscous friction.
    #[must_use]
    #[inline]
    pub fn viscous_velocity(&self, v_mps: f64) -> f64 {
        let (mut velocity, mut factor) = (v_mps, 1.0);
        for effect in self.effects_at(ChainStage::Friction) {
            velocity = effect.friction_velocity(velocity);
            factor *= effect.friction_factor(v_mps);
        }
        velocity * factor
    }

    /// Advances to the sample at `time_s` with tip position `z_m` and velocity `v_mps`, reports ruptures (in order; more
    /// than one when a step crosses several faces) and returns the force.
    ///
    /// Time must not run backwards; a repeated time stamp, or one that does run backwards, is a step of zero length. A
    /// sample that is not finite gives a NaN force and leaves the state unchanged. Rupture positions are relative to the
    /// tissue.
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

    /// [`ForceLaw::step`] for many samples, each `[time_s, z_m, v_mps]`; `on_force` receives the force of each.
    #[inline]
    pub fn run(
        &self,
        state: &mut ForceLawState,
        samples: impl Iterator<Item = [f64; 3]>,
        mut on_rupture: impl FnMut(Rupture),
        mut on_force: impl FnMut(&TissueForce),
    ) {
        if !self.plain {
            return samples.for_each(|[t, z, v]| on_force(&self.step(state, t, z, v, &mut on_rupture)));
        }
        for [time_s, z_m, v_mps] in samples {
            if (time_s + z_m + v_mps).is_finite() {
                on_force(&self.step_plain(
                    state,
                    time_s,
                    z_m,
                    v_mps,
                    &mut CriterionRuptures(&mut on_rupture),
                ));
            } else {
                on_force(&TissueForce::not_finite(state.ruptured + 1));
            }
        }
    }

    /// [`ForceLaw::step`] with imposed ruptures: at this sample the first `ruptured` layers are ruptured, regardless of
    /// their force and the tip's position. Reports the rupture criterion of the layer that was active before, and of every
    /// layer that becomes active in this step.
    ///
    /// For fitting: with ruptures imposed where the measured data show them, the force is smooth in nearly every parameter,
    /// and the criterion shows how far the force law is from rupturing there by itself. With the law's own ruptures imposed,
    /// the result is bit for bit that of [`ForceLaw::step`].
    #[inline]
    pub fn step_imposed(
        &self,
        state: &mut ForceLawState,
        time_s: f64,
        z_m: f64,
        v_mps: f64,
        ruptured: usize,
        on_criterion: impl FnMut(RuptureCriterion),
    ) -> TissueForce {
        self.step_with_policy(state, time_s, z_m, v_mps, &mut ImposedRuptures { ruptured, on_criterion })
    }

    /// [`ForceLaw::step`] with any rupture policy.
    #[inline]
    pub(crate) fn step_with_policy(
        &self,
        state: &mut ForceLawState,
        time_s: f64,
        z_m: f64,
        v_mps: f64,
        policy: &mut impl RupturePolicy,
    ) -> TissueForce {
        if self.plain && (time_s + z_m + v_mps).is_finite() {
            self.step_plain(state, time_s, z_m, v_mps, policy)
        } else {
            self.step_with_effects(state, time_s, z_m, v_mps, policy)
        }
    }

    /// A step with all effects. Not inlined, so that the step of the base law is small enough to be.
    #[inline(never)]
    pub(crate) fn step_with_effects(
        &self,
        state: &mut ForceLawState,
        time_s: f64,
        z_m: f64,
        v_mps: f64,
        policy: &mut impl RupturePolicy,
    ) -> TissueForce {
        if !(time_s + z_m + v_mps).is_finite() {
            return TissueForce::not_finite(state.ruptured + 1);
        }
        let (mut z, mut v) = (z_m, v_mps);
        for effect in self.effects_at(ChainStage::Kinematics) {
            (z, v) = effect.relative_motion(time_s, z, v);
        }
        if !state.started {
            state.begin(time_s, z, v);
        }
        let time_s = time_s.max(state.time_s);
        let dt = time_s - state.time_s;
        if self.needle_n_per_m < f64::INFINITY {
            return self.step_compliant_needle(state, time_s, z, policy);
        }
        let elastic_n = self.elastic_after_ruptures(state, dt, z, v, policy);
        self.rupture_membranes(state, z);
        self.finish_step(state, time_s, z, v, elastic_n)
    }

    /// A step of the base law: the same arithmetic as with effects, without calling any hook.
    #[inline]
    fn step_plain(
        &self,
        state: &mut ForceLawState,
        time_s: f64,
        z: f64,
        v: f64,
        policy: &mut impl RupturePolicy,
    ) -> TissueForce {
        if !state.started {
            state.begin(time_s, z, v);
        }
        let time_s = if time_s > state.time_s { time_s } else { state.time_s };
        let mut elastic_n = 0.0;
        let mut completed_share = 0.0;
        while let Some(slab) = self.slabs.get(state.ruptured) {
            let x = z - slab.front_m;
            elastic_n = slab.stiffness_n_per_m * if x > 0.0 { x } else { 0.0 };
            let criterion = RuptureCriterion {
                layer: state.ruptured + 1,
                elastic_n,
                puncture_n: slab.puncture_n,
                tip_m: z,
                far_m: slab.far_m(),
            };
            if !policy.ruptures(&criterion) {
                break;
            }
            let dt = time_s - state.time_s;
            let rupture =
                Self::locate_rupture(state, slab, dt, z, elastic_n, slab.puncture_n, completed_share);
            completed_share = if dt > 0.0 { (rupture.time_s - state.time_s) / dt } else { 1.0 };
            state.ruptured += 1;
            state.elastic_n = 0.0;
            elastic_n = 0.0;
            policy.on_rupture(rupture);
        }
        state.time_s = time_s;
        state.z_m = z;
        state.v_mps = v;
        state.elastic_n = elastic_n;
        let (passed_layers, layers_ahead) = self.slabs.split_at(state.ruptured.min(self.slabs.len()));
        let along = |slabs: &[Slab]| {
            let mut sum = 0.0;
            for slab in slabs {
                sum += slab.friction_ns_per_m2 * slab.length_inside_m(z);
            }
            sum
        };
        let (cumulative, local) = (along(passed_layers), along(layers_ahead));
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

    /// Elastic force of the active layer, after the ruptures of this step.
    #[inline]
    fn elastic_after_ruptures(
        &self,
        state: &mut ForceLawState,
        dt: f64,
        z: f64,
        v: f64,
        policy: &mut impl RupturePolicy,
    ) -> f64 {
        let mut completed_share = 0.0; // fraction of the step before the latest rupture
        while let Some(slab) = self.slabs.get(state.ruptured) {
            let tip = state.tip_state(state.time_s + dt, z, v);
            // After a rupture only the rest of the step is left.
            let travel = if completed_share > 0.0 { 0.0 } else { 1.0 };
            let tip = TipState { dt_s: (1.0 - completed_share) * dt, dz_m: travel * tip.dz_m, ..tip };
            let elastic = self.layer_elastic_force(slab, &tip, &mut state.effects);
            match self.try_rupture(state, slab, dt, (z, v), elastic, completed_share, policy) {
                None => return elastic,
                Some(rupture) => {
                    completed_share = if dt > 0.0 { (rupture.time_s - state.time_s) / dt } else { 1.0 };
                }
            }
        }
        0.0
    }

    /// Elastic force of a layer after the elastic and relaxation effects.
    #[inline]
    pub(crate) fn layer_elastic_force(&self, slab: &Slab, tip: &TipState, states: &mut EffectStates) -> f64 {
        let depth = tip.z_m - slab.front_m;
        let x = slab.indentation_m(if depth > 0.0 { depth } else { 0.0 });
        let mut elastic = slab.stiffness_n_per_m * x;
        if slab.is_curved() || !self.effects.is_empty() {
            for effect in self.effects_at(ChainStage::Elastic) {
                elastic = effect.elastic_force(slab.stiffness_n_per_m, x, elastic);
            }
            elastic += slab.stiffness_n_per_m * x * slab.kappa_per_m * x + slab.curvature_n_per_m2 * x * x;
            for (effect, memory) in self.effects_with_state(ChainStage::Relaxation, states) {
                elastic = effect.relax(tip, depth, elastic, memory);
            }
            for (effect, memory) in self.effects_with_state(ChainStage::Friction, states) {
                elastic = effect.relax_layer(tip.ruptured + 1, tip.dt_s, elastic, memory);
            }
        }
        elastic
    }

    /// The rupture of the active layer, if the policy decides so. `completed_share` is the fraction of the step that is over.
    #[inline]
    #[allow(clippy::too_many_arguments, reason = "the inputs of one step")]
    pub(crate) fn try_rupture(
        &self,
        state: &mut ForceLawState,
        slab: &Slab,
        dt: f64,
        (z, v): (f64, f64),
        elastic: f64,
        completed_share: f64,
        policy: &mut impl RupturePolicy,
    ) -> Option<Rupture> {
        let mut threshold = slab.puncture_n;
        let layer = state.ruptured + 1;
        for (effect, memory) in self.effects_with_state(ChainStage::Puncture, &mut state.effects) {
            threshold = effect.puncture_force(threshold, v);
            threshold = effect.puncture_force_after_load(
                layer,
                (1.0 - completed_share) * dt,
                elastic,
                threshold,
                memory,
            );
        }
        let criterion = RuptureCriterion {
            layer: state.ruptured + 1,
            elastic_n: elastic,
            puncture_n: threshold,
            tip_m: z,
            far_m: slab.rupture_position_m(),
        };
        if !policy.ruptures(&criterion) {
            return None;
        }
        let rupture = Self::locate_rupture(state, slab, dt, z, elastic, threshold, completed_share);
        for (effect, memory) in self.effects_with_state(ChainStage::Relaxation, &mut state.effects) {
            effect.on_rupture(rupture.released_n, rupture.position_m, memory);
        }
        let mut released = rupture.released_n;
        for (effect, memory) in self.effects_with_state(ChainStage::Release, &mut state.effects) {
            effect.on_rupture(released, rupture.position_m, memory);
            released -= effect.retained_force(released);
        }
        for (effect, memory) in self.effects_with_state(ChainStage::Friction, &mut state.effects) {
            effect.on_layer_rupture(rupture.layer, released, memory);
        }
        state.ruptured += 1;
        state.elastic_n = 0.0;
        policy.on_rupture(rupture);
        Some(rupture)
    }

    /// Time and position of the rupture within the step, by linear interpolation, and the force that it released.
    #[cold]
    fn locate_rupture(
        state: &ForceLawState,
        slab: &Slab,
        dt: f64,
        z: f64,
        elastic: f64,
        threshold: f64,
        completed_share: f64,
    ) -> Rupture {
        let share = |from: f64, to: f64, at: f64| {
            if to > from { ((at - from) / (to - from)).clamp(0.0, 1.0) } else { 1.0 }
        };
        // A layer that is entered within this step is loaded from its front face on, not from the last sample.
        let entry = share(state.z_m, z, slab.front_m);
        let start = if state.z_m < slab.front_m { entry } else { 0.0 }.max(completed_share);
        let far = slab.rupture_position_m();
        let at_face = if z >= far { share(state.z_m, z, far).max(completed_share) } else { 2.0 };
        let at_force = if elastic >= threshold {
            start + (1.0 - start) * share(state.elastic_n, elastic, threshold)
        } else {
            2.0
        };
        let by_force = at_force <= at_face;
        // An imposed rupture without force or face is at the end of the step.
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

    /// Ruptures the membranes of effects with the tip at `z`; returns whether there was any.
    #[inline]
    pub(crate) fn rupture_membranes(&self, state: &mut ForceLawState, z: f64) -> bool {
        let mut any = false;
        for (effect, memory) in self.effects_with_state(ChainStage::Tip, &mut state.effects) {
            any |= effect.ruptures_membrane(z, &self.slabs, memory);
        }
        any
    }

    /// Total force at the end of a step, which is stored in the state.
    #[inline]
    fn finish_step(
        &self,
        state: &mut ForceLawState,
        time_s: f64,
        z: f64,
        v: f64,
        elastic_n: f64,
    ) -> TissueForce {
        let tip = state.tip_state(time_s, z, v);
        state.store(&tip, elastic_n);
        self.total_force(&tip, elastic_n, &mut state.effects)
    }

    /// Elastic force, friction along the shaft and tip effects, with the ground truth.
    #[inline]
    pub(crate) fn total_force(
        &self,
        tip: &TipState,
        elastic_n: f64,
        states: &mut EffectStates,
    ) -> TissueForce {
        let along = |slabs: &[Slab], back_mps: f64| {
            let (mut sum, mut inside) = (0.0, 0.0);
            for slab in slabs {
                let length = slab.contact_length_m(tip.z_m, back_mps);
                inside += length;
                sum += slab.friction_ns_per_m2 * length * (1.0 - slab.replaced_friction_share);
            }
            (sum, inside)
        };
        let (passed_layers, layers_ahead) = self.slabs.split_at(tip.ruptured.min(self.slabs.len()));
        let (mut cumulative, passed) = along(passed_layers, tip.v_mps);
        let (mut local, active) = along(layers_ahead, 0.0);
        let inside = passed + active;
        let mut velocity = tip.v_mps;
        let mut tip_extra_n = 0.0;
        let mut dry_n = 0.0;
        let mut layer_n = 0.0;
        if self.force_may_jump {
            let mut factor = 1.0;
            let mut at = InsertionState { inside_m: inside, slabs: &self.slabs, elastic_n, friction_n: 0.0 };
            for (effect, memory) in self.effects_with_state(ChainStage::Release, states) {
                tip_extra_n += effect.tip_force(tip, &at, memory);
            }
            for (effect, memory) in self.effects_with_state(ChainStage::Friction, states) {
                velocity = effect.friction_velocity(velocity);
                factor *= effect.friction_factor(tip.v_mps);
                at.friction_n = velocity * factor * (cumulative + local) + dry_n;
                dry_n += effect.shaft_force(tip, &at, memory);
            }
            at.friction_n = velocity * factor * (cumulative + local) + dry_n;
            for (effect, memory) in self.effects_with_state(ChainStage::Tip, states) {
                tip_extra_n += effect.tip_force(tip, &at, memory);
            }
            for (effect, memory) in self.effects_with_state(ChainStage::Friction, states) {
                layer_n += effect.layer_friction(tip, &self.slabs, velocity * factor, memory);
            }
            cumulative *= factor;
            local *= factor;
        }
        let friction_n = velocity * (cumulative + local) + dry_n + layer_n;
        let total_n = elastic_n + friction_n + tip_extra_n;
        // Dry friction is shared in proportion to the length inside.
        let passed_dry_n = if inside > 0.0 { dry_n * passed / inside } else { 0.0 };
        TissueForce {
            total_n,
            elastic_n,
            friction_n,
            tip_extra_n,
            cumulative_friction_ns_per_m: cumulative,
            // Without the friction of the passed layers: viscous, dry, presliding, and that of single layers.
            tip_n: total_n - cumulative * velocity - passed_dry_n - layer_n,
            active_layer: tip.ruptured + 1,
        }
    }

    /// The effects of a stage.
    #[inline]
    fn effects_at(&self, stage: ChainStage) -> &[AnyEffect] {
        self.effects.get(self.range(stage)).unwrap_or(&[])
    }

    /// The effects of a stage, each with its state.
    #[inline]
    pub(crate) fn effects_with_state<'a>(
        &'a self,
        stage: ChainStage,
        states: &'a mut EffectStates,
    ) -> impl Iterator<Item = (&'a AnyEffect, &'a mut EffectState)> {
        let range = self.range(stage);
        let states = states.get_mut(range.clone()).unwrap_or(&mut []);
        self.effects.get(range).unwrap_or(&[]).iter().zip(states)
    }

    #[inline]
    fn range(&self, stage: ChainStage) -> core::ops::Range<usize> {
        let stage = (stage as usize).min(TISSUE_STAGES - 1);
        usize::from(self.first[stage])..usize::from(self.first[stage + 1])
    }
}
