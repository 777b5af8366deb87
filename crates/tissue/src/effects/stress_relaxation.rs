use crate::effect::{Effect, Memory, Place};
use alloc::vec::Vec;

/// One term of the Prony series.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct PronyTerm {
    /// Share of the elastic force that relaxes, `g_j`, 0 to 1.
    pub fraction: f64,
    /// Time constant `tau_j` in seconds, positive.
    pub time_constant_s: f64,
}

/// Elastic force that relaxes while the tissue is held: a Prony series on the elastic force `E` of
/// the active layer, `f_K = E - sum_j q_j`, `q_j' = (g_j E - q_j)/tau_j`, `q_j = 0` at rupture.
///
/// The step response is `1 - sum_j g_j (1 - exp(-t/tau_j))`. Integrated exactly for an `E` held
/// over the sample. Signature: decay in time, not in depth, while the needle stands still.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct StressRelaxation {
    /// One or two terms. Neutral: no term, or only zero fractions.
    pub terms: Vec<PronyTerm>,
}

impl Effect for StressRelaxation {
    fn id(&self) -> &'static str {
        "stress_relaxation"
    }
    fn place(&self) -> Place {
        Place::Relaxation
    }
    fn is_neutral(&self) -> bool {
        self.terms.iter().all(|term| term.fraction == 0.0)
    }
    fn relax(&self, dt_s: f64, elastic_n: f64, memory: &mut Memory) -> f64 {
        let mut force = elastic_n;
        for (term, q) in self.terms.iter().zip(memory.iter_mut()) {
            let keep = libm::exp(-dt_s / term.time_constant_s);
            *q = *q * keep + (1.0 - keep) * term.fraction * elastic_n;
            force -= *q;
        }
        force
    }
    fn on_rupture(&self, _released_n: f64, _z_m: f64, memory: &mut Memory) {
        *memory = [0.0; 4];
    }
}
