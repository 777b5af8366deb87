use super::Described;
use crate::effect::{ChainStage, Effect, EffectState, SGN_DEAD_BAND_MPS, TipState};
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};
use crate::layer_geometry::Slab;

/// A rupture that does not release everything: a share `rho` of `f_K` at rupture stays as a
/// constant tip force until the next rupture or reversal.
///
/// Source: Okamura, Simone, O'Leary 2004 (liver: drop 0.66 N of 2.30 N). Signature: the force
/// does not fall to the friction line after a puncture.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct IncompleteRelease {
    /// Share that stays, `rho`, 0 to 1. Neutral: 0.
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
    extended: None,
    proposal: Proposal::LinearColumns(&[&[&[0.05]]]),
    nested_in: &[],
    absorbs_unmodelled: false,
};

impl Described for IncompleteRelease {
    fn values(&self) -> alloc::vec::Vec<f64> {
        alloc::vec![self.fraction]
    }
    fn from_values(values: &[f64]) -> Option<Self> {
        let [fraction] = *values else { return None };
        Some(Self { fraction })
    }
}

impl Effect for IncompleteRelease {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_neutral(&self) -> bool {
        self.fraction == 0.0
    }
    fn remembers(&self) -> bool {
        true
    }
    fn withheld(&self, released_n: f64) -> f64 {
        self.fraction * released_n
    }
    fn on_rupture(&self, released_n: f64, _z_m: f64, memory: &mut EffectState) {
        memory[0] = self.fraction * released_n;
    }
    fn tip_force(&self, moment: &TipState, _slabs: &[Slab], memory: &mut EffectState) -> f64 {
        if moment.v_mps < -SGN_DEAD_BAND_MPS {
            memory[0] = 0.0;
        }
        memory[0]
    }
}
