//! The scenario.

use crate::input_error::InputError;
use crate::load_ron::{parse, read_text};
use crate::motion::Motion;
use crate::robot_config::Robot;
use crate::sensor_config::Sensor;
use serde::{Deserialize, Serialize};
use std::path::Path;
use stylet_core::EnhanceConfig;
use stylet_core::config::Model;
use stylet_tissue::{AnyEffect, Tissue};

/// A simulated insertion (`docs/reference/scenario.md`). Only `name`, `tissue` and `motion` are required.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    /// Title.
    pub name: String,
    /// Where the values come from.
    #[serde(default)]
    pub source: String,
    /// The layers.
    pub tissue: Tissue,
    /// Departures from the base law.
    #[serde(default)]
    pub effects: Vec<AnyEffect>,
    /// Custom effects that a diagnosis searches for like those of the library; a simulation ignores them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub candidates: Vec<AnyEffect>,
    /// The motion.
    pub motion: Motion,
    /// What moves the needle.
    #[serde(default)]
    pub robot: Robot,
    /// What records the force.
    #[serde(default)]
    pub sensor: Sensor,
    /// The online algorithm.
    #[serde(default)]
    pub enhance: EnhanceConfig,
    /// Settings for the force of the virtual sensor; as `enhance` when left out. `model` is that of `enhance`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub enhance_virtual: Option<EnhanceConfig>,
    /// Further models that are run on the same data.
    #[serde(default)]
    pub compare: Vec<Model>,
    /// Samples per second.
    #[serde(default = "sample_hz")]
    pub sample_hz: f64,
    /// Physics steps per second; rounded up to a whole multiple of `sample_hz`.
    #[serde(default = "physics_hz")]
    pub physics_hz: f64,
    /// Relative uncertainty of stiffness, friction and puncture force, 0 to 1: bounds of a diagnosis.
    #[serde(default = "tolerance")]
    pub tolerance: f64,
    /// Relative uncertainty of thicknesses.
    #[serde(default = "thickness_tolerance")]
    pub thickness_tolerance: f64,
    /// Uncertainty of the surface position, in m.
    #[serde(default = "surface_tolerance_m")]
    pub surface_tolerance_m: f64,
    /// Seed of every random number.
    #[serde(default = "seed")]
    pub seed: u64,
}

fn sample_hz() -> f64 {
    200.0
}
fn physics_hz() -> f64 {
    1000.0
}
fn tolerance() -> f64 {
    0.3
}
fn thickness_tolerance() -> f64 {
    0.1
}
fn surface_tolerance_m() -> f64 {
    0.002
}
fn seed() -> u64 {
    1
}

impl Scenario {
    /// A scenario with the default of every other field.
    #[must_use]
    pub fn new(name: String, tissue: Tissue, motion: Motion) -> Self {
        Self {
            name,
            source: String::new(),
            tissue,
            effects: Vec::new(),
            candidates: Vec::new(),
            motion,
            robot: Robot::default(),
            sensor: Sensor::default(),
            enhance: EnhanceConfig::default(),
            enhance_virtual: None,
            compare: Vec::new(),
            sample_hz: sample_hz(),
            physics_hz: physics_hz(),
            tolerance: tolerance(),
            thickness_tolerance: thickness_tolerance(),
            surface_tolerance_m: surface_tolerance_m(),
            seed: seed(),
        }
    }

    /// The models to run: `enhance.model` first, then those of `compare` that differ.
    #[must_use]
    pub fn models(&self) -> Vec<Model> {
        let mut models = vec![self.enhance.model];
        for model in &self.compare {
            if !models.contains(model) {
                models.push(*model);
            }
        }
        models
    }

    /// The online algorithm for the virtual sensor's force.
    #[must_use]
    pub fn enhance_for_virtual(&self) -> &EnhanceConfig {
        self.enhance_virtual.as_ref().unwrap_or(&self.enhance)
    }
}

impl Scenario {
    /// Loads and checks a scenario file.
    ///
    /// # Errors
    /// [`InputError`] with file, line, column, what is wrong and what would be right.
    pub fn load(path: &Path) -> Result<Self, InputError> {
        Self::parse(&path.display().to_string(), &read_text(path)?)
    }

    /// Parses and checks a scenario; `file` is named in errors.
    ///
    /// # Errors
    /// As [`Scenario::load`].
    pub fn parse(file: &str, text: &str) -> Result<Self, InputError> {
        let scenario: Self = parse(file, text)?;
        scenario.check().map_err(|problem| problem.in_file(file, text))?;
        Ok(scenario)
    }

    /// The scenario with every default written out.
    ///
    /// # Errors
    /// When a value cannot be written as RON, which no checked scenario holds.
    pub fn to_ron(&self) -> Result<String, ron::Error> {
        let pretty = ron::ser::PrettyConfig::new().struct_names(false).depth_limit(8);
        let body = crate::ron_dialect::ron_options().to_string_pretty(self, pretty)?;
        Ok(format!("Scenario{body}\n"))
    }

    /// The scenario as compact JSON.
    #[must_use]
    pub fn to_json(&self) -> String {
        serde_json::to_string(self).unwrap_or_default()
    }
}
