//! A model identified from other insertions, as a source of shaft friction for the online core.

use crate::error::Error;
use std::path::Path;
use stylet_core::config::{Algorithm, EnhanceConfig};
use stylet_scenario::Scenario;
use stylet_score::Trace;
use stylet_testbed::SimulateError;
use stylet_tissue::{AnyEffect, ForceLaw, ShaftFriction};

/// The model of a diagnosis (`extended.ron`, of single recordings or of a set) or of any scenario. Its shaft friction replaces the
/// core's own estimate.
#[derive(Clone, Debug)]
pub struct IdentifiedModel {
    /// File name, for messages.
    pub file: String,
    law: ForceLaw,
    effects: Vec<AnyEffect>,
    layers: usize,
    surface_m: f64,
    surface_tolerance_m: f64,
}

impl IdentifiedModel {
    /// Loads the model of a scenario file.
    ///
    /// # Errors
    /// [`Error::Input`] with file, line and column; [`Error::Simulate`] when the model has too many effects.
    pub fn load(path: &Path) -> Result<Self, Error> {
        Self::new(path.display().to_string(), &Scenario::load(path)?)
    }

    /// The model of a scenario; `file` appears in messages. Motion, robot, noise and configuration of the scenario are not used.
    ///
    /// # Errors
    /// [`Error::Simulate`] when the model has too many effects.
    pub fn new(file: impl Into<String>, scenario: &Scenario) -> Result<Self, Error> {
        let file = file.into();
        let law = ForceLaw::new(&scenario.tissue, &scenario.effects)
            .map_err(|why| Error::Simulate { file: file.clone(), why: SimulateError::Effects(why) })?;
        Ok(Self {
            file,
            law,
            effects: scenario.effects.clone(),
            layers: scenario.tissue.layers.len(),
            surface_m: scenario.tissue.surface_m,
            surface_tolerance_m: scenario.surface_tolerance_m,
        })
    }

    /// Shaft friction for a recording at about this sampling rate, from the first sample on.
    #[must_use]
    pub fn shaft_friction(&self, sample_hz: f64) -> ShaftFriction {
        ShaftFriction::new(self.law.clone(), &self.effects, sample_hz)
    }

    /// Checks that the configured algorithm can use a model.
    ///
    /// # Errors [`Error::Request`] when it cannot.
    pub fn check_algorithm(&self, config: &EnhanceConfig) -> Result<(), Error> {
        if config.active_algorithm() == Algorithm::Stylet {
            return Ok(());
        }
        Err(Error::Request(format!(
            "{}: an identified model requires the algorithm Stylet, and the configuration runs {:?}: set `algorithm: Stylet` and \
             `model: MultiLayer` without known depths, or omit --model",
            self.file,
            config.active_algorithm()
        )))
    }

    /// Signs that model and recording do not match.
    #[must_use]
    pub fn warnings(&self, trace: &Trace) -> Vec<String> {
        let Self { file, layers, surface_m, surface_tolerance_m, .. } = self;
        let mut warnings = Vec::new();
        if let Some(contact_m) = trace.contact_m
            && (contact_m - surface_m).abs() > 3.0 * surface_tolerance_m
        {
            warnings.push(format!(
                "{file} has the surface at {:.1} mm and the core detects contact at {:.1} mm: the model is replayed along the recorded \
                 positions, whose zero must be the same (stylet predict --refit surface shifts a model)",
                1e3 * surface_m,
                1e3 * contact_m
            ));
        }
        if let Some(at_s) = trace.model_rejected_s {
            warnings.push(format!(
                "from {at_s:.2} s on the friction of {file} leaves more force in retraction than the core's own, which is used while that is so"
            ));
        }
        if trace.detections.len() > *layers {
            warnings.push(format!(
                "{} ruptures were detected and {file} has {layers} layer(s): further ruptures do not change the model",
                trace.detections.len()
            ));
        }
        warnings
    }
}
