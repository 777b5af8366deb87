use crate::chain_stage::ChainStage;
use crate::effect::{BaseMotion, Effect, EffectState};
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};

/// A force between arm and sensor that is linear in position, in air too: `+ k (z - z_0)`.
///
/// Inactive: `k = 0`. Signature: a line of force against position in air, the same on retraction, whatever the speed.
/// Source: cables, linear guides, return springs, the weight of a tool whose tilt changes with the stroke.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct PositionDependentForce {
    /// Slope `k` in N/m, -10 000 to 10 000. Inactive: 0.
    pub stiffness_n_per_m: f64,
    /// Position `z_0` of the base, in metres, at which the force is zero, -10 to 10.
    pub rest_m: f64,
}

static INFO: EffectInfo = EffectInfo {
    id: "position_dependent_force",
    equation: "+ k (z - z_0), in air too",
    source: "Cables, linear guides, return springs, the weight of a tilted tool",
    signature: "A line of force against position in air, the same on retraction, whatever the speed.",
    stage: ChainStage::Tool,
    parameters: &[
        ParameterInfo::strength("stiffness_n_per_m", "N/m", "slope of the force")
            .allowed(-1e4, 1e4)
            .search(5.0, -200.0, 200.0),
        // The sensor is usually zeroed near the start of the stroke.
        ParameterInfo::shape("rest_m", "m", "position at which the force is zero")
            .allowed(-10.0, 10.0)
            .search(-0.01, -0.2, 0.2)
            .measured_prior(0.0, 0.03),
    ],
    proposal: Proposal::LinearColumns(&[
        &[&[1.0, -0.1]],
        &[&[1.0, -0.03]],
        &[&[1.0, -0.01]],
        &[&[1.0, 0.0]],
        &[&[1.0, 0.03]],
        &[&[1.0, 0.1]],
    ]),
    baseline: true,
    ..EffectInfo::DEFAULTS
};

described!(PositionDependentForce { stiffness_n_per_m, rest_m });

impl Effect for PositionDependentForce {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_inactive(&self) -> bool {
        self.stiffness_n_per_m == 0.0
    }
    fn tool_force(&self, base: &BaseMotion, _force_n: f64, _state: &mut EffectState) -> f64 {
        self.stiffness_n_per_m * (base.z_m - self.rest_m)
    }
}
