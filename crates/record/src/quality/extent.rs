//! Ranges of the columns of a recording.

/// Ranges and median interval of a recording, for several checks.
pub(super) struct Extent {
    pub force_n: (f64, f64),
    pub position_m: (f64, f64),
    pub median_interval_s: f64,
}
