//! The sweep file: scenario, number of trials, drawn quantities. Format: docs/reference/files.md, section "Sweep".

use crate::distribution::Distribution;
use crate::input_error::InputError;
use crate::load_ron::parse;
use crate::ron_dialect::ron_options;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use stylet_tissue::AnyEffect;

/// Sampling method.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Sampling {
    /// Independent random draws.
    #[default]
    Random,
    /// Latin hypercube: each of `trials` equally likely strata of every quantity is sampled once.
    LatinHypercube,
    /// Sobol sequence (direction numbers of Joe and Kuo 2008) with a random digital shift, for up to 21 quantities.
    Sobol,
}

/// One quantity that is drawn.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VariedField {
    /// Path of the field, such as `tissue.layers[1].stiffness_n_per_m`. `effects[i]` counts the
    /// scenario's effects first, then the sweep's.
    pub path: String,
    /// Its distribution, in the field's unit.
    pub with: Distribution,
}

/// An effect that is switched on at random.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RandomEffect {
    /// The effect with its parameters.
    pub effect: AnyEffect,
    /// Probability that it is on, 0 to 1.
    pub probability: f64,
}

/// `Sweep(...)` as in the file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[serde(rename = "Sweep")]
pub struct SweepFile {
    /// Scenario file, relative to the sweep's.
    pub scenario: PathBuf,
    /// Number of trials.
    pub trials: u64,
    /// Sampling method.
    #[serde(default)]
    pub sampling: Sampling,
    /// Seed of all draws.
    #[serde(default = "one")]
    pub seed: u64,
    /// Quantities that are drawn.
    #[serde(default)]
    pub vary: Vec<VariedField>,
    /// Effects that are switched on at random.
    #[serde(default)]
    pub effects: Vec<RandomEffect>,
}

fn one() -> u64 {
    1
}

impl SweepFile {
    /// Parses the text of a sweep file; `file` is named in errors. Ranges are checked with the scenario, by `stylet-sweep`.
    ///
    /// # Errors
    /// [`InputError`] with line and column.
    pub fn parse(file: &str, text: &str) -> Result<Self, InputError> {
        parse(file, text)
    }

    /// The file as RON.
    #[must_use]
    pub fn to_ron(&self) -> String {
        let body = ron_options().to_string_pretty(self, Default::default()).unwrap_or_default();
        format!("Sweep{body}\n")
    }

    /// The file as compact JSON.
    #[must_use]
    pub fn to_json(&self) -> String {
        serde_json::to_string(self).unwrap_or_default()
    }
}
