use super::parameters::{LAYER, layer_mut};
use crate::chain_stage::ChainStage;
use crate::effect::{Effect, EffectState};
use crate::effect_info::{EffectInfo, ParameterInfo};
use crate::layer_geometry::Slab;

/// A layer that ruptures by accumulated damage: `D' = (f_K/F_1)^n / (1 s)`, rupture at `D = 1`, whatever its
/// puncture force and far face.
///
/// A constant force `F_1` takes one second, `2 F_1` takes `2^n` times less; a large `n` is a force threshold. Integrated
/// exactly for a force that is linear within a step. The reported puncture force is `f_K / D^(1/n)`: the `F_1` for which
/// the rupture would be now.
///
/// Inactive: `F_1 = inf`. Signature: a rupture at rest, or under a force that the layer carried before; faster insertions
/// rupture at larger force. Source: linear damage under Basquin's power law (Zhurkov 1965; Vincent 1990 for soft tissue),
/// measured in a muscle phantom.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct DelayedPuncture {
    /// Layer, 1-based; without such a layer the effect is inactive.
    pub layer: usize,
    /// Elastic force `F_1` in N that the layer carries for one second, positive. Inactive: infinity.
    pub force_n: f64,
    /// Exponent `n`, 1 to 200.
    pub exponent: f64,
}

impl Default for DelayedPuncture {
    /// The inactive effect.
    fn default() -> Self {
        Self { layer: 1, force_n: f64::INFINITY, exponent: 10.0 }
    }
}

static INFO: EffectInfo = EffectInfo {
    id: "delayed_puncture",
    equation: "rupture when the integral of (f_K/F_1)^n dt reaches 1 s",
    source: "Linear damage under a power law of the force (Zhurkov 1965); measured muscle phantom",
    signature: "A rupture in a hold, or under a force that the layer carried before.",
    stage: ChainStage::Puncture,
    parameters: &[
        LAYER,
        ParameterInfo::strength("force_n", "N", "elastic force that the layer carries for one second")
            .allowed(1e-3, f64::INFINITY)
            .inactive(f64::INFINITY)
            .search(3.0, 0.3, 30.0),
        ParameterInfo::shape("exponent", "", "exponent of the force")
            .allowed(1.0, 200.0)
            .inactive(10.0)
            .search(10.0, 3.0, 40.0)
            .log(),
    ],
    ..EffectInfo::DEFAULTS
};

described!(DelayedPuncture { layer; force_n, exponent });

impl Effect for DelayedPuncture {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_inactive(&self) -> bool {
        self.force_n == f64::INFINITY
    }
    fn has_state(&self) -> bool {
        true
    }
    fn scale_puncture(&mut self, layer: usize, factor: f64) {
        if layer == self.layer {
            self.force_n *= factor;
        }
    }
    fn modify_layers(&self, slabs: &mut [Slab]) {
        if let Some(slab) = layer_mut(slabs, self.layer) {
            slab.reach_m = f64::INFINITY;
        }
    }
    /// State: the damage, and the previous force relative to `F_1`.
    fn puncture_force_after_load(
        &self,
        layer: usize,
        dt_s: f64,
        elastic_n: f64,
        threshold_n: f64,
        state: &mut EffectState,
    ) -> f64 {
        if layer != self.layer {
            return threshold_n;
        }
        let now = elastic_n.max(0.0) / self.force_n;
        let before = core::mem::replace(&mut state[1], now);
        if dt_s > 0.0 && (now > 0.0 || before > 0.0) {
            let n = self.exponent;
            let most = now.max(before);
            // Relative to the larger force, so that no power exceeds 1.
            let share = now.min(before) / most;
            let mean = if share < 0.999_9 {
                (1.0 - libm::pow(share, n + 1.0)) / ((n + 1.0) * (1.0 - share))
            } else {
                0.5 * (1.0 + libm::pow(share, n))
            };
            state[0] += dt_s * mean * libm::exp((n * libm::log(most)).min(600.0));
        }
        if state[0] > 0.0 {
            elastic_n.max(0.0) / libm::pow(state[0], 1.0 / self.exponent)
        } else {
            f64::INFINITY
        }
    }
}
