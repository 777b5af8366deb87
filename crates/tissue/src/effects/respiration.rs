use super::Described;
use crate::effect::{ChainStage, Effect};
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};

/// Tissue that moves with the breath: `s_i -> s_i + A sin(2 pi f t + phase)`; depth and velocity
/// in the law become relative to it.
///
/// Source: respiratory motion of abdominal organs, 0.2-0.4 Hz (research notes, number 18).
/// Signature: periodic in time, also while the needle is held.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Respiration {
    /// Amplitude `A` in metres, 0 to 0.1. Neutral: 0.
    pub amplitude_m: f64,
    /// Frequency in Hz, 0 to 20.
    pub frequency_hz: f64,
    /// Phase at time zero in radians.
    pub phase_rad: f64,
}

static INFO: EffectInfo = EffectInfo {
    id: "respiration",
    equation: "s_i -> s_i + A sin(2 pi f t + phase); z and v in the law are relative to the tissue",
    source: "Respiratory motion of abdominal organs, 0.2-0.4 Hz",
    signature: "Periodic in time, also while the needle is held.",
    stage: ChainStage::Kinematics,
    parameters: &[
        ParameterInfo::strength("amplitude_m", "m", "amplitude of the tissue's motion")
            .allowed(0.0, 0.1)
            .search(0.002, 1e-4, 0.02)
            .log(),
        ParameterInfo::shape("frequency_hz", "Hz", "frequency of the breath")
            .allowed(0.0, 20.0)
            .inactive(0.25)
            .search(0.25, 0.05, 2.0)
            .log(),
        ParameterInfo::shape("phase_rad", "rad", "phase at time zero").allowed(-100.0, 100.0).search(
            0.0,
            -core::f64::consts::PI,
            core::f64::consts::PI,
        ),
    ],
    extended: None,
    proposal: Proposal::TissueMotion,
    nested_in: &[],
    absorbs_unmodelled: true,
};

impl Described for Respiration {
    fn values(&self) -> alloc::vec::Vec<f64> {
        alloc::vec![self.amplitude_m, self.frequency_hz, self.phase_rad]
    }
    fn from_values(values: &[f64]) -> Option<Self> {
        let [amplitude_m, frequency_hz, phase_rad] = *values else { return None };
        Some(Self { amplitude_m, frequency_hz, phase_rad })
    }
}

impl Effect for Respiration {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_neutral(&self) -> bool {
        self.amplitude_m == 0.0
    }
    fn relative(&self, time_s: f64, z_m: f64, v_mps: f64) -> (f64, f64) {
        let omega = core::f64::consts::TAU * self.frequency_hz;
        let (sin, cos) = libm::sincos(omega * time_s + self.phase_rad);
        (z_m - self.amplitude_m * sin, v_mps - self.amplitude_m * omega * cos)
    }
}
