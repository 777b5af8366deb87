//! Which law a set needs: the base law, what the library adds to it, or a shaft that slips; and what each part of it is worth on
//! recordings left out.

use crate::base_law_fit::{PreparedRecordings, fit_base_law};
use crate::effect_selection::Search;
use crate::random_effect_selection::select_random_effects;
use crate::repeated_insertions::cross_validation::{
    PHASE_NAMES, PredictionScore, population_without, score_prediction,
};
use crate::repeated_insertions::multistart_fit::{
    SET_BLOCK_S, SetFit, draw_starts, fit_from, multistart_fit, set_blocks,
};
use crate::repeated_insertions::population_prediction::{Population, predict_force};
use crate::repeated_insertions::start_values::{
    SegmentedRecording, base_law_prior, group_by_speed_and_stroke, have_one_speed,
};
use rand::rngs::ChaCha8Rng;
use rayon::prelude::*;
use std::sync::Arc;
use stylet_identify::block_averages::BlockAverages;
use stylet_identify::fit::{Effort, fit as fitted_on};
use stylet_identify::likelihood::residuals;
use stylet_identify::model::{
    Assumptions, EffectTerm, MAX_VARYING_PARAMETERS, Model, RecordingParameters, TiedParameter,
};
use stylet_identify::rupture_likelihood::RuptureEvent;
use stylet_record::sensor_artefacts::SensorArtefacts;
use stylet_stats::student_t;
use stylet_tissue::{AnyEffect, DelayedPuncture, Effect, EffectInfo, ShaftSlip, Tissue};

/// Starts of the law of a shaft that slips, which about one in five brings near the best optimum, at least,
const STARTS: usize = 24;
/// and as many more as make so many fits of one recording: small sets have worse starts and cheaper fits.
const START_FITS: usize = 300;
/// The library is searched for what it adds with about so many insertions.
const SEARCHED: usize = 6;
/// A law is judged by so many parts of the set, each left out once ...
const FOLDS: usize = 3;
/// ... and by single recordings left out when there are no more than so many: two thirds of few say little of a law.
const FEW: usize = 8;
/// Blocks are averaged by so many to judge a law,
const COARSE: usize = 3;
/// its fits go on for so many steps at most,
pub(super) const REFIT_TURNS: usize = 5;
/// and it is drawn so many times.
const DRAWS: usize = 16;
/// A law has to predict recordings left out better than the base law by this share.
const WORTH: f64 = 0.02;
/// More effects than this, each with a story of its own, are taken for a shaft that slips
const ONE_STORY: usize = 2;
/// only when they predict recordings left out better by this share.
const MANY_STORIES: f64 = 0.1;
/// An effect stays when recordings left out are predicted worse by this share without it, and surely so, or when the likelihood asks
/// for it. It has to be more than the effect would seem to be worth by chance: a law without it has been looked for less.
const PART_WORTH: f64 = 0.05;
/// The same of what only shapes an effect that stands: it accuses nobody, and what it costs is a number. More than one standard error
/// is enough (Breiman and others 1984: of laws that predict about as well the simplest).
const SHAPE_WORTH: f64 = 0.01;
/// Probability that an effect which is worth nothing is named for what recordings left out lose without it. A shaft that slips is asked
/// for two, waiting and letting go: one set of a hundred is accused.
const ACCUSED: f64 = 0.005;

/// Where a law comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ModelFamily {
    /// The base law with its numbers of each recording's own.
    Base,
    /// The base law and the effects that the search over the library adds to it.
    Library,
    /// Layers that cling to the shaft and slip, give way after a while, let go at depths of their own.
    ShaftSlip,
}

/// A law that was fitted and judged.
#[derive(Clone, Debug)]
pub struct ScoredModel {
    /// Where it comes from.
    pub family: ModelFamily,
    /// The fit.
    pub set_fit: SetFit,
    /// Error (N) on every recording when its part of the set is left out.
    pub errors_n: Vec<f64>,
    /// The same by part of an insertion; none where it could not be predicted.
    pub scores: Vec<Option<PredictionScore>>,
}

impl ScoredModel {
    /// A fit, judged.
    pub(super) fn new(kind: ModelFamily, fitted: SetFit, runs: &[&SegmentedRecording]) -> Self {
        let scores = judged(&fitted, runs);
        let errors_n = errors_n(&scores);
        Self { family: kind, set_fit: fitted, errors_n, scores }
    }

    /// Mean error (N) on parts left out.
    #[must_use]
    pub fn held_out_n(&self) -> f64 {
        stylet_stats::mean(&self.errors_n)
    }
}

/// A part of a law, and what it is worth.
#[derive(Clone, Debug)]
pub struct ModelTerm {
    /// The effect that it is or belongs to.
    pub effect: &'static str,
    /// What it is called.
    pub name: String,
    /// Error (N) on every recording left out, without it.
    pub without_n: Vec<f64>,
    /// What every recording left out loses without it, as a share of what is left.
    pub held_out_loss: Vec<f64>,
    /// The same with whole speeds left out; nothing where there is one only.
    pub held_out_speed_loss: Vec<f64>,
    /// Nats that the recordings say for it beyond what its numbers cost.
    pub gain_nats: f64,
    /// Whether it stayed.
    pub kept: bool,
    /// Whether it may be named.
    pub significant: bool,
}

impl ModelTerm {
    /// Whether it is an effect that the law predicts better with, but not surely: it stays, and is not named.
    #[must_use]
    pub fn is_uncertain(&self) -> bool {
        self.kept && !self.significant && self.name == self.effect
    }
}

/// Laws of a set.
#[derive(Clone, Debug)]
pub struct CandidateModels {
    /// The base law.
    pub base: ScoredModel,
    /// With what the library adds to it, where that is something.
    pub library: Option<ScoredModel>,
    /// The law of a shaft that slips, where it could be fitted.
    pub slip: Option<ScoredModel>,
    /// Which of them predicts recordings left out best; the base law where the others are hardly better.
    pub best: ScoredModel,
    /// The parts of the best.
    pub terms: Vec<ModelTerm>,
}

/// Finds the law of a set. `None` when not even the base law can be fitted.
#[must_use]
pub fn select_model(
    believed: &Tissue,
    runs: &[&SegmentedRecording],
    raw: &SensorArtefacts,
    rng: &mut ChaCha8Rng,
    progress: &mut impl FnMut(&str),
) -> Option<CandidateModels> {
    progress("fitting the base law");
    let prepared = PreparedRecordings::new(
        Arc::new(base_law_prior(believed, runs)),
        set_blocks(runs, raw),
        floor_n(raw),
    );
    let (fit, data) = fit_base_law(&prepared)?;
    let (fit, data) = select_random_effects(fit, data);
    let (searched, which) = some(&prepared, runs);
    let fewer = data.subset(&which);
    let fit = fitted_on(&fit.model.subset(&which), &fewer, Effort::FULL)?;
    let search = Search::run(&searched, fit, fewer, progress);
    let drops = prepared.drop_times();
    let on = |model: &Model| {
        let mut model = model.clone();
        model.per_recording = vec![RecordingParameters::default(); runs.len()];
        model.rupture_times_s = runs.iter().map(|r| r.ruptures_s.clone()).collect();
        (model.free.recording_surface, model.free.recording_friction) = (true, true);
        fit_from(&model, prepared.blocks.to_vec(), drops.clone())
    };
    let base = ScoredModel::new(ModelFamily::Base, on(&search.base.model)?, runs);
    let library = (!search.best.model.effects.is_empty())
        .then(|| on(&search.best.model))
        .flatten()
        .map(|f| ScoredModel::new(ModelFamily::Library, f, runs));
    progress("fitting a shaft that slips, from several starts");
    let slip = fit_stick_slip(believed, runs, raw, rng);
    let mut best = best_candidate(&base, slip.as_ref(), library.as_ref()).clone();
    progress("what each part of the law is worth");
    let parts = ablate(&mut best, runs);
    Some(CandidateModels { base, library, slip, best, terms: parts })
}

/// Noise (N) that the steps of a sensor make.
fn floor_n(raw: &SensorArtefacts) -> f64 {
    raw.step_n.unwrap_or(0.0) * stylet_stats::UNIFORM_SD
}

/// Of the laws that were tried the one that predicts recordings left out best; the base law where the others are hardly better.
pub(super) fn best_candidate<'a>(
    base: &'a ScoredModel,
    slip: Option<&'a ScoredModel>,
    library: Option<&'a ScoredModel>,
) -> &'a ScoredModel {
    let mut best = base;
    for law in slip.into_iter().chain(library) {
        let worth = law.held_out_n() < (1.0 - WORTH) * base.held_out_n();
        let many = law.family == ModelFamily::Library
            && best.family == ModelFamily::ShaftSlip
            && active_effects(&law.set_fit.fit.model).len() > ONE_STORY;
        let margin = if many { MANY_STORIES } else { 0.0 };
        if worth && law.held_out_n() < (1.0 - margin) * best.held_out_n() {
            best = law;
        }
    }
    best
}

/// The law of a shaft that slips: of the best fits the one that leaves least, unless another one predicts recordings left out better by
/// more than chance. The least of several errors would be too good to compare with: a law without a part has one fit only.
///
/// At one speed a force that a layer bears for a while and one at which it gives way say the same: waiting is looked for with the same
/// starts as the simpler law, and has to pay beside it.
#[must_use]
pub fn fit_stick_slip(
    believed: &Tissue,
    runs: &[&SegmentedRecording],
    raw: &SensorArtefacts,
    rng: &mut ChaCha8Rng,
) -> Option<ScoredModel> {
    let began = draw_starts(believed, runs, starts(runs.len()), rng);
    let look = |began: &[Model]| {
        let laws = multistart_fit(began, runs, raw)
            .into_iter()
            .map(|f| ScoredModel::new(ModelFamily::ShaftSlip, f, runs));
        surest(laws.collect())
    };
    let waits = look(&began);
    if !have_one_speed(runs) {
        return waits;
    }
    let id = DelayedPuncture::default().info().id;
    let gives_way = look(&began.iter().map(|m| less(m, &[], id)).collect::<Vec<_>>());
    match (&waits, &gives_way) {
        (Some(w), Some(g)) if surely_pays(&loses(&g.scores, &w.scores)) => waits,
        _ => gives_way.or(waits),
    }
}

/// The first law, unless another one is better by more than chance; then the best of those.
fn surest(laws: Vec<ScoredModel>) -> Option<ScoredModel> {
    let mut best: Option<ScoredModel> = None;
    let first = laws.first()?.clone();
    for law in laws.into_iter().skip(1).filter(|l| pays(&loses(&first.scores, &l.scores), PART_WORTH)) {
        if best.as_ref().is_none_or(|b| law.held_out_n() < b.held_out_n()) {
            best = Some(law);
        }
    }
    best.or(Some(first))
}

/// From how many starts the law of a shaft that slips is fitted to so many recordings.
fn starts(recordings: usize) -> usize {
    (START_FITS / recordings.max(1)).clamp(STARTS, 3 * STARTS)
}

/// Some of the insertions, as many of every speed and stroke: what the library adds is searched for in these.
fn some(prepared: &PreparedRecordings, runs: &[&SegmentedRecording]) -> (PreparedRecordings, Vec<usize>) {
    let groups = group_by_speed_and_stroke(runs);
    let each = (SEARCHED / groups.len().max(1)).max(1);
    let mut which: Vec<usize> = groups.iter().flat_map(|g| g.iter().take(each).copied()).collect();
    which.sort_unstable();
    let part = PreparedRecordings {
        assumed: Arc::clone(&prepared.assumed),
        blocks: Arc::new(which.iter().map(|r| prepared.blocks[*r].clone()).collect()),
        drops: which.iter().map(|r| prepared.drops[*r].clone()).collect(),
        min_noise_sd_n: prepared.min_noise_sd_n,
    };
    (part, which)
}

/// The same on longer blocks; what is on them already stays.
pub(super) fn with_coarse_blocks(fitted: &SetFit) -> SetFit {
    let long = |b: &BlockAverages| b.samples_per_block as f64 * b.sample_step_s > 1.5 * SET_BLOCK_S;
    if fitted.data.recordings.iter().all(long) {
        return fitted.clone();
    }
    let blocks: Vec<BlockAverages> = fitted.data.recordings.par_iter().map(|b| b.coarsened(COARSE)).collect();
    SetFit { data: fitted.data.with_recordings(blocks), ..fitted.clone() }
}

/// The parts of a set of so many recordings that are left out in turn.
pub(super) fn folds(recordings: usize) -> Vec<Vec<usize>> {
    let count = if recordings <= FEW { recordings } else { FOLDS };
    (0..count).map(|k| (k..recordings).step_by(count.max(1)).collect()).collect()
}

/// How well a law predicts recordings that it has not seen.
pub(super) fn predict_fold(
    law: &Population,
    day_of: &[usize],
    runs: &[&SegmentedRecording],
    which: &[usize],
) -> Vec<(usize, PredictionScore)> {
    let one =
        |r: usize| score_prediction(runs[r], &predict_force(law, runs[r], day_of.get(r).copied(), DRAWS));
    which.iter().map(|r| (*r, one(*r))).collect()
}

/// How well every recording is predicted, its part of the set left out.
fn judged(fitted: &SetFit, runs: &[&SegmentedRecording]) -> Vec<Option<PredictionScore>> {
    let at = with_coarse_blocks(fitted);
    left_out(&at, runs, &folds(runs.len()), &at.fit.model.day_of)
}

/// How well every recording is predicted, its whole speed and stroke left out; nothing where there is one only.
fn by_speed(fitted: &SetFit, runs: &[&SegmentedRecording]) -> Vec<Option<PredictionScore>> {
    if have_several_speeds(runs) {
        left_out(&with_coarse_blocks(fitted), runs, &group_by_speed_and_stroke(runs), &[])
    } else {
        Vec::new()
    }
}

/// How well every recording is predicted by fits without its part of the set, on days that are known where they are named.
fn left_out(
    at: &SetFit,
    runs: &[&SegmentedRecording],
    parts: &[Vec<usize>],
    day_of: &[usize],
) -> Vec<Option<PredictionScore>> {
    let done: Vec<Vec<(usize, PredictionScore)>> = parts
        .par_iter()
        .map(|part| {
            let Some(p) = population_without(at, runs, part, &[REFIT_TURNS]) else { return Vec::new() };
            predict_fold(&p, day_of, runs, part)
        })
        .collect();
    let mut out = vec![None; runs.len()];
    for (r, s) in done.into_iter().flatten() {
        out[r] = Some(s).filter(|s| s.rmse_n.is_finite());
    }
    out
}

/// Error (N) on every recording; without end where it could not be predicted.
fn errors_n(scores: &[Option<PredictionScore>]) -> Vec<f64> {
    scores.iter().map(|s| s.as_ref().map_or(f64::INFINITY, |s| s.rmse_n)).collect()
}

/// The effect that a shaft that slips is.
#[must_use]
pub fn shaft_slip_info() -> &'static EffectInfo {
    ShaftSlip::default().info()
}

/// What a law may do without; `events` are those of its fit.
fn candidates(model: &Model, events: &[Vec<RuptureEvent>]) -> Vec<(&'static str, String, Model)> {
    let mut out = Vec::new();
    let slips = model.effects.iter().any(|c| c.info.id == shaft_slip_info().id);
    let mut seen: Vec<&str> = Vec::new();
    for id in model.effects.iter().map(|c| c.info.id) {
        if seen.contains(&id) || id == shaft_slip_info().id {
            continue;
        }
        seen.push(id);
        out.push((id, id.to_owned(), less(model, events, id)));
    }
    if slips {
        let neutral: [(&str, &[(&str, f64)]); 4] = [
            ("curved spring", &[("curvature_n_per_m2", 0.0)]),
            (
                "relaxation",
                &[
                    ("fractions.0", 0.0),
                    ("fractions.1", 0.0),
                    ("time_constants_s.0", 1.0),
                    ("time_constants_s.1", 10.0),
                ],
            ),
            ("wear", &[("wear_per_m", 0.0)]),
            ("rate of the hold", &[("rate", 0.0)]),
        ];
        for (name, numbers) in neutral {
            if let Some(model) = held(model, numbers) {
                out.push((shaft_slip_info().id, format!("{}: {name}", shaft_slip_info().id), model));
            }
        }
    }
    out
}

/// A model without any effect of this id; layers that waited give way at the force at which they did.
fn less(model: &Model, events: &[Vec<RuptureEvent>], id: &str) -> Model {
    let mut out = model.clone();
    let mut tissue = out.assumed.tissue.clone();
    // What differs from insertion to insertion goes by the order of the effects.
    let stays: Vec<usize> = model
        .varying_parameters()
        .enumerate()
        .filter(|(_, d)| model.effects[d.0].info.id != id)
        .map(|d| d.0)
        .collect();
    let kept = |all: [f64; MAX_VARYING_PARAMETERS]| {
        std::array::from_fn(|k| stays.get(k).map_or(0.0, |from| all[*from]))
    };
    while let Some(k) = out.effects.iter().position(|c| c.info.id == id) {
        if let Some(AnyEffect::DelayedPuncture(waits)) = out.effects[k].effect() {
            let layer = waits.layer.saturating_sub(1);
            let gave_way = events.iter().filter_map(|e| e.get(layer).filter(|e| e.ruptured));
            let forces_n: Vec<f64> = gave_way.map(|e| e.elastic_n).filter(|f| *f > 0.0).collect();
            let force_n = stylet_stats::median_of(forces_n.iter().copied());
            if forces_n.len() > 1 {
                out.scatter.rupture_force =
                    out.scatter.rupture_force.max(stylet_stats::sd(&forces_n) / force_n);
            }
            for t in [&mut tissue, &mut out.tissue] {
                if let Some(l) = t.layers.get_mut(layer) {
                    l.puncture_n = Some(if force_n.is_finite() { force_n } else { waits.force_n });
                }
            }
        }
        out = out.without_effect(k);
    }
    out.per_recording.iter_mut().for_each(|o| o.varying = kept(o.varying));
    out.scatter.varying = kept(out.scatter.varying);
    out.assumed = Arc::new(Assumptions { tissue, ..(*out.assumed).clone() });
    out
}

/// A model with numbers of its `shaft_slip` held where they do nothing; `None` when they are already.
fn held(model: &Model, numbers: &[(&str, f64)]) -> Option<Model> {
    let mut out = model.clone();
    let mut any = false;
    for effect in 0..out.effects.len() {
        let choice = &out.effects[effect];
        if choice.info.id != shaft_slip_info().id {
            continue;
        }
        let mut values = choice.values.clone();
        for (path, neutral) in numbers {
            let parameter = choice.info.parameters.iter().position(|p| p.path == *path)?;
            any |= values[parameter] != *neutral;
            values[parameter] = *neutral;
            if !model.tied.iter().any(|b| b.effect == effect && b.parameter == parameter) {
                out.tied.push(TiedParameter { effect, parameter, tied_to: None });
            }
        }
        out.effects[effect] = EffectTerm::new(model.effects[effect].info, &values);
    }
    any.then_some(out)
}

/// Probability that errors `without` something are larger on new runs than those `with` it (Student, one-sided, paired: runs are
/// what is independent).
pub(super) fn paired_confidence(without: &[f64], with: &[f64]) -> f64 {
    let worth: Vec<f64> = without.iter().zip(with).map(|(a, b)| a - b).filter(|d| d.is_finite()).collect();
    if worth.len() < 2 {
        return f64::from(u8::from(!without.is_empty() && worth.is_empty()));
    }
    let error = stylet_stats::sd(&worth) / (worth.len() as f64).sqrt();
    student_t::cdf(stylet_stats::mean(&worth) / error.max(1e-9), worth.len() as f64 - 1.0)
}

/// What every recording loses `without` something, as a share of what is left `with` it: squares of the parts of an insertion, each by
/// what is left there of all recordings. Where a puncture falls is mostly chance, a hold is not: a score by parts (the likelihood of
/// noise that every part has its own size of) sees what the whole hides.
fn loses(without: &[Option<PredictionScore>], with: &[Option<PredictionScore>]) -> Vec<f64> {
    let mut left = [(0.0, 0.0); PHASE_NAMES.len()];
    for s in with.iter().flatten() {
        for (sum, part) in left.iter_mut().zip(s.phase_squares) {
            *sum = (sum.0 + part.0, sum.1 + part.1);
        }
    }
    let one = |(without, with): (&Option<PredictionScore>, &Option<PredictionScore>)| match (without, with) {
        (_, None) => 0.0,
        (None, _) => f64::INFINITY,
        (Some(without), Some(with)) => {
            let samples: f64 = with.phase_squares.iter().map(|p| p.1).sum();
            let more = |k: usize| {
                let square = left[k].0 / f64::max(left[k].1, 1.0);
                if square > 0.0 {
                    (without.phase_squares[k].0 - with.phase_squares[k].0) / square
                } else {
                    0.0
                }
            };
            (0..PHASE_NAMES.len()).map(more).sum::<f64>() / samples.max(1.0)
        }
    };
    without.iter().zip(with).map(one).collect()
}

/// Whether a part is worth having: what recordings lose without it is at least `worth`, and more than its standard error over the
/// recordings, which are what is independent.
fn pays(loses: &[f64], worth: f64) -> bool {
    pays_beyond(loses, worth, 1.0)
}

/// Whether an effect may be named: the standard error of few recordings is hardly known itself, so that Student's distribution says how
/// many of them chance would reach.
fn surely_pays(loses: &[f64]) -> bool {
    let dof = loses.len().saturating_sub(1).max(1) as f64;
    pays_beyond(loses, PART_WORTH, student_t::quantile(1.0 - ACCUSED, dof))
}

/// Whether what recordings lose is at least `worth`, and more than so many standard errors.
fn pays_beyond(loses: &[f64], worth: f64, errors: f64) -> bool {
    let mean = stylet_stats::mean(loses);
    let error = stylet_stats::sd(loses) / (loses.len() as f64).sqrt();
    // Squares are twice as much worse as their roots.
    mean >= 2.0 * worth && (mean == f64::INFINITY || mean > errors * error)
}

/// What is missed without a part of a law.
struct Missed {
    /// What every recording left out loses, as a share of what is left.
    loses: Vec<f64>,
    /// The same with whole speeds left out; nothing where there is one only.
    speeds_lose: Vec<f64>,
    /// Nats that the recordings say for the part, by the noise that the whole law leaves, beyond what its numbers cost: half the logarithm
    /// of the blocks each (Schwarz 1978).
    nats: f64,
}

impl Missed {
    fn new(
        whole: &SetFit,
        less: Option<&SetFit>,
        with: &[Option<PredictionScore>],
        without: &[Option<PredictionScore>],
    ) -> Self {
        let nats = |f: &SetFit| residuals(&f.fit.model, &whole.data).map(|r| r.nats);
        let numbers = |f: &SetFit| f.fit.model.shared_parameters().len() as f64;
        let beyond = |less: &SetFit| {
            let cost = 0.5
                * (numbers(whole) - numbers(less))
                * libm::log(whole.data.compared_block_count().max(1) as f64);
            Some(nats(less)? - nats(whole)? - cost)
        };
        let nats = less.and_then(beyond).unwrap_or(f64::INFINITY);
        Self { loses: loses(without, with), speeds_lose: Vec::new(), nats }
    }

    /// Whether an effect is: recordings left out miss it, or those that are fitted say so and the others do not deny it.
    fn effect(&self) -> bool {
        let worse = |loses: &[f64]| !loses.is_empty() && stylet_stats::mean(loses) > 0.0;
        let told = self.nats > 0.0 && (worse(&self.loses) || worse(&self.speeds_lose));
        told || surely_pays(&self.loses) || surely_pays(&self.speeds_lose)
    }

    /// Whether the law predicts better with an effect, if not surely: it stays, and is not named.
    fn useful(&self) -> bool {
        self.effect() || pays(&self.loses, PART_WORTH)
    }

    /// Whether what shapes an effect pays.
    fn shape(&self) -> bool {
        pays(&self.loses, SHAPE_WORTH) || pays(&self.speeds_lose, SHAPE_WORTH)
    }
}

/// Says what each part of a law is worth, and takes away what nobody misses.
pub(super) fn ablate(best: &mut ScoredModel, runs: &[&SegmentedRecording]) -> Vec<ModelTerm> {
    let at = with_coarse_blocks(&best.set_fit);
    let (whole, speeds) = (best.scores.clone(), by_speed(&best.set_fit, runs));
    let ask = |from: &SetFit, model: &Model| {
        let less = from.refit_with(model);
        let scores: Vec<Option<PredictionScore>> = less.as_ref().map_or_else(Vec::new, |f| judged(f, runs));
        let mut missed = Missed::new(from, less.as_ref(), &whole, &scores);
        missed.speeds_lose = less.as_ref().map_or_else(Vec::new, |f| loses(&by_speed(f, runs), &speeds));
        (less, scores, missed)
    };
    let asked: Vec<_> = candidates(&at.fit.model, &at.fit.residuals.ruptures)
        .into_par_iter()
        .map(|(effect, name, model)| (effect, name, ask(&at, &model)))
        .collect();
    let mut order: Vec<usize> = (0..asked.len()).collect();
    let lost = |k: &usize| stylet_stats::mean(&asked[*k].2.2.loses);
    order.sort_by(|a, b| lost(a).total_cmp(&lost(b)));
    let mut gone: Vec<usize> = Vec::new();
    for k in order {
        let (effect, name, (less, _, missed)) = &asked[k];
        let stays = |m: &Missed| if name == effect { m.useful() } else { m.shape() };
        let Some(less) = less.as_ref().filter(|_| !stays(missed)) else { continue };
        let smaller = if gone.is_empty() {
            best.set_fit.refit_with(&less.fit.model)
        } else {
            // Beside what went before it.
            let now = &best.set_fit.fit;
            let now = candidates(&now.model, &now.residuals.ruptures).into_iter().find(|c| c.1 == *name);
            let Some((less, _, missed)) = now.map(|c| ask(&with_coarse_blocks(&best.set_fit), &c.2)) else {
                continue;
            };
            less.filter(|_| !stays(&missed)).and_then(|f| best.set_fit.refit_with(&f.fit.model))
        };
        if let Some(smaller) = smaller {
            *best = ScoredModel::new(best.family, smaller, runs);
            gone.push(k);
        }
    }
    if best.set_fit.fit.model.effects.is_empty() {
        best.family = ModelFamily::Base;
    }
    let asked = asked.into_iter().enumerate();
    asked
        .map(|(k, (effect, name, (_, scores, missed)))| ModelTerm {
            effect,
            name,
            without_n: errors_n(&scores),
            significant: missed.effect(),
            held_out_loss: missed.loses,
            held_out_speed_loss: missed.speeds_lose,
            gain_nats: missed.nats,
            kept: !gone.contains(&k),
        })
        .collect()
}

/// Whether the insertions were made at several speeds or strokes.
#[must_use]
pub fn have_several_speeds(runs: &[&SegmentedRecording]) -> bool {
    group_by_speed_and_stroke(runs).len() > 1
}

/// Effects that a law has, each once.
#[must_use]
pub fn active_effects(model: &Model) -> Vec<&'static str> {
    let mut out: Vec<&str> = Vec::new();
    for c in &model.effects {
        let neutral = c.effect().is_none_or(|e| e.is_inactive());
        if !neutral && !out.contains(&c.info.id) {
            out.push(c.info.id);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::{
        DRAWS, Missed, ModelFamily, PART_WORTH, REFIT_TURNS, SHAPE_WORTH, ScoredModel, WORTH, ablate,
        active_effects, best_candidate, candidates, errors_n, have_several_speeds, held, judged, less, loses,
        paired_confidence, pays, some, starts, surely_pays, surest, with_coarse_blocks,
    };
    use crate::base_law_fit::PreparedRecordings;
    use crate::repeated_insertions::SegmentedRecording;
    use crate::repeated_insertions::cross_validation::{
        PredictionScore, population_without, score_prediction,
    };
    use crate::repeated_insertions::multistart_fit::{SET_BLOCK_S, SetFit, set_blocks};
    use crate::repeated_insertions::population_prediction::predict_force;
    use crate::test_fixtures::{self, assumed_layers, fit_from_truth, simulated_recordings};
    use stylet_identify::likelihood::residuals;
    use stylet_identify::model::{EffectTerm, MAX_VARYING_PARAMETERS, Model, Scatter, TiedParameter};
    use stylet_identify::rupture_likelihood::RuptureEvent;
    use stylet_record::Recording;
    use stylet_record::sensor_artefacts::SensorArtefacts;
    use stylet_tissue::{
        AnyEffect, CoulombFriction, DelayedPuncture, Effect, ForceBias, ForceDrift, PowerLawFriction,
        ReleaseDepth, ShaftSlip, StribeckFriction,
    };

    fn model(all: &[AnyEffect]) -> Model {
        let belief = assumed_layers(&[[0.02, 100.0, 1000.0]; 2]);
        let mut m = Model::base(belief, 1);
        m.effects = all.iter().map(|e| EffectTerm::new(e.info(), &e.parameters())).collect();
        m
    }

    fn slips(layer: usize) -> AnyEffect {
        ShaftSlip {
            layer,
            push_n: 1.0,
            curvature_n_per_m2: 3e3,
            fractions: [0.1, 0.2],
            time_constants_s: [0.5, 7.0],
            wear_per_m: 4.0,
            rate: -0.1,
            ..ShaftSlip::default()
        }
        .into()
    }

    fn waits(layer: usize, force_n: f64) -> AnyEffect {
        DelayedPuncture { layer, force_n, exponent: 9.0 }.into()
    }

    fn lets_go(layer: usize) -> AnyEffect {
        ReleaseDepth { layer, depth_m: 1e-3 }.into()
    }

    #[test]
    fn a_law_may_do_without_each_effect_and_each_part_of_a_slipping_shaft() {
        let m = model(&[slips(1), waits(1, 1.5), lets_go(1), slips(2), waits(2, 2.5), lets_go(2)]);
        let all = candidates(&m, &[]);
        let names: Vec<&str> = all.iter().map(|c| c.1.as_str()).collect();
        assert_eq!(
            names,
            [
                "delayed_puncture",
                "release_depth",
                "shaft_slip: curved spring",
                "shaft_slip: relaxation",
                "shaft_slip: wear",
                "shaft_slip: rate of the hold"
            ]
        );
        assert_eq!(all.iter().map(|c| c.0).collect::<Vec<_>>()[1..3], ["release_depth", "shaft_slip"]);
        let count = |m: &Model| m.effects.len();
        assert_eq!(all.iter().map(|c| count(&c.2)).collect::<Vec<_>>(), [4, 4, 6, 6, 6, 6]);
        let value = |m: &Model, e: usize, path: &str| {
            let k = m.effects[e].info.parameters.iter().position(|p| p.path == path).expect("a parameter");
            m.effects[e].values[k]
        };
        for e in [0, 3] {
            assert_eq!(value(&all[2].2, e, "curvature_n_per_m2"), 0.0);
            assert_eq!(
                (value(&all[3].2, e, "fractions.1"), value(&all[3].2, e, "time_constants_s.1")),
                (0.0, 10.0)
            );
            assert_eq!(
                (value(&all[3].2, e, "time_constants_s.0"), value(&all[3].2, e, "curvature_n_per_m2")),
                (1.0, 3e3)
            );
            assert_eq!((value(&all[4].2, e, "wear_per_m"), value(&all[5].2, e, "rate")), (0.0, 0.0));
        }
        // Without a slipping shaft only whole effects go.
        assert_eq!(candidates(&model(&[CoulombFriction { c_n_per_m: 3.0 }.into()]), &[]).len(), 1);
        assert!(candidates(&model(&[]), &[]).is_empty());
        assert_eq!(candidates(&model(&[slips(1)]), &[]).len(), 4);
    }

    #[test]
    fn numbers_that_are_held_do_nothing_and_are_fitted_no_more() {
        let m = model(&[waits(1, 1.5), slips(1), slips(2)]);
        let wear =
            m.effects[1].info.parameters.iter().position(|p| p.path == "wear_per_m").expect("a parameter");
        let out = held(&m, &[("wear_per_m", 0.0)]).expect("it wore");
        let bound = |e| TiedParameter { effect: e, parameter: wear, tied_to: None };
        assert_eq!(out.tied, [bound(1), bound(2)]);
        // One that is bound already is not bound again; where nothing changes there is nothing to try.
        let mut half = m.clone();
        half.tied = vec![TiedParameter { effect: 2, parameter: wear, tied_to: Some(1) }];
        assert_eq!(held(&half, &[("wear_per_m", 0.0)]).expect("it wore").tied, [half.tied[0], bound(1)]);
        assert!(held(&out, &[("wear_per_m", 0.0)]).is_none());
        assert!(held(&m, &[("no such number", 0.0)]).is_none());
    }

    #[test]
    fn layers_that_waited_give_way_at_a_force_when_they_wait_no_more() {
        let mut m = model(&[waits(2, 2.5), slips(1), waits(1, 1.5), lets_go(1), lets_go(2)]);
        (m.per_recording[0].varying[0], m.scatter.varying[1]) = (3e-4, 2e-4);
        let out = less(&m, &[], "delayed_puncture");
        assert_eq!(out.effects.len(), 3);
        for t in [&out.tissue, &out.assumed.tissue] {
            assert_eq!([t.layers[0].puncture_n, t.layers[1].puncture_n], [Some(1.5), Some(2.5)]);
        }
        assert_eq!(
            (out.per_recording[0].varying, out.scatter.varying),
            (m.per_recording[0].varying, m.scatter.varying)
        );
        let same = less(&m, &[], "shaft_slip");
        assert_eq!((same.effects.len(), same.tissue.layers[0].puncture_n), (4, None));
        // What differs from insertion to insertion goes with its effect, and only with it.
        let none = less(&m, &[], "release_depth");
        assert_eq!(
            (none.per_recording[0].varying, none.scatter.varying),
            ([0.0; MAX_VARYING_PARAMETERS], [0.0; MAX_VARYING_PARAMETERS])
        );
    }

    /// A layer that waited gives way where it did, and as differently.
    #[test]
    fn the_force_of_a_layer_that_waits_no_more_is_that_at_which_it_gave_way() {
        let m = model(&[waits(1, 1.5)]);
        let event =
            |elastic_n: f64, ruptured: bool| RuptureEvent { elastic_n, ruptured, ..RuptureEvent::INITIAL };
        let events =
            [vec![event(1.8, true)], vec![event(2.0, true)], vec![event(2.2, true)], vec![event(9.0, false)]];
        let out = less(&m, &events, "delayed_puncture");
        assert_eq!(
            (out.tissue.layers[0].puncture_n, out.assumed.tissue.layers[0].puncture_n),
            (Some(2.0), Some(2.0))
        );
        assert!((out.scatter.rupture_force - 0.1).abs() < 1e-12, "{}", out.scatter.rupture_force);
        // A scatter that is wider already stays.
        let wide = Model { scatter: Scatter { rupture_force: 0.3, ..m.scatter }, ..m };
        assert_eq!(less(&wide, &events, "delayed_puncture").scatter.rupture_force, 0.3);
    }

    #[test]
    fn a_laws_effects_are_named_once_and_only_where_they_do_something() {
        let nothing: AnyEffect = CoulombFriction { c_n_per_m: 0.0 }.into();
        assert_eq!(
            active_effects(&model(&[slips(1), waits(1, 1.5), slips(2), nothing])),
            ["shaft_slip", "delayed_puncture"]
        );
    }

    #[test]
    fn one_speed_is_not_several() {
        let run = |speed: f64| {
            let t: Vec<f64> = (0..200).map(|k| 0.05 * f64::from(k)).collect();
            let z = t.iter().map(|t| (speed * t).min(0.01)).collect();
            SegmentedRecording::new(
                String::new(),
                Recording::new(t, z, vec![0.0; 200]).expect("clean columns"),
                1,
            )
        };
        let (a, b, c) = (run(0.002), run(0.002), run(0.004));
        assert!(!have_several_speeds(&[&a, &b]) && have_several_speeds(&[&a, &c]));
    }

    #[test]
    fn confidence_is_the_chance_that_the_mean_of_what_is_worse_lies_above_nothing() {
        let (without, with) = ([0.5, 0.7, 0.4, 0.9], [0.45, 0.5, 0.42, 0.6]);
        let d: [f64; 4] = std::array::from_fn(|k| without[k] - with[k]);
        let mean = d.iter().sum::<f64>() / 4.0;
        let sd = (d.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 3.0).sqrt();
        let wanted = stylet_stats::student_t::cdf(mean / (sd / 2.0), 3.0);
        assert!((paired_confidence(&without, &with) - wanted).abs() < 1e-12);
        // A recording that cannot be predicted without it does not count; where none can be, nothing else is left.
        let more: Vec<f64> = without.iter().copied().chain([f64::INFINITY]).collect();
        assert!((paired_confidence(&more, &[&with[..], &[0.5]].concat()) - wanted).abs() < 1e-12);
        assert_eq!(paired_confidence(&[f64::INFINITY; 3], &with[..3]), 1.0);
        assert_eq!((paired_confidence(&[], &[]), paired_confidence(&[0.5], &[0.4])), (0.0, 0.0));
        // Two tell already: worse by 1 and by 3 is 2 with an error of 1.
        assert_eq!(paired_confidence(&[1.5, 3.5], &[0.5, 0.5]), stylet_stats::student_t::cdf(2.0, 1.0));
    }

    /// By hand: 4 and 1 N² are left of a hundred samples each in loading and hold on the mean of two recordings.
    #[test]
    fn what_recordings_lose_is_counted_part_by_part_in_what_is_left_there() {
        let of = |loading: f64, hold: f64| {
            let parts = [(loading, 100.0), (0.0, 0.0), (0.0, 0.0), (hold, 100.0), (0.0, 0.0)];
            Some(PredictionScore { phase_squares: parts, ..PredictionScore::default() })
        };
        let with = [of(300.0, 150.0), of(500.0, 50.0)];
        let told = loses(&[of(340.0, 150.0), of(500.0, 60.0)], &with);
        assert!((told[0] - 40.0 / 4.0 / 200.0).abs() < 1e-12 && (told[1] - 10.0 / 200.0).abs() < 1e-12);
        assert_eq!(loses(&[None, with[1].clone()], &with), [f64::INFINITY, 0.0]);
        assert_eq!(loses(&[with[0].clone(), None], &[None, with[1].clone()])[0], 0.0);
    }

    #[test]
    fn a_part_pays_that_is_worth_a_twentieth_and_more_than_its_standard_error() {
        let about = |mean: f64, errors: f64| -> Vec<f64> {
            // Errors of the mean of these five are sqrt(0.5).
            let scale = mean / errors / 0.5_f64.sqrt();
            [-2.0, -1.0, 0.0, 1.0, 2.0].map(|x| mean + scale * x).to_vec()
        };
        for (mean, errors, wanted) in
            [(0.2, 1.1, true), (0.2, 0.9, false), (0.101, 9.0, true), (0.099, 9.0, false), (-0.2, 9.0, false)]
        {
            assert_eq!(pays(&about(mean, errors), PART_WORTH), wanted, "{mean} {errors}");
        }
        assert!(pays(&[0.0, f64::INFINITY, 0.0], PART_WORTH) && !pays(&[], PART_WORTH));
        // A shape is asked for less.
        assert!(pays(&about(0.03, 9.0), SHAPE_WORTH) && !pays(&about(0.03, 9.0), PART_WORTH));
    }

    /// Tables of Student's distribution: of chance one of 200 means is beyond 4.604 standard errors of five recordings, 2.977 of fifteen.
    #[test]
    fn an_effect_is_named_for_what_recordings_miss_when_chance_would_hardly_reach_it() {
        let about = |mean: f64, errors: f64, half: i32| -> Vec<f64> {
            let shape: Vec<f64> = (-half..=half).map(f64::from).collect();
            let error = stylet_stats::sd(&shape) / (shape.len() as f64).sqrt();
            shape.iter().map(|x| mean + mean / errors / error * x).collect()
        };
        for (half, errors) in [(2, 4.604), (7, 2.977)] {
            assert!(surely_pays(&about(0.2, errors + 0.01, half)), "{half}");
            assert!(!surely_pays(&about(0.2, errors - 0.01, half)), "{half}");
            assert!(!surely_pays(&about(0.099, 99.0, half)), "{half}");
        }
        // A drawn set of five was accused of waiting for this; a shape may be as unsure.
        assert!(!surely_pays(&about(0.114, 2.5, 2)) && pays(&about(0.114, 2.5, 2), PART_WORTH));
        assert!(surely_pays(&[0.0, f64::INFINITY]) && !surely_pays(&[]) && !surely_pays(&[0.9]));
    }

    #[test]
    fn an_effect_stays_that_recordings_left_out_miss_or_the_fitted_ones_say_and_the_others_do_not_deny() {
        let some = |mean: f64| vec![mean - 0.01, mean, mean + 0.01];
        let missed = |loses: f64, speeds: &[f64], nats: f64| Missed {
            loses: some(loses),
            speeds_lose: speeds.to_vec(),
            nats,
        };
        for (loses, speeds, nats, wanted) in [
            (0.2, vec![], -9.0, true),
            (0.02, vec![], -9.0, false),
            (0.02, vec![], 9.0, true),
            (-0.02, vec![], 9.0, false),
            (-0.02, some(0.03), 9.0, true),
            (-0.02, some(0.3), -9.0, true),
        ] {
            assert_eq!(missed(loses, &speeds, nats).effect(), wanted, "{loses} {speeds:?} {nats}");
        }
        // Without being sure of it an effect is of use where recordings lose by more than one standard error.
        assert!(missed(0.12, &[], -9.0).useful() && !missed(0.09, &[], -9.0).useful());
        let unsure = Missed { loses: vec![0.0, 0.2, 0.3], ..missed(0.0, &[], -9.0) };
        assert!(unsure.useful() && !unsure.effect());
        // What shapes one pays by itself.
        assert!(missed(0.03, &[], -9.0).shape() && !missed(0.01, &[], 9.0).shape());
    }

    /// Every number costs half the logarithm of the blocks, beside what the larger law leaves as noise.
    #[test]
    fn nats_of_a_part_are_beyond_what_its_numbers_cost() {
        let bias: AnyEffect = ForceBias { force_n: 1e-3 }.into();
        let runs = simulated_recordings(&[], &FOUR);
        let runs: Vec<&SegmentedRecording> = runs.iter().collect();
        let (whole, less) = (fit_from_truth(&[bias], &runs), fit_from_truth(&[], &runs));
        let nats = |f: &SetFit| residuals(&f.fit.model, &whole.data).expect("a replay").nats;
        let cost = 0.5 * (whole.data.compared_block_count() as f64).ln();
        let told = Missed::new(&whole, Some(&less), &[], &[]).nats;
        assert!((told - (nats(&less) - nats(&whole) - cost)).abs() < 1e-9, "{told}");
        // What a law cannot be fitted without is missed.
        assert_eq!(Missed::new(&whole, None, &[], &[]).nats, f64::INFINITY);
    }

    /// Of chance the least of several errors is too good.
    #[test]
    fn the_fit_that_leaves_least_stands_unless_another_one_predicts_better_by_more_than_chance() {
        let law = |errors: &[f64]| {
            test_fixtures::unmeasured_candidate(ModelFamily::ShaftSlip, &[slips(1)], errors, 0.0)
        };
        let first = [1.0, 1.1, 0.9, 1.2, 1.0];
        let chosen = |others: &[[f64; 5]]| {
            let all = [first].iter().chain(others).map(|e| law(e)).collect();
            surest(all).expect("a law").errors_n
        };
        assert_eq!(chosen(&[]), first);
        // Better by a sixth on the mean, for one recording alone.
        assert_eq!(chosen(&[[1.02, 1.1, 0.9, 0.3, 1.0]]), first);
        let (better, best) = ([0.8, 0.9, 0.7, 1.0, 0.8], [0.7, 0.8, 0.6, 0.9, 0.7]);
        assert_eq!(chosen(&[better, best, better]), best);
        assert!(surest(Vec::new()).is_none());
    }

    fn rubs(c_n_per_m: f64) -> AnyEffect {
        CoulombFriction { c_n_per_m }.into()
    }

    #[test]
    fn a_law_beats_the_base_law_by_two_per_cent_and_many_stories_beat_one_by_ten() {
        let drift: AnyEffect = ForceDrift { rate_n_per_s: 0.1 }.into();
        let bend: AnyEffect = PowerLawFriction { exponent: 0.5 }.into();
        let base = test_fixtures::unmeasured_candidate(ModelFamily::Base, &[], &[0.9, 1.1], 0.0);
        let slip =
            |e: f64| test_fixtures::unmeasured_candidate(ModelFamily::ShaftSlip, &[slips(1)], &[e, e], 0.0);
        let library = |e: f64| {
            test_fixtures::unmeasured_candidate(
                ModelFamily::Library,
                &[rubs(3.0), drift.clone()],
                &[e, e],
                0.0,
            )
        };
        let many = |e: f64| {
            test_fixtures::unmeasured_candidate(
                ModelFamily::Library,
                &[rubs(3.0), drift.clone(), bend.clone()],
                &[e, e],
                0.0,
            )
        };
        let kind = |slip: Option<ScoredModel>, library: Option<ScoredModel>| {
            best_candidate(&base, slip.as_ref(), library.as_ref()).family
        };
        assert_eq!(kind(None, None), ModelFamily::Base);
        // Two per cent of the base law's 1 N.
        assert_eq!(kind(Some(slip(0.985)), Some(library(0.985))), ModelFamily::Base);
        assert_eq!(kind(Some(slip(0.975)), None), ModelFamily::ShaftSlip);
        assert_eq!(kind(None, Some(library(0.975))), ModelFamily::Library);
        assert_eq!(kind(None, Some(many(0.975))), ModelFamily::Library);
        // One or two effects against a shaft that slips: the better one; three have to be better by a tenth.
        assert_eq!(kind(Some(slip(0.5)), Some(library(0.49))), ModelFamily::Library);
        assert_eq!(kind(Some(slip(0.5)), Some(library(0.51))), ModelFamily::ShaftSlip);
        assert_eq!(kind(Some(slip(0.5)), Some(many(0.46))), ModelFamily::ShaftSlip);
        assert_eq!(kind(Some(slip(0.5)), Some(many(0.44))), ModelFamily::Library);
        // Just two per cent are not better, nor is a law as good as another.
        assert_eq!(kind(Some(slip(1.0 - WORTH)), None), ModelFamily::Base);
        assert_eq!(kind(Some(slip(0.5)), Some(library(0.5))), ModelFamily::ShaftSlip);
        let base = test_fixtures::unmeasured_candidate(ModelFamily::Base, &[], &[2.0, 2.0], 0.0);
        assert_eq!(best_candidate(&base, Some(&slip(1.9)), None).family, ModelFamily::ShaftSlip);
        // What could not be judged is no law.
        assert_eq!(kind(Some(slip(f64::INFINITY)), Some(many(0.97))), ModelFamily::Library);
    }

    #[test]
    fn a_sensor_with_steps_has_the_noise_of_what_is_spread_evenly_over_one() {
        let noise_n = super::floor_n(&SensorArtefacts { step_n: Some(0.6), ..SensorArtefacts::default() });
        assert!((noise_n / (0.6 / 12.0_f64.sqrt()) - 1.0).abs() < 2e-3, "{noise_n}");
        assert_eq!(super::floor_n(&SensorArtefacts::default()), 0.0);
    }

    #[test]
    fn few_recordings_are_begun_from_more_starts() {
        assert_eq!([1, 4, 5, 10, 12, 13, 40].map(starts), [72, 72, 60, 30, 25, 24, 24]);
        assert_eq!(starts(0), 72);
    }

    #[test]
    fn the_library_is_searched_with_as_many_insertions_of_every_speed() {
        let one = simulated_recordings(&[], &[[0.008, 0.0]]).remove(0);
        let of = |speeds: &[f64]| {
            let runs: Vec<SegmentedRecording> =
                speeds.iter().map(|v| SegmentedRecording { speed_mps: *v, ..one.clone() }).collect();
            let runs: Vec<&SegmentedRecording> = runs.iter().collect();
            let mut all = set_blocks(&runs, &SensorArtefacts::default());
            // Told apart by their first force.
            all.iter_mut().enumerate().for_each(|(k, b)| b.force_n[0] = k as f64);
            let prepared = PreparedRecordings::new(assumed_layers(&[[0.05, 250.0, 2e4]]), all, 0.3);
            let (part, which) = some(&prepared, &runs);
            assert_eq!(part.blocks.iter().map(|b| b.force_n[0] as usize).collect::<Vec<_>>(), which);
            assert_eq!((part.drops.len(), part.min_noise_sd_n), (which.len(), prepared.min_noise_sd_n));
            which
        };
        assert_eq!(of(&[1.0; 9]), [0, 1, 2, 3, 4, 5]);
        assert_eq!(of(&[1.0; 2]), [0, 1]);
        assert_eq!(of(&[3.0, 1.0, 1.0, 3.0, 2.0, 3.0, 2.0, 1.0, 2.0]), [0, 1, 2, 3, 4, 6]);
        // More speeds than insertions are wanted: one of each.
        assert_eq!(of(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 7.0]), [0, 1, 2, 3, 4, 5, 6]);
    }

    #[test]
    fn a_law_is_judged_on_blocks_three_times_as_long_and_longer_ones_stay() {
        let runs = simulated_recordings(&[], &[[0.004, 0.0], [0.008, 1e-4]]);
        let runs: Vec<&SegmentedRecording> = runs.iter().collect();
        let fine = fit_from_truth(&[], &runs);
        let long = with_coarse_blocks(&fine);
        for (a, b) in fine.data.recordings.iter().zip(long.data.recordings.iter()) {
            assert!(
                (b.end_s[3] - b.start_s[3] - 0.24).abs() < 1e-9 && b.len() == a.len().div_ceil(3),
                "{}",
                b.len()
            );
        }
        let again = with_coarse_blocks(&long);
        assert_eq!(again.data.recordings[0].len(), long.data.recordings[0].len());
        // Longer are blocks of more than one and a half of the first ones.
        let mut blocks = fine.data.recordings.to_vec();
        blocks.iter_mut().for_each(|b| (b.samples_per_block, b.sample_step_s) = (1, 1.5 * SET_BLOCK_S));
        let half_more = SetFit { data: fine.data.with_recordings(blocks), ..fine.clone() };
        assert_eq!(with_coarse_blocks(&half_more).data.recordings[0].len(), long.data.recordings[0].len());
    }

    /// Of at most eight every one is left out by itself, of more every third with it.
    #[test]
    fn a_law_is_judged_by_what_it_says_of_recordings_that_took_no_part() {
        let speeds = [0.008, 0.016];
        for (count, fold) in [(4, vec![1]), (8, vec![1]), (9, vec![1, 4, 7])] {
            let all: Vec<[f64; 2]> = (0..count).map(|k| [speeds[k % 2], 1e-4 * (k % 3) as f64]).collect();
            let runs = simulated_recordings(&[], &all);
            let runs: Vec<&SegmentedRecording> = runs.iter().collect();
            let fitted = fit_from_truth(&[], &runs);
            let told = judged(&fitted, &runs);
            assert_eq!(told.len(), count);
            let others = population_without(&with_coarse_blocks(&fitted), &runs, &fold, &[REFIT_TURNS])
                .expect("a fit");
            for r in fold {
                let wanted = score_prediction(runs[r], &predict_force(&others, runs[r], None, DRAWS));
                assert_eq!(told[r], Some(wanted), "{r} of {count}");
            }
            assert!(errors_n(&told).iter().all(|e| *e > 0.0 && *e < 0.5), "{told:?}");
        }
    }

    /// Two insertions each at two speeds.
    const FOUR: [[f64; 2]; 4] = [[0.008, 1e-4], [0.008, -1e-4], [0.016, 0.0], [0.016, 1e-4]];

    #[test]
    fn a_part_that_recordings_left_out_do_not_miss_goes_and_one_that_they_miss_stays() {
        let true_one = rubs(150.0);
        let runs = simulated_recordings(std::slice::from_ref(&true_one), &FOUR);
        let runs: Vec<&SegmentedRecording> = runs.iter().collect();
        let bias: AnyEffect = ForceBias { force_n: 1e-3 }.into();
        let mut law =
            ScoredModel::new(ModelFamily::Library, fit_from_truth(&[bias.clone(), true_one], &runs), &runs);
        let before = law.held_out_n();
        let told = ablate(&mut law, &runs);
        let said: Vec<(&str, &str, bool)> =
            told.iter().map(|p| (p.effect, p.name.as_str(), p.kept)).collect();
        assert_eq!(
            said,
            [("force_bias", "force_bias", false), ("coulomb_friction", "coulomb_friction", true)]
        );
        let mean = |k: usize| stylet_stats::mean(&told[k].without_n);
        assert!(mean(0) < 1.01 * before && mean(1) > 1.05 * before, "{before}: {} {}", mean(0), mean(1));
        assert_eq!(
            (active_effects(&law.set_fit.fit.model), law.family),
            (vec!["coulomb_friction"], ModelFamily::Library)
        );
        assert!(law.held_out_n() < 1.01 * before);
        // A law that has lost all its parts is the base law.
        let runs = simulated_recordings(&[], &FOUR);
        let runs: Vec<&SegmentedRecording> = runs.iter().collect();
        let mut law = ScoredModel::new(ModelFamily::Library, fit_from_truth(&[bias], &runs), &runs);
        assert!(!ablate(&mut law, &runs)[0].kept);
        assert_eq!((law.family, law.set_fit.fit.model.effects.len()), (ModelFamily::Base, 0));
    }

    /// Friction that either of two effects explains: one goes, and is then missed in the other's place.
    #[test]
    fn of_two_parts_that_say_the_same_one_stays() {
        let true_one = rubs(150.0);
        let runs = simulated_recordings(std::slice::from_ref(&true_one), &FOUR);
        let runs: Vec<&SegmentedRecording> = runs.iter().collect();
        let same: AnyEffect =
            StribeckFriction { c_n_per_m: 75.0, c_static_n_per_m: 75.0, v_stribeck_mps: 2e-3 }.into();
        let mut law =
            ScoredModel::new(ModelFamily::Library, fit_from_truth(&[rubs(75.0), same], &runs), &runs);
        let told = ablate(&mut law, &runs);
        assert_eq!(told.iter().filter(|p| p.kept).count(), 1, "{told:?}");
        assert_eq!(law.set_fit.fit.model.effects.len(), 1);
    }

    /// What the law does not know is an oscillation of 4 N: a part is worth its share of the error, however large that is.
    #[test]
    fn a_part_goes_under_large_errors_as_under_small_ones() {
        let all = [[0.008, 0.0], [0.008, 1e-4], [0.016, 0.0], [0.016, 1e-4]];
        let runs = test_fixtures::recordings_with_added_force(&[], &all, |t| 4.0 * (9.0 * t).sin());
        let runs: Vec<&SegmentedRecording> = runs.iter().collect();
        let bias: AnyEffect = ForceBias { force_n: 1e-3 }.into();
        let mut law = ScoredModel::new(ModelFamily::Library, fit_from_truth(&[bias], &runs), &runs);
        assert!(law.held_out_n() > 1.5, "{}", law.held_out_n());
        assert!(!ablate(&mut law, &runs)[0].kept);
    }
}
