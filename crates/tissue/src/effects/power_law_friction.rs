use super::Described;
use crate::effect::{ChainStage, Effect, sgn};
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};

/// Friction that is not linear in speed: `v -> sgn(v) v0 (abs(v)/v0)^n` in the viscous friction,
/// `v0 = 1 mm/s`.
///
/// Source: rate dependence of phantoms and liver (van Gerwen et al. 2012: log-like, then flat).
/// Signature: friction against speed is a curve through the base law's value at 1 mm/s; invisible at
/// one constant velocity.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct PowerLawFriction {
    /// Exponent `n`, -0.9 to 3; below zero friction falls with speed. Neutral: 1.
    pub exponent: f64,
}

impl Default for PowerLawFriction {
    /// The neutral effect.
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
    extended: None,
    proposal: Proposal::LinearColumns(&[&[&[1.02]]]),
    nested_in: &[],
    absorbs_unmodelled: false,
};

impl Described for PowerLawFriction {
    fn values(&self) -> alloc::vec::Vec<f64> {
        alloc::vec![self.exponent]
    }
    fn from_values(values: &[f64]) -> Option<Self> {
        let [exponent] = *values else { return None };
        Some(Self { exponent })
    }
}

impl Effect for PowerLawFriction {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_neutral(&self) -> bool {
        self.exponent == 1.0
    }
    fn friction_velocity(&self, v_mps: f64) -> f64 {
        let sign = sgn(v_mps);
        if sign == 0.0 { 0.0 } else { sign * 1e-3 * libm::exp(self.exponent * libm::log(v_mps.abs() / 1e-3)) }
    }
}
