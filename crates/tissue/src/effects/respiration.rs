use crate::effect::{Effect, Place};

/// Tissue that moves with the breath: `s_i -> s_i + A sin(2 pi f t + phase)`; depth and velocity
/// in the law become relative to it.
///
/// Signature: periodic in time, also while the needle is held.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Respiration {
    /// Amplitude `A` in metres, zero or positive. Neutral: 0.
    pub amplitude_m: f64,
    /// Frequency in Hz, positive.
    pub frequency_hz: f64,
    /// Phase at time zero in radians.
    pub phase_rad: f64,
}

impl Effect for Respiration {
    fn id(&self) -> &'static str {
        "respiration"
    }
    fn place(&self) -> Place {
        Place::Kinematics
    }
    fn is_neutral(&self) -> bool {
        self.amplitude_m == 0.0
    }
    fn relative(&self, time_s: f64, z_m: f64, v_mps: f64) -> (f64, f64) {
        let omega = core::f64::consts::TAU * self.frequency_hz;
        let angle = omega * time_s + self.phase_rad;
        (
            z_m - self.amplitude_m * libm::sin(angle),
            v_mps - self.amplitude_m * omega * libm::cos(angle),
        )
    }
}
