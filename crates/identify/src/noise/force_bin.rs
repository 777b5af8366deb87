//! Autoregressive noise in one range of the force.

use super::long_memory::{AR_ORDER, STRETCHES};

/// Noise in one range of the force.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForceBinNoise {
    /// Autoregressive coefficients, newest first.
    pub ar: [f64; AR_ORDER],
    /// Coefficients of the means over stretches further back.
    pub long_memory: [f64; STRETCHES.len()],
    /// Standard deviation of the innovations in N.
    pub innovation_sd_n: f64,
    /// Marginal standard deviation in N.
    pub sd_n: f64,
    /// Predictors of blocks with fewer than [`AR_ORDER`] predecessors since a break: none, one, ...
    pub after_break: [AfterBreak; AR_ORDER],
}

/// Predictor of a block shortly after a break.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AfterBreak {
    /// Autoregressive coefficients, newest first; as many as there are blocks since the break.
    pub ar: [f64; AR_ORDER],
    /// Coefficients of the means over stretches further back.
    pub long_memory: [f64; STRETCHES.len()],
    /// Standard deviation of the prediction error in N.
    pub sd_n: f64,
}

impl AfterBreak {
    /// No information about earlier blocks.
    pub(super) fn without_history(sd_n: f64) -> Self {
        Self { ar: [0.0; AR_ORDER], long_memory: [0.0; STRETCHES.len()], sd_n }
    }
}

impl ForceBinNoise {
    /// Independent noise.
    pub(super) fn white(sd_n: f64) -> Self {
        let none = AfterBreak::without_history(sd_n);
        Self {
            ar: none.ar,
            long_memory: none.long_memory,
            innovation_sd_n: sd_n,
            sd_n,
            after_break: [none; AR_ORDER],
        }
    }

    /// Whether it has a long memory.
    pub(super) fn has_long_memory(&self) -> bool {
        let none = [0.0; STRETCHES.len()];
        self.long_memory != none || self.after_break.iter().any(|f| f.long_memory != none)
    }

    /// Standard deviation (N) of the prediction error of a block with `run` predecessors since a break.
    pub(super) fn innovation_sd_after_n(&self, run: usize) -> f64 {
        self.after_break.get(run).map_or(self.innovation_sd_n, |f| f.sd_n)
    }
}
