//! Compliant needle: the tip position at which needle and tissue are in balance.
//!
//! `needle_compliance` requires `z_tip = z - f(z_tip, v_tip)/k_s` at every sample. Within a step the unknown is the tip
//! velocity `v` at its end, with the travel `dt ((1 - theta) v_before + theta v)`. `theta` makes the step exact for the
//! relaxation of the tip, whose time constant is `tau = sum_i b_i l_i/(k_s + K_a)` (exponential fitting: Liniger and
//! Willoughby 1970): 1/2 in steps much shorter than `tau`, 1 (backward Euler) without viscous friction. The residual
//! `h(v) = z_tip + f/k_s - z` increases with `v` wherever the force increases with depth and speed; its root is found by
//! secant steps inside a bracket, first without ruptures. A layer that would rupture on the way does so at its time: the
//! tip keeps its position, gets the velocity at which friction balances the released force, and the rest of the step
//! continues from there (without viscous friction the tip jumps). Where the force jumps at the dead band of `sgn` (dry
//! friction), the root may lie in the jump: the tip sticks, and the friction is what the spring force requires.

use crate::effect::{SGN_DEAD_BAND_MPS, TipState, sgn};
use crate::force::{Rupture, TissueForce};
use crate::force_law::ForceLaw;
use crate::force_law_state::ForceLawState;
use crate::rupture_policy::RupturePolicy;

/// Largest residual in metres that counts as balance.
const TOLERANCE_M: f64 = 1e-13;

/// Relative tolerance of the force balance of a slipping tip.
const SLIP_TOLERANCE: f64 = 1e-9;

/// Most evaluations of the force law per root search.
const MAX_TRIALS: usize = 80;

/// Evaluations after which the search only bisects; the remaining ones suffice for any bracket.
const MAX_SECANT_TRIALS: usize = 16;

/// Velocity in m/s just outside the dead band.
const SLIDING_MPS: f64 = SGN_DEAD_BAND_MPS * (1.0 + 1e-9);

/// Tip position and velocity in balance.
#[derive(Clone, Copy)]
struct Balance {
    z: f64,
    v: f64,
    /// The force there, when it does not depend on the state of an effect.
    force: Option<TissueForce>,
    /// For a sticking tip: the spring force in N, and the force on both sides of the jump.
    stuck: Option<(f64, [TissueForce; 2])>,
}

/// The equation of a step. Its unknown is the tip velocity, or the tip position in a step of zero length.
#[derive(Clone, Copy)]
struct Step {
    dt: f64,
    /// Weight of the end velocity in the travel, 1/2 to 1.
    theta: f64,
    base_m: f64,
    from_m: f64,
    v_before: f64,
    /// Correction of the travel for an accelerating base.
    lead_m: f64,
}

/// Weight of the end velocity in a step of `dt_s` that is exact for a relaxation with `tau_s`.
fn theta(dt_s: f64, tau_s: f64) -> f64 {
    let ratio = dt_s / tau_s;
    if ratio.is_nan() || ratio > 700.0 {
        1.0
    } else if ratio < 1e-3 {
        0.5 + ratio / 12.0
    } else {
        -1.0 / libm::expm1(-ratio) - 1.0 / ratio
    }
}

/// Sets the force of a sticking tip to `total_n`. The difference is shared between friction and tip force in the proportion
/// of the jump between the forces on both sides.
fn stick(force: &mut TissueForce, total_n: f64, [low, high]: [TissueForce; 2]) {
    let missing = total_n - force.total_n;
    let jump = high.total_n - low.total_n;
    let share = if jump == 0.0 { 0.0 } else { missing / jump };
    let at_tip = share * (high.tip_extra_n - low.tip_extra_n);
    force.tip_extra_n += at_tip;
    force.friction_n += missing - at_tip;
    force.tip_n += share * (high.tip_n - low.tip_n);
    force.total_n = total_n;
}

impl Step {
    /// Position and velocity of the tip at the value `u` of the unknown.
    fn tip(&self, u: f64) -> (f64, f64) {
        if self.dt > 0.0 {
            (self.from_m + self.lead_m + self.dt * ((1.0 - self.theta) * self.v_before + self.theta * u), u)
        } else {
            (u, self.v_before)
        }
    }

    /// The next trial from `u` towards `target`, which evaluates both sides of an edge of the dead band before crossing it.
    fn limit_to_dead_band_edge(&self, u: f64, target: f64) -> f64 {
        let (here, there) = (sgn(u), sgn(target));
        if self.dt == 0.0 || here == there {
            return target;
        }
        let side = if here == 0.0 { there } else { here };
        let (near, beyond) = if here == 0.0 {
            (side * SGN_DEAD_BAND_MPS, side * SLIDING_MPS)
        } else {
            (side * SLIDING_MPS, side * SGN_DEAD_BAND_MPS)
        };
        if u == near { beyond } else { near }
    }
}

impl ForceLaw {
    /// [`ForceLaw::step`] with a compliant needle, after the kinematic effects.
    #[inline(never)]
    pub(crate) fn step_compliant_needle(
        &self,
        state: &mut ForceLawState,
        time_s: f64,
        base_m: f64,
        policy: &mut impl RupturePolicy,
    ) -> TissueForce {
        let mut base_before = if state.base_known { state.base_m } else { base_m };
        state.base_known = true;
        state.base_m = base_m;
        let mut just_released = false; // a layer has ruptured at this time
        loop {
            // Every iteration but the last ruptures a layer or a membrane, so there are few.
            let dt = time_s - state.time_s;
            let (viscous, stiffness) = self.resistance(state);
            let tau = viscous / (self.needle_n_per_m + stiffness);
            let theta = theta(dt, tau);
            // The tip accelerates with the base: its travel is that of the mean speed.
            let lead_m = (0.5 - theta) * state.base_acceleration_mps2 * dt * dt;
            let step = Step { dt, theta, base_m, from_m: state.z_m, v_before: state.v_mps, lead_m };
            let Balance { z, v, force, stuck } = if just_released && dt <= 0.0 && viscous > 0.0 {
                Balance { z: state.z_m, v: state.v_mps, force: None, stuck: None }
            } else {
                self.balance(state, step)
            };
            if self.rupture_membranes(state, z) {
                continue;
            }
            let mut elastic = 0.0;
            if let Some(slab) = self.slabs.get(state.ruptured) {
                elastic = match force {
                    Some(force) => force.elastic_n,
                    None => {
                        let tip = state.tip_state(time_s, z, v);
                        self.layer_elastic_force(slab, &tip, &mut state.effects)
                    }
                };
                if let Some(rupture) = self.try_rupture(state, slab, dt, (z, v), elastic, 0.0, policy) {
                    let share = if dt > 0.0 { (rupture.time_s - state.time_s) / dt } else { 1.0 };
                    let base = base_before + share * (base_m - base_before);
                    self.release_layer(state, &rupture, base, v, share);
                    base_before = base;
                    just_released = true;
                    continue;
                }
            }
            let tip = state.tip_state(time_s, z, v);
            state.store(&tip, elastic);
            let mut force = force.unwrap_or_else(|| self.total_force(&tip, elastic, &mut state.effects));
            if let Some((total_n, sides)) = stuck {
                stick(&mut force, total_n, sides);
            }
            return force;
        }
    }

    /// Moves the tip to the time of a rupture, with the base at `base_m` and the velocity at which friction balances the
    /// released force.
    fn release_layer(
        &self,
        state: &mut ForceLawState,
        rupture: &Rupture,
        base_m: f64,
        v_end: f64,
        share: f64,
    ) {
        state.v_mps += share * (v_end - state.v_mps);
        state.z_m = rupture.position_m;
        state.time_s = rupture.time_s;
        let (viscous, _) = self.resistance(state);
        if viscous > 0.0 {
            state.v_mps = self.slip_speed(state, base_m, viscous);
            state.dv_mps = 0.0;
        }
    }

    /// The tip velocity at which friction balances the needle force, at the present tip position.
    ///
    /// Linear viscous friction gives it directly. Where friction is larger at that speed (`power_law_friction` above 1), the
    /// root below is found by false position (Illinois). Where friction is smaller, the linear value is kept: the tip would
    /// be faster, but its travel to the new balance is the same.
    fn slip_speed(&self, state: &mut ForceLawState, base_m: f64, viscous: f64) -> f64 {
        let effect_states = state.effects;
        let (at_m, v_mps) = (state.z_m, state.v_mps);
        let pressed_n = (base_m - at_m) * self.needle_n_per_m;
        let mut missing = |v_before: f64| {
            let step = Step { dt: 0.0, theta: 1.0, base_m, from_m: at_m, v_before, lead_m: 0.0 };
            let force = self.trial(state, &step, at_m);
            state.effects = effect_states;
            pressed_n - force.total_n
        };
        let (mut from, mut lacks) = (v_mps, missing(v_mps));
        let mut to = from + lacks / viscous;
        let close = SLIP_TOLERANCE * (f64::abs(pressed_n) + f64::abs(lacks));
        let mut left = missing(to);
        for _ in 0..MAX_TRIALS {
            if left.abs() <= close || to == from || (lacks > 0.0) == (left > 0.0) {
                break;
            }
            let mid = from + (to - from) * lacks / (lacks - left);
            let there = missing(mid);
            if (there > 0.0) == (left > 0.0) {
                lacks *= 0.5;
            } else {
                (from, lacks) = (to, left);
            }
            (to, left) = (mid, there);
        }
        to
    }

    /// Viscous friction in N s/m and stiffness in N/m at the present tip position.
    fn resistance(&self, state: &ForceLawState) -> (f64, f64) {
        let viscous = self.slabs.iter().map(|s| s.friction_ns_per_m2 * s.length_inside_m(state.z_m)).sum();
        let active = self.slabs.get(state.ruptured).filter(|s| state.z_m > s.front_m);
        (viscous, active.map_or(0.0, |s| s.stiffness_n_per_m))
    }

    /// Force at a trial value of the unknown, without ruptures.
    fn trial(&self, state: &mut ForceLawState, step: &Step, u: f64) -> TissueForce {
        let (z_m, v_mps) = step.tip(u);
        let tip = state.tip_state(state.time_s + step.dt, z_m, v_mps);
        let elastic = match self.slabs.get(state.ruptured) {
            Some(slab) => {
                self.layer_elastic_force(slab, &TipState { dt_s: step.dt, ..tip }, &mut state.effects)
            }
            None => 0.0,
        };
        self.total_force(&tip, elastic, &mut state.effects)
    }

    /// Derivative of the residual by the unknown, from stiffness and viscous friction only.
    fn slope(&self, state: &ForceLawState, step: &Step, u: f64) -> f64 {
        let (z, v) = step.tip(u);
        let mut friction = 0.0;
        let mut by_depth = 0.0;
        for (i, slab) in self.slabs.iter().enumerate() {
            let inside = slab.length_inside_m(z);
            friction += slab.friction_ns_per_m2 * inside;
            if inside > 0.0 && inside < slab.thickness_m {
                by_depth += slab.friction_ns_per_m2 * v;
            }
            if i == state.ruptured && inside > 0.0 {
                by_depth += slab.stiffness_n_per_m;
            }
        }
        let by_depth = 1.0 + by_depth.max(0.0) / self.needle_n_per_m;
        if step.dt > 0.0 {
            step.theta * step.dt * by_depth + friction / self.needle_n_per_m
        } else {
            by_depth
        }
    }

    /// Solves `z_tip + f/k_s - z = 0` without ruptures.
    fn balance(&self, state: &mut ForceLawState, step: Step) -> Balance {
        let effect_states = self.has_state.then_some(state.effects);
        let mut u = if step.dt > 0.0 { step.v_before + state.dv_mps } else { step.base_m };
        let (mut low, mut high) = (None, None); // the bracket: residual negative, positive
        let mut sides = [TissueForce::default(); 2]; // and the forces there
        let mut before: Option<(f64, f64)> = None;
        let mut best = (u, f64::INFINITY, None);
        let smallest = if step.dt > 0.0 { 2e-9 * SGN_DEAD_BAND_MPS } else { TOLERANCE_M };
        let mut sticks = false;
        for turn in 0..MAX_TRIALS {
            let force = self.trial(state, &step, u);
            if let Some(effect_states) = &effect_states {
                state.effects = *effect_states;
            }
            let residual = step.tip(u).0 + force.total_n / self.needle_n_per_m - step.base_m;
            if residual.abs() < best.1 {
                best = (u, residual.abs(), Some(force));
            }
            if residual.abs() <= TOLERANCE_M {
                break;
            }
            *if residual < 0.0 { &mut low } else { &mut high } = Some(u);
            sides[usize::from(residual >= 0.0)] = force;
            if let (Some(low), Some(high)) = (low, high)
                && f64::abs(high - low) <= smallest
            {
                sticks = true;
                best = (if low.abs() < high.abs() { low } else { high }, 0.0, None);
                break;
            }
            let secant = before.map(|(at, was)| (residual - was) / (u - at));
            let slope = match (secant, before) {
                (Some(slope), Some((at, _))) if slope > 0.0 && slope.is_finite() && sgn(at) == sgn(u) => {
                    slope
                }
                _ => self.slope(state, &step, u),
            };
            let mut next = u - residual / slope;
            if self.force_may_jump {
                next = step.limit_to_dead_band_edge(u, next);
            }
            if let (Some(low), Some(high)) = (low, high) {
                let inside = f64::min(low, high) < next && next < f64::max(low, high);
                // Where the force jumps, secant steps converge slowly: then bisect.
                if !inside || turn % 4 == 3 || turn >= MAX_SECANT_TRIALS {
                    next = 0.5 * (low + high);
                }
            } else if turn > 3 {
                // Force that decreases with depth or speed: extend the search range.
                next = u + (next - u) * (1u64 << (turn - 3).min(40)) as f64;
            }
            before = Some((u, residual));
            u = next;
        }
        let (z, v) = step.tip(best.0);
        let force = best.2.filter(|_| effect_states.is_none());
        Balance { z, v, force, stuck: sticks.then_some(((step.base_m - z) * self.needle_n_per_m, sides)) }
    }
}

#[cfg(test)]
mod tests;
