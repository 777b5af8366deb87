//! Fits the sensor baseline before other effects: offset, drift, force linear in position, steps of the sensor zero.
//!
//! The baseline also acts in air and may exceed the force of the tissue. Without it, the base law assigns force drops to wrong layers and
//! shifts the surface, and a search from there stays in that local minimum. If one effect leaves structure, the search therefore also starts
//! from the base law with the baseline terms whose gain exceeds their BIC penalty; the better of both searches is kept.

use crate::base_law_fit::{
    COARSENING_FACTOR, PreparedRecordings, coarse_refit, fit_from_prior, leaves_noise, with_noise_of,
};
use crate::effect_selection::{MAX_EFFECTS, Search, SearchStage};
use crate::model_comparison::{MIN_GAIN_NATS, bic_penalty, likelihood_gain};
use crate::model_pruning::required_gain_nats;
use crate::random_effect_selection::select_random_effects;
use crate::zero_steps::{
    remove_weak_steps, toggled, unassigned, with_steps_in_residual, zero_step_candidates,
};
use std::sync::Arc;
use stylet_identify::block_averages::BlockAverages;
use stylet_identify::fit::{Effort, Fit, fit};
use stylet_identify::likelihood::FitData;
use stylet_identify::model::{Assumptions, EffectTerm, ZeroStep};
use stylet_identify::noise::NoiseSource;
use stylet_identify::score_test::ScoreTest;
use stylet_stats::parallel::*;
use stylet_tissue::{EffectInfo, Proposal};

/// Rounds in which further steps are detected in the residual.
const RESIDUAL_ROUNDS: usize = 3;
/// Number of force drops that are tried, one at a time, as steps of the zero instead of ruptures.
const MAX_ALTERNATIVES: usize = 6;
/// Rounds in which one force drop changes between rupture and step.
const MAX_EXCHANGES: usize = 3;

/// A search for effects in two parts: a first effect, then further ones.
#[derive(Clone)]
pub(crate) struct EffectSearch {
    pub search: Search,
    /// The recordings that the search was fitted to, with the steps of its baseline.
    pub prepared: PreparedRecordings,
    /// Fit of the base law and its data; `None` if the search began with a baseline.
    base: Option<(Fit, FitData)>,
}

impl EffectSearch {
    /// Searches for one effect from the base law. If that leaves structure, also from the base law with a baseline, if the baseline leaves
    /// only noise.
    pub(crate) fn first_effect(
        prepared: &PreparedRecordings,
        base: Fit,
        data: FitData,
        progress: &mut dyn FnMut(&str),
    ) -> Self {
        let one_more = |mut found: Self, progress: &mut dyn FnMut(&str)| {
            let most = found.search.best.model.effects.len() + 1;
            found.search.add_effects(most, &found.prepared, progress);
            found
        };
        let search = Search::start(base.clone(), data.clone());
        let from_base = Self { search, prepared: prepared.clone(), base: Some((base.clone(), data.clone())) };
        let from_base = one_more(from_base, progress);
        if from_base.search.leaves_noise(&from_base.search.best) || prepared.is_search_limit_reached() {
            return from_base;
        }
        progress("fitting the sensor's baseline");
        match Baseline::fit(prepared, &base, &data, BaselineEffort::Quick) {
            None => from_base,
            Some(baseline) => from_base.or_better(one_more(Self::from_baseline(baseline, base), progress)),
        }
    }

    /// Searches for further effects. A search without a baseline that leaves structure is compared with one from a baseline with full effort.
    pub(crate) fn complete(mut self, progress: &mut dyn FnMut(&str)) -> (Search, PreparedRecordings) {
        self.add_further(progress);
        if let Some((base, data)) = self.base.clone()
            && !self.search.leaves_noise(&self.search.best)
            && !self.prepared.is_search_limit_reached()
            && let Some(baseline) = Baseline::fit(&self.prepared, &base, &data, BaselineEffort::Full)
        {
            let mut other = Self::from_baseline(baseline, base);
            other.add_further(progress);
            self = self.or_better(other);
        }
        (self.search, self.prepared)
    }

    /// The same search with weak priors around the fitted layers instead of the assumed ones.
    pub(crate) fn with_weak_priors(mut self) -> Self {
        let tissue = self.search.best.model.tissue.clone();
        let assumed = Arc::new(Assumptions { tissue, ..self.prepared.assumed.with_weak_priors() });
        let relax = |f: &mut Fit, data: &FitData| {
            f.model.assumed = Arc::clone(&assumed);
            if let Some(relaxed) = fit(&f.model, data, Effort::FULL) {
                *f = relaxed;
            }
        };
        relax(&mut self.search.best, &self.search.data);
        relax(&mut self.search.base, &self.search.data);
        if let Some((base, data)) = &mut self.base {
            relax(base, data);
        }
        self.prepared.assumed = assumed;
        self.search.is_exhausted = false;
        self
    }

    fn from_baseline(baseline: Baseline, base: Fit) -> Self {
        let Baseline { prepared, fit, data, stages } = baseline;
        Self { search: Search { base, stages, ..Search::start(fit, data) }, prepared, base: None }
    }

    fn add_further(&mut self, progress: &mut dyn FnMut(&str)) {
        self.search.add_effects(MAX_EFFECTS, &self.prepared, progress);
        self.search.finish(&self.prepared);
        if self.base.is_none() {
            remove_weak_steps(&mut self.search, NoiseSource::LongMemory);
        }
    }

    /// The other search if its penalised likelihood is better.
    fn or_better(self, other: Self) -> Self {
        let penalty = |s: &Search| s.penalty_of(&s.best.model);
        let needed = penalty(&other.search) - penalty(&self.search);
        let gain = likelihood_gain(&self.search.best, &other.search.best, &other.search.data);
        if gain > needed { other } else { self }
    }
}

/// Recordings with their steps of the zero, fit, and data with the noise of the fit.
type Fitted = (PreparedRecordings, Fit, FitData);

/// Effort of a fit of the baseline.
#[derive(Clone, Copy, PartialEq)]
enum BaselineEffort {
    /// One force drop is exchanged between rupture and step; the baseline must leave only noise.
    Quick,
    /// Up to [`MAX_EXCHANGES`] drops, and all unassigned ones at once.
    Full,
}

/// A fit of the base law with a baseline.
struct Baseline {
    prepared: PreparedRecordings,
    fit: Fit,
    data: FitData,
    /// One selection step per baseline effect.
    stages: Vec<SearchStage>,
}

impl Baseline {
    /// Fits the baseline; `None` if its gain is below its penalty. If it leaves structure, force drops are exchanged between rupture and step,
    /// one per round.
    fn fit(
        prepared: &PreparedRecordings,
        base: &Fit,
        data: &FitData,
        effort: BaselineEffort,
    ) -> Option<Self> {
        let infos: Vec<&'static EffectInfo> =
            base.model.assumed.candidates().filter(|i| i.baseline).collect();
        let candidates = zero_step_candidates(prepared);
        let jumps_up = candidates.steps.iter().flatten().any(|s| s.size_n > 0.0);
        if !jumps_up && unassigned(&candidates.drops, base).next().is_none() && !may_gain(&infos, base, data)
        {
            return None;
        }
        let inactive = |i: &&'static EffectInfo| {
            EffectTerm::new(i, &i.parameters.iter().map(|p| p.inactive).collect::<Vec<f64>>())
        };
        let terms: Vec<EffectTerm> = infos.iter().map(inactive).collect();
        let fitted = |steps: Vec<Vec<ZeroStep>>| {
            let prepared = prepared.with_zero_steps(steps);
            let (fit, data) = fit_from_prior(&prepared, &terms, (false, false))?;
            Some((prepared, fit, data))
        };
        let gain_of = |other: &(PreparedRecordings, Fit, FitData),
                       best: &(PreparedRecordings, Fit, FitData)| {
            let count = |f: &Fit| f.model.effect_parameter_count() as f64;
            let blocks = other.2.compared_block_count();
            let penalty = (count(&other.1) - count(&best.1)) * bic_penalty(1, blocks);
            likelihood_gain(&best.1, &other.1, &other.2) - penalty
        };
        let rounds = match effort {
            BaselineEffort::Quick => 1,
            BaselineEffort::Full => MAX_EXCHANGES,
        };
        // The steps with the exchange of one drop that fits best on coarse blocks.
        let best_exchange = |best: &Fitted| {
            let coarse = with_noise_of(&best.1.model, &best.2.coarsened(COARSENING_FACTOR))?;
            let tried: Vec<(f64, Vec<Vec<ZeroStep>>)> = candidates
                .drops
                .iter()
                .take(MAX_ALTERNATIVES)
                .into_par_iter()
                .filter_map(|drop| {
                    let steps = toggled(&best.0.zero_steps, *drop);
                    let with_steps = prepared.with_zero_steps(steps);
                    let f = coarse_refit(&with_steps, &terms, (false, false), &coarse)?;
                    let penalty =
                        bic_penalty(f.model.effect_parameter_count(), coarse.compared_block_count());
                    Some((f.nats() + penalty, with_steps.zero_steps))
                })
                .collect();
            tried.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, steps)| steps)
        };
        // While structure is left, a drop is tried as a step instead of a rupture, or the reverse.
        let exchanged = |mut best: Fitted| {
            for _ in 0..rounds {
                if leaves_noise(&best.1, &best.2) {
                    break;
                }
                let Some(other) = best_exchange(&best).and_then(fitted) else { break };
                if gain_of(&other, &best) < MIN_GAIN_NATS {
                    break;
                }
                best = other;
            }
            best
        };
        let mut best = exchanged(fitted(candidates.steps.clone())?);
        if effort == BaselineEffort::Full && !leaves_noise(&best.1, &best.2) {
            // For many steps at once: all drops that are not assigned to a layer.
            let known = |drop: &&(usize, ZeroStep)| best.0.zero_steps[drop.0].contains(&drop.1);
            let more = unassigned(&candidates.drops, &best.1).filter(|drop| !known(drop));
            let steps = more.fold(best.0.zero_steps.clone(), |steps, drop| toggled(&steps, *drop));
            if let Some(other) = fitted(steps).map(exchanged)
                && gain_of(&other, &best) > MIN_GAIN_NATS
            {
                best = other;
            }
        }
        for _ in 0..RESIDUAL_ROUNDS {
            let (with_steps, fit, data) = &best;
            let Some(steps) = with_steps_in_residual(&with_steps.zero_steps, fit, data) else { break };
            let Some(other) = fitted(steps) else { break };
            if gain_of(&other, &best) < MIN_GAIN_NATS {
                break;
            }
            best = other;
        }
        let (prepared, fit, data) = best;
        if effort == BaselineEffort::Quick && !leaves_noise(&fit, &data) {
            return None;
        }
        let (fit, data) = select_random_effects(fit, data);
        let mut search = Search { base: base.clone(), ..Search::from_fit(fit, data) };
        let stages = search.prune_baseline();
        let prepared = prepared.with_zero_steps(search.best.model.zero_steps.clone());
        let any = !search.best.model.effects.is_empty() || search.best.model.zero_step_count() > 0;
        let needed = search.penalty_of(&search.best.model) + MIN_GAIN_NATS;
        (any && likelihood_gain(base, &search.best, &search.data) > needed).then_some(Self {
            prepared,
            fit: search.best,
            data: search.data,
            stages,
        })
    }
}

/// Whether the first-order gain of any baseline effect exceeds its penalty.
fn may_gain(infos: &[&'static EffectInfo], base: &Fit, data: &FitData) -> bool {
    let score_test = ScoreTest::new(base, data);
    let offset_needed = bic_penalty(1, data.compared_block_count()) + MIN_GAIN_NATS;
    let is_offset_needed = |recording: usize| {
        let ones = |(r, b): (usize, &BlockAverages)| vec![f64::from(u8::from(r == recording)); b.len()];
        let force: Vec<Vec<f64>> = data.recordings.iter().enumerate().map(ones).collect();
        score_test.gain(&[score_test.force_column(&force)]).nats > offset_needed
    };
    if (0..data.recording_count()).any(is_offset_needed) {
        return true;
    }
    let is_needed = |info: &&'static EffectInfo| {
        let Proposal::LinearColumns(groups) = info.proposal else { return false };
        let needed = bic_penalty(info.parameters.len(), data.compared_block_count()) + MIN_GAIN_NATS;
        groups.iter().filter_map(|g| g.first()).any(|values| {
            let column = score_test.effect_column(&EffectTerm::new(info, values));
            column.is_some_and(|c| score_test.gain(&[c]).nats > needed)
        })
    };
    infos.par_iter().map(is_needed).into_iter().any(|needed| needed)
}

impl Search {
    /// Removes baseline effects and steps whose gain is below their penalty; returns one selection step per remaining effect.
    fn prune_baseline(&mut self) -> Vec<SearchStage> {
        loop {
            remove_weak_steps(self, NoiseSource::Residual);
            let tried: Vec<(usize, Fit)> = (0..self.best.model.effects.len())
                .into_par_iter()
                .filter_map(|k| Some((k, fit(&self.best.model.without_effect(k), &self.data, Effort::FULL)?)))
                .collect();
            let gains: Vec<(usize, f64, f64, Fit)> = tried
                .into_par_iter()
                .map(|(k, f)| {
                    let needed = required_gain_nats(&f, &self.best, &self.data);
                    (k, likelihood_gain(&f, &self.best, &self.data), needed, f)
                })
                .collect();
            let weakest = gains.iter().min_by(|a, b| (a.1 - a.2).total_cmp(&(b.1 - b.2)));
            match weakest {
                Some((_, gain, needed, f)) if gain < needed => self.accept(f.clone()),
                _ => return gains.iter().map(|g| self.baseline_stage(g.0, g.1, g.2)).collect(),
            }
        }
    }

    fn baseline_stage(&self, k: usize, gain: f64, required_nats: f64) -> SearchStage {
        let term = &self.best.model.effects[k];
        let parameters = term.info.parameters.iter().filter(|p| !p.integer).count();
        SearchStage {
            included: self.best.model.effects[..k].iter().map(|e| e.info.id).collect(),
            candidates: vec![(term.info.id, gain, parameters)],
            selected: Some((term.info.id, gain)),
            required_nats,
            choices: vec![term.clone()],
        }
    }
}
