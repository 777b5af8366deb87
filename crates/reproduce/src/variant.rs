//! The ways in which the online algorithm is run.

use stylet_core::EnhanceConfig;
use stylet_core::config::{Contact, Depths, Model, Reset};
use stylet_scenario::Scenario;

/// Thresholds on `trace P` that are tried for the threshold-triggered reset; the prior's trace is 2e6. At
/// constant velocity the friction's entry stays near 1e6 and the threshold must lie above that; where the
/// speed varies it falls too and the threshold must lie below.
pub const TRACE_THRESHOLDS: [f64; 8] = [9e5, 9.9e5, 1.000_05e6, 1.000_5e6, 1.005e6, 1.02e6, 1.1e6, 1.4e6];

/// What is changed against the scenario's own configuration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Protocol {
    /// Nothing: depths unknown, 40 Hz resets, re-weighting, `s1` as published.
    Paper,
    /// Surface and depths are known (the paper's 3-D model): a layer ends at the latest at its far face.
    KnownDepth,
    /// A CUSUM tuned to weak exits, `s1 = 0.03 N`: the lower end of what was published.
    Sensitive,
    /// Covariance reset only at ruptures (supplement Figs 10-12).
    OnlyRuptures,
    /// No a posteriori re-weighting (supplement Figs 13-15).
    NoReweight,
    /// No re-weighting, depths known.
    NoReweightKnown,
    /// Covariance reset when its trace falls below `TRACE_THRESHOLDS[i]` (supplement sec. II).
    Trace(usize),
}

/// One way of running the algorithm: model and protocol.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Variant {
    /// Kelvin-Voigt instead of multi-layer.
    pub kelvin_voigt: bool,
    /// Protocol.
    pub protocol: Protocol,
}

impl Variant {
    /// The multi-layer model.
    #[must_use]
    pub const fn ml(protocol: Protocol) -> Self {
        Self { kelvin_voigt: false, protocol }
    }

    /// The Kelvin-Voigt model.
    #[must_use]
    pub const fn kv(protocol: Protocol) -> Self {
        Self { kelvin_voigt: true, protocol }
    }

    /// Short name of the model.
    #[must_use]
    pub const fn model_name(self) -> &'static str {
        if self.kelvin_voigt { "KV" } else { "ML" }
    }

    /// The configuration for a sensor of a scenario.
    #[must_use]
    pub fn config(self, scenario: &Scenario, sensor: Sensor) -> EnhanceConfig {
        let mut config = match sensor {
            Sensor::ForceTorque => scenario.enhance.clone(),
            Sensor::Virtual => scenario.enhance_for_virtual().clone(),
        };
        config.model = if self.kelvin_voigt { Model::KelvinVoigt } else { Model::MultiLayer };
        let thicknesses = || scenario.tissue.layers.iter().map(|l| l.thickness_m).collect();
        match self.protocol {
            Protocol::Paper => {}
            Protocol::KnownDepth => {
                config.contact = Contact::Known;
                config.depths = Depths::Known(thicknesses());
            }
            Protocol::Sensitive => config.cusum.sigma_rupture_n = 0.03,
            Protocol::OnlyRuptures => config.reset = Reset::Ruptures,
            Protocol::NoReweight => config.drop.reweight = false,
            Protocol::NoReweightKnown => {
                config.drop.reweight = false;
                config.contact = Contact::Known;
                config.depths = Depths::Known(thicknesses());
            }
            Protocol::Trace(index) => {
                config.reset = Reset::Trace { below: TRACE_THRESHOLDS[index % TRACE_THRESHOLDS.len()] };
            }
        }
        config
    }
}

/// Which sensor is listened to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Sensor {
    /// The force/torque sensor.
    ForceTorque,
    /// The virtual sensor.
    Virtual,
}

impl Sensor {
    /// The name that the testbed gives it.
    #[must_use]
    pub const fn key(self) -> &'static str {
        match self {
            Sensor::ForceTorque => "force_torque",
            Sensor::Virtual => "virtual",
        }
    }

    /// The name in tables.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Sensor::ForceTorque => "force/torque",
            Sensor::Virtual => "virtual",
        }
    }
}
