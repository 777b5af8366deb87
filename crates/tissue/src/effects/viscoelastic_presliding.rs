use super::parameters::{LAYER, layer_mut};
use crate::chain_stage::ChainStage;
use crate::effect::{Effect, EffectState, TipState};
use crate::effect_info::{EffectInfo, ParameterInfo};
use crate::layer_geometry::Slab;

/// Speed in m/s below which a layer keeps the friction of the last motion (0.1 mm/s).
const REST_MPS: f64 = 1e-4;

/// A punctured layer that adheres to the shaft and is dragged along: a spring in series with friction, which creeps
/// (one branch of a Maxwell-slip model).
///
/// With the sliding friction of the whole layer `S_i = b_i d_i abs(phi(v))` (`phi(v)` is `v`, or what
/// `power_law_friction` and `asymmetric_friction` make of it) the branch exerts
///
/// `w' = (share S_i/delta) v - w/tau`, clipped to `-share S_i` and `share S_i`,
///
/// from the puncture of the layer on. At the puncture `w` starts from `share retained_share f_K`. When the speed changes,
/// `S_i` follows over the travel `delta` in which the contact is renewed, and not at all below 0.1 mm/s. When the tip comes
/// back to `release_m` beyond the layer's front face, the layer releases the shaft: `w = 0`.
///
/// Branches of one layer add up; a share of the layer that no branch carries remains the base law's `b_i l_i phi(v)`.
/// Integrated exactly for a velocity that is constant within the step.
///
/// Inactive: `share = 0`. Signature: after a reversal the force follows travel over several millimetres; part of it fades
/// in a hold; in retraction it ends in a step. Source: Dahl 1968; Al-Bender, Lampaert, Swevers 2005 (generalised
/// Maxwell-slip), with relaxation as measured in skin and muscle phantoms.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct ViscoelasticPresliding {
    /// Layer `i`, 1-based; without such a layer the effect is inactive.
    pub layer: usize,
    /// Share of the layer's friction that this branch carries, 0 to 1. Inactive: 0.
    pub share: f64,
    /// Travel `delta` in metres over which friction builds up from zero to sliding, 1e-6 to 0.1.
    pub delta_m: f64,
    /// Share of the elastic force at the puncture that passes into the branch, 0 to 1.
    pub retained_share: f64,
    /// Time constant `tau` of the creep in seconds, 0.001 to 1e6; the longest means no creep.
    pub time_constant_s: f64,
    /// Release depth in retraction, in metres beyond the layer's front face, -0.1 to 0.1.
    pub release_m: f64,
}

impl Default for ViscoelasticPresliding {
    /// The inactive effect.
    fn default() -> Self {
        Self {
            layer: 1,
            share: 0.0,
            delta_m: 5e-3,
            retained_share: 1.0,
            time_constant_s: 1e6,
            release_m: 0.0,
        }
    }
}

/// `1 - exp(-x)` for `x >= 0`; below 0.1 by its series, to 1e-10 of the value.
fn one_minus_exp(x: f64) -> f64 {
    if x < 0.1 {
        let series = 1.0 - x / 6.0 * (1.0 - x / 7.0);
        x * (1.0 - x / 2.0 * (1.0 - x / 3.0 * (1.0 - x / 4.0 * (1.0 - x / 5.0 * series))))
    } else {
        -libm::expm1(-x)
    }
}

static INFO: EffectInfo = EffectInfo {
    id: "viscoelastic_presliding",
    equation: "w' = (share S_i/delta) v - w/tau, abs(w) <= share S_i = share b_i d_i abs(phi(v)), from puncture to release",
    source: "Maxwell-slip friction (Al-Bender, Lampaert, Swevers 2005) with creep; measured skin and muscle phantoms",
    signature: "After a reversal the force follows travel over millimetres, part of it fades in a hold, and in retraction it ends in a step.",
    stage: ChainStage::Friction,
    parameters: &[
        LAYER,
        ParameterInfo::strength("share", "", "share of the layer's friction that this branch carries")
            .allowed(0.0, 1.0)
            .search(1.0, 0.01, 1.0),
        ParameterInfo::shape("delta_m", "m", "travel over which friction builds up to sliding")
            .allowed(1e-6, 0.1)
            .inactive(5e-3)
            .search(5e-3, 2e-4, 0.05)
            .log(),
        ParameterInfo::shape(
            "retained_share",
            "",
            "share of the elastic force at the puncture that passes into friction",
        )
        .allowed(0.0, 1.0)
        .inactive(1.0)
        .search(1.0, 0.0, 1.0),
        ParameterInfo::shape("time_constant_s", "s", "time constant of the creep")
            .allowed(1e-3, 1e6)
            .inactive(1e6)
            .search(3.0, 0.1, 60.0)
            .log(),
        ParameterInfo::shape("release_m", "m", "release depth in retraction, beyond the layer's front face")
            .allowed(-0.1, 0.1)
            .search(0.0, -0.01, 0.01),
    ],
    ..EffectInfo::DEFAULTS
};

described!(ViscoelasticPresliding { layer; share, delta_m, retained_share, time_constant_s, release_m });

impl Effect for ViscoelasticPresliding {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_inactive(&self) -> bool {
        self.share == 0.0
    }
    fn has_state(&self) -> bool {
        true
    }
    fn modify_layers(&self, slabs: &mut [Slab]) {
        if let Some(slab) = layer_mut(slabs, self.layer) {
            slab.replaced_friction_share = (slab.replaced_friction_share + self.share).min(1.0);
        }
    }
    fn on_layer_rupture(&self, layer: usize, released_n: f64, state: &mut EffectState) {
        if layer == self.layer {
            state[0] = self.share * self.retained_share * released_n;
        }
    }
    /// State: `w`, the limit `share S_i`, and the time step with its weights.
    fn layer_friction(
        &self,
        tip: &TipState,
        slabs: &[Slab],
        sliding_mps: f64,
        state: &mut EffectState,
    ) -> f64 {
        let Some(slab) = self.layer.checked_sub(1).and_then(|i| slabs.get(i)) else { return 0.0 };
        let [mut w, mut limit, step, keep, ramp, ..] = *state;
        if limit == 0.0 || tip.v_mps.abs() >= REST_MPS {
            let steady = self.share * slab.friction_ns_per_m2 * slab.thickness_m * sliding_mps.abs();
            let fresh = limit == 0.0 || tip.ruptured < self.layer;
            let renewed = if fresh { 1.0 } else { one_minus_exp(tip.dz_m.abs() / self.delta_m) };
            limit += (steady - limit) * renewed;
            state[1] = limit;
        }
        if tip.ruptured < self.layer {
            return 0.0;
        }
        if tip.z_m < slab.front_m + self.release_m {
            state[0] = 0.0;
            return 0.0;
        }
        let (mut keep, mut ramp) = (keep, ramp);
        if step == 0.0 || !crate::effect::same_step(tip.dt_s, step) {
            // The spring's force after a step of constant velocity: w keep + k dz ramp.
            let ratio = tip.dt_s / self.time_constant_s;
            let faded = one_minus_exp(ratio);
            keep = 1.0 - faded;
            ramp = if ratio > 0.0 { faded / ratio } else { 1.0 };
            state[2] = tip.dt_s;
            state[3] = keep;
            state[4] = ramp;
        }
        w = (w * keep + limit / self.delta_m * tip.dz_m * ramp).max(-limit).min(limit);
        state[0] = w;
        w
    }
}
