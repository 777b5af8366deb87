//! Restarts of the effect selection: refits candidates from the prior, and the current model from a candidate's parameters.

use crate::base_law_fit::{
    PreparedRecordings, coarse_refit, random_effects_of, refit_from_prior, with_noise_of,
};
use crate::effect_start::EffectStart;
use crate::effect_start_values::starts_at_common_drops;
use crate::model_comparison::MIN_GAIN_NATS;
use crate::selection_state::Search;
use stylet_identify::fit::{Effort, Fit, fit_if_below};
use stylet_identify::likelihood::{FitData, residuals};
use stylet_identify::model::EffectTerm;
use stylet_stats::parallel::*;
use stylet_tissue::Proposal;

/// Largest distance of a candidate from the best, as a share of the best gain, for a full fit.
pub(crate) const MAX_BEHIND_SHARE: f64 = 0.5;
/// Smallest gain of a restart as a share of the leading candidate's gain; a marginally better model does not change the selection.
const MIN_RESTART_SHARE: f64 = 0.1;
/// Largest distance of a coarse refit from the leading candidate, as a share of that candidate's gain, for a full refit.
const MAX_COARSE_BEHIND_SHARE: f64 = 0.05;
/// Largest number of candidates that are fully refitted from the prior.
const MAX_PRIOR_REFITS: usize = 3;

impl Search {
    /// Refits promising candidates from the prior until one leaves only noise; `None` if the leading candidate already does, or no refits
    /// are left. The fits so far may depend on ruptures that were assigned without the effect.
    pub(crate) fn refit_candidates_from_prior(
        &mut self,
        full: &[Fit],
        ranked: &[Vec<EffectStart>],
        coarse: &FitData,
        prepared: &PreparedRecordings,
    ) -> Option<Vec<Fit>> {
        let leader = full.first()?;
        if self.prior_refits == 0 || self.leaves_noise(leader) {
            return None;
        }
        self.prior_refits -= 1;
        let with = |choice: &EffectTerm| {
            let mut effects = self.best.model.effects.clone();
            effects.push(choice.clone());
            effects
        };
        // Coarse refits of all candidates and of the model without them, then full refits of those close to the best.
        let coarse = with_noise_of(&leader.model, coarse)?;
        let leader_nats = residuals(&leader.model, &coarse)?.nats;
        let random_effects = random_effects_of(&self.best.model);
        let current = coarse_refit(prepared, &self.best.model.effects, random_effects, &coarse)?.nats();
        let tried: Vec<EffectTerm> = ranked
            .iter()
            .filter_map(|s| Some(&s.first()?.choice))
            .flat_map(|c| {
                let is_breaking = c.info.proposal == Proposal::MembraneRupture;
                std::iter::once(c.clone()).chain(
                    is_breaking.then(|| starts_at_common_drops(c.info, prepared)).into_iter().flatten(),
                )
            })
            .collect();
        let mut coarse_fits: Vec<(f64, Vec<EffectTerm>)> = tried
            .par_iter()
            .filter_map(|c| {
                let f = coarse_refit(prepared, &with(c), random_effects, &coarse)?;
                Some((f.nats(), f.model.effects))
            })
            .collect();
        coarse_fits.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut names: Vec<&str> = Vec::new();
        coarse_fits.retain(|(_, effects)| effects.last().is_some_and(|e| is_new_name(&mut names, e.info.id)));
        let most = current - coarse_fits.first()?.0;
        // Candidates further behind would not overtake the leading one.
        let reach = leader_nats + MAX_COARSE_BEHIND_SHARE * (current - leader_nats).max(0.0);
        coarse_fits.retain(|s| current - s.0 > MAX_BEHIND_SHARE * most && s.0 < reach);
        coarse_fits.truncate(MAX_PRIOR_REFITS);
        let mut started: Vec<Fit> = Vec::new();
        for (_, effects) in coarse_fits {
            let Some(f) = refit_from_prior(prepared, &effects, random_effects, &self.data) else { continue };
            let leaves_noise = self.leaves_noise(&f);
            started.push(f);
            if leaves_noise {
                break;
            }
        }
        Some(started)
    }

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

/// Whether the last effect of a fit is not in `names` yet; adds it.
pub(crate) fn is_new_effect(names: &mut Vec<&'static str>, f: &Fit) -> bool {
    is_new_name(names, f.model.effects.last().map_or("", |e| e.info.id))
}

fn is_new_name(names: &mut Vec<&'static str>, name: &'static str) -> bool {
    let new = !names.contains(&name);
    names.push(name);
    new
}
