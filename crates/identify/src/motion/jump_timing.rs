//! Times of velocity jumps.

/// A velocity jump with its time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JumpTiming {
    /// Time in s.
    pub time_s: f64,
    /// Midpoint of the samples before and after it, in s.
    pub sample_mid_s: f64,
    /// Standard deviation of the time in s.
    pub time_sd_s: f64,
    /// Position in m.
    pub position_m: f64,
    /// Velocity in m/s before and after.
    pub velocity_mps: [f64; 2],
}
