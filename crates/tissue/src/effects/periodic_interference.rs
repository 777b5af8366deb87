use crate::chain_stage::ChainStage;
use crate::effect::{Effect, EffectState};
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};

/// A tone in the force: `+ A sin(2 pi f t + phase)`, in air too.
///
/// Inactive: `A = 0`. Signature: a narrow spectral line, the same in air, in holds and at every depth.
/// Source: mains, drives, vibration of the stage.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct PeriodicInterference {
    /// Amplitude `A` in N, 0 to 100. Inactive: 0.
    pub amplitude_n: f64,
    /// Frequency in Hz, 0 to 1e5.
    pub frequency_hz: f64,
    /// Phase at time zero in radians.
    pub phase_rad: f64,
}

static INFO: EffectInfo = EffectInfo {
    id: "periodic_interference",
    equation: "+ A sin(2 pi f t + phase), in air too",
    source: "Mains, drives, stage vibration",
    signature: "A narrow line in time, the same in air, in holds and at every depth.",
    stage: ChainStage::Sensor,
    parameters: &[
        ParameterInfo::strength("amplitude_n", "N", "amplitude")
            .allowed(0.0, 100.0)
            .search(0.05, 0.002, 2.0)
            .log(),
        ParameterInfo::shape("frequency_hz", "Hz", "frequency")
            .allowed(0.0, 1e5)
            .inactive(5.0)
            .search(5.0, 0.05, 100.0)
            .log()
            .clock(),
        ParameterInfo::shape("phase_rad", "rad", "phase at time zero").allowed(-100.0, 100.0).search(
            0.0,
            -core::f64::consts::PI,
            core::f64::consts::PI,
        ),
    ],
    proposal: Proposal::SpectralTone,
    absorbs_unmodelled: true,
    ..EffectInfo::DEFAULTS
};

described!(PeriodicInterference { amplitude_n, frequency_hz, phase_rad });

impl Effect for PeriodicInterference {
    fn info(&self) -> &'static EffectInfo {
        &INFO
    }
    fn is_inactive(&self) -> bool {
        self.amplitude_n == 0.0
    }
    fn sensor_output(&self, time_s: f64, _dt_s: f64, force_n: f64, _state: &mut EffectState) -> f64 {
        let angle = core::f64::consts::TAU * self.frequency_hz * time_s + self.phase_rad;
        force_n + self.amplitude_n * libm::sin(angle)
    }
    /// The mean of a tone over evenly spaced samples (Dirichlet kernel).
    fn mean_sensor_output(
        &self,
        time_s: f64,
        span_s: f64,
        samples: f64,
        force_n: f64,
        _state: &mut EffectState,
    ) -> f64 {
        let half = core::f64::consts::PI * self.frequency_hz * span_s / samples.max(1.0);
        let (below, above) = (libm::sin(half), libm::sin(samples * half));
        let share = if below.abs() < 1e-9 { 1.0 } else { above / (samples * below) };
        let angle = core::f64::consts::TAU * self.frequency_hz * time_s + self.phase_rad;
        force_n + self.amplitude_n * share * libm::sin(angle)
    }
}
