//! The answer of a diagnosis program: `diagnosis.json` (docs/reference/files.md) as plain data. Fields that are not named here are ignored.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A value with its 95 % interval.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// Best value.
    pub value: f64,
    /// Lower end.
    #[serde(default)]
    pub low: Option<f64>,
    /// Upper end.
    #[serde(default)]
    pub high: Option<f64>,
}

/// One cause.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Cause {
    /// Effect, by its id.
    pub effect: String,
    /// Effects that explain the data as well.
    #[serde(default)]
    pub equivalent: Vec<String>,
    /// Probability that it belongs to the model.
    #[serde(default)]
    pub confidence: Option<f64>,
    /// Parameters by their paths.
    #[serde(default)]
    pub parameters: BTreeMap<String, Estimate>,
}

/// A base parameter as fitted.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BaseParameter {
    /// Layer, 1-based; 0 for the surface.
    #[serde(default)]
    pub layer: usize,
    /// Field of the layer.
    pub name: String,
    /// Fitted value.
    pub value: f64,
    /// Lower end of the 95 % interval.
    #[serde(default)]
    pub low: Option<f64>,
    /// Upper end.
    #[serde(default)]
    pub high: Option<f64>,
}

/// Label of a parameter in an answer: how well it is determined.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LabelledParameter {
    /// Layer, 1-based; 0 for the surface and for effects.
    #[serde(default)]
    pub layer: usize,
    /// Effect that it belongs to; `None` for the base law.
    #[serde(default)]
    pub effect: Option<String>,
    /// Field of the layer, or path in the effect.
    pub name: String,
    /// The label.
    pub label: String,
}

/// An effect too small to matter: never counted as a cause.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct NegligibleEffect {
    /// Effect, by its id.
    pub effect: String,
    /// Parameters by their paths.
    #[serde(default)]
    pub parameters: BTreeMap<String, Estimate>,
    /// Why it does not matter.
    #[serde(default)]
    pub reason: String,
}

/// The verdict.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The simulation agrees with the data.
    None,
    /// One or more causes.
    Named,
    /// A class of effects that these data cannot separate.
    Ambiguous,
    /// Structure that no effect of the library explains dominates.
    Unknown,
    /// No cause, but parameters of the scenario are wrong.
    Parameters,
}

/// The grade that an answer gives its model.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Grade {
    /// A to D.
    pub letter: String,
}

/// An answer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Answer {
    /// Verdict.
    pub verdict: Verdict,
    /// Grade of its model.
    #[serde(default)]
    pub grade: Option<Grade>,
    /// Causes, strongest first.
    #[serde(default)]
    pub causes: Vec<Cause>,
    /// Base parameters.
    #[serde(default)]
    pub base_parameters: Vec<BaseParameter>,
    /// Labels of the parameters.
    #[serde(default)]
    pub parameters: Vec<LabelledParameter>,
    /// Effects that are not identifiable from these recordings.
    #[serde(default)]
    pub not_identifiable: Vec<String>,
    /// Effects too small to matter.
    #[serde(default)]
    pub negligible: Vec<NegligibleEffect>,
}

impl Answer {
    /// Number of layers in its base parameters.
    #[must_use]
    pub fn layer_count(&self) -> usize {
        self.base_parameters.iter().map(|p| p.layer).max().unwrap_or(0)
    }

    /// Label of a parameter, if it has one.
    #[must_use]
    pub fn label(&self, layer: usize, effect: Option<&str>, name: &str) -> Option<String> {
        let is_it =
            |p: &&LabelledParameter| p.layer == layer && p.effect.as_deref() == effect && p.name == name;
        self.parameters.iter().find(is_it).map(|p| p.label.clone())
    }

    /// An answer without any finding.
    #[must_use]
    pub fn none() -> Self {
        Self {
            verdict: Verdict::None,
            grade: None,
            causes: Vec::new(),
            base_parameters: Vec::new(),
            parameters: Vec::new(),
            not_identifiable: Vec::new(),
            negligible: Vec::new(),
        }
    }

    /// Reads `diagnosis.json`.
    ///
    /// # Errors The missing or invalid field, and its place.
    pub fn from_json(text: &str) -> Result<Self, serde_json::Error> {
        serde_json::from_str(text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_example_of_the_specification_is_read_and_further_fields_are_ignored() {
        let text = r#"{ "verdict": "named",
          "causes": [ { "effect": "coulomb_friction", "equivalent": [], "confidence": 0.99, "gain_nats": 7.0,
                        "parameters": { "c_n_per_m": { "value": 4.1, "low": 3.9, "high": 4.3 } } } ],
          "base_parameters": [ { "layer": 1, "name": "stiffness_n_per_m", "assumed": 40.0, "value": 40.3, "low": 39.9,
                                 "high": 40.7, "changed": false } ],
          "not_identifiable": ["force_gain"],
          "negligible": [ { "effect": "time_delay", "parameters": { "delay_s": { "value": 0.00015, "low": 0.0001,
                        "high": 0.0002 } }, "reason": "below a twentieth of the sampling step" } ],
          "residual_structure": { "p_value": 0.4, "depends_on": [], "share": 0.0 }, "data_quality": [ ] }"#;
        let answer = Answer::from_json(text).expect("the example");
        assert_eq!(answer.verdict, Verdict::Named);
        assert_eq!(answer.causes[0].effect, "coulomb_friction");
        assert_eq!(answer.negligible[0].effect, "time_delay");
    }
}
