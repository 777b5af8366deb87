use crate::chain_stage::ChainStage;
use crate::effect::Effect;
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};

/// Isolated outlying samples of the force. The effect holds the parameters only: the sensor draws the spikes and
/// adds them with the noise.
///
/// Inactive: `rate = 0` or `size = 0`. Signature: single samples far from their neighbours, at any depth and in air.
/// Source: lost bits and loose contacts.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct ForceSpikes {
    /// Mean number per second, 0 to 1000. Inactive: 0.
    pub rate_hz: f64,
    /// Size of a spike in N, -1000 to 1000. Inactive: 0.
    pub size_n: f64,
}

static INFO: EffectInfo = EffectInfo {
    id: "force_spikes",
    equation: "+ isolated samples of size_n, rate_hz of them per second",
    source: "Lost bits and loose contacts",
    signature: "Single samples far from both neighbours, at any depth and in air.",
    stage: ChainStage::Sensor,
    parameters: &[
        ParameterInfo::strength("rate_hz", "Hz", "mean number per second")
            .allowed(0.0, 1000.0)
            .search(0.2, 0.01, 20.0)
            .log(),
        ParameterInfo::strength("size_n", "N", "size of a spike")
            .allowed(-1000.0, 1000.0)
            .search(1.0, 0.1, 20.0)
            .log(),
    ],
    proposal: Proposal::RawSamples,
    ..EffectInfo::DEFAULTS
};

described!(ForceSpikes { rate_hz, size_n });

impl Effect for ForceSpikes {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_inactive(&self) -> bool {
        self.rate_hz == 0.0 || self.size_n == 0.0
    }
}
