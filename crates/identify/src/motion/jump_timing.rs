//! Times of velocity jumps.

/// Time, position and velocities of a velocity jump.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JumpTiming {
    /// Time in s.
    pub time_s: f64,
    /// Midpoint (s) of the samples before and after the jump.
    pub sample_mid_s: f64,
    /// Standard deviation of the time in s.
    pub time_sd_s: f64,
    /// Position in m.
    pub position_m: f64,
    /// Velocity in m/s before and after.
    pub velocity_mps: [f64; 2],
}
