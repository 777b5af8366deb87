use crate::chain_stage::ChainStage;
use crate::effect::{Effect, EffectState, InsertionState, TipState, sgn};
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};

/// Dry friction that builds up with travel (Dahl): `f_B += c xi sum l_i`, `xi' = (v/delta)(1 - xi sgn v)` while the
/// shaft is inside.
///
/// Integrated exactly in the travel `dz` of a sample: `xi` relaxes towards `sgn v` as `exp(-abs(dz)/delta)`; within the
/// dead band of `sgn` it follows `dz/delta`, a spring. `xi` stays within -1 and 1. For `delta -> 0` it is
/// `coulomb_friction`.
///
/// Inactive: `c = 0`. Signature: after each reversal a line of force against travel whose slope does not depend on speed;
/// the friction persists in holds. Source: Dahl 1968; LuGre model.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct PreslidingFriction {
    /// Friction per metre of needle inside once sliding, `c` in N/m, 0 to 10 000. Inactive: 0.
    pub c_n_per_m: f64,
    /// Travel `delta` over which it builds up, in metres, 1e-7 to 0.1.
    pub delta_m: f64,
}

impl Default for PreslidingFriction {
    /// The inactive effect.
    fn default() -> Self {
        Self { c_n_per_m: 0.0, delta_m: 5e-4 }
    }
}

static INFO: EffectInfo = EffectInfo {
    id: "presliding_friction",
    equation: "+ c xi sum l_i, xi' = (v/delta)(1 - xi sgn v) while any shaft is inside",
    source: "Dahl 1968; LuGre model",
    signature: "After each reversal the force follows travel over a finite distance, whatever the speed, and it stays in holds.",
    stage: ChainStage::Friction,
    parameters: &[
        ParameterInfo::strength("c_n_per_m", "N/m", "dry friction per metre of needle inside once sliding")
            .allowed(0.0, 1e4)
            .search(3.0, 0.05, 100.0)
            .log(),
        ParameterInfo::shape("delta_m", "m", "travel over which the friction builds up")
            .allowed(1e-7, 0.1)
            .inactive(5e-4)
            .search(5e-4, 1e-5, 2e-2)
            .log(),
    ],
    proposal: Proposal::LinearColumns(&[
        &[&[1.0, 6e-5]],
        &[&[1.0, 2.5e-4]],
        &[&[1.0, 1e-3]],
        &[&[1.0, 4e-3]],
    ]),
    absorbs_unmodelled: true,
    ..EffectInfo::DEFAULTS
};

described!(PreslidingFriction { c_n_per_m, delta_m });

impl Effect for PreslidingFriction {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_inactive(&self) -> bool {
        self.c_n_per_m == 0.0
    }
    fn has_state(&self) -> bool {
        true
    }
    /// State: `xi`.
    fn shaft_force(&self, tip: &TipState, at: &InsertionState, state: &mut EffectState) -> f64 {
        let inside_m = at.inside_m;
        if inside_m > 0.0 {
            // On entry only the travel inside the tissue counts.
            let dz = tip.dz_m.min(inside_m);
            let sign = sgn(tip.v_mps);
            let xi = state[0];
            let next = if sign * dz > 0.0 {
                sign + (xi - sign) * libm::exp(-dz.abs() / self.delta_m)
            } else {
                xi + dz / self.delta_m * (1.0 - xi * sign)
            };
            state[0] = next.clamp(-1.0, 1.0);
        }
        self.c_n_per_m * state[0] * inside_m
    }
}
