//! Hash over results, to compare runs.

use sha2::{Digest, Sha256};
use stylet_core::Output;
use stylet_score::{Trace, coefficients};

/// First 16 bytes, in hex, of the SHA-256 over the recording's CSV and every output of the online algorithm.
#[must_use]
pub fn hash_results(recording_csv: &[u8], traces: &[&Trace]) -> String {
    let mut hash = ResultHash::default();
    hash.update_text(recording_csv);
    for trace in traces {
        for column in [
            &trace.enhanced_n,
            &trace.reconstructed_n,
            &trace.stiffness_n_per_m,
            &trace.friction,
            &trace.cumulative_friction_ns_per_m,
            &trace.cusum_n2,
            &trace.derivative_n_per_s,
        ] {
            hash.update_column(column);
        }
    }
    hash.finish()
}

/// Number of columns of [`hashed_values`].
pub(crate) const HASHED_COLUMNS: usize = 7;

/// The hashed outputs of a sample, in the order of the columns of [`hash_results`].
pub(crate) fn hashed_values(out: &Output) -> [f64; HASHED_COLUMNS] {
    let [stiffness, friction] = coefficients(out);
    [
        out.enhanced_n,
        out.reconstructed_n,
        stiffness,
        friction,
        out.cumulative_friction_ns_per_m,
        out.cusum_n2,
        out.derivative_n_per_s,
    ]
}

/// Incremental [`hash_results`]: the recording's CSV, then one column after the other.
#[derive(Clone, Default)]
pub(crate) struct ResultHash(Sha256);

impl ResultHash {
    pub fn update_text(&mut self, piece: &[u8]) {
        self.0.update(piece);
    }

    pub fn update_column(&mut self, piece: &[f64]) {
        for value in piece {
            self.0.update(value.to_le_bytes());
        }
    }

    pub fn finish(self) -> String {
        self.0.finalize().iter().take(16).map(|byte| format!("{byte:02x}")).collect()
    }
}
