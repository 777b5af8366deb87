//! Effects enter by what they gain, and leave when the others can do without them.

use crate::base_law_fit::{
    COARSENING_FACTOR, MISFIT_FACTOR, PreparedRecordings, coarse_refit, random_effects_of, refit_from_prior,
};
use crate::effect_start_values::{EffectStart, effect_starts, starts_at_common_drops};
use crate::model_comparison::{MIN_GAIN_NATS, bic_penalty, likelihood_gain};
use crate::reweighted_fit::fit_reweighted;
use rayon::prelude::*;
use stylet_identify::delay_refinement::refine_delay;
use stylet_identify::evidence_nats::Nats;
use stylet_identify::fit::{Effort, Fit, Linearization, fit, fit_from_zero_scatter, fit_if_below};
use stylet_identify::likelihood::{FitData, residuals, with_break_uncertainty};
use stylet_identify::model::{EffectTerm, Model, ParameterRole};
use stylet_identify::noise::NoiseSource;
use stylet_identify::score_test::ScoreTest;
use stylet_identify::update_event_times::update_event_times;
use stylet_tissue::{ChainStage, FitScale, Proposal};

/// Most effects at once.
pub const MAX_EFFECTS: usize = 5;
/// Effects that get a short fit, and of those the ones that get a full one.
const SHORT: usize = 8;
const FULL: usize = 4;

/// An effect gets a fit when it promises this share of what it needs, to first order.
const PROMISE: f64 = 0.5;
/// A rival that gains less than the best by more than this share is not fitted to the end.
const BEHIND: f64 = 0.5;
/// Nor is one that would end more than so many nats behind it if every step gained as much as the last.
const NEAR: f64 = 100.0;
/// The best so far is begun anew at most so often.
const RESTARTS: usize = 4;
/// It is, when it then has this share of the leader's gain: beside a strong effect a base law that is hardly better finds nothing else.
const OWED: f64 = 0.1;

/// By so many tolerances of a thickness a face is moved to see whether it lies better elsewhere.
const MOVES: [f64; 4] = [-2.0, -1.0, 1.0, 2.0];
/// What breaks is tried with up to so many times less and more of what it bears.
const BEARS: f64 = 3.0;
/// The steps with the ruptures where they are.
const FINELY: i32 = 40;
/// The steps with ruptures that follow.
const FROM_AFAR: i32 = 10;
/// Valleys along it from which a fit begins.
const VALLEYS: usize = 5;
/// Of what the leader gains a sketch may lack this share to be begun anew.
const SKETCHED: f64 = 0.05;
/// Effects that are begun anew to the end.
const ANEW: usize = 3;
/// Stages of a search in which effects are begun anew from what is believed.
const BEGINNINGS: usize = 2;

/// One step of the search.
#[derive(Clone, Debug)]
pub struct SearchStage {
    /// Effects that stood.
    pub included: Vec<&'static str>,
    /// Rivals: name, nats gained by the search's noise, numbers.
    pub candidates: Vec<(&'static str, f64, usize)>,
    /// The one taken, and what it gained.
    pub selected: Option<(&'static str, f64)>,
    /// Nats that it needed.
    pub required_nats: f64,
    /// The rivals as effects, where one was taken.
    pub choices: Vec<EffectTerm>,
}

/// A search under way.
pub struct Search {
    /// The base law.
    pub base: Fit,
    /// The best so far.
    pub best: Fit,
    /// The data with the noise of the best.
    pub data: FitData,
    /// What was tried.
    pub stages: Vec<SearchStage>,
    /// How often the best may still be begun anew from a rival's numbers.
    restarts: usize,
    /// In how many stages effects may still be begun anew from what is believed.
    beginnings: usize,
    /// Frequencies (Hz) of the lines of the residual's spectrum.
    lines: Vec<f64>,
}

#[cfg(test)]
impl Search {
    /// A search that found nothing, for tests of what follows it.
    pub(crate) fn for_tests(fit: Fit, data: FitData) -> Self {
        Self {
            base: fit.clone(),
            best: fit,
            data,
            stages: Vec::new(),
            restarts: 0,
            beginnings: 0,
            lines: Vec::new(),
        }
    }
}

impl Search {
    /// From the base law on.
    #[must_use]
    pub fn run(
        prepared: &PreparedRecordings,
        base: Fit,
        data: FitData,
        progress: &mut impl FnMut(&str),
    ) -> Self {
        let mut search = Self {
            best: base.clone(),
            base,
            data,
            stages: Vec::new(),
            restarts: RESTARTS,
            beginnings: BEGINNINGS,
            lines: Vec::new(),
        };
        loop {
            let stands = search.best.model.effects.len();
            progress(&format!("looking for {} effect", if stands == 0 { "an" } else { "another" }));
            if stands >= MAX_EFFECTS || !search.grow(prepared) {
                break;
            }
        }
        search.prune();
        if !search.best.model.effects.is_empty() {
            (search.best, search.data) = crate::random_effect_selection::select_random_effects(
                search.best.clone(),
                search.data.clone(),
            );
        }
        let told = crate::geometry_selection::fix_geometry(&mut search, prepared);
        if told {
            search.prune();
        }
        search
    }

    /// The search with another best of other weights, which begins nothing anew.
    fn at(&self, best: Fit, data: FitData) -> Self {
        Self {
            base: self.base.clone(),
            best,
            data,
            stages: self.stages.clone(),
            restarts: 0,
            beginnings: 0,
            lines: Vec::new(),
        }
    }

    /// The search gone on by what is heard where the unknown is silent.
    #[must_use]
    pub fn continue_reweighted(&self, prepared: &PreparedRecordings) -> Option<Self> {
        let (best, data) = fit_reweighted(&self.best, &self.data)?;
        let mut search = self.at(best, data);
        while search.best.model.effects.len() < MAX_EFFECTS && search.grow(prepared) {
            (search.best, search.data) = fit_reweighted(&search.best, &search.data)?;
        }
        search.prune();
        (search.best, search.data) = fit_reweighted(&search.best, &search.data)?;
        Some(search)
    }

    /// The search with the law of another one, which listened, where that is worth more by all that was recorded.
    #[must_use]
    pub fn adopt_if_better(&self, listened: &Self, prepared: &PreparedRecordings) -> Option<Self> {
        let mut model = listened.best.model.clone();
        update_event_times(&mut model, &self.data, &prepared.drop_times());
        let f = fit(&model, &self.data, Effort::FULL)?;
        let needed = required_gain_nats(&self.best, &f, &self.data);
        if self.best.nats() - f.nats() < needed
            || !likelihood_gain(&self.best, &f, &self.data).exceeds(needed)
        {
            return None;
        }
        let mut search =
            Self { stages: listened.stages.clone(), ..self.at(self.best.clone(), self.data.clone()) };
        search.accept(f);
        Some(search)
    }

    /// Takes one more effect; false when none is worth it.
    fn grow(&mut self, prepared: &PreparedRecordings) -> bool {
        self.see_lines();
        let look = ScoreTest::new(&self.best, &self.data);
        let times = prepared.drop_times();
        let blocks = self.data.compared_block_count();
        let worth = |m: &Model| bic_penalty(m.effect_parameter_count(), blocks);
        let promises = |s: &[EffectStart]| {
            let numbers = s[0].choice.info.parameters.iter().filter(|p| !p.integer).count();
            // What only ruptures show looks like their scatter at first, and that shrinks when it is fitted.
            s[0].choice.info.stage == ChainStage::Puncture
                || s[0].gain_nats > PROMISE * (bic_penalty(numbers, blocks) + MIN_GAIN_NATS)
        };
        let mut ranked = effect_starts(&look, prepared, &self.lines);
        ranked.retain(|s| promises(s));
        let by_ruptures = |s: &&Vec<EffectStart>| s[0].choice.info.stage == ChainStage::Puncture;
        let tried: Vec<&EffectStart> = ranked
            .iter()
            .take(SHORT)
            .chain(ranked.iter().skip(SHORT).filter(by_ruptures))
            .flatten()
            .collect();
        let coarse = self.coarse();
        // What was started from numbers of its own goes to the end.
        let (begun, tried): (Vec<&EffectStart>, Vec<&EffectStart>) =
            tried.into_iter().partition(|s| s.model.is_some());
        let mut short: Vec<Fit> = tried
            .par_iter()
            .filter_map(|s| fit(&self.best.model.with_effect(s.choice.clone()), &coarse, Effort::SHORT))
            .collect();
        short.sort_by(|a, b| (a.nats() + worth(&a.model)).total_cmp(&(b.nats() + worth(&b.model))));
        let mut names: Vec<&str> = Vec::new();
        short.retain(|f| first_of(&mut names, f));
        // Rivals far behind are not fitted to the end.
        if let (Some(first), Some(stood)) =
            (short.first().map(Fit::nats), residuals(&self.best.model, &coarse))
        {
            let reach = (1.0 - BEHIND) * (stood.nats - first);
            short.retain(|f| stood.nats - f.nats() >= reach.min(stood.nats - first - 30.0));
        }
        short.truncate(FULL);
        let fitted = |model: &Model, wanted: f64| {
            let mut model = model.clone();
            update_event_times(&mut model, &self.data, &times);
            fit_if_below(&model, &self.data, Effort::FULL, wanted)
        };
        // The likeliest goes to the end, the others as long as they may come near it.
        let mut full: Vec<Fit> =
            short.first().and_then(|f| fitted(&f.model, f64::INFINITY)).into_iter().collect();
        let wanted = full.first().map_or(f64::INFINITY, |f| f.nats() + NEAR);
        let to_the_end = |model: &Model| fitted(model, wanted);
        // With the scatter that was told ruptures move far; with the one that they show where they are they stay near.
        let near = |model: &Model| fit(model, &self.data, Effort::SHORT).and_then(|f| to_the_end(&f.model));
        let far = |model: &Model| {
            let mut model = model.clone();
            update_event_times(&mut model, &self.data, &times);
            fit(&model, &coarse, Effort::SHORT).and_then(|f| to_the_end(&f.model))
        };
        let begun = begun.par_iter().filter_map(|s| s.model.as_ref());
        full.extend(short.par_iter().skip(1).filter_map(|f| to_the_end(&f.model)).collect::<Vec<_>>());
        full.extend(begun.flat_map_iter(|m| [far(m), near(m)]).flatten().collect::<Vec<_>>());
        full.sort_by(|a, b| (a.nats() + worth(&a.model)).total_cmp(&(b.nats() + worth(&b.model))));
        let mut names: Vec<&str> = Vec::new();
        full.retain(|f| first_of(&mut names, f));
        if let Some(moved) = full.first().and_then(|f| self.with_a_face_moved(f, &coarse, &times)) {
            full[0] = moved;
        }
        if let Some(moved) = full.first().and_then(|f| self.broken_elsewhere(f, &coarse, &times)) {
            full[0] = moved;
        }
        if let Some(more) = self.anew(&full, &ranked, &coarse, prepared) {
            full.extend(more);
            full.sort_by(|a, b| (a.nats() + worth(&a.model)).total_cmp(&(b.nats() + worth(&b.model))));
            let mut names: Vec<&str> = Vec::new();
            full.retain(|f| first_of(&mut names, f));
        }
        if self.started_too_far(&full) {
            return self.grow(prepared);
        }
        let name = |f: &Fit| f.model.effects.last().map_or("", |e| e.info.id);
        let mut stage = SearchStage {
            included: self.best.model.effects.iter().map(|e| e.info.id).collect(),
            candidates: full
                .iter()
                .map(|f| (name(f), self.best.nats() - f.nats(), f.model.effect_parameter_count()))
                .collect(),
            selected: None,
            required_nats: full
                .first()
                .map_or(0.0, |f| worth(&f.model) - worth(&self.best.model) + MIN_GAIN_NATS),
            choices: full.iter().filter_map(|f| f.model.effects.last().cloned()).collect(),
        };
        for f in simpler_first(full, &self.data).into_iter().take(2) {
            let needed = worth(&f.model) - worth(&self.best.model) + MIN_GAIN_NATS;
            if self.best.nats() - f.nats() < needed {
                continue;
            }
            let judged = likelihood_gain(&self.best, &f, &self.data);
            if judged < Nats::new(needed) {
                continue;
            }
            stage.selected = Some((name(&f), judged.value()));
            self.accept(f);
            self.enlarge(&times);
            break;
        }
        let any = stage.selected.is_some();
        self.stages.push(stage);
        any
    }

    /// Whether a fit leaves nothing but noise.
    fn leaves_noise(&self, f: &Fit) -> bool {
        let calm = self.data.with_estimated_noise(&f.residuals.residual_n, NoiseSource::Detrended);
        f.rms_n(&self.data) < MISFIT_FACTOR * calm.noise.sd_n()
    }

    /// The leader with a face moved, where it leaves more than noise and that is likelier: a face that was fitted to the ruptures of a law
    /// that lacked something does not come back by small steps.
    fn with_a_face_moved(&self, leader: &Fit, coarse: &FitData, times: &[Vec<f64>]) -> Option<Fit> {
        if !leader.model.free.thickness || self.leaves_noise(leader) {
            return None;
        }
        let coarse = coarse
            .with_estimated_noise(&residuals(&leader.model, coarse)?.residual_n, NoiseSource::Detrended);
        let belief = &leader.model.assumed;
        let tolerance_m = |l: usize| belief.thickness_tolerance[l] * belief.tissue.layers[l].thickness_m;
        let moved = |l: usize, tolerances: f64| {
            let shift_m = tolerances * tolerance_m(l).min(tolerance_m(l + 1));
            let mut model = leader.model.clone();
            model.tissue.layers[l].thickness_m += shift_m;
            model.tissue.layers[l + 1].thickness_m -= shift_m;
            update_event_times(&mut model, &coarse, times);
            fit(&model, &coarse, Effort::SHORT)
        };
        let faces = 0..leader.model.layers().saturating_sub(1);
        let tried: Vec<(usize, f64)> = faces.flat_map(|l| MOVES.map(|m| (l, m))).collect();
        let fits: Vec<Fit> = tried.into_par_iter().filter_map(|(l, m)| moved(l, m)).collect();
        let likeliest = fits.into_iter().min_by(|a, b| a.nats().total_cmp(&b.nats()))?;
        let mut model = likeliest.model;
        update_event_times(&mut model, &self.data, times);
        let wanted = leader.nats() - MIN_GAIN_NATS;
        fit_if_below(&model, &self.data, Effort::FULL, wanted).filter(|f| f.nats() < wanted)
    }

    /// The leader with what breaks in it breaking elsewhere, where that is likelier: where a recording turns before the break and where it
    /// turns after it are two valleys, and ruptures that were fitted beside a wrong break hold it.
    fn broken_elsewhere(&self, leader: &Fit, coarse: &FitData, times: &[Vec<f64>]) -> Option<Fit> {
        let last = leader.model.effects.last().filter(|e| e.info.proposal == Proposal::MembraneRupture)?;
        let coarse = coarse
            .with_estimated_noise(&residuals(&leader.model, coarse)?.residual_n, NoiseSource::Detrended);
        let rest = leader.model.without_effect(leader.model.effects.len() - 1);
        // Every valley along what it bears: finely with the ruptures where they are, and from afar with those that follow.
        let along = |steps: i32, follow: bool| -> Vec<(f64, Model)> {
            let at = |choice: EffectTerm| {
                let mut model = rest.with_effect(choice);
                if follow {
                    update_event_times(&mut model, &coarse, times);
                }
                Some((residuals(&model, &coarse)?.nats, model))
            };
            let tried: Vec<(f64, Model)> =
                bearing_otherwise(last, steps).into_par_iter().filter_map(at).collect();
            let lowest = |k: usize| {
                let beside = [k.checked_sub(1), Some(k + 1)].into_iter().flatten();
                beside.filter_map(|k| tried.get(k)).all(|b| tried[k].0 < b.0)
            };
            (0..tried.len()).filter(|k| lowest(*k)).map(|k| tried[k].clone()).collect()
        };
        let mut valleys = along(FINELY, false);
        valleys.extend(along(FROM_AFAR, true));
        valleys.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut fits: Vec<Fit> = valleys
            .into_par_iter()
            .take(VALLEYS)
            .filter_map(|(_, mut model)| {
                update_event_times(&mut model, &coarse, times);
                fit(&model, &coarse, Effort::SHORT)
            })
            .collect();
        fits.sort_by(|a, b| a.nats().total_cmp(&b.nats()));
        let wanted = leader.nats() - MIN_GAIN_NATS;
        let to_the_end = |f: &Fit| {
            let mut model = f.model.clone();
            update_event_times(&mut model, &self.data, times);
            fit_if_below(&model, &self.data, Effort::FULL, wanted).filter(|f| f.nats() < wanted)
        };
        let fitted = fits.par_iter().take(2).filter_map(to_the_end).collect::<Vec<Fit>>();
        fitted.into_iter().min_by(|a, b| a.nats().total_cmp(&b.nats()))
    }

    /// Effects that promise something, begun anew from what is believed until one leaves nothing but noise, when even the leader leaves far
    /// more: the fits so far may stand on what the law without the effect took for ruptures.
    fn anew(
        &mut self,
        full: &[Fit],
        ranked: &[Vec<EffectStart>],
        coarse: &FitData,
        prepared: &PreparedRecordings,
    ) -> Option<Vec<Fit>> {
        let leader = full.first()?;
        if self.beginnings == 0 || self.leaves_noise(leader) {
            return None;
        }
        self.beginnings -= 1;
        let with = |choice: &EffectTerm| {
            let mut effects = self.best.model.effects.clone();
            effects.push(choice.clone());
            effects
        };
        // In short for all, and beside the law without; to the end for those that come near the best of them.
        let coarse = coarse
            .with_estimated_noise(&residuals(&leader.model, coarse)?.residual_n, NoiseSource::Detrended);
        let led = residuals(&leader.model, &coarse)?.nats;
        let apart = random_effects_of(&self.best.model);
        let stood = coarse_refit(prepared, &self.best.model.effects, apart, &coarse)?.nats();
        let tried: Vec<EffectTerm> = ranked
            .iter()
            .filter_map(|s| Some(&s.first()?.choice))
            .flat_map(|c| {
                let breaks = c.info.proposal == Proposal::MembraneRupture;
                std::iter::once(c.clone())
                    .chain(breaks.then(|| starts_at_common_drops(c.info, prepared)).into_iter().flatten())
            })
            .collect();
        let mut sketches: Vec<(f64, Vec<EffectTerm>)> = tried
            .par_iter()
            .filter_map(|c| {
                let f = coarse_refit(prepared, &with(c), apart, &coarse)?;
                Some((f.nats(), f.model.effects))
            })
            .collect();
        sketches.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut names: Vec<&str> = Vec::new();
        sketches.retain(|(_, effects)| effects.last().is_some_and(|e| new_name(&mut names, e.info.id)));
        let most = stood - sketches.first()?.0;
        // None that is sketched further behind the leader comes before it in the end.
        let reach = led + SKETCHED * (stood - led).max(0.0);
        sketches.retain(|s| stood - s.0 > BEHIND * most && s.0 < reach);
        sketches.truncate(ANEW);
        let mut begun: Vec<Fit> = Vec::new();
        for (_, effects) in sketches {
            let Some(f) = refit_from_prior(prepared, &effects, apart, &self.data) else { continue };
            let enough = self.leaves_noise(&f);
            begun.push(f);
            if enough {
                break;
            }
        }
        Some(begun)
    }

    /// Whether the leader owes a good part of its gain to a better start: the best so far, begun from the leader's numbers, is then better
    /// than it was and takes its own place.
    fn started_too_far(&mut self, full: &[Fit]) -> bool {
        let Some(leader) = full.first() else { return false };
        let Some(last) = leader.model.effects.len().checked_sub(1) else { return false };
        if self.restarts == 0 || self.best.nats() - leader.nats() < MIN_GAIN_NATS {
            return false;
        }
        let gained = self.best.nats() - leader.nats();
        let wanted = self.best.nats() - MIN_GAIN_NATS.max(OWED * gained);
        let again = fit_if_below(&leader.model.without_effect(last), &self.data, Effort::FULL, wanted);
        let Some(again) = again.filter(|f| f.nats() < wanted) else { return false };
        self.restarts -= 1;
        self.accept(again);
        if self.best.model.effects.is_empty() {
            self.base = self.best.clone();
        }
        true
    }

    /// Looks for strong lines of the residual's spectrum, and judges beside them from here on.
    fn see_lines(&mut self) {
        let found = crate::tone_detection::detect_tones(&self.best, &self.data);
        if !found.is_empty() {
            let data = crate::tone_detection::with_noise_without_tones(&self.best, &self.data, &found);
            if let Some(left) = residuals(&self.best.model, &data) {
                self.best.residuals = left;
                self.data = data;
            }
        }
        self.lines = found;
    }

    /// The data averaged further, with the noise of the best, to rank starts.
    fn coarse(&self) -> FitData {
        let coarse = self.data.with_recordings(
            self.data.recordings.par_iter().map(|b| b.coarsened(COARSENING_FACTOR)).collect(),
        );
        let model = self.best.model.clone();
        let Some(residuals) = residuals(&model, &coarse) else { return coarse };
        let seen = Fit { model, residuals };
        crate::tone_detection::with_noise_without_tones(&seen, &coarse, &self.lines)
    }

    /// Gives effects that have a larger form (a second time constant of relaxation) that form, where it is worth its numbers;
    /// it names no further cause, and need not gain what a name has to.
    fn enlarge(&mut self, times: &[Vec<f64>]) {
        for k in 0..self.best.model.effects.len() {
            let Some(larger) = self.best.model.effects[k].info.extended else { continue };
            let Proposal::SplitTerm(starts) = larger.proposal else { continue };
            let coarse = self.coarse();
            let values = &self.best.model.effects[k].values;
            let begun = |factors: &&[f64]| {
                let mut model = self.best.model.clone();
                let split: Vec<f64> = values.iter().cycle().zip(*factors).map(|(v, f)| v * f).collect();
                model.effects[k] = EffectTerm::new(larger, &split);
                fit(&model, &coarse, Effort::SHORT)
            };
            let tried: Vec<Fit> = starts.par_iter().filter_map(begun).collect();
            let likeliest = tried.into_iter().min_by(|a, b| a.nats().total_cmp(&b.nats()));
            let whole = likeliest.and_then(|f| {
                let mut model = f.model;
                update_event_times(&mut model, &self.data, times);
                fit(&model, &self.data, Effort::FULL)
            });
            if let Some(f) = whole
                && !effect_at_bound(&f, k)
                && every_strength_is_told(&f, k, &self.data)
                && likelihood_gain(&self.best, &f, &self.data).exceeds(bic_penalty(
                    f.model.effect_parameter_count() - self.best.model.effect_parameter_count(),
                    self.data.compared_block_count(),
                ))
            {
                self.accept(f);
            }
        }
    }

    /// Makes a fit the best, with the noise that it leaves.
    pub fn accept(&mut self, f: Fit) {
        self.data = with_break_uncertainty(&f.model, &self.data)
            .with_estimated_noise(&f.residuals.residual_n, NoiseSource::Detrended);
        let best = fit_from_zero_scatter(&f.model, &self.data, Effort::FULL).unwrap_or(f);
        self.best = match refine_delay(&best, &self.data) {
            Some((late, data)) => {
                self.data = data.with_estimated_noise(&late.residuals.residual_n, NoiseSource::Detrended);
                fit(&late.model, &self.data, Effort::FULL).unwrap_or(late)
            }
            None => best,
        };
    }

    /// Makes a fit the best in which a rival stands for effect `k`; the stage that took the effect took the rival then.
    pub fn replace_effect(&mut self, k: usize, f: Fit) {
        let (Some(old), Some(new)) = (self.best.model.effects.get(k), f.model.effects.get(k)) else { return };
        let (old, new, more) = (old.info.id, new.info.id, self.best.nats() - f.nats());
        let stage = self.stages.iter_mut().rev().find_map(|s| s.selected.as_mut().filter(|t| t.0 == old));
        if let Some(taken) = stage {
            *taken = (new, taken.1 + more);
        }
        self.accept(f);
    }

    /// Drops effects that the others can do without.
    fn prune(&mut self) {
        loop {
            let n = self.best.model.effects.len();
            if n < 2 {
                return;
            }
            let blocks = self.data.compared_block_count();
            let less: Vec<(usize, Fit)> = (0..n)
                .into_par_iter()
                .filter_map(|k| Some((k, fit(&self.best.model.without_effect(k), &self.data, Effort::FULL)?)))
                .collect();
            let lost = |f: &Fit| {
                let saved = bic_penalty(
                    self.best.model.effect_parameter_count() - f.model.effect_parameter_count(),
                    blocks,
                ) + MIN_GAIN_NATS;
                likelihood_gain(f, &self.best, &self.data) - saved
            };
            let worst = less.into_iter().map(|(_, f)| (lost(&f), f)).min_by(|a, b| a.0.total_cmp(&b.0));
            match worst {
                Some((lost, f)) if lost < Nats::new(0.0) => self.accept(f),
                _ => return,
            }
        }
    }
}

/// Which of an effect's numbers is the force that it bears.
fn strength_n(at: &EffectTerm) -> Option<usize> {
    at.info.parameters.iter().position(|p| p.unit == "N")
}

/// An effect that bears less and more before it breaks, from where it begins, in order.
fn bearing_otherwise(at: &EffectTerm, steps: i32) -> Vec<EffectTerm> {
    let bears = strength_n(at);
    let with = |k: i32| {
        let mut values = at.values.clone();
        *values.get_mut(bears?)? *= libm::pow(BEARS, f64::from(k) / f64::from(steps));
        Some(EffectTerm::new(at.info, &values))
    };
    (-steps..=steps).filter_map(with).collect()
}

/// Whether the last effect of a fit is not among the names yet; it then is.
fn first_of(names: &mut Vec<&'static str>, f: &Fit) -> bool {
    new_name(names, f.model.effects.last().map_or("", |e| e.info.id))
}

fn new_name(names: &mut Vec<&'static str>, name: &'static str) -> bool {
    let new = !names.contains(&name);
    names.push(name);
    new
}

/// A special case of the leader goes before it, unless what the leader has beyond it is worth its numbers when all that is
/// left is noise, and none of these numbers stands at a bound: there an effect is another one.
fn simpler_first(mut full: Vec<Fit>, data: &FitData) -> Vec<Fit> {
    let Some(leader) = full.first() else { return full };
    let id = leader.model.effects.last().map_or("", |e| e.info.id);
    let special = |f: &Fit| f.model.effects.last().is_some_and(|e| e.info.nested_in.contains(&id));
    let Some(k) = full.iter().position(special) else { return full };
    let last = leader.model.effects.len().saturating_sub(1);
    if effect_at_bound(leader, last)
        || likelihood_gain(&full[k], leader, data) < Nats::new(required_gain_nats(&full[k], leader, data))
    {
        let f = full.remove(k);
        full.insert(0, f);
    }
    full
}

/// Nats that the numbers which `larger` has beyond `smaller` must gain.
#[must_use]
pub fn required_gain_nats(smaller: &Fit, larger: &Fit, data: &FitData) -> f64 {
    let more = larger.model.effect_parameter_count().saturating_sub(smaller.model.effect_parameter_count());
    bic_penalty(more, data.compared_block_count()) + MIN_GAIN_NATS
}

/// So many standard deviations from neutral a strength is told.
const TOLD: f64 = 5.0;

/// Whether each strength of an effect is told by itself: two terms that stand for one share its strength as they like.
fn every_strength_is_told(f: &Fit, which: usize, data: &FitData) -> bool {
    let tangent = Linearization::new(&f.model, data, &f.residuals);
    let variances = tangent.factor().inverse_diagonal();
    tangent.shared.iter().zip(variances).all(|(n, variance)| match n.role {
        ParameterRole::Effect { effect, parameter } if effect == which => {
            let p = &f.model.effects[which].info.parameters[parameter];
            let off = f.model.effects[which].values[parameter] - p.inactive;
            !p.strength || p.fit_scale() != FitScale::Linear || off.abs() > TOLD * variance.sqrt()
        }
        _ => true,
    })
}

/// Whether a number of an effect stands where it may not go further.
#[must_use]
pub fn effect_at_bound(f: &Fit, which: usize) -> bool {
    f.model.shared_parameters().iter().any(|n| match n.role {
        ParameterRole::Effect { effect, .. } if effect == which => {
            let x = f.model.get(n.role, 0);
            let near = 1e-6 * (n.high - n.low);
            near.is_finite() && (x <= n.low + near || x >= n.high - near)
        }
        _ => false,
    })
}

#[cfg(test)]
mod tests {
    use super::{
        Search, effect_at_bound, every_strength_is_told, first_of, required_gain_nats, simpler_first,
    };
    use crate::base_law_fit::PreparedRecordings;
    use crate::effect_start_values::{EffectStart, effect_starts};
    use crate::model_comparison::likelihood_gain;
    use crate::repeated_insertions::SegmentedRecording;
    use crate::repeated_insertions::multistart_fit::SetFit;
    use crate::test_fixtures::{assumed_layers, fit_from_truth, recordings_with_added_force, search_stage};
    use rand::rngs::ChaCha8Rng;
    use rand::{RngExt, SeedableRng};
    use std::sync::Arc;
    use stylet_identify::block_averages::{BLOCK_S, BlockAverages};
    use stylet_identify::fit::{Effort, Fit};
    use stylet_identify::likelihood::{FitData, residuals};
    use stylet_identify::model::{EffectTerm, Model, ParameterRole};
    use stylet_identify::noise::Noise;
    use stylet_identify::score_test::ScoreTest;
    use stylet_record::Recording;
    use stylet_tissue::{
        AnyEffect, AsymmetricFriction, ChainStage, CoulombFriction, Effect, ForceBias, ForceDrift,
        HiddenMembrane, PeriodicInterference, PreslidingFriction, StribeckFriction,
    };

    fn data() -> FitData {
        let t: Vec<f64> = (0..600).map(|k| f64::from(k) / 100.0).collect();
        let z = t.iter().map(|t| if *t < 4.0 { 4e-3 * t } else { 0.016 - 4e-3 * (t - 4.0) }).collect();
        let f = t
            .iter()
            .enumerate()
            .map(|(k, t)| 0.3 * t + 0.01 * (((k * 7919) % 101) as f64 / 101.0 - 0.5))
            .collect();
        let r = Recording::new(t, z, f).expect("a recording");
        FitData::new(Arc::new(vec![BlockAverages::new(&r, &[], BLOCK_S)]), Noise::white(0.02), 0.0)
    }

    fn fit(effects: &[AnyEffect]) -> Fit {
        let belief = assumed_layers(&[[0.05, 60.0, 4000.0]]);
        let mut model = Model::base(belief, 1);
        model.effects = effects.iter().map(|e| EffectTerm::new(e.info(), &e.parameters())).collect();
        let residuals = residuals(&model, &data()).expect("a replay");
        Fit { model, residuals }
    }

    #[test]
    fn a_number_stands_at_a_bound_within_a_millionth_of_its_range() {
        let bias = |force_n: f64| -> AnyEffect { ForceBias { force_n }.into() };
        let f = fit(&[bias(0.1), AsymmetricFriction { eps: 0.2 }.into()]);
        assert!(!effect_at_bound(&f, 0) && !effect_at_bound(&f, 1));
        let role = ParameterRole::Effect { effect: 1, parameter: 0 };
        let n = f.model.shared_parameters().into_iter().find(|n| n.role == role).expect("free");
        assert!((n.high - n.low).is_finite());
        let near = 1e-6 * (n.high - n.low);
        for (x, at) in [
            (n.low + 0.9 * near, true),
            (n.low + 1.1 * near, false),
            (n.high - 0.9 * near, true),
            (n.high - 1.1 * near, false),
        ] {
            let mut moved = f.clone();
            moved.model.set(role, 0, x);
            assert_eq!((effect_at_bound(&moved, 0), effect_at_bound(&moved, 1)), (false, at), "{x}");
        }
    }

    #[test]
    fn what_a_larger_model_has_to_gain_is_the_cost_of_its_numbers() {
        let (none, one) = (fit(&[]), fit(&[ForceBias { force_n: 0.1 }.into()]));
        let stribeck = StribeckFriction { c_n_per_m: 2.0, c_static_n_per_m: 5.0, v_stribeck_mps: 1e-3 };
        let three = fit(&[stribeck.into()]);
        let d = data();
        let each = 0.5 * (d.compared_block_count() as f64).ln();
        assert!((required_gain_nats(&none, &one, &d) - each - 4.0).abs() < 1e-9);
        assert!((required_gain_nats(&one, &three, &d) - 2.0 * each - 4.0).abs() < 1e-9);
        assert!((required_gain_nats(&three, &one, &d) - 4.0).abs() < 1e-9);
    }

    #[test]
    fn each_effect_is_taken_once() {
        let mut names = Vec::new();
        let (a, b) =
            (fit(&[ForceBias { force_n: 0.1 }.into()]), fit(&[CoulombFriction { c_n_per_m: 2.0 }.into()]));
        assert_eq!([&a, &b, &a, &b].map(|f| first_of(&mut names, f)), [true, true, false, false]);
        assert_eq!(names, ["force_bias", "coulomb_friction", "force_bias", "coulomb_friction"]);
    }

    #[test]
    fn a_special_case_goes_before_a_leader_whose_further_numbers_gain_nothing() {
        let coulomb = fit(&[CoulombFriction { c_n_per_m: 2.0 }.into()]);
        let stribeck = StribeckFriction { c_n_per_m: 2.0, c_static_n_per_m: 2.1, v_stribeck_mps: 1e-3 };
        let stribeck = fit(&[stribeck.into()]);
        let bias = fit(&[ForceBias { force_n: 0.1 }.into()]);
        let order = |all: Vec<Fit>| -> Vec<&'static str> {
            simpler_first(all, &data())
                .iter()
                .filter_map(|f| f.model.effects.last())
                .map(|e| e.info.id)
                .collect()
        };
        assert_eq!(
            order(vec![stribeck.clone(), bias.clone(), coulomb.clone()]),
            ["coulomb_friction", "stribeck_friction", "force_bias"]
        );
        assert_eq!(
            order(vec![bias.clone(), stribeck.clone(), coulomb.clone()]),
            ["force_bias", "stribeck_friction", "coulomb_friction"]
        );
        assert_eq!(order(vec![stribeck, bias]), ["stribeck_friction", "force_bias"]);
        assert!(order(Vec::new()).is_empty());
    }

    #[test]
    fn a_rival_that_takes_a_causes_place_has_its_stage_and_gains_what_it_is_ahead() {
        let old = fit(&[CoulombFriction { c_n_per_m: 2.0 }.into()]);
        let new = fit(&[ForceBias { force_n: 0.9 }.into()]);
        let more = old.nats() - new.nats();
        let mut search = Search::for_tests(old, data());
        let stage = |taken| search_stage(taken, 0.0, &[]);
        search.stages =
            vec![stage(Some(("coulomb_friction", 20.0))), stage(Some(("force_drift", 9.0))), stage(None)];
        search.replace_effect(0, new);
        let (name, gained) = search.stages[0].selected.expect("taken");
        assert_eq!(name, "force_bias");
        assert!((gained - 20.0 - more).abs() < 1e-9, "{gained}");
        assert_eq!(search.stages[1].selected, Some(("force_drift", 9.0)));
        assert_eq!(search.best.model.effects[0].info.id, "force_bias");
    }

    /// Insertions whose force drifts by 20 mN/s; with these effects fitted.
    fn drifting(effects: &[AnyEffect]) -> SetFit {
        let runs =
            recordings_with_added_force(&[], &[[4e-3, 3e-4], [5e-3, -3e-4], [6e-3, 0.0]], |t| 0.02 * t);
        fit_from_truth(effects, &runs.iter().collect::<Vec<_>>())
    }

    fn drift(rate_n_per_s: f64) -> AnyEffect {
        ForceDrift { rate_n_per_s }.into()
    }

    #[test]
    fn an_effect_that_the_others_can_do_without_goes_and_the_last_one_stays() {
        let pruned = |effects: &[AnyEffect]| {
            let f = drifting(effects);
            let mut search = Search::for_tests(f.fit, f.data);
            search.prune();
            search.best.model.effects.iter().map(|e| e.info.id).collect::<Vec<_>>()
        };
        let bias: AnyEffect = ForceBias { force_n: 0.002 }.into();
        assert_eq!(pruned(&[drift(0.01), bias.clone()]), ["force_drift"]);
        assert_eq!(pruned(&[bias.clone(), drift(0.01)]), ["force_drift"]);
        assert_eq!(pruned(&[bias]), ["force_bias"]);
    }

    #[test]
    fn a_strength_is_told_when_it_lies_five_standard_deviations_from_none() {
        let bias: AnyEffect = ForceBias { force_n: 0.002 }.into();
        let f = drifting(&[drift(0.01), bias]);
        assert!(every_strength_is_told(&f.fit, 0, &f.data));
        assert!(!every_strength_is_told(&f.fit, 1, &f.data));
        // Every insertion tells the drift by its noise over its length: at a five-thousandth of it nothing is told.
        let mut less = f.fit.clone();
        less.model.effects[0].values[0] = 1e-6;
        assert!(!every_strength_is_told(&less, 0, &f.data));
        less.model.effects[0].values[0] = -0.02;
        assert!(every_strength_is_told(&less, 0, &f.data));
    }

    fn rubs(c_n_per_m: f64) -> AnyEffect {
        CoulombFriction { c_n_per_m }.into()
    }

    /// Insertions with these effects off a sensor that shows so much more (N), fitted with others, and made ready for a search.
    fn under_way(
        there: &[AnyEffect],
        fitted: &[AnyEffect],
        more_n: impl Fn(f64) -> f64,
    ) -> (Search, PreparedRecordings) {
        of_runs(
            &recordings_with_added_force(there, &[[4e-3, 3e-4], [5e-3, -3e-4], [6e-3, 0.0]], more_n),
            fitted,
        )
    }

    fn of_runs(runs: &[SegmentedRecording], fitted: &[AnyEffect]) -> (Search, PreparedRecordings) {
        let f = fit_from_truth(fitted, &runs.iter().collect::<Vec<_>>());
        let prepared = PreparedRecordings::new(f.fit.model.assumed.clone(), f.data.recordings.to_vec(), 0.0);
        (Search::for_tests(f.fit, f.data), prepared)
    }

    /// A fit of the best of a search with one more effect.
    fn with(search: &Search, effect: &AnyEffect) -> Fit {
        let model = search.best.model.with_effect(EffectTerm::new(effect.info(), &effect.parameters()));
        stylet_identify::fit::fit(&model, &search.data, Effort::FULL).expect("a fit")
    }

    /// Nats of a fit without one of its effects.
    fn nats_without(search: &Search, f: &Fit, effect: usize) -> f64 {
        let less = stylet_identify::fit::fit(&f.model.without_effect(effect), &search.data, Effort::FULL);
        less.expect("a fit").nats()
    }

    #[test]
    fn the_best_so_far_begins_anew_where_the_leader_only_had_a_better_start() {
        let (mut search, _) = under_way(&[], &[], |_| 0.0);
        let good = search.best.clone();
        let leader = with(&search, &drift(1e-4));
        let again = nats_without(&search, &leader, 0);
        let started = |search: &mut Search, ahead: f64, leader_ahead: f64, restarts: usize| {
            let mut leader = leader.clone();
            (search.best, search.base) = (good.clone(), good.clone());
            search.best.residuals.nats = again + ahead;
            leader.residuals.nats = search.best.nats() - leader_ahead;
            search.base.residuals.nats = f64::INFINITY;
            search.restarts = restarts;
            (search.started_too_far(&[leader]), search.restarts, search.base.nats().is_finite())
        };
        assert_eq!(started(&mut search, 4.1, 4.1, 0), (false, 0, false));
        assert_eq!(started(&mut search, 3.9, 4.1, 3), (false, 3, false));
        assert_eq!(started(&mut search, 4.1, 3.9, 3), (false, 3, false));
        // Less than a tenth of the leader's gain is no reason.
        assert_eq!(started(&mut search, 4.3, 45.0, 3), (false, 3, false));
        // Then other noise is left.
        let (mut other, _) = under_way(&[], &[], |_| 0.0);
        assert_eq!(started(&mut other, 4.3, 40.5, 3), (true, 2, true));
        assert_eq!(started(&mut search, 4.1, 4.1, 3), (true, 2, true));
        assert!(!search.started_too_far(&[]) && !search.started_too_far(std::slice::from_ref(&good)));
        // What stands with an effect is no base.
        let (mut search, _) = under_way(&[], &[drift(1e-4)], |_| 0.0);
        let mut leader = with(&search, &rubs(0.1));
        search.restarts = 1;
        search.best.residuals.nats = nats_without(&search, &leader, 1) + 9.0;
        search.base.residuals.nats = f64::INFINITY;
        leader.residuals.nats = search.best.nats() - 9.0;
        assert!(search.started_too_far(&[leader]));
        assert_eq!(search.base.nats(), f64::INFINITY);
    }

    #[test]
    fn lines_are_seen_and_the_noise_is_told_beside_them() {
        let tone = |t: f64| 0.1 * (std::f64::consts::TAU * 2.3 * t).sin();
        let (mut search, _) = under_way(&[], &[], tone);
        let before = search.data.noise.sd_n();
        search.see_lines();
        assert_eq!(search.lines.len(), 1);
        assert!((search.lines[0] - 2.3).abs() < 0.02, "{:?}", search.lines);
        assert!(search.data.noise.sd_n() < 0.5 * before);
        let left = residuals(&search.best.model, &search.data).expect("a replay").nats;
        assert_eq!(search.best.nats(), left);
        let coarse = search.coarse();
        assert_eq!(coarse.recordings[0].len(), search.data.recordings[0].len().div_ceil(3));
        // Without one all stays as it is.
        let (mut search, _) = under_way(&[], &[], |_| 0.0);
        let (noise, nats) = (search.data.noise.clone(), search.best.nats());
        search.see_lines();
        assert!(search.lines.is_empty() && search.data.noise == noise && search.best.nats() == nats);
    }

    /// A drift beside something in the middle of the recordings that no effect explains.
    #[test]
    fn a_search_goes_on_where_the_unknown_is_silent_and_takes_over_what_is_worth_it_by_all() {
        let lump = |t: f64| 0.1 * (-(4.0 * (t - 4.0)).powi(2)).exp();
        let shown = |t: f64| 0.1 * t + lump(t);
        let of =
            |s: &Search| s.best.model.effects.iter().map(|e| (e.info.id, e.values[0])).collect::<Vec<_>>();
        let (search, prepared) = under_way(&[], &[drift(1e-4)], shown);
        let told = search.continue_reweighted(&prepared).expect("a fit");
        let found = of(&told);
        assert!(found.len() == 1 && found[0].0 == "force_drift", "{found:?}");
        assert!((found[0].1 / 0.1 - 1.0).abs() < 0.03, "{found:?}");
        assert!(told.stages.last().is_some_and(|s| s.selected.is_none()) && search.stages.is_empty());
        assert!(search.adopt_if_better(&told, &prepared).is_none());
        // One that had found nothing takes the law over, and weighs all that was recorded.
        let (mut without, prepared) = under_way(&[], &[], shown);
        without.accept(without.best.clone());
        let taken = without.adopt_if_better(&told, &prepared).expect("a better law");
        assert_eq!(of(&taken)[0].0, "force_drift");
    }

    #[test]
    fn what_breaks_is_found_in_another_valley_of_what_it_bears() {
        let membrane: AnyEffect =
            HiddenMembrane { depth_m: 2e-3, stiffness_n_per_m: 120.0, puncture_n: 0.36 }.into();
        let (search, prepared) = under_way(std::slice::from_ref(&membrane), &[], |_| 0.0);
        let times = prepared.drop_times();
        let found = with(&search, &membrane);
        let moved = |share: f64| {
            let mut leader = found.clone();
            leader.model.effects[0].values[2] *= share;
            leader.residuals = residuals(&leader.model, &search.data).expect("a replay");
            search.broken_elsewhere(&leader, &search.coarse(), &times)
        };
        for share in [0.6, 1.7] {
            let told = moved(share).expect("a better place").model.effects[0].values[2];
            assert!((told - 0.36).abs() < 0.02, "{told} from {share} times");
        }
        assert!(moved(1.0).is_none());
        let rubs = with(&search, &rubs(1.0));
        assert!(search.broken_elsewhere(&rubs, &search.coarse(), &times).is_none());
    }

    #[test]
    fn effects_begin_anew_where_even_the_leader_leaves_more_than_noise() {
        let there = HiddenMembrane { depth_m: 2e-3, stiffness_n_per_m: 120.0, puncture_n: 0.36 };
        let membrane: AnyEffect = there.into();
        let (mut search, prepared) = under_way(std::slice::from_ref(&membrane), &[], |_| 0.0);
        let start = |e: &AnyEffect| {
            let choice = EffectTerm::new(e.info(), &e.parameters());
            vec![EffectStart { choice, gain_nats: 1.0, detectable_nats: 1.0, model: None }]
        };
        let good = [with(&search, &rubs(1.0))];
        let mut full = good.clone();
        full[0].model.tissue.layers[0].stiffness_n_per_m *= 0.8;
        let weak = [start(&drift(1e-4)), start(&ForceBias { force_n: 1e-3 }.into())];
        let ranked = [weak.to_vec(), vec![start(&membrane); 4]].concat();
        let begun = |search: &mut Search, full: &[Fit], ranked: &[Vec<EffectStart>], beginnings: usize| {
            search.beginnings = beginnings;
            let names = search.anew(full, ranked, &search.coarse(), &prepared).map(|all| {
                all.iter().map(|f| f.model.effects.last().map_or("", |e| e.info.id)).collect::<Vec<_>>()
            });
            (names, search.beginnings)
        };
        // Each effect once, and none that comes less than half as near.
        assert_eq!(begun(&mut search, &full, &ranked, 2), (Some(vec!["hidden_membrane"]), 1));
        assert_eq!(begun(&mut search, &full, &ranked[..3], 1), (Some(vec!["hidden_membrane"]), 0));
        // What breaks begins at the drops as well.
        assert_eq!(begun(&mut search, &good, &ranked, 2), (Some(vec!["hidden_membrane"]), 1));
        assert_eq!(begun(&mut search, &full, &ranked, 0), (None, 0));
        assert_eq!(begun(&mut search, &[], &ranked, 2), (None, 2));
        // The first that leaves nothing but noise ends it.
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut normal = || (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
        let noise_n: Vec<f64> = (0..1000).map(|_| 0.05 * normal()).collect();
        let alike = recordings_with_added_force(&[], &[[4e-3, 0.0], [6e-3, 0.0]], |t| {
            0.05 * t + noise_n[(50.0 * t).round() as usize]
        });
        let (mut drifts, prepared_too) = of_runs(&alike, &[]);
        drifts.beginnings = 1;
        let full_too = [with(&drifts, &rubs(1.0))];
        let names = |all: Vec<Fit>| all.iter().map(|f| f.model.effects[0].info.id).collect::<Vec<_>>();
        let begun_too =
            drifts.anew(&full_too, &vec![start(&drift(1e-4)); 4], &drifts.coarse(), &prepared_too).map(names);
        assert_eq!(begun_too, Some(vec!["force_drift"]));
        // Noise alone, and noise beside something slow.
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut leader = full[0].clone();
        for e in &mut leader.residuals.residual_n {
            e.iter_mut().for_each(|e| *e = 0.01 * ((0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0));
        }
        let leaves = |slow_n: f64| {
            let mut f = leader.clone();
            for e in &mut f.residuals.residual_n {
                e.iter_mut().enumerate().for_each(|(k, e)| *e += slow_n * (0.02 * k as f64).sin());
            }
            [f]
        };
        assert_eq!(begun(&mut search, &leaves(0.0), &ranked, 2), (None, 2));
        assert_eq!(begun(&mut search, &leaves(0.03), &ranked, 2).1, 1);
    }

    #[test]
    fn an_effect_stays_when_it_gains_four_nats_more_than_its_numbers_cost() {
        let mut seen = [0, 0];
        for bias_n in [0.0, 2e-3, 3e-3, 4e-3, 5e-3, 6e-3, 8e-3] {
            let bias: AnyEffect = ForceBias { force_n: 1e-4 }.into();
            let (mut search, _) = under_way(&[], &[drift(0.02), bias], |t| 0.02 * t + bias_n);
            let less =
                stylet_identify::fit::fit(&search.best.model.without_effect(1), &search.data, Effort::FULL);
            let gained = likelihood_gain(&less.expect("a fit"), &search.best, &search.data).value();
            let wanted = 0.5 * (search.data.compared_block_count() as f64).ln() + 4.0;
            search.prune();
            let stays = search.best.model.effects.len() == 2;
            assert_eq!(stays, gained > wanted, "{gained} of {wanted}");
            if (gained - wanted).abs() < 2.7 {
                seen[usize::from(stays)] += 1;
            }
        }
        assert!(seen.iter().all(|n| *n > 0), "{seen:?}");
    }

    /// A search by one step, and the starts of that step; judged by its calm stretches or by all that is left.
    fn grown(
        calm: bool,
        beginnings: usize,
        there: &[AnyEffect],
        more_n: impl Fn(f64) -> f64,
    ) -> (Search, Vec<EffectStart>) {
        let (mut search, prepared) = under_way(there, &[], more_n);
        if calm {
            search.accept(search.best.clone());
        }
        search.beginnings = beginnings;
        let first = effect_starts(&ScoreTest::new(&search.best, &search.data), &prepared, &[]);
        let any = search.grow(&prepared);
        assert_eq!(any, search.stages.last().is_some_and(|s| s.selected.is_some()));
        (search, first.into_iter().map(|s| s[0].clone()).collect())
    }

    #[test]
    fn an_effect_is_fitted_when_it_promises_half_of_what_it_needs() {
        let mut seen = [0, 0];
        for drift_n_per_s in [6e-4, 8e-4] {
            let (search, first) = grown(false, 0, &[], |t| drift_n_per_s * t);
            let tried = |s: &EffectStart| search.stages[0].candidates.iter().any(|r| r.0 == s.choice.info.id);
            for s in first.iter().filter(|s| s.choice.info.stage != ChainStage::Puncture) {
                let numbers = s.choice.info.parameters.len() as f64;
                let needed = 0.5 * numbers * (search.data.compared_block_count() as f64).ln() + 4.0;
                assert!(s.gain_nats > 0.5 * needed || !tried(s), "{} of {needed}", s.gain_nats);
                if ["force_drift", "force_bias"].contains(&s.choice.info.id) {
                    assert_eq!(tried(s), s.gain_nats > 0.5 * needed, "{} of {needed}", s.gain_nats);
                    seen[usize::from(tried(s))] += 1;
                }
            }
            assert!(search.stages[0].candidates.iter().any(|r| r.0 == "rate_dependent_puncture"));
        }
        assert_eq!(seen, [1, 3]);
    }

    #[test]
    fn rivals_far_behind_are_not_fitted_to_the_end() {
        let names = |there: &[AnyEffect], beginnings: usize, drift_n_per_s: f64| {
            let (search, _) = grown(true, beginnings, there, |t| drift_n_per_s * t);
            let price =
                |numbers: usize| 0.5 * numbers as f64 * (search.data.compared_block_count() as f64).ln();
            let worth: Vec<f64> = search.stages[0].candidates.iter().map(|r| r.1 - price(r.2)).collect();
            assert!(worth.windows(2).all(|w| w[0] >= w[1]), "{worth:?}");
            search.stages[0].candidates.iter().map(|r| r.0).collect::<Vec<_>>()
        };
        let punctures = "rate_dependent_puncture";
        assert_eq!(names(&[], 0, 0.02), ["force_drift", "force_bias", punctures]);
        // Within thirty nats of the best nobody is far behind.
        assert_eq!(
            names(&[], 0, 3e-4),
            ["respiration", "cutting_force", "asymmetric_friction", "incomplete_release", punctures]
        );
        // What costs most may gain more than others and still come late.
        assert_eq!(
            names(&[rubs(50.0)], 0, 0.0),
            ["respiration", "nonlinear_elasticity", "drive_friction", "hidden_membrane", punctures]
        );
    }

    #[test]
    fn a_shape_is_told_whatever_it_is() {
        let tone = PeriodicInterference { amplitude_n: 0.1, frequency_hz: 1.7, phase_rad: 0.0 };
        let sine = |t: f64| 0.1 * (std::f64::consts::TAU * 1.7 * t).sin();
        let (mut search, _) = under_way(&[], &[tone.into(), drift(1e-6)], sine);
        search.best.model.effects[0].values[2] = 0.0;
        assert!(every_strength_is_told(&search.best, 0, &search.data));
        assert!(!every_strength_is_told(&search.best, 1, &search.data));
    }

    #[test]
    fn a_leader_whose_further_numbers_gain_stays_before_its_special_case_unless_one_is_at_a_bound() {
        let slides: AnyEffect = PreslidingFriction { c_n_per_m: 50.0, delta_m: 1e-3 }.into();
        let (search, _) = under_way(std::slice::from_ref(&slides), &[], |_| 0.0);
        let (whole, part) = (with(&search, &slides), with(&search, &rubs(50.0)));
        let first = |leader: &Fit| {
            let order = simpler_first(vec![leader.clone(), part.clone()], &search.data);
            order[0].model.effects[0].info.id
        };
        assert_eq!(first(&whole), "presliding_friction");
        let mut bound = whole.clone();
        let role = ParameterRole::Effect { effect: 0, parameter: 1 };
        let n = bound.model.shared_parameters().into_iter().find(|n| n.role == role).expect("free");
        bound.model.set(role, 0, n.low);
        assert_eq!(first(&bound), "coulomb_friction");
    }
}
