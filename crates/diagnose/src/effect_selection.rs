//! Forward selection of effects: each step adds the effect with the largest penalised gain; superfluous effects are removed afterwards.

use crate::base_law_fit::{PreparedRecordings, is_rms_that_of_quiet_parts, with_updated_times};
use crate::effect_start::EffectStart;
use crate::effect_start_values::effect_starts;
use crate::geometry_selection::fix_geometry;
use crate::model_comparison::{MIN_GAIN_NATS, bic_penalty, likelihood_gain};
use crate::motion_period::has_confounded_clock;
use crate::random_effect_selection::select_random_effects;
use crate::reweighted_fit::fit_reweighted;
use crate::selection_restarts::{MAX_BEHIND_SHARE, is_new_effect};
pub use crate::selection_state::{Search, SearchStage};
use stylet_identify::fit::{Effort, Fit, fit, fit_if_below};
use stylet_identify::likelihood::{FitData, residuals};
use stylet_identify::model::Model;
use stylet_identify::score_test::ScoreTest;
use stylet_stats::parallel::*;
use stylet_tissue::ChainStage;

/// Largest number of selected effects.
pub const MAX_EFFECTS: usize = 5;
/// Candidates that get a short fit.
const SHORT_FITS: usize = 8;
/// Candidates that get a full fit after the short one.
const FULL_FITS: usize = 4;

/// Share of its required gain that the first-order gain of a candidate must reach for it to be fitted.
const MIN_FIRST_ORDER_SHARE: f64 = 0.5;
/// A full fit of a candidate stops when, at its rate of convergence, it would end more than this many nats behind the best.
const STOP_DISTANCE_NATS: f64 = 100.0;
/// Largest number of restarts of the current model from a candidate's parameters.
const MAX_RESTARTS: usize = 4;
/// Selection steps in which candidates may be refitted from the prior.
const MAX_PRIOR_STAGES: usize = 2;

/// A short fit on coarse blocks with at most one effect, to compare start values of the layers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OneEffectFit {
    /// Logarithm of the likelihood (nats) with the noise that the fit leaves, negative, with the penalty for the parameters of the effect.
    pub criterion_nats: f64,
    /// RMS residual in N.
    pub rms_n: f64,
    /// Whether it leaves only noise.
    pub leaves_noise: bool,
}

impl Search {
    /// A selection before its first step, from a fit that may already have effects.
    pub(crate) fn start(fit: Fit, data: FitData) -> Self {
        Self { restarts: MAX_RESTARTS, prior_refits: MAX_PRIOR_STAGES, ..Self::from_fit(fit, data) }
    }

    /// Adds effects until none gains enough, or the model has `max_effects` of them.
    pub(crate) fn add_effects(
        &mut self,
        max_effects: usize,
        prepared: &PreparedRecordings,
        progress: &mut dyn FnMut(&str),
    ) {
        while self.best.model.effects.len() < max_effects
            && !self.is_exhausted
            && !prepared.is_search_limit_reached()
        {
            let another = if self.best.model.effects.is_empty() { "an" } else { "another" };
            progress(&format!("searching for {another} effect"));
            self.is_exhausted = !self.add_effect(prepared);
        }
    }

    /// Removes superfluous effects, and selects random effects and geometry.
    pub(crate) fn finish(&mut self, prepared: &PreparedRecordings) {
        self.prune();
        if !self.best.model.effects.is_empty() {
            (self.best, self.data) = select_random_effects(self.best.clone(), self.data.clone());
        }
        if fix_geometry(self, prepared) {
            self.prune();
        }
    }

    /// Continues the selection with reweighted fits ([`fit_reweighted`]), for data with an unmodelled effect.
    pub(crate) fn continue_reweighted(&self, prepared: &PreparedRecordings) -> Option<Self> {
        let (best, data) = fit_reweighted(&self.best, &self.data)?;
        let mut search = self.with_best(best, data);
        while search.best.model.effects.len() < MAX_EFFECTS
            && !prepared.is_search_limit_reached()
            && search.add_effect(prepared)
        {
            (search.best, search.data) = fit_reweighted(&search.best, &search.data)?;
        }
        search.prune();
        (search.best, search.data) = fit_reweighted(&search.best, &search.data)?;
        Some(search)
    }

    /// One selection step; returns whether an effect was added.
    pub(crate) fn add_effect(&mut self, prepared: &PreparedRecordings) -> bool {
        self.update_tones();
        let times = prepared.drop_times();
        let coarse = self.coarse();
        let ranked = self.promising_starts(prepared);
        let mut full = self.fit_candidates(&ranked, &coarse, &times);
        if let Some(moved) = full.first().and_then(|f| self.with_boundary_moved(f, &coarse, &times)) {
            full[0] = moved;
        }
        if let Some(more) = self.refit_candidates_from_prior(&full, &ranked, &coarse, prepared) {
            full.extend(more);
            self.rank(&mut full);
        }
        full.retain(|f| !has_confounded_clock(f, &self.data));
        if self.restart_from_leader(&full) {
            return self.add_effect(prepared);
        }
        let name = |f: &Fit| f.model.effects.last().map_or("", |e| e.info.id);
        let mut stage = SearchStage {
            included: self.best.model.effects.iter().map(|e| e.info.id).collect(),
            candidates: full
                .iter()
                .map(|f| (name(f), self.best.nats() - f.nats(), f.model.effect_parameter_count()))
                .collect(),
            selected: None,
            required_nats: full.first().map_or(0.0, |f| self.required_nats(f)),
            choices: full.iter().filter_map(|f| f.model.effects.last().cloned()).collect(),
        };
        for f in full.into_iter().take(2) {
            let needed = self.required_nats(&f);
            if self.best.nats() - f.nats() < needed {
                continue;
            }
            let gained = likelihood_gain(&self.best, &f, &self.data);
            if gained < needed {
                continue;
            }
            stage.selected = Some((name(&f), gained));
            self.accept(f);
            self.use_extended_forms(&times);
            break;
        }
        let any = stage.selected.is_some();
        self.stages.push(stage);
        any
    }

    /// The best short fit with at most one effect.
    pub(crate) fn one_effect_fit(mut self, prepared: &PreparedRecordings) -> OneEffectFit {
        self.update_tones();
        let coarse = self.coarse();
        let ranked = self.promising_starts(prepared);
        let tried: Vec<&EffectStart> =
            ranked.iter().take(SHORT_FITS).flatten().filter(|s| s.model.is_none()).collect();
        let fits: Vec<Fit> = tried
            .par_iter()
            .filter_map(|s| fit(&self.best.model.with_effect(s.choice.clone()), &coarse, Effort::SHORT))
            .collect();
        let base = residuals(&self.best.model, &coarse)
            .map(|residuals| Fit { model: self.best.model.clone(), residuals });
        let blocks = coarse.compared_block_count() as f64;
        let described = |f: Fit| {
            let rms_n = f.rms_n(&coarse);
            OneEffectFit {
                criterion_nats: blocks * libm::log(rms_n) + self.penalty_of(&f.model),
                rms_n,
                leaves_noise: is_rms_that_of_quiet_parts(&f, &coarse),
            }
        };
        let all = fits.into_iter().chain(base).map(described);
        let none = OneEffectFit { criterion_nats: f64::INFINITY, rms_n: f64::INFINITY, leaves_noise: false };
        all.min_by(|a, b| a.criterion_nats.total_cmp(&b.criterion_nats)).unwrap_or(none)
    }

    /// Start values of the effects whose first-order gain is close to what they require.
    fn promising_starts(&self, prepared: &PreparedRecordings) -> Vec<Vec<EffectStart>> {
        let blocks = self.data.compared_block_count();
        let mut ranked = effect_starts(&ScoreTest::new(&self.best, &self.data), prepared, &self.tones_hz);
        ranked.retain(|s| {
            let parameters = s[0].choice.info.parameters.iter().filter(|p| !p.integer).count();
            // Before it is fitted, a rupture effect appears as scatter of the ruptures, so its first-order gain is too small.
            s[0].choice.info.stage == ChainStage::Puncture
                || s[0].gain_nats > MIN_FIRST_ORDER_SHARE * (bic_penalty(parameters, blocks) + MIN_GAIN_NATS)
        });
        ranked
    }

    /// Fits of the model plus one effect, best first: short fits on coarse blocks, then full fits of the best.
    fn fit_candidates(&self, ranked: &[Vec<EffectStart>], coarse: &FitData, times: &[Vec<f64>]) -> Vec<Fit> {
        let by_ruptures = |s: &&Vec<EffectStart>| s[0].choice.info.stage == ChainStage::Puncture;
        let tried = ranked.iter().take(SHORT_FITS).chain(ranked.iter().skip(SHORT_FITS).filter(by_ruptures));
        // Starts that bring their own model skip the short fit.
        let (with_model, tried): (Vec<&EffectStart>, Vec<&EffectStart>) =
            tried.flatten().partition(|s| s.model.is_some());
        let mut short: Vec<Fit> = tried
            .par_iter()
            .filter_map(|s| fit(&self.best.model.with_effect(s.choice.clone()), coarse, Effort::SHORT))
            .collect();
        self.rank(&mut short);
        // No full fit of candidates far behind the best.
        if let (Some(first), Some(current)) =
            (short.first().map(Fit::nats), residuals(&self.best.model, coarse))
        {
            let reach = (1.0 - MAX_BEHIND_SHARE) * (current.nats - first);
            short.retain(|f| current.nats - f.nats() >= reach.min(current.nats - first - 30.0));
        }
        short.truncate(FULL_FITS);
        let fitted = |model: &Model, wanted: f64| {
            let model = with_updated_times(model.clone(), &self.data, times);
            fit_if_below(&model, &self.data, Effort::FULL, wanted)
        };
        // The best candidate is fitted to convergence; the other fits stop early if they cannot come close.
        let mut full: Vec<Fit> =
            short.first().and_then(|f| fitted(&f.model, f64::INFINITY)).into_iter().collect();
        let wanted = full.first().map_or(f64::INFINITY, |f| f.nats() + STOP_DISTANCE_NATS);
        let if_close = |model: &Model| fitted(model, wanted);
        // Rupture times updated under the assumed scatter move far, under the scatter of the present times little; both are tried.
        let near = |model: &Model| fit(model, &self.data, Effort::SHORT).and_then(|f| if_close(&f.model));
        let far = |model: &Model| {
            let model = with_updated_times(model.clone(), &self.data, times);
            fit(&model, coarse, Effort::SHORT).and_then(|f| if_close(&f.model))
        };
        let with_model = with_model.iter().filter_map(|s| s.model.as_ref());
        full.extend(short.iter().skip(1).into_par_iter().filter_map(|f| if_close(&f.model)));
        full.extend(with_model.into_par_iter().map(|m| [far(m), near(m)]).into_iter().flatten().flatten());
        self.rank(&mut full);
        full
    }

    /// BIC penalty (nats) of the effects and steps of a model.
    pub(crate) fn penalty_of(&self, model: &Model) -> f64 {
        bic_penalty(model.effect_parameter_count(), self.data.compared_block_count())
    }

    /// Gain (nats) required of a fit to be selected.
    fn required_nats(&self, f: &Fit) -> f64 {
        self.penalty_of(&f.model) - self.penalty_of(&self.best.model) + MIN_GAIN_NATS
    }

    /// Sorts fits by their penalised objective and keeps the best of each effect.
    fn rank(&self, fits: &mut Vec<Fit>) {
        let penalised = |f: &Fit| f.nats() + self.penalty_of(&f.model);
        fits.sort_by(|a, b| penalised(a).total_cmp(&penalised(b)));
        let mut names: Vec<&str> = Vec::new();
        fits.retain(|f| is_new_effect(&mut names, f));
    }
}

#[cfg(test)]
mod tests;
