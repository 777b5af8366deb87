use super::parameters::ParameterVector;
use crate::chain_stage::ChainStage;
use crate::effect::{Effect, EffectState, InsertionState, TipState, sgn};
use crate::effect_info::{EffectInfo, ParameterError, ParameterInfo, Proposal};

/// Dry friction that is larger at low speed: `f_B += sgn(v) sum l_i (c + (c_s - c) exp(-(v/v_s)²))`, `c_s >= c`.
///
/// With `c_s = c` it is `coulomb_friction`.
///
/// Inactive: `c = c_s = 0`. Signature: larger force at lower speed, a break-away peak after each stop.
/// Source: Stribeck curve, as in the LuGre model.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct StribeckFriction {
    /// Friction per metre at high speed, `c` in N/m, 0 to 10 000. Inactive: 0.
    pub c_n_per_m: f64,
    /// Friction per metre at low speed, `c_s` in N/m, at least `c`. Inactive: 0.
    pub c_static_n_per_m: f64,
    /// Speed `v_s` of the transition in m/s, 1e-6 to 1.
    pub v_stribeck_mps: f64,
}

impl Default for StribeckFriction {
    /// The inactive effect.
    fn default() -> Self {
        Self { c_n_per_m: 0.0, c_static_n_per_m: 0.0, v_stribeck_mps: 2e-3 }
    }
}

static INFO: EffectInfo = EffectInfo {
    id: "stribeck_friction",
    equation: "+ sgn(v) sum l_i (c + (c_s - c) exp(-(v/v_s)^2)), c_s >= c",
    source: "Stribeck curve, as in the LuGre model",
    signature: "Force higher at lower speed, and a break-away peak after each stop.",
    stage: ChainStage::Friction,
    parameters: &[
        ParameterInfo::strength("c_n_per_m", "N/m", "dry friction per metre of needle inside at high speed")
            .allowed(0.0, 1e4)
            .search(3.0, 0.05, 100.0)
            .log(),
        ParameterInfo::strength(
            "c_static_n_per_m",
            "N/m",
            "dry friction per metre of needle inside at low speed",
        )
        .allowed(0.0, 1e4)
        .search(6.0, 0.05, 200.0)
        .log(),
        ParameterInfo::shape("v_stribeck_mps", "m/s", "speed at which static friction fades")
            .allowed(1e-6, 1.0)
            .inactive(2e-3)
            .search(2e-3, 1e-4, 2e-2)
            .log(),
    ],
    proposal: Proposal::LinearColumns(&[
        &[&[1.0, 1.0, 3e-4], &[0.0, 1.0, 3e-4]],
        &[&[1.0, 1.0, 8e-4], &[0.0, 1.0, 8e-4]],
        &[&[1.0, 1.0, 2e-3], &[0.0, 1.0, 2e-3]],
        &[&[1.0, 1.0, 5e-3], &[0.0, 1.0, 5e-3]],
    ]),
    ..EffectInfo::DEFAULTS
};

impl ParameterVector for StribeckFriction {
    fn values(&self) -> alloc::vec::Vec<f64> {
        alloc::vec![self.c_n_per_m, self.c_static_n_per_m, self.v_stribeck_mps]
    }
    fn from_values(values: &[f64]) -> Option<Self> {
        let [c_n_per_m, c_static_n_per_m, v_stribeck_mps] = *values else { return None };
        Some(Self { c_n_per_m, c_static_n_per_m, v_stribeck_mps })
    }
    /// The excess at low speed over that at high speed instead of the value at low speed, which may not be less.
    fn coordinates(&self) -> alloc::vec::Vec<f64> {
        alloc::vec![self.c_n_per_m, self.c_static_n_per_m - self.c_n_per_m, self.v_stribeck_mps]
    }
    fn from_coordinates(coordinates: &[f64]) -> Option<Self> {
        let [c_n_per_m, beyond, v_stribeck_mps] = *coordinates else { return None };
        Some(Self { c_n_per_m, c_static_n_per_m: c_n_per_m + beyond, v_stribeck_mps })
    }
    fn check_together(&self) -> Result<(), ParameterError> {
        if self.c_static_n_per_m >= self.c_n_per_m {
            return Ok(());
        }
        Err(ParameterError {
            effect: INFO.id,
            path: "c_static_n_per_m",
            value: self.c_static_n_per_m,
            allowed: (self.c_n_per_m, 1e4),
        })
    }
}

impl Effect for StribeckFriction {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_inactive(&self) -> bool {
        self.c_n_per_m == 0.0 && self.c_static_n_per_m == 0.0
    }
    fn shaft_force(&self, tip: &TipState, at: &InsertionState, _state: &mut EffectState) -> f64 {
        let inside_m = at.inside_m;
        let sign = sgn(tip.v_mps);
        if sign == 0.0 || inside_m == 0.0 {
            return 0.0;
        }
        let ratio = tip.v_mps / self.v_stribeck_mps;
        let extra = (self.c_static_n_per_m - self.c_n_per_m) * libm::exp(-ratio * ratio);
        sign * inside_m * (self.c_n_per_m + extra)
    }
}
