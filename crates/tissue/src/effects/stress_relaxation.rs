use super::parameters::ParameterVector;
use crate::chain_stage::ChainStage;
use crate::effect::{Effect, EffectState, TipState, lag_weights, same_step};
use crate::effect_info::{EffectInfo, ParameterError, ParameterInfo, Proposal};
use alloc::vec::Vec;

/// One term of the Prony series.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct PronyTerm {
    /// Share of the elastic force that relaxes, `g_j`, 0 to 1.
    pub fraction: f64,
    /// Time constant `tau_j` in seconds, 0.001 to 10 000.
    pub time_constant_s: f64,
}

/// Relaxation of the elastic force `E` of the active layer, a Prony series: `f_K = E - sum_j q_j`,
/// `q_j' = (g_j E - q_j)/tau_j`, `q_j = 0` at rupture.
///
/// The step response is `1 - sum_j g_j (1 - exp(-t/tau_j))`. Integrated exactly for an `E` that is linear between samples,
/// so that the relaxation is the same at every sampling rate.
///
/// Inactive: no term, or all `g_j = 0`. Signature: decay in time, not in depth, while the needle stands still.
/// Source: relaxation of phantoms, measured with 0.3 s and 2.7 s.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct StressRelaxation {
    /// One or two terms, fractions adding up to at most 1. Inactive: no term, or only zero fractions.
    pub terms: Vec<PronyTerm>,
}

const FRACTION: ParameterInfo =
    ParameterInfo::strength("terms.0.fraction", "", "share of the elastic force that relaxes")
        .allowed(0.0, 1.0)
        .search(0.3, 0.01, 0.95);
const TIME: ParameterInfo = ParameterInfo::shape("terms.0.time_constant_s", "s", "time constant")
    .allowed(1e-3, 1e4)
    .inactive(2.0)
    .search(2.0, 0.05, 60.0)
    .log();

const ONE: EffectInfo = EffectInfo {
    id: "stress_relaxation",
    equation: "f_K = E - sum_j q_j, q_j' = (g_j E - q_j)/tau_j, q_j = 0 at rupture",
    source: "Prony series; phantoms measured with 0.3 s and 2.7 s",
    signature: "Decay at v = 0, exponential in time and not in depth, independent of the last speed.",
    stage: ChainStage::Relaxation,
    parameters: &[FRACTION, TIME],
    proposal: Proposal::LinearColumns(&[
        &[&[0.05, 0.06]],
        &[&[0.05, 0.2]],
        &[&[0.05, 0.5]],
        &[&[0.05, 1.3]],
        &[&[0.05, 3.0]],
        &[&[0.05, 8.0]],
        &[&[0.05, 25.0]],
    ]),
    ..EffectInfo::DEFAULTS
};

static TWO_TERMS: EffectInfo = EffectInfo {
    parameters: &[
        FRACTION.search(0.3, 0.01, 0.95),
        TIME.search(0.3, 0.02, 5.0),
        ParameterInfo { path: "terms.1.fraction", ..FRACTION },
        ParameterInfo { path: "terms.1.time_constant_s", ..TIME }.search(3.0, 0.2, 120.0),
    ],
    // One fitted term may be two of similar strength with time constants on both sides, or a weak one far from it.
    proposal: Proposal::SplitTerm(&[
        &[0.5, 0.1, 0.5, 1.5],
        &[0.5, 0.3, 0.5, 3.0],
        &[0.2, 0.05, 0.8, 1.2],
        &[0.8, 0.8, 0.2, 10.0],
    ]),
    ..ONE
};

static ONE_TERM: EffectInfo = EffectInfo { extended: Some(&TWO_TERMS), ..ONE };

/// Index of the second share among the parameters.
const SECOND: usize = 2;

impl ParameterVector for StressRelaxation {
    fn values(&self) -> Vec<f64> {
        self.terms.iter().flat_map(|term| [term.fraction, term.time_constant_s]).collect()
    }
    fn from_values(values: &[f64]) -> Option<Self> {
        let (pairs, rest) = values.as_chunks::<2>();
        if !rest.is_empty() || !(1..=2).contains(&pairs.len()) {
            return None;
        }
        let term = |&[fraction, time_constant_s]: &[f64; 2]| PronyTerm { fraction, time_constant_s };
        Some(Self { terms: pairs.iter().map(term).collect() })
    }
    /// The second share relative to the rest after the first, so that both may be anywhere in 0 to 1.
    fn coordinates(&self) -> Vec<f64> {
        let mut out = self.values();
        if let [first, second] = &self.terms[..] {
            let left = 1.0 - first.fraction;
            out[SECOND] = if left > 0.0 { (second.fraction / left).min(1.0) } else { 0.0 };
        }
        out
    }
    fn from_coordinates(coordinates: &[f64]) -> Option<Self> {
        let mut out = Self::from_values(coordinates)?;
        if let [first, second] = &mut out.terms[..] {
            second.fraction *= 1.0 - first.fraction;
        }
        Some(out)
    }
    fn check_together(&self) -> Result<(), ParameterError> {
        let error = |path, value, allowed| Err(ParameterError { effect: ONE.id, path, value, allowed });
        if !(1..=2).contains(&self.terms.len()) {
            return error("terms", self.terms.len() as f64, (1.0, 2.0));
        }
        if let [first, second] = self.terms[..]
            && first.fraction + second.fraction > 1.0
        {
            return error("terms.1.fraction", second.fraction, (0.0, 1.0 - first.fraction));
        }
        Ok(())
    }
}

impl Effect for StressRelaxation {
    fn info(&self) -> &'static EffectInfo {
        if self.terms.len() < 2 { &ONE_TERM } else { &TWO_TERMS }
    }
    fn is_inactive(&self) -> bool {
        self.terms.iter().all(|term| term.fraction == 0.0)
    }
    fn has_state(&self) -> bool {
        true
    }
    /// State: `q_1`, `q_2`, the previous `E`, the time step and its two weights per term.
    fn relax(&self, tip: &TipState, _depth_m: f64, elastic_n: f64, state: &mut EffectState) -> f64 {
        let dt_s = tip.dt_s;
        let [q1, q2, before, ..] = *state;
        state[2] = elastic_n;
        if dt_s <= 0.0 || (elastic_n == 0.0 && before == 0.0 && q1 == 0.0 && q2 == 0.0) {
            return elastic_n - q1 - q2;
        }
        if !same_step(dt_s, state[3]) {
            state[3] = dt_s;
            for (term, weights) in self.terms.iter().zip(state[4..].as_chunks_mut().0) {
                *weights = lag_weights(dt_s, term.time_constant_s).into();
            }
        }
        let mut force = elastic_n;
        for (j, term) in self.terms.iter().take(2).enumerate() {
            let (keep, ramp) = (state[4 + 2 * j], state[5 + 2 * j]);
            let end = term.fraction * before;
            state[j] = end + keep * (state[j] - end) + ramp * term.fraction * (elastic_n - before);
            force -= state[j];
        }
        force
    }
    fn on_rupture(&self, _released_n: f64, _z_m: f64, state: &mut EffectState) {
        state[..3].fill(0.0);
    }
}
