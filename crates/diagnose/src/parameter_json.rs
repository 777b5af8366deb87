//! Parameters in `diagnosis.json`: estimates, their identifiability, and estimates per recording.

use serde::{Deserialize, Serialize};
use stylet_stats::number_format::significant;

/// A value with its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// Best value.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// A parameter of the base law.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BaseParameter {
    /// Layer, 1-based; 0 for the whole tissue.
    pub layer: usize,
    /// Name of the parameter.
    pub name: String,
    /// Value in the scenario.
    pub assumed: f64,
    /// Fitted value.
    pub value: f64,
    /// Lower end of the 95 % interval.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Whether the assumed value lies outside the interval.
    pub changed: bool,
    /// Whether the estimate is at a bound of the search.
    pub at_bound: bool,
    /// Whether the value is only a lower limit `low`: no recording reached this puncture force.
    #[serde(default)]
    pub at_least: bool,
    /// Whether the whole interval is outside the tolerance of the scenario.
    #[serde(default)]
    pub out_of_tolerance: bool,
}

/// Identifiability of a parameter from the recordings.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ParameterLabel {
    /// The data bound it on both sides, or determine it to 10 %.
    Determined,
    /// The data bound it on one side.
    OneSided,
    /// The data do not bound it; the estimate is that of the prior.
    NotIdentifiable,
    /// Its estimate is strongly correlated with that of another parameter.
    TradesWith,
    /// It is at a bound of the search.
    AtBound,
}

/// A parameter of the base law or of a cause, with its identifiability.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LabelledParameter {
    /// Layer, 1-based; 0 for the whole tissue and for effects.
    pub layer: usize,
    /// Effect of the parameter; `None` for the base law.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub effect: Option<String>,
    /// Name, or path within the effect.
    pub name: String,
    /// Its identifiability.
    pub label: ParameterLabel,
    /// Parameter with the most correlated estimate, if the correlation is 0.9 or more.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub trades_with: Option<String>,
    /// Correlation with that parameter, -1 to 1; 0 without one.
    #[serde(default)]
    pub correlation: f64,
}

impl LabelledParameter {
    pub(crate) fn new(layer: usize, effect: Option<&str>, name: &str, label: ParameterLabel) -> Self {
        let (effect, name) = (effect.map(str::to_owned), name.to_owned());
        Self { layer, effect, name, label, trades_with: None, correlation: 0.0 }
    }

    /// The label in words, as in the report.
    #[must_use]
    pub fn label_in_words(&self) -> String {
        match (self.label, &self.trades_with) {
            (ParameterLabel::Determined, _) => "determined".to_owned(),
            (ParameterLabel::OneSided, _) => "bounded on one side only".to_owned(),
            (ParameterLabel::NotIdentifiable, _) => "not identifiable".to_owned(),
            (ParameterLabel::AtBound, _) => "at its bound".to_owned(),
            (ParameterLabel::TradesWith, Some(partner)) => {
                format!("trades with {partner}, correlation {}", significant(self.correlation, 2))
            }
            (ParameterLabel::TradesWith, None) => "trades with others".to_owned(),
        }
    }
}

impl std::fmt::Display for LabelledParameter {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        match (&self.effect, self.layer) {
            (Some(effect), _) => write!(f, "{} of {effect}", self.name),
            (None, 0) => write!(f, "{}", self.name),
            (None, layer) => write!(f, "{} of layer {layer}", self.name),
        }
    }
}

/// Estimates of a parameter from each recording alone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ParameterByRecording {
    /// Name of the parameter.
    pub parameter: String,
    /// Value and 95 % interval of each recording, in the order of `gain.recordings`; `None` where the recording does not determine it.
    pub estimates: Vec<Option<Estimate>>,
    /// p-value of the differences between recordings under one common value (Cochran's Q).
    pub p_value: f64,
}
