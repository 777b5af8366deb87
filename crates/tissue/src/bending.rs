//! A needle that gives: the position of the tip at which needle and tissue are in balance.
//!
//! `needle_compliance` asks for `z_tip = z - f(z_tip, v_tip)/k_s` at every sample, with
//! `v_tip = (z_tip - z_tip_before)/dt`. Within a step the unknown is the tip's velocity `v`; the
//! surplus `h(v) = z_tip + f/k_s - z` rises with it wherever force rises with depth and speed. It
//! is solved by secant steps inside a bracket, without ruptures first: a layer (or membrane) that
//! would give way at the solution does, and the balance is sought again without it, which is how
//! the tip jumps. Where the force jumps at the dead band of `sgn` (dry friction), the solution may
//! lie in the jump: the tip sticks and friction is what the spring asks for.

use crate::breaking::Breaking;
use crate::effect::{SGN_DEAD_BAND_MPS, sgn};
use crate::force::TissueForce;
use crate::law::Law;
use crate::state::LawState;

/// Largest surplus in metres that counts as balance.
const TOLERANCE_M: f64 = 1e-13;

/// Evaluations of the law per search at most.
const MAX_TRIALS: usize = 80;

/// Just outside the dead band.
const SLIDING_MPS: f64 = SGN_DEAD_BAND_MPS * (1.0 + 1e-9);

/// Where the tip is in balance.
#[derive(Clone, Copy)]
struct Balance {
    z: f64,
    v: f64,
    /// The force there, when it could be told without the effects' remembering anything.
    force: Option<TissueForce>,
    /// Force in N when the tip sticks: the spring's, somewhere in the jump of the law's.
    stuck_n: Option<f64>,
}

/// What is sought: the tip's velocity, or its position when no time has passed.
#[derive(Clone, Copy)]
struct Step {
    dt: f64,
    /// The part of `dt` after the ruptures so far.
    left: f64,
    base_m: f64,
    from_m: f64,
    v_before: f64,
}

impl Step {
    /// Position and velocity of the tip at the value `u` of the unknown.
    fn tip(&self, u: f64) -> (f64, f64) {
        if self.dt > 0.0 { (self.from_m + u * self.dt, u) } else { (u, self.v_before) }
    }

    /// Where to go from `u` towards `target`: not across an edge of the dead band without having
    /// looked at both of its sides.
    fn up_to_the_jump(&self, u: f64, target: f64) -> f64 {
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

impl Law {
    /// [`Law::step`] with a needle that gives, from its kinematics on.
    #[inline(never)]
    pub(crate) fn step_bending(
        &self,
        state: &mut LawState,
        time_s: f64,
        base_m: f64,
        breaking: &mut impl Breaking,
    ) -> TissueForce {
        let dt = time_s - state.time_s;
        let mut done = 0.0; // share of the step that the ruptures so far have used up
        loop {
            // Every turn but the last breaks a layer or a membrane, so there are few.
            let left = (1.0 - done) * dt;
            let step = Step { dt, left, base_m, from_m: state.z_m, v_before: state.v_mps };
            let Balance { z, v, force, stuck_n } = self.balance(state, step);
            if self.membrane_breaks(state, z) {
                continue;
            }
            let mut elastic = 0.0;
            if let Some(slab) = self.slabs.get(state.ruptured) {
                elastic = match force {
                    Some(force) => force.elastic_n,
                    None => self.elastic(slab, left, z, &mut state.memory),
                };
                if let Some(rupture) = self.give_way(state, slab, dt, (z, v), elastic, done, breaking) {
                    done = if dt > 0.0 { (rupture.time_s - state.time_s) / dt } else { 1.0 };
                    continue;
                }
            }
            let moment = state.moment(time_s, z, v);
            state.remember(&moment, elastic);
            let mut force = force.unwrap_or_else(|| self.sum_up(&moment, elastic, &mut state.memory));
            if let Some(total_n) = stuck_n {
                let missing = total_n - force.total_n;
                force.friction_n += missing;
                force.tip_n += missing;
                force.total_n = total_n;
            }
            return force;
        }
    }

    /// Force at a trial position of the tip, with nothing breaking and nothing remembered.
    fn trial(&self, state: &mut LawState, step: &Step, u: f64) -> TissueForce {
        let (z_m, v_mps) = step.tip(u);
        let elastic = match self.slabs.get(state.ruptured) {
            Some(slab) => self.elastic(slab, step.left, z_m, &mut state.memory),
            None => 0.0,
        };
        self.sum_up(&state.moment(state.time_s + step.dt, z_m, v_mps), elastic, &mut state.memory)
    }

    /// How fast the surplus rises with the unknown by stiffness and viscous friction alone.
    fn slope(&self, state: &LawState, step: &Step, u: f64) -> f64 {
        let (z, v) = step.tip(u);
        let mut friction = 0.0;
        let mut by_depth = 0.0;
        for (i, slab) in self.slabs.iter().enumerate() {
            let inside = slab.inside_m(z);
            friction += slab.friction_ns_per_m2 * inside;
            if inside > 0.0 && inside < slab.thickness_m {
                by_depth += slab.friction_ns_per_m2 * v;
            }
            if i == state.ruptured && inside > 0.0 {
                by_depth += slab.stiffness_n_per_m;
            }
        }
        let by_depth = 1.0 + by_depth.max(0.0) / self.needle_n_per_m;
        if step.dt > 0.0 { step.dt * by_depth + friction / self.needle_n_per_m } else { by_depth }
    }

    /// Solves `z_tip + f/k_s - z = 0` with the layers as they are.
    fn balance(&self, state: &mut LawState, step: Step) -> Balance {
        let memory = self.remembers.then_some(state.memory);
        let mut u = if step.dt > 0.0 { step.v_before + state.dv_mps } else { step.base_m };
        let (mut low, mut high) = (None, None); // the bracket: surplus negative, positive
        let mut before: Option<(f64, f64)> = None;
        let mut best = (u, f64::INFINITY, None);
        let smallest = if step.dt > 0.0 { 2e-9 * SGN_DEAD_BAND_MPS } else { TOLERANCE_M };
        let mut stuck = false;
        for turn in 0..MAX_TRIALS {
            let force = self.trial(state, &step, u);
            if let Some(memory) = &memory {
                state.memory = *memory;
            }
            let surplus = step.tip(u).0 + force.total_n / self.needle_n_per_m - step.base_m;
            if surplus.abs() < best.1 {
                best = (u, surplus.abs(), Some(force));
            }
            if surplus.abs() <= TOLERANCE_M {
                break;
            }
            *if surplus < 0.0 { &mut low } else { &mut high } = Some(u);
            if let (Some(low), Some(high)) = (low, high)
                && f64::abs(high - low) <= smallest
            {
                stuck = true;
                best = (if low.abs() < high.abs() { low } else { high }, 0.0, None);
                break;
            }
            let secant = before.map(|(at, was)| (surplus - was) / (u - at));
            let slope = match (secant, before) {
                (Some(slope), Some((at, _))) if slope > 0.0 && slope.is_finite() && sgn(at) == sgn(u) => {
                    slope
                }
                _ => self.slope(state, &step, u),
            };
            let mut next = u - surplus / slope;
            if self.jumps {
                next = step.up_to_the_jump(u, next);
            }
            if let (Some(low), Some(high)) = (low, high) {
                let inside = f64::min(low, high) < next && next < f64::max(low, high);
                if !inside || turn % 4 == 3 {
                    next = 0.5 * (low + high);
                }
            } else if turn > 3 {
                // Force that falls with depth or speed: look further and further.
                next = u + (next - u) * (1u64 << (turn - 3).min(40)) as f64;
            }
            before = Some((u, surplus));
            u = next;
        }
        let (z, v) = step.tip(best.0);
        let force = best.2.filter(|_| memory.is_none());
        Balance { z, v, force, stuck_n: stuck.then_some((step.base_m - z) * self.needle_n_per_m) }
    }
}
