use crate::chain_stage::ChainStage;
use crate::effect::Effect;
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};

/// Tissue that moves periodically: `s_i -> s_i + A sin(2 pi f t + phase)`; `z` and `v` in the force law are relative
/// to the tissue.
///
/// Inactive: `A = 0`. Signature: periodic in time, also while the needle is held.
/// Source: respiratory motion of abdominal organs, 0.2-0.4 Hz.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Respiration {
    /// Amplitude `A` in metres, 0 to 0.1. Inactive: 0.
    pub amplitude_m: f64,
    /// Frequency in Hz, 0 to 20.
    pub frequency_hz: f64,
    /// Phase at time zero in radians.
    pub phase_rad: f64,
}

static INFO: EffectInfo = EffectInfo {
    id: "respiration",
    equation: "s_i -> s_i + A sin(2 pi f t + phase); z and v in the force law are relative to the tissue",
    source: "Respiratory motion of abdominal organs, 0.2-0.4 Hz",
    signature: "Periodic in time, also while the needle is held.",
    stage: ChainStage::Kinematics,
    parameters: &[
        ParameterInfo::strength("amplitude_m", "m", "amplitude of the tissue's motion")
            .allowed(0.0, 0.1)
            .search(0.002, 1e-4, 0.02)
            .log(),
        ParameterInfo::shape("frequency_hz", "Hz", "frequency of the tissue's motion")
            .allowed(0.0, 20.0)
            .inactive(0.25)
            .search(0.25, 0.05, 2.0)
            .log()
            .clock(),
        ParameterInfo::shape("phase_rad", "rad", "phase at time zero").allowed(-100.0, 100.0).search(
            0.0,
            -core::f64::consts::PI,
            core::f64::consts::PI,
        ),
    ],
    proposal: Proposal::TissueMotion,
    absorbs_unmodelled: true,
    ..EffectInfo::DEFAULTS
};

described!(Respiration { amplitude_m, frequency_hz, phase_rad });

impl Effect for Respiration {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_inactive(&self) -> bool {
        self.amplitude_m == 0.0
    }
    fn relative_motion(&self, time_s: f64, z_m: f64, v_mps: f64) -> (f64, f64) {
        let omega = core::f64::consts::TAU * self.frequency_hz;
        let (sin, cos) = libm::sincos(omega * time_s + self.phase_rad);
        (z_m - self.amplitude_m * sin, v_mps - self.amplitude_m * omega * cos)
    }
}
