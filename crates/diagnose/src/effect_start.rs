//! Start values of one effect.

use stylet_identify::model::{EffectTerm, Model};
use stylet_identify::score_test::ScoreTestResult;

/// Start values of an effect with its first-order gain.
#[derive(Clone, Debug)]
pub struct EffectStart {
    /// The effect with its start values.
    pub choice: EffectTerm,
    /// First-order gain in nats.
    pub gain_nats: f64,
    /// Expected gain (nats) of the effect at its typical strength.
    pub detectable_nats: f64,
    /// Model to start from, if it is not the current model plus the effect.
    pub model: Option<Model>,
}

impl EffectStart {
    /// Start values of an effect with the result of its score test.
    pub(crate) fn new(choice: EffectTerm, gain: &ScoreTestResult) -> Self {
        Self { choice, gain_nats: gain.nats, detectable_nats: gain.detectable_nats, model: None }
    }
}
