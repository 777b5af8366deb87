use super::Described;
use crate::effect::{ChainStage, Effect, EffectState};
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};
use crate::layer_geometry::Slab;

/// A layer that gives way after having borne a force for a time: damage that adds up.
///
/// `D' = (f_K/F_1)^n / 1 s`, and the layer ruptures when `D = 1`, whatever its puncture force and wherever its far face. Under a
/// constant force `F_1` that takes one second, under `2 F_1` `2^n` times less; a large `n` is a threshold of the force. Integrated
/// exactly for a force that is linear within a step. As the force at the rupture the law sees `f_K / D^(1/n)`: what `F_1` would have to
/// be for the rupture to be now.
///
/// Source: linear damage under Basquin's power law (Zhurkov 1965; Vincent 1990 for soft tissue), measured in a muscle phantom.
/// Signature: a rupture at rest, or under a force that was borne before; faster insertions rupture under more force.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct DelayedPuncture {
    /// Layer, 1-based; one that is not there changes nothing.
    pub layer: usize,
    /// Elastic force `F_1` in N that the layer bears for one second, positive. Neutral: infinity.
    pub force_n: f64,
    /// Exponent `n`, 1 to 200.
    pub exponent: f64,
}

impl Default for DelayedPuncture {
    /// The neutral effect.
    fn default() -> Self {
        Self { layer: 1, force_n: f64::INFINITY, exponent: 10.0 }
    }
}

static INFO: EffectInfo = EffectInfo {
    id: "delayed_puncture",
    equation: "rupture when the integral of (f_K/F_1)^n dt reaches 1 s",
    source: "Linear damage under a power law of the force (Zhurkov 1965); measured muscle phantom",
    signature: "A rupture in a hold, or under a force that the layer had borne before.",
    stage: ChainStage::Puncture,
    parameters: &[
        ParameterInfo::shape("layer", "", "layer, 1-based")
            .allowed(1.0, 1000.0)
            .inactive(1.0)
            .search(1.0, 1.0, 10.0)
            .integer(),
        ParameterInfo::strength("force_n", "N", "elastic force that the layer bears for one second")
            .allowed(1e-3, f64::INFINITY)
            .inactive(f64::INFINITY)
            .search(3.0, 0.3, 30.0),
        ParameterInfo::shape("exponent", "", "exponent of the force")
            .allowed(1.0, 200.0)
            .inactive(10.0)
            .search(10.0, 3.0, 40.0)
            .log(),
    ],
    extended: None,
    proposal: Proposal::PerLayer,
    nested_in: &[],
    absorbs_unmodelled: false,
};

impl Described for DelayedPuncture {
    fn values(&self) -> alloc::vec::Vec<f64> {
        alloc::vec![self.layer as f64, self.force_n, self.exponent]
    }
    fn from_values(values: &[f64]) -> Option<Self> {
        let [layer, force_n, exponent] = *values else { return None };
        let layer = libm::round(layer) as usize; // saturates, and NaN is zero, which is no layer
        Some(Self { layer, force_n, exponent })
    }
}

impl Effect for DelayedPuncture {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_neutral(&self) -> bool {
        self.force_n == f64::INFINITY
    }
    fn remembers(&self) -> bool {
        true
    }
    fn toughened(&mut self, layer: usize, factor: f64) {
        if layer == self.layer {
            self.force_n *= factor;
        }
    }
    fn shape(&self, slabs: &mut [Slab]) {
        if let Some(slab) = self.layer.checked_sub(1).and_then(|i| slabs.get_mut(i)) {
            slab.reach_m = f64::INFINITY;
        }
    }
    /// Memory: the damage and the force before, relative to `F_1`.
    fn endure(
        &self,
        layer: usize,
        dt_s: f64,
        elastic_n: f64,
        threshold_n: f64,
        memory: &mut EffectState,
    ) -> f64 {
        if layer != self.layer {
            return threshold_n;
        }
        let now = elastic_n.max(0.0) / self.force_n;
        let before = core::mem::replace(&mut memory[1], now);
        if dt_s > 0.0 && (now > 0.0 || before > 0.0) {
            let n = self.exponent;
            let most = now.max(before);
            // In units of the larger force, which no power takes beyond 1.
            let share = now.min(before) / most;
            let mean = if share < 0.999_9 {
                (1.0 - libm::pow(share, n + 1.0)) / ((n + 1.0) * (1.0 - share))
            } else {
                0.5 * (1.0 + libm::pow(share, n))
            };
            memory[0] += dt_s * mean * libm::exp((n * libm::log(most)).min(600.0));
        }
        if memory[0] > 0.0 {
            elastic_n.max(0.0) / libm::pow(memory[0], 1.0 / self.exponent)
        } else {
            f64::INFINITY
        }
    }
}
