//! Sensors, as in scenarios.

use crate::observer_gain::ObserverGain;
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
    /// Resolution in N; 0: none.
    pub quantisation_n: f64,
    /// Readings are clamped to plus and minus this, in N.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range_n: Option<f64>,
}

impl Default for ForceTorque {
    fn default() -> Self {
        Self { noise_n: 0.02, ar1: 0.0, bias_n: 0.0, drift_n_per_s: 0.0, quantisation_n: 0.0, range_n: None }
    }
}

/// The virtual sensor: a momentum observer on the arm's joint torques, `r = G (p - p(0) - int(tau +
/// C^T qd - g + r) ds)` once per physics step, `r` less its value before contact, and the axial
/// component of the wrench at the tip that explains it, positive when it resists the insertion.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct VirtualSensor {
    /// Gain `G` of the observer in 1/s, one for all joints or a list of seven; 5 /s in the laboratory
    /// software of the paper: a lag of 0.2 s.
    pub gain_per_s: ObserverGain,
    /// Standard deviation of the white noise on each measured joint torque in N m, drawn at every
    /// physics step. Assumed: no source gives it for this arm.
    pub torque_noise_nm: f64,
    /// When the residual is zeroed.
    pub zero: ZeroWindow,
    /// How the force at the tip is found from the joint torques.
    pub wrench: WrenchEstimate,
}

impl Default for VirtualSensor {
    fn default() -> Self {
        Self {
            gain_per_s: ObserverGain::Uniform(5.0),
            torque_noise_nm: 0.02,
            zero: ZeroWindow::default(),
            wrench: WrenchEstimate::default(),
        }
    }
}

/// The residual of the joint torques is averaged in air and subtracted, with model errors and the friction of a steady motion. A motion that starts
/// too close to the tissue is preceded by an approach in air at its first speed.
///
/// The recorded force is zeroed from its start; online algorithms run from the end of the window on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum ZeroWindow {
    /// In motion, just before contact as planned.
    BeforeContact {
        /// End of the averaging before the planned contact, s.
        lead_s: f64,
        /// Length of the averaging, s.
        average_s: f64,
    },
    /// With the arm at rest before the motion: joint friction is not in the average.
    AtRest {
        /// Length of the averaging, s.
        average_s: f64,
    },
    /// Not at all.
    Never,
}

impl Default for ZeroWindow {
    fn default() -> Self {
        Self::BeforeContact { lead_s: 0.8, average_s: 0.5 }
    }
}

/// From joint torques to the force at the tip.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum WrenchEstimate {
    /// Force and moment, `pinv(J^T) r`, slightly damped: as in the paper.
    #[default]
    Full,
    /// Force alone, assuming no moment about the tip: less sensitive to joint friction.
    Point,
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

impl Sensor {
    /// The force/torque sensor, if it records.
    #[must_use]
    pub fn force_torque(&self) -> Option<&ForceTorque> {
        match self {
            Self::ForceTorque(config) | Self::Both { force_torque: config, .. } => Some(config),
            Self::Virtual(_) => None,
        }
    }

    /// The virtual sensor, if it records.
    #[must_use]
    pub fn virtual_sensor(&self) -> Option<&VirtualSensor> {
        match self {
            Self::Virtual(config) | Self::Both { virtual_sensor: config, .. } => Some(config),
            Self::ForceTorque(_) => None,
        }
    }
}

impl Default for Sensor {
    fn default() -> Self {
        Self::ForceTorque(ForceTorque::default())
    }
}
