//! Detection thresholds as tuned for a recording, and the values tried for them.

/// Values of `s1` in N that are tried, the published default first; the laboratory uses 0.03 to 0.15 for its phantoms.
pub const SIGMA_RUPTURE_N: [f64; 4] = [0.15, 0.1, 0.05, 0.03];
/// Values of `beta` in N/s that are tried, the published default first; the laboratory uses 0.05 to 0.15 for its phantoms.
pub const ON_N_PER_S: [f64; 3] = [0.075, 0.05, 0.15];

/// Thresholds tuned for one phantom, motion, noise level and sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tuning {
    /// `s1` in N.
    pub sigma_rupture_n: f64,
    /// `beta` in N/s.
    pub on_n_per_s: f64,
    /// Missed and false ruptures over the tuning seeds with these thresholds.
    pub wrong: usize,
    /// Threshold on `trace P` of the triggered reset.
    pub trace_below: f64,
}

impl Default for Tuning {
    fn default() -> Self {
        Self {
            sigma_rupture_n: SIGMA_RUPTURE_N[0],
            on_n_per_s: ON_N_PER_S[0],
            wrong: 0,
            trace_below: 1.000_5e6,
        }
    }
}
