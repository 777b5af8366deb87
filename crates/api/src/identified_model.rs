//! A law that was fitted to other insertions, as the online core takes it.

use crate::error::Error;
use std::path::Path;
use stylet_core::config::{Algorithm, EnhanceConfig};
use stylet_scenario::Scenario;
use stylet_score::Trace;
use stylet_testbed::SimulateError;
use stylet_tissue::{AnyEffect, ForceLaw, ShaftFriction};

/// The law of a diagnosis (`extended.ron`, of single recordings or of a set), or of any scenario: what it says of the friction along
/// the shaft takes the place of what the core expects of it by itself.
#[derive(Clone, Debug)]
pub struct IdentifiedModel {
    /// Where it comes from, for people.
    pub file: String,
    law: ForceLaw,
    effects: Vec<AnyEffect>,
    layers: usize,
    surface_m: f64,
    surface_tolerance_m: f64,
}

impl IdentifiedModel {
    /// Loads a scenario's law.
    ///
    /// # Errors
    /// [`Error::Input`] with file, line and column; [`Error::Simulate`] when the law has too many effects.
    pub fn load(path: &Path) -> Result<Self, Error> {
        Self::new(path.display().to_string(), &Scenario::load(path)?)
    }

    /// The law of a scenario; `file` is named in errors and notes. Motion, robot, noise and configuration of the scenario play no part.
    ///
    /// # Errors
    /// [`Error::Simulate`] when the law has too many effects.
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

    /// What it says of the shaft of a recording at about this rate, from the first sample on.
    #[must_use]
    pub fn shaft_friction(&self, sample_hz: f64) -> ShaftFriction {
        ShaftFriction::new(self.law.clone(), &self.effects, sample_hz)
    }

    /// Whether a configuration has an algorithm that takes a law.
    ///
    /// # Errors
    /// [`Error::Request`] when it does not.
    pub fn check_algorithm(&self, config: &EnhanceConfig) -> Result<(), Error> {
        if config.active_algorithm() == Algorithm::Stylet {
            return Ok(());
        }
        Err(Error::Request(format!(
            "{}: the law is for the algorithm Stylet, and the configuration runs {:?}: take `algorithm: Stylet` and `model: MultiLayer`, \
             without known depths, or leave the law out",
            self.file,
            config.active_algorithm()
        )))
    }

    /// What hints that law and recording do not belong together.
    #[must_use]
    pub fn warnings(&self, trace: &Trace) -> Vec<String> {
        let Self { file, layers, surface_m, surface_tolerance_m, .. } = self;
        let mut doubts = Vec::new();
        if let Some(contact_m) = trace.contact_m
            && (contact_m - surface_m).abs() > 3.0 * surface_tolerance_m
        {
            doubts.push(format!(
                "{file} has the surface at {:.1} mm and the core finds first contact at {:.1} mm: the law is replayed along the recorded \
                 positions, whose zero must be the same (stylet predict --refit surface moves a law)",
                1e3 * surface_m,
                1e3 * contact_m
            ));
        }
        if trace.detections.len() > *layers {
            doubts.push(format!(
                "{} ruptures were found and {file} has {layers} layer(s): those beyond change nothing in the law",
                trace.detections.len()
            ));
        }
        doubts
    }
}
