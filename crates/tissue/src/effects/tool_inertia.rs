use crate::chain_stage::ChainStage;
use crate::effect::{BaseMotion, Effect, EffectState};
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};

/// Inertia of the tool in front of the sensor: `+ m a`.
///
/// Inactive: `m = 0`. Signature: spikes at start and stop, also in air, in proportion to the acceleration.
/// Source: needle 0.068 kg, sensor 0.236 kg (laboratory software).
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct ToolInertia {
    /// Mass in kg, 0 to 100. Inactive: 0.
    pub mass_kg: f64,
}

static INFO: EffectInfo = EffectInfo {
    id: "tool_inertia",
    equation: "+ m a",
    source: "Needle 0.068 kg, sensor 0.236 kg: the laboratory's software",
    signature: "Spikes at start and stop, also in air, in proportion to the acceleration.",
    stage: ChainStage::Tool,
    parameters: &[ParameterInfo::strength("mass_kg", "kg", "mass beyond the sensor")
        .allowed(0.0, 100.0)
        .search(0.1, 0.005, 5.0)
        .log()],
    proposal: Proposal::LinearColumns(&[&[&[0.1]]]),
    ..EffectInfo::DEFAULTS
};

described!(ToolInertia { mass_kg });

impl Effect for ToolInertia {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_inactive(&self) -> bool {
        self.mass_kg == 0.0
    }
    fn tool_force(&self, base: &BaseMotion, _force_n: f64, _state: &mut EffectState) -> f64 {
        self.mass_kg * base.a_mps2
    }
}
