use crate::chain_stage::ChainStage;
use crate::effect::{Effect, EffectState, TipState};
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};

/// Rate-independent hysteresis of the elastic force: unloading runs below loading,
/// `f_K -> f_K (1 - phi (1 - xi)/2)` with `xi' = (E'/F_r)(1 - xi sgn E')`, `E` the elastic force of the loading curve.
///
/// `xi` is 1 on first loading and goes to -1 once the force has fallen by a few `F_r`; it depends on the path of `E` alone,
/// not on time. Integrated exactly in the change of `E` within a sample. A rupture restores `xi = 1`.
///
/// Inactive: `phi = 0`. Signature: after a reversal the elastic force follows a lower branch, the same at every speed; the
/// first loading is unchanged. Source: Fung 1993 (pseudoelasticity of soft tissue); switching branches as in Dahl 1968.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct LoadingHysteresis {
    /// Share `phi` of the elastic force that is lost on the unloading branch, 0 to 0.95. Inactive: 0.
    pub fraction: f64,
    /// Change `F_r` of the elastic force over which the branches switch, in N, 1e-5 to 100.
    pub reversal_n: f64,
}

impl Default for LoadingHysteresis {
    /// The inactive effect.
    fn default() -> Self {
        Self { fraction: 0.0, reversal_n: 0.05 }
    }
}

static INFO: EffectInfo = EffectInfo {
    id: "loading_hysteresis",
    equation: "f_K -> f_K (1 - phi (1 - xi)/2), xi' = (E'/F_r)(1 - xi sgn E'), xi = 1 on first loading",
    source: "Fung 1993, pseudoelasticity of soft tissue; Dahl 1968",
    signature: "After each reversal the elastic force follows a lower branch, the same at every speed, and it stays there in holds.",
    stage: ChainStage::Relaxation,
    parameters: &[
        ParameterInfo::strength("fraction", "", "share of the elastic force lost on unloading")
            .allowed(0.0, 0.95)
            .search(0.2, 0.01, 0.8),
        ParameterInfo::shape("reversal_n", "N", "change of the elastic force over which the branches switch")
            .allowed(1e-5, 100.0)
            .inactive(0.05)
            .search(0.05, 1e-3, 2.0)
            .log(),
    ],
    proposal: Proposal::LinearColumns(&[&[&[0.05, 0.01]], &[&[0.05, 0.05]], &[&[0.05, 0.2]]]),
    absorbs_unmodelled: true,
    ..EffectInfo::DEFAULTS
};

described!(LoadingHysteresis { fraction, reversal_n });

impl Effect for LoadingHysteresis {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_inactive(&self) -> bool {
        self.fraction == 0.0
    }
    fn has_state(&self) -> bool {
        true
    }
    /// State: `E` of the previous sample, `1 - xi`.
    fn relax(&self, _tip: &TipState, _depth_m: f64, elastic_n: f64, state: &mut EffectState) -> f64 {
        let change = elastic_n - state[0];
        // Distance from the branch of this direction: 0 on loading, 2 on unloading.
        let branch = if change < 0.0 { 2.0 } else { 0.0 };
        state[1] = branch + (state[1] - branch) * libm::exp(-change.abs() / self.reversal_n);
        state[0] = elastic_n;
        elastic_n * (1.0 - 0.5 * self.fraction * state[1])
    }
    fn on_rupture(&self, _released_n: f64, _z_m: f64, state: &mut EffectState) {
        *state = [0.0; 8];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec::Vec;

    const REST: TipState =
        TipState { time_s: 0.0, dt_s: 0.01, z_m: 0.0, dz_m: 0.0, v_mps: 0.0, dv_mps: 0.0, ruptured: 0 };

    /// Forces along a path of elastic forces, with steps of `step_n`.
    fn along(path: &[f64], step_n: f64) -> Vec<f64> {
        let effect = LoadingHysteresis { fraction: 0.4, reversal_n: 0.05 };
        let (mut state, mut at) = ([0.0; 8], 0.0);
        let mut ends = Vec::new();
        for &to in path {
            let steps = ((to - at) / step_n).abs().ceil().max(1.0);
            let from = at;
            let mut force = f64::NAN;
            for k in 1..=steps as i32 {
                at = from + (to - from) * f64::from(k) / steps;
                force = effect.relax(&REST, 0.0, at, &mut state);
            }
            ends.push(force);
        }
        ends
    }

    #[test]
    fn first_loading_is_unchanged_and_unloading_runs_on_the_lower_branch() {
        let ends = along(&[1.0, 0.5, 1.0], 1e-3);
        assert_eq!(ends[0], 1.0);
        assert!((ends[1] - 0.5 * 0.6).abs() < 1e-4 && (ends[2] - 1.0).abs() < 1e-4, "{ends:?}");
    }

    #[test]
    fn the_force_depends_on_the_path_and_not_on_the_steps() {
        let path = [1.0, 0.97, 0.99, 0.6, 0.65];
        for (a, b) in along(&path, 1e-3).iter().zip(along(&path, 0.2)) {
            assert!((a - b).abs() < 1e-12, "{a} {b}");
        }
    }
}
