//! Restarts of the effect selection: refits the current model from a candidate's parameters.

use crate::model_comparison::MIN_GAIN_NATS;
use crate::selection_state::Search;
use stylet_identify::fit::{Effort, Fit, fit_if_below};

/// Smallest gain of a restart as a share of the leading candidate's gain; a marginally better model does not change the selection.
const MIN_RESTART_SHARE: f64 = 0.1;

impl Search {
    /// Refits the current model from the parameters of the leading candidate, and accepts it if it gains enough; returns whether it did. A
    /// part of the candidate's gain is then due to better start values.
    pub(crate) fn restart_from_leader(&mut self, full: &[Fit]) -> bool {
        let Some(leader) = full.first() else { return false };
        let Some(last) = leader.model.effects.len().checked_sub(1) else { return false };
        if self.restarts == 0 || self.best.nats() - leader.nats() < MIN_GAIN_NATS {
            return false;
        }
        let gained = self.best.nats() - leader.nats();
        let wanted = self.best.nats() - MIN_GAIN_NATS.max(MIN_RESTART_SHARE * gained);
        let again = fit_if_below(&leader.model.without_effect(last), &self.data, Effort::FULL, wanted);
        let Some(again) = again.filter(|f| f.nats() < wanted) else { return false };
        self.restarts -= 1;
        self.accept(again);
        if self.best.model.effects.is_empty() {
            self.base = self.best.clone();
        }
        true
    }
}
