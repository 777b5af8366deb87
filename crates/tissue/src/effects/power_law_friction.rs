use crate::chain_stage::ChainStage;
use crate::effect::{Effect, sgn};
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};

/// Friction that is a power of speed: `v -> sgn(v) v0 (abs(v)/v0)^n` in the viscous friction, `v0` = 1 mm/s.
///
/// Inactive: `n = 1`. Signature: friction against speed is a curve through the base law's value at 1 mm/s; not
/// identifiable at one constant velocity. Source: rate dependence of phantoms and liver (van Gerwen et al. 2012).
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct PowerLawFriction {
    /// Exponent `n`, -0.9 to 3; below zero friction falls with speed. Inactive: 1.
    pub exponent: f64,
}

impl Default for PowerLawFriction {
    /// The inactive effect.
    fn default() -> Self {
        Self { exponent: 1.0 }
    }
}

static INFO: EffectInfo = EffectInfo {
    id: "power_law_friction",
    equation: "v -> sgn(v) v0 (|v|/v0)^n in the friction, v0 = 1 mm/s",
    source: "Rate dependence of phantoms and liver: van Gerwen et al. 2012",
    signature: "Friction against speed is a curve, not a line; no offset between speeds near 1 mm/s.",
    stage: ChainStage::Friction,
    parameters: &[ParameterInfo::strength("exponent", "", "exponent of speed in the friction")
        .allowed(-0.9, 3.0)
        .inactive(1.0)
        .search(0.7, 0.1, 2.0)],
    proposal: Proposal::LinearColumns(&[&[&[1.02]]]),
    ..EffectInfo::DEFAULTS
};

described!(PowerLawFriction { exponent });

impl Effect for PowerLawFriction {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_inactive(&self) -> bool {
        self.exponent == 1.0
    }
    fn friction_velocity(&self, v_mps: f64) -> f64 {
        let sign = sgn(v_mps);
        if sign == 0.0 { 0.0 } else { sign * 1e-3 * libm::exp(self.exponent * libm::log(v_mps.abs() / 1e-3)) }
    }
}
