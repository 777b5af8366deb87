//! Fits the base law to the recordings: assigns force drops to layers, then fits parameters and rupture times in turn.

use crate::random_effect_selection::select_random_effects;
use crate::slow_noise::leaves_slow_noise;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use stylet_identify::block_averages::BlockAverages;
use stylet_identify::fit::{Effort, Fit, fit, fit_from_zero_scatter};
use stylet_identify::force_drops::{ForceDrop, detect_force_drops};
use stylet_identify::likelihood::{FitData, residuals};
use stylet_identify::model::{Assumptions, EffectTerm, Model, ZeroStep};
use stylet_identify::noise::{Noise, NoiseSource};
use stylet_identify::rupture_assignment::assign_ruptures;
use stylet_identify::update_event_times::update_event_times;
use stylet_scenario::Scenario;
use stylet_stats::parallel::*;
use stylet_tissue::Effect;

/// Assumptions of a scenario: its tissue, effects and tolerances.
#[must_use]
pub fn assumptions_of(s: &Scenario) -> Assumptions {
    let layers = s.tissue.layers.len();
    Assumptions {
        tissue: s.tissue.clone(),
        known_effects: s.effects.clone(),
        further_effects: s.candidates.iter().map(Effect::info).collect(),
        tolerance: vec![s.tolerance; layers],
        thickness_tolerance: vec![s.thickness_tolerance; layers],
        surface_tolerance_m: s.surface_tolerance_m,
    }
}

/// Number of blocks replayed so far, shared by all fits of a diagnosis.
pub(crate) type ReplayCount = Arc<AtomicU64>;

/// Recordings in blocks, with their detected force drops and steps of the sensor zero.
#[derive(Clone, Debug)]
pub struct PreparedRecordings {
    /// Assumed tissue with its tolerances.
    pub assumed: Arc<Assumptions>,
    /// Blocks of each recording.
    pub blocks: Arc<Vec<BlockAverages>>,
    /// Steps of the sensor zero of each recording.
    pub zero_steps: Vec<Vec<ZeroStep>>,
    /// Force drops of each recording, without steps of the sensor zero.
    pub drops: Vec<Vec<ForceDrop>>,
    /// Lower bound of the noise standard deviation, in N.
    pub min_noise_sd_n: f64,
    /// Rupture times (s) of the layers in each recording, if they are given instead of assigned.
    pub rupture_times_s: Option<Vec<Vec<f64>>>,
    /// Number of blocks replayed so far, in all fits of the diagnosis.
    pub(crate) replayed: ReplayCount,
    /// Replays of all recordings after which the search for effects ends.
    pub(crate) max_replays: u64,
}

impl PreparedRecordings {
    /// Detects the force drops of the recordings.
    #[must_use]
    pub fn new(assumed: Arc<Assumptions>, blocks: Vec<BlockAverages>, min_noise_sd_n: f64) -> Self {
        let drops = blocks.par_iter().map(detect_force_drops).collect();
        let zero_steps = vec![Vec::new(); blocks.len()];
        Self {
            zero_steps,
            assumed,
            blocks: Arc::new(blocks),
            drops,
            min_noise_sd_n,
            rupture_times_s: None,
            replayed: Arc::default(),
            max_replays: MAX_REPLAYS,
        }
    }

    /// Whether the search for effects has reached its limit. To be asked between fits that run one after another, so that
    /// the answer is the same for any number of threads.
    pub(crate) fn is_search_limit_reached(&self) -> bool {
        let blocks: usize = self.blocks.iter().map(BlockAverages::len).sum();
        self.replayed.load(Ordering::Relaxed) > self.max_replays.saturating_mul(blocks as u64)
    }

    /// The same recordings with these steps of the sensor zero, which are subtracted before force drops are detected again.
    pub(crate) fn with_zero_steps(&self, zero_steps: Vec<Vec<ZeroStep>>) -> Self {
        let without_steps = |(b, steps): (&BlockAverages, &Vec<ZeroStep>)| {
            let mut force_n = b.force_n.clone();
            steps.iter().for_each(|s| s.add_to(&b.start_s, &b.end_s, &mut force_n, -1.0));
            let b = BlockAverages::with_force(b, force_n);
            let mut drops = detect_force_drops(&b);
            drops.retain(|d| steps.iter().all(|s| (s.time_s - d.time_s).abs() > SAME_EVENT_S));
            drops
        };
        let drops = self.blocks.par_iter().zip(&zero_steps).map(without_steps).collect();
        Self { zero_steps, drops, ..self.clone() }
    }

    /// Times (s) of the drops of each recording.
    pub(crate) fn drop_times(&self) -> Vec<Vec<f64>> {
        self.drops.iter().map(|d| d.iter().map(|d| d.time_s).collect()).collect()
    }

    /// Largest minus smallest force in N, which does not depend on an offset.
    fn force_range_n(&self) -> f64 {
        let all = || self.blocks.iter().flat_map(|b| &b.force_n);
        all().fold(f64::NEG_INFINITY, |m, f| m.max(*f)) - all().fold(f64::INFINITY, |m, f| m.min(*f))
    }

    /// Largest force in N.
    pub(crate) fn largest_force_n(&self) -> f64 {
        self.blocks.iter().flat_map(|b| &b.abs_force_n).fold(1e-9, |m: f64, f| m.max(*f))
    }
}

/// Time (s) within which a force drop and a step of the sensor zero are the same event.
pub(crate) const SAME_EVENT_S: f64 = 0.12;
/// Standard deviation of the noise in the first fit, as a share of the largest force: so large that small details do not create local
/// minima.
const FIRST_NOISE_SHARE: f64 = 0.03;

/// A fit leaves unexplained structure when its RMS residual exceeds the noise of the quiet parts by this factor.
pub(crate) const MISFIT_FACTOR: f64 = 1.2;
/// Blocks averaged into one to rank start values.
pub(crate) const COARSENING_FACTOR: usize = 3;
/// Largest share of the objective that a coarse refit with random effects may leave for a full refit to follow.
const MAX_OBJECTIVE_SHARE: f64 = 0.5;

/// Replays of all recordings after which the search for effects ends, summed over all numbers of layers.
pub(crate) const MAX_REPLAYS: u64 = 100_000;

/// Whether a fit leaves only noise: its RMS residual is that of the quiet parts, or what exceeds it is slow noise, which recordings do not
/// have in common.
pub(crate) fn leaves_noise(f: &Fit, data: &FitData) -> bool {
    let calm = data.with_estimated_noise(&f.residuals.residual_n, NoiseSource::Detrended);
    f.rms_n(data) < MISFIT_FACTOR * calm.noise.sd_n() || leaves_slow_noise(f, &calm)
}

/// Whether the RMS residual of a fit is that of the quiet parts; also for coarse blocks.
pub(crate) fn is_rms_that_of_quiet_parts(f: &Fit, data: &FitData) -> bool {
    let calm = data.with_estimated_noise(&f.residuals.residual_n, NoiseSource::Detrended);
    f.rms_n(data) < MISFIT_FACTOR * calm.noise.sd_n()
}

/// Effort of coarse fits and of the first rounds of a full one.
const COARSE_EFFORT: Effort = Effort { max_iterations: 5, min_gain_nats: 0.3 };

/// The model with rupture times updated to the data; `times` are the force drops (s) of each recording.
pub(crate) fn with_updated_times(mut model: Model, data: &FitData, times: &[Vec<f64>]) -> Model {
    update_event_times(&mut model, data, times);
    model
}

/// The data with the noise estimated from the detrended residuals of a model.
pub(crate) fn with_noise_of(model: &Model, data: &FitData) -> Option<FitData> {
    Some(data.with_estimated_noise(&residuals(model, data)?.residual_n, NoiseSource::Detrended))
}

/// Standard deviation (N) of the block means from third differences, which vanish for a smooth force.
pub(crate) fn roughness(blocks: &[BlockAverages]) -> f64 {
    stylet_stats::third_difference_sd(blocks.iter().map(|b| b.force_n.as_slice())).max(1e-6)
}

/// Whether each recording has its own surface position and its own friction factor.
pub(crate) type RandomEffects = (bool, bool);

/// Random effects that are free in a model.
pub(crate) fn random_effects_of(model: &Model) -> RandomEffects {
    (model.free.recording_surface, model.free.recording_friction)
}

/// Fits the base law from the prior; returns the fit and the data with the noise estimated from it. `None` when the model cannot be
/// replayed.
#[must_use]
pub fn fit_base_law(prepared: &PreparedRecordings) -> Option<(Fit, FitData)> {
    fit_from_prior(prepared, &[], (false, false))
}

/// Fits a model with effects from the prior, so that this model determines which drops belong to layers.
///
/// The base law mistakes drops that an effect produces for ruptures and shifts its layers; a fit that starts from there stays in that local
/// minimum.
pub(crate) fn refit_from_prior(
    prepared: &PreparedRecordings,
    effects: &[EffectTerm],
    random_effects: RandomEffects,
    data: &FitData,
) -> Option<Fit> {
    let (found, _) = fit_from_prior(prepared, effects, random_effects)?;
    fit(&with_updated_times(found.model, data, &prepared.drop_times()), data, Effort::FULL)
}

/// As [`refit_from_prior`], on coarser blocks (`coarse`) and with fewer steps, to decide whether a full refit can help.
pub(crate) fn coarse_refit(
    prepared: &PreparedRecordings,
    effects: &[EffectTerm],
    random_effects: RandomEffects,
    coarse: &FitData,
) -> Option<Fit> {
    let averaged = PreparedRecordings { blocks: Arc::clone(&coarse.recordings), ..prepared.clone() };
    let (found, _) = fit_with_assigned_drops(&averaged, effects, random_effects)?;
    let mut model = found.model;
    if random_effects != (false, false) {
        // Rupture times would otherwise be shifted to compensate for the missing random effects.
        model = fit(&model, coarse, COARSE_EFFORT)?.model;
    }
    fit(&with_updated_times(model, coarse, &prepared.drop_times()), coarse, COARSE_EFFORT)
}

/// Refits the base law with a surface position and a friction factor per recording. The refit is kept if it reduces the objective so
/// strongly that the first fit must have mistaken differences between recordings for ruptures.
pub(crate) fn refit_with_random_effects(
    prepared: &PreparedRecordings,
    base_fit: Fit,
    data: FitData,
) -> (Fit, FitData) {
    let refitted = || {
        let calm_data = data.with_estimated_noise(&base_fit.residuals.residual_n, NoiseSource::Detrended);
        if data.recording_count() < 2 || base_fit.rms_n(&data) < MISFIT_FACTOR * calm_data.noise.sd_n() {
            return None;
        }
        let coarse = with_noise_of(&base_fit.model, &data.coarsened(COARSENING_FACTOR))?;
        let current = residuals(&base_fit.model, &coarse)?.nats;
        let coarse_fit = coarse_refit(prepared, &[], (true, true), &coarse)?;
        if coarse_fit.nats() > MAX_OBJECTIVE_SHARE * current {
            return None;
        }
        let model = with_updated_times(coarse_fit.model, &calm_data, &prepared.drop_times());
        let full = fit(&model, &calm_data, Effort::FULL)?;
        let data = calm_data.with_estimated_noise(&full.residuals.residual_n, NoiseSource::Detrended);
        let (refitted, data) =
            select_random_effects(fit_from_zero_scatter(&full.model, &data, Effort::FULL)?, data);
        (refitted.nats() < residuals(&base_fit.model, &data)?.nats).then_some((refitted, data))
    };
    refitted().unwrap_or((base_fit, data))
}

/// Assigns drops to layers and fits the parameters, in turn, under a large white noise.
fn fit_with_assigned_drops(
    prepared: &PreparedRecordings,
    effects: &[EffectTerm],
    random_effects: RandomEffects,
) -> Option<(Fit, FitData)> {
    let rough_n = roughness(&prepared.blocks);
    // With a baseline, the range does not contain the offset.
    let baseline = effects.iter().any(|e| e.info.baseline);
    let largest_n = if baseline { prepared.force_range_n() } else { prepared.largest_force_n() };
    let wide_noise = Noise::white(rough_n.max(FIRST_NOISE_SHARE * largest_n));
    let data = FitData::new(Arc::clone(&prepared.blocks), wide_noise, prepared.min_noise_sd_n)
        .counted_in(&prepared.replayed);
    let mut start = Model::base(Arc::clone(&prepared.assumed), prepared.blocks.len());
    start.free.wide_thickness = true;
    start.zero_steps.clone_from(&prepared.zero_steps);
    (start.free.recording_surface, start.free.recording_friction) = random_effects;
    let model = effects.iter().fold(start, |m, choice| m.with_effect(choice.clone()));
    let mut best: Option<Fit> = None;
    for strictness in [1.0, 0.5] {
        let from = best.as_ref().map_or(&model, |b| &b.model);
        let rupture_times_s = match &prepared.rupture_times_s {
            Some(given) => given.clone(),
            None => assign_ruptures(from, &prepared.blocks, &prepared.drops, strictness, rough_n),
        };
        let next = Model { rupture_times_s, ..from.clone() };
        if let Some(new) = fit(&next, &data, Effort { max_iterations: 4, min_gain_nats: 0.3 })
            && best.as_ref().is_none_or(|b| new.nats() < b.nats())
        {
            best = Some(new);
        }
    }
    Some((best?, data))
}

/// Fit from the prior: assigned drops, then rounds in which noise, rupture times and parameters are updated.
pub(crate) fn fit_from_prior(
    prepared: &PreparedRecordings,
    effects: &[EffectTerm],
    random_effects: RandomEffects,
) -> Option<(Fit, FitData)> {
    let (mut best, mut data) = fit_with_assigned_drops(prepared, effects, random_effects)?;
    let times = prepared.drop_times();
    for round in 0..3 {
        data = data.with_estimated_noise(&best.residuals.residual_n, NoiseSource::Detrended);
        let mut model = best.model.clone();
        if round == 0 && random_effects != (false, false) {
            model = fit(&model, &data, COARSE_EFFORT)?.model;
        }
        let effort = if round == 2 { Effort::FULL } else { COARSE_EFFORT };
        best = fit(&with_updated_times(model, &data, &times), &data, effort)?;
    }
    data = data.with_estimated_noise(&best.residuals.residual_n, NoiseSource::Detrended);
    best = fit_from_zero_scatter(&best.model, &data, Effort::FULL)?;
    Some((best, data))
}

#[cfg(test)]
mod tests;
