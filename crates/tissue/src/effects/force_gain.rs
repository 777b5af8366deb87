use crate::chain_stage::ChainStage;
use crate::effect::{Effect, EffectState};
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};

/// Calibration error of the sensor: `f -> (1 + eps) f`.
///
/// Inactive: `eps = 0`. Signature: all forces scaled; not identifiable together with `K_i`, `b_i`, `F_i`, so check it with
/// a known load. Source: calibration errors of force sensors.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct ForceGain {
    /// Relative error `eps`, -0.99 to 10. Inactive: 0.
    pub eps: f64,
}

static INFO: EffectInfo = EffectInfo {
    id: "force_gain",
    equation: "f -> (1 + eps) f",
    source: "Calibration of force sensors",
    signature: "All forces scaled, known loads too; invisible in the shape of an insertion.",
    stage: ChainStage::Sensor,
    parameters: &[ParameterInfo::strength("eps", "", "relative error of the force")
        .allowed(-0.99, 10.0)
        .search(0.05, -0.5, 0.5)],
    proposal: Proposal::LinearColumns(&[&[&[0.01]]]),
    ..EffectInfo::DEFAULTS
};

described!(ForceGain { eps });

impl Effect for ForceGain {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_inactive(&self) -> bool {
        self.eps == 0.0
    }
    fn sensor_output(&self, _time_s: f64, _dt_s: f64, force_n: f64, _state: &mut EffectState) -> f64 {
        (1.0 + self.eps) * force_n
    }
}
