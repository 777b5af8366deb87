//! Sensors: what a scenario says of them.

use serde::{Deserialize, Serialize};

/// The force/torque sensor at the needle's base.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ForceTorque {
    /// Standard deviation of the noise in N.
    pub noise_n: f64,
    /// Pole of the noise, first order autoregressive per sample, -1 to 1; 0 is white.
    pub ar1: f64,
    /// Constant offset in N.
    pub bias_n: f64,
    /// Drift in N/s.
    pub drift_n_per_s: f64,
    /// Smallest step in N; 0 is none.
    pub quantisation_n: f64,
    /// Readings end at plus and minus this, in N.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range_n: Option<f64>,
}

impl Default for ForceTorque {
    fn default() -> Self {
        Self { noise_n: 0.02, ar1: 0.0, bias_n: 0.0, drift_n_per_s: 0.0, quantisation_n: 0.0, range_n: None }
    }
}

/// The virtual sensor: a momentum observer on the arm's joint torques.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct VirtualSensor {
    /// Gain of the observer in 1/s.
    pub gain_per_s: f64,
}

impl Default for VirtualSensor {
    fn default() -> Self {
        Self { gain_per_s: 5.0 }
    }
}

/// Which sensors record.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Sensor {
    /// The force/torque sensor.
    ForceTorque(ForceTorque),
    /// The virtual sensor.
    Virtual(VirtualSensor),
    /// Both side by side.
    Both {
        /// The force/torque sensor.
        #[serde(default)]
        force_torque: ForceTorque,
        /// The virtual sensor.
        #[serde(default)]
        virtual_sensor: VirtualSensor,
    },
}

impl Default for Sensor {
    fn default() -> Self {
        Self::ForceTorque(ForceTorque::default())
    }
}
