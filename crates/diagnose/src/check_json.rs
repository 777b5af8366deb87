//! Items of the check of recordings, in `check.json` and `diagnosis.json`.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Suitability of recordings for a diagnosis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Rating {
    /// Good enough for a diagnosis.
    Good,
    /// A diagnosis will be limited.
    Limited,
    /// A diagnosis would not be meaningful.
    Unusable,
}

impl Rating {
    /// Name as printed by the command and the report.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Rating::Good => "good",
            Rating::Limited => "limited",
            Rating::Unusable => "unusable",
        }
    }
}

/// Result of the check of one aspect of an experiment.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct CheckItem {
    /// Aspect: `recordings`, `contact`, `motion`, `depth`, `parameters` or `effects`.
    pub topic: String,
    /// Suitability of the recordings in this aspect.
    pub light: Rating,
    /// The reason, in one sentence.
    pub message: String,
}

impl CheckItem {
    pub(crate) fn new(topic: &str, light: Rating, message: String) -> Self {
        Self { topic: topic.to_owned(), light, message }
    }
}

/// Size from which an effect is detectable in the recordings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EffectVisibility {
    /// Effect id.
    pub effect: String,
    /// Whether an effect of typical size would be detected.
    pub visible: bool,
    /// Expected gain (nats) of an effect of typical size.
    pub nats: f64,
    /// Parameters at the smallest detectable size; `None` when no plausible size is detectable.
    pub smallest: Option<BTreeMap<String, f64>>,
    /// Parameters at the size below which the effect would be missed; `None` when it would be missed at every plausible size.
    pub hidden_below: Option<BTreeMap<String, f64>>,
}
