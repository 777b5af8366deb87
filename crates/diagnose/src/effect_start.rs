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
    /// Nats by which the effect at its typical strength would be detected.
    pub detectable_nats: f64,
    /// The model to start from, when it is not the current model plus the effect; such a start skips the short fit.
    pub model: Option<Model>,
}

impl EffectStart {
    /// Start values of an effect with the result of its score test.
    pub(crate) fn new(choice: EffectTerm, gain: &ScoreTestResult) -> Self {
        Self { choice, gain_nats: gain.nats, detectable_nats: gain.detectable_nats, model: None }
    }
}
