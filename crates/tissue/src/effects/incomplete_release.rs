use crate::chain_stage::ChainStage;
use crate::effect::{Effect, EffectState, InsertionState, SGN_DEAD_BAND_MPS, TipState};
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};

/// A rupture that releases a part of the elastic force: the share `rho` of `f_K` at rupture stays as a constant tip
/// force until the next rupture or reversal.
///
/// Inactive: `rho = 0`. Signature: the force does not fall to the friction line after a puncture.
/// Source: Okamura, Simone, O'Leary 2004 (liver: drop of 0.66 N out of 2.30 N).
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct IncompleteRelease {
    /// Retained share `rho`, 0 to 1. Inactive: 0.
    pub fraction: f64,
}

static INFO: EffectInfo = EffectInfo {
    id: "incomplete_release",
    equation: "+ rho f_K(at rupture), constant until the next rupture or reversal",
    source: "Okamura, Simone, O'Leary 2004 (liver: drop 0.66 N of 2.30 N)",
    signature: "The force does not fall to the friction line after a puncture, and the rest goes at reversal.",
    stage: ChainStage::Release,
    parameters: &[ParameterInfo::strength("fraction", "", "share of the elastic force that stays")
        .allowed(0.0, 1.0)
        .search(0.3, 0.01, 0.99)],
    proposal: Proposal::LinearColumns(&[&[&[0.05]]]),
    ..EffectInfo::DEFAULTS
};

described!(IncompleteRelease { fraction });

impl Effect for IncompleteRelease {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_inactive(&self) -> bool {
        self.fraction == 0.0
    }
    fn has_state(&self) -> bool {
        true
    }
    fn retained_force(&self, released_n: f64) -> f64 {
        self.fraction * released_n
    }
    fn on_rupture(&self, released_n: f64, _z_m: f64, state: &mut EffectState) {
        state[0] = self.fraction * released_n;
    }
    fn tip_force(&self, tip: &TipState, _at: &InsertionState, state: &mut EffectState) -> f64 {
        if tip.v_mps < -SGN_DEAD_BAND_MPS {
            state[0] = 0.0;
        }
        state[0]
    }
}
