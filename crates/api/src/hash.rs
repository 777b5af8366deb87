//! A hash of results: same inputs, same bytes.

use sha2::{Digest, Sha256};
use stylet_score::Trace;

/// First 16 bytes of the SHA-256 over the recording's bytes and every output of the core, in hex.
#[must_use]
pub fn of_results(recording_csv: &[u8], traces: &[&Trace]) -> String {
    let mut hash = Sha256::new();
    hash.update(recording_csv);
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
            for value in column {
                hash.update(value.to_le_bytes());
            }
        }
    }
    hash.finalize().iter().take(16).map(|byte| format!("{byte:02x}")).collect()
}
