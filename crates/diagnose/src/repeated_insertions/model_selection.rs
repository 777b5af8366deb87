//! Selects the model of repeated recordings by cross-validation: base law, base law with library effects, or stick-slip of the shaft.

use super::ablation::{ModelTerm, ablate};
use super::multistart_fit::{fit_from, set_blocks};
use super::scored_model::{ModelFamily, ScoredModel, active_effects};
use super::segmented_recording::{SegmentedRecording, group_by_speed_and_stroke};
use super::start_values::base_law_prior;
use super::stick_slip_fit::fit_stick_slip;
use crate::base_law_fit::{PreparedRecordings, assumptions_of, roughness};
use crate::measured_start::search_from_any_start;
use rand::rngs::ChaCha8Rng;
use std::sync::Arc;
use stylet_identify::model::{Model, RecordingParameters};
use stylet_identify::rupture_assignment::assign_ruptures;
use stylet_record::Recording;
use stylet_record::sensor_artefacts::SensorArtefacts;
use stylet_scenario::Scenario;
use stylet_tissue::Tissue;

/// Approximate number of recordings used in the search of the effect library, which limits its cost.
const SEARCH_RECORDINGS: usize = 6;
/// Smallest relative improvement of the held-out error over the base law for another model.
const MIN_IMPROVEMENT: f64 = 0.02;
/// Number of effects above which a library model needs a margin over the single stick-slip mechanism.
const FEW_EFFECTS: usize = 2;
/// Share by which the held-out error of a library model with many effects must be smaller than that of the stick-slip model.
const MANY_EFFECTS_MARGIN: f64 = 0.1;

/// Candidate models of repeated recordings.
#[derive(Clone, Debug)]
pub struct CandidateModels {
    /// Base law.
    pub base: ScoredModel,
    /// Base law with library effects, if the search added any.
    pub library: Option<ScoredModel>,
    /// Stick-slip model, if it could be fitted.
    pub slip: Option<ScoredModel>,
    /// Model with the smallest held-out error; the base law if no other improves enough.
    pub best: ScoredModel,
    /// Terms of the best model.
    pub terms: Vec<ModelTerm>,
}

/// Fits and compares the candidate models: from the numbers of a scenario, if there is one, as a diagnosis of single recordings does, and from
/// those in the data. `None` when the base law cannot be fitted.
pub(crate) fn select_model(
    (assumed, scenario): (&Tissue, Option<&Scenario>),
    recordings: &[&SegmentedRecording],
    artefacts: &SensorArtefacts,
    rng: &mut ChaCha8Rng,
    progress: &mut dyn FnMut(&str),
) -> Option<CandidateModels> {
    progress("fitting the base law");
    let prepared = PreparedRecordings::new(
        Arc::new(scenario.map_or_else(|| base_law_prior(assumed, recordings), assumptions_of)),
        set_blocks(recordings, artefacts),
        artefacts.quantisation_sd_n(),
    );
    let (searched, which) = search_subset(&prepared, recordings);
    let clean: Vec<Recording> = which.iter().map(|r| recordings[*r].recording.clone()).collect();
    let (search, _) = search_from_any_start(searched, &clean, progress)?;
    let drops = prepared.drop_times();
    let on = |model: &Model| {
        let mut model = model.clone();
        model.per_recording = vec![RecordingParameters::default(); recordings.len()];
        model.zero_steps = vec![Vec::new(); recordings.len()];
        (model.free.recording_surface, model.free.recording_friction) = (true, true);
        let assigned =
            assign_ruptures(&model, &prepared.blocks, &prepared.drops, 1.0, roughness(&prepared.blocks));
        let fitted = |r: usize| which.iter().position(|w| *w == r).map(|i| model.rupture_times_s[i].clone());
        model.rupture_times_s =
            assigned.into_iter().enumerate().map(|(r, times_s)| fitted(r).unwrap_or(times_s)).collect();
        fit_from(&model, prepared.blocks.to_vec(), drops.clone())
    };
    let base = ScoredModel::new(ModelFamily::Base, on(&search.base.model)?, recordings);
    let library = (!search.best.model.effects.is_empty())
        .then(|| on(&search.best.model))
        .flatten()
        .map(|f| ScoredModel::new(ModelFamily::Library, f, recordings));
    // Where only noise is left, there is nothing that another mechanism could explain; steps of the sensor zero are not kept. Assumed effects
    // are no part of the stick-slip model.
    let is_explained = search.leaves_noise(&search.best) && search.best.model.zero_step_count() == 0;
    let is_tried = !is_explained && scenario.is_none_or(|s| s.effects.is_empty());
    let slip = is_tried
        .then(|| {
            progress("fitting the stick-slip model from several starts");
            fit_stick_slip(assumed, recordings, artefacts, rng)
        })
        .flatten();
    let mut best = best_candidate(&base, slip.as_ref(), library.as_ref()).clone();
    progress("testing the terms of the model");
    let parts = ablate(&mut best, recordings);
    Some(CandidateModels { base, library, slip, best, terms: parts })
}

/// Candidate with the smallest held-out error; the base law unless another improves on it by [`MIN_IMPROVEMENT`].
pub(super) fn best_candidate<'a>(
    base: &'a ScoredModel,
    slip: Option<&'a ScoredModel>,
    library: Option<&'a ScoredModel>,
) -> &'a ScoredModel {
    let mut best = base;
    for candidate in slip.into_iter().chain(library) {
        let improves = candidate.held_out_n() < (1.0 - MIN_IMPROVEMENT) * base.held_out_n();
        let many = candidate.family == ModelFamily::Library
            && best.family == ModelFamily::ShaftSlip
            && active_effects(&candidate.set_fit.fit.model).len() > FEW_EFFECTS;
        let margin = if many { MANY_EFFECTS_MARGIN } else { 0.0 };
        if improves && candidate.held_out_n() < (1.0 - margin) * best.held_out_n() {
            best = candidate;
        }
    }
    best
}

/// About [`SEARCH_RECORDINGS`] recordings with equal numbers from each group, and their indices.
fn search_subset(
    prepared: &PreparedRecordings,
    recordings: &[&SegmentedRecording],
) -> (PreparedRecordings, Vec<usize>) {
    let groups = group_by_speed_and_stroke(recordings);
    let each = (SEARCH_RECORDINGS / groups.len().max(1)).max(1);
    let mut which: Vec<usize> = groups.iter().flat_map(|g| g.iter().take(each).copied()).collect();
    which.sort_unstable();
    let part = PreparedRecordings {
        zero_steps: which.iter().map(|r| prepared.zero_steps[*r].clone()).collect(),
        blocks: Arc::new(which.iter().map(|r| prepared.blocks[*r].clone()).collect()),
        drops: which.iter().map(|r| prepared.drops[*r].clone()).collect(),
        rupture_times_s: None,
        // The report of a set does not say that a search was cut short, so none is.
        max_replays: u64::MAX,
        ..prepared.clone()
    };
    (part, which)
}

#[cfg(test)]
mod tests;
