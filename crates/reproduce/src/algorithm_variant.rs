//! Variants of the online algorithm: model, prior knowledge, ablation and sensor.

use crate::tuned_thresholds::Tuning;
use stylet_core::EnhanceConfig;
use stylet_core::config::{Algorithm, Contact, Depths, DerivativeSense, Model, Reset};
use stylet_scenario::Scenario;

/// Prior knowledge of the algorithm, and how its detection is tuned.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Setup {
    /// The paper's protocol: depth unknown, detection tuned within the published range.
    Tuned,
    /// Depth unknown, the published defaults: `s1 = 0.15 N`, `beta = 0.075 N/s`.
    Published,
    /// Surface and depths known (the paper's 3-D model), the published defaults; a layer ends at its far face at the latest.
    KnownDepth,
    /// As `Tuned`, without the completions of this project.
    Literal,
    /// As `Tuned`, with the derivative acting on the falling force, as in the supplement, instead of the rising one, as in the
    /// laboratory.
    FallingForce,
    /// As `Tuned`, without detections by the trailing edge of the derivative, as in the laboratory.
    NoTrailingEdge,
    /// As `Tuned`, with resets at 6.66 Hz, the laboratory's other frequency.
    SlowReset,
    /// As `Tuned`, `s1` halved.
    SigmaHalved,
    /// As `Tuned`, `s1` doubled.
    SigmaDoubled,
    /// The thresholds of the scenario; for the virtual sensor `s1 = 0.015 N`, an assumed value.
    ScenarioThresholds,
}

/// Part of the algorithm that is left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Ablation {
    /// Nothing.
    None,
    /// Covariance reset only at ruptures (supplement Figs 10-12).
    OnlyRuptures,
    /// No a posteriori re-weighting (supplement Figs 13-15).
    NoReweight,
    /// Covariance reset when its trace falls below a tuned threshold (supplement sec. II).
    Trace,
}

/// A variant of the algorithm.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Variant {
    /// Kelvin-Voigt instead of multi-layer.
    pub kelvin_voigt: bool,
    /// Prior knowledge and tuning.
    pub setup: Setup,
    /// The part that is left out.
    pub ablation: Ablation,
}

impl Variant {
    /// The multi-layer model without ablation.
    #[must_use]
    pub const fn ml(setup: Setup) -> Self {
        Self { kelvin_voigt: false, setup, ablation: Ablation::None }
    }

    /// The Kelvin-Voigt model without ablation.
    #[must_use]
    pub const fn kv(setup: Setup) -> Self {
        Self { kelvin_voigt: true, setup, ablation: Ablation::None }
    }

    /// The same variant with an ablation.
    #[must_use]
    pub const fn without(self, ablation: Ablation) -> Self {
        Self { ablation, ..self }
    }

    /// Short name of the model.
    #[must_use]
    pub const fn model_name(self) -> &'static str {
        if self.kelvin_voigt { "KV" } else { "ML" }
    }

    /// Whether the detection must be tuned first.
    #[must_use]
    pub const fn is_tuned(self) -> bool {
        !matches!(self.setup, Setup::Published | Setup::KnownDepth | Setup::ScenarioThresholds)
    }

    /// The configuration of the paper's algorithm for a sensor of a scenario.
    #[must_use]
    pub fn config(self, scenario: &Scenario, sensor: Sensor, tuning: &Tuning) -> EnhanceConfig {
        let mut config = match sensor {
            Sensor::ForceTorque => scenario.enhance.clone(),
            Sensor::Virtual => scenario.enhance_for_virtual().clone(),
        };
        config.algorithm = Algorithm::Paper;
        config.model = if self.kelvin_voigt { Model::KelvinVoigt } else { Model::MultiLayer };
        if self.setup != Setup::ScenarioThresholds {
            let published = Tuning::default();
            let chosen = if self.is_tuned() { tuning } else { &published };
            config.cusum.sigma_rupture_n = chosen.sigma_rupture_n;
            config.derivative.on_n_per_s = chosen.on_n_per_s;
        }
        match self.setup {
            Setup::Tuned | Setup::Published | Setup::ScenarioThresholds => {}
            Setup::KnownDepth => {
                config.contact = Contact::Known;
                config.depths = Depths::Known(scenario.tissue.layers.iter().map(|l| l.thickness_m).collect());
            }
            Setup::Literal => config.algorithm = Algorithm::Literal,
            Setup::FallingForce => config.derivative.sense = DerivativeSense::Drop,
            Setup::NoTrailingEdge => config.derivative.trailing_edge = false,
            Setup::SigmaHalved => config.cusum.sigma_rupture_n *= 0.5,
            Setup::SigmaDoubled => config.cusum.sigma_rupture_n *= 2.0,
            Setup::SlowReset => config.reset = Reset::Frequency { hz: 6.66 },
        }
        match self.ablation {
            Ablation::None => {}
            Ablation::OnlyRuptures => config.reset = Reset::Ruptures,
            Ablation::NoReweight => config.drop.reweight = false,
            Ablation::Trace => config.reset = Reset::Trace { below: tuning.trace_below },
        }
        config
    }
}

/// The sensor whose force the algorithm processes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Sensor {
    /// The force/torque sensor.
    ForceTorque,
    /// The virtual sensor.
    Virtual,
}

impl Sensor {
    /// Its name in the testbed.
    #[must_use]
    pub const fn key(self) -> &'static str {
        match self {
            Sensor::ForceTorque => "force_torque",
            Sensor::Virtual => "virtual",
        }
    }

    /// Its name in tables.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Sensor::ForceTorque => "force/torque",
            Sensor::Virtual => "virtual",
        }
    }
}
