//! Items of a check of recordings, in `check.json` and `diagnosis.json`.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// How far recordings serve.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Light {
    /// Good enough for a diagnosis.
    Good,
    /// A diagnosis will be limited.
    Limited,
    /// A diagnosis would mean nothing.
    Unusable,
}

impl Light {
    /// As the command and its report print it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Light::Good => "good",
            Light::Limited => "limited",
            Light::Unusable => "unusable",
        }
    }
}

/// One aspect of an experiment.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct CheckItem {
    /// What was checked: `recordings`, `contact`, `motion`, `depth`, `parameters` or `effects`.
    pub topic: String,
    /// How far the recordings serve.
    pub light: Light,
    /// The reason, in one sentence.
    pub message: String,
}

impl CheckItem {
    pub(crate) fn new(topic: &str, light: Light, message: String) -> Self {
        Self { topic: topic.to_owned(), light, message }
    }
}

/// From which size on an effect would be seen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EffectVisibility {
    /// Effect id.
    pub effect: String,
    /// Whether its typical size would be seen.
    pub visible: bool,
    /// Nats that its typical size would gain.
    pub nats: f64,
    /// Parameters at the smallest size that would be seen; `None` when no plausible size would.
    pub smallest: Option<BTreeMap<String, f64>>,
    /// Parameters at the size below which it would be missed; `None` when at every plausible size.
    pub hidden_below: Option<BTreeMap<String, f64>>,
}
