//! Candidates and information from which planning starts: from a diagnosis, or from a scenario without
//! measurements.

use crate::candidate::{Candidate, typical_effect};
use crate::error::PlanError;
use crate::information_state::{InformationState, motion_to_recording};
use crate::motion_programs::StartConditions;
use std::sync::Arc;
use stylet_diagnose::{DiagnosisResult, EQUIVALENCE_NATS, Verdict, assumptions_of};
use stylet_identify::block_averages::{BLOCK_S, BlockAverages};
use stylet_identify::forward_model::free_rupture_times;
use stylet_identify::likelihood::motion_pieces;
use stylet_identify::model::{EffectTerm, Model};
use stylet_identify::noise::Noise;
use stylet_scenario::{Motion, Scenario};
use stylet_tissue::{AnyEffect, Effect};

/// Total probability of effects that were not detected.
const OTHER_EFFECTS_PROBABILITY: f64 = 0.5;
/// Start in m above the surface without a recording.
const START_ABOVE_SURFACE_M: f64 = 0.005;
/// Largest travel in m beyond the tissue.
const BEYOND_TISSUE_M: f64 = 0.003;
/// Noise in N if the scenario's sensor states none.
const DEFAULT_NOISE_N: f64 = 0.05;

/// Initial position and sampling of the next insertion.
#[must_use]
pub fn start_conditions(scenario: &Scenario, start_m: Option<f64>) -> StartConditions {
    let surface_m = scenario.tissue.surface_m;
    let depth_m: f64 = scenario.tissue.layers.iter().map(|l| l.thickness_m).sum();
    StartConditions {
        start_m: start_m.unwrap_or(surface_m - START_ABOVE_SURFACE_M).min(surface_m - 0.001),
        surface_m,
        max_depth_m: surface_m + depth_m + BEYOND_TISSUE_M,
        sample_hz: scenario.sample_hz,
    }
}

/// Information and candidates after a diagnosis: the class that it could not resolve, or else the effects that
/// were not identifiable.
///
/// # Errors
/// [`PlanError::NoForce`] when the model cannot be replayed.
pub fn from_diagnosis(
    scenario: &Scenario,
    examined: &DiagnosisResult,
) -> Result<(InformationState, StartConditions), PlanError> {
    let d = &examined.diagnosis;
    let search = &examined.search;
    let best = &search.best.model;
    let ambiguous = d
        .causes
        .iter()
        .filter(|c| !c.equivalent.is_empty())
        .find_map(|c| best.effects.iter().position(|e| e.info.id == c.effect));
    let mut candidates = Vec::new();
    let mut base = best.clone();
    if let Some(k) = ambiguous {
        base = best.without_effect(k);
        candidates.push(Candidate::with_effect(best.effects[k].clone(), 1.0));
        for alternative in examined
            .competing_effects
            .get(k)
            .into_iter()
            .flatten()
            .filter(|r| r.nats_behind < EQUIVALENCE_NATS)
        {
            candidates.push(Candidate::with_effect(
                alternative.choice.clone(),
                libm::exp(-alternative.nats_behind.max(-3.0)),
            ));
        }
    } else {
        candidates.push(Candidate::without_effect(1.0));
    }
    let sum: f64 = candidates.iter().map(|c| c.probability).sum();
    let named: Vec<&str> = base.effects.iter().map(|e| e.info.id).collect();
    let others: Vec<EffectTerm> = base
        .assumed
        .candidates()
        .filter(|i| d.not_identifiable.iter().any(|n| n == i.id) && !named.contains(&i.id))
        .filter(|i| candidates.iter().all(|c| c.name != i.id))
        .filter_map(typical_effect)
        .collect();
    let other_probability = if others.is_empty() {
        0.0
    } else if ambiguous.is_some() {
        0.5 * OTHER_EFFECTS_PROBABILITY
    } else {
        OTHER_EFFECTS_PROBABILITY
    };
    candidates.iter_mut().for_each(|c| c.probability *= (1.0 - other_probability) / sum);
    let each = other_probability / others.len().max(1) as f64;
    candidates.extend(others.into_iter().map(|c| Candidate::with_effect(c, each)));
    let unknown = (d.verdict == Verdict::Unknown).then_some(d.gain.rmse_after_n.max(d.noise.sd_n));
    let first = |b: &BlockAverages| b.sample_time_s.first().map(|t| b.motion.at(*t).0);
    let start = search.data.recordings.iter().filter_map(first).fold(f64::INFINITY, f64::min);
    let state = InformationState::new(
        base,
        candidates,
        unknown.filter(|n| n.is_finite()),
        &search.data.recordings,
        (*search.data.noise).clone(),
        scenario.sample_hz,
    )
    .ok_or_else(PlanError::no_force)?;
    Ok((state, start_conditions(scenario, start.is_finite().then_some(start))))
}

/// Every effect of the library at its typical size in addition to the diagnosed model, over the available
/// recordings.
///
/// # Errors
/// [`PlanError::NoForce`] when the model cannot be replayed.
pub fn from_recordings(
    scenario: &Scenario,
    examined: &DiagnosisResult,
) -> Result<InformationState, PlanError> {
    let search = &examined.search;
    let base = search.best.model.clone();
    let mut candidates = vec![Candidate::without_effect(1.0 - OTHER_EFFECTS_PROBABILITY)];
    let found = |id: &str| base.effects.iter().any(|e| e.info.id == id);
    candidates.extend(
        base.assumed
            .candidates()
            .filter(|i| !found(i.id))
            .filter_map(typical_effect)
            .map(|c| Candidate::with_effect(c, 0.02)),
    );
    let noise = (*search.data.noise).clone();
    InformationState::new(base, candidates, None, &search.data.recordings, noise, scenario.sample_hz)
        .ok_or_else(PlanError::no_force)
}

/// Candidates before any measurement: no effect, or any one effect of the library at its typical size. The
/// scenario's own motion, or the given one, counts as executed.
///
/// # Errors
/// [`PlanError::NoForce`] when the model cannot be replayed along the motion.
pub fn from_scenario(
    scenario: &Scenario,
    motion: Option<&Motion>,
) -> Result<(InformationState, StartConditions), PlanError> {
    let motion = motion.unwrap_or(&scenario.motion);
    let recording = motion_to_recording(motion, scenario.sample_hz);
    let start = recording.as_ref().and_then(|r| r.position_m.first().copied());
    let recordings: Vec<BlockAverages> =
        recording.iter().map(|r| BlockAverages::new(r, &[], BLOCK_S)).collect();
    let mut base = Model::base(Arc::new(assumptions_of(scenario)), recordings.len().max(1));
    for (r, b) in recordings.iter().enumerate() {
        let compiled = base.compile(r).ok_or_else(PlanError::no_force)?;
        base.rupture_times_s[r] = free_rupture_times(&compiled, &motion_pieces(&compiled, b));
    }
    let known: Vec<&str> = scenario.effects.iter().map(|e| e.info().id).collect();
    let terms: Vec<EffectTerm> =
        base.assumed.candidates().filter(|i| !known.contains(&i.id)).filter_map(typical_effect).collect();
    let each = OTHER_EFFECTS_PROBABILITY / terms.len().max(1) as f64;
    let mut candidates = vec![Candidate::without_effect(1.0 - OTHER_EFFECTS_PROBABILITY)];
    candidates.extend(terms.into_iter().map(|c| Candidate::with_effect(c, each)));
    let state = InformationState::new(
        base,
        candidates,
        None,
        &recordings,
        sensor_noise(scenario),
        scenario.sample_hz,
    )
    .ok_or_else(PlanError::no_force)?;
    Ok((state, start_conditions(scenario, start)))
}

/// Noise of blocks for a scenario's sensor: first-order autoregressive noise is white over a block, with its
/// long-run variance.
fn sensor_noise(scenario: &Scenario) -> Noise {
    let (sd_n, pole) = scenario.sensor.force_torque().map_or((DEFAULT_NOISE_N, 0.0), |s| (s.noise_n, s.ar1));
    let samples = (BLOCK_S * scenario.sample_hz).round().max(1.0);
    let pole = pole.clamp(-0.95, 0.95);
    Noise::white((sd_n.max(1e-4) * ((1.0 + pole) / (1.0 - pole)).sqrt() / samples.sqrt()).max(1e-5))
}

/// A candidate as a scenario that can be simulated.
#[must_use]
pub fn candidate_scenario(
    assumed: &Scenario,
    state: &InformationState,
    which: usize,
    motion: &Motion,
) -> Scenario {
    let model = state.candidate_model(which);
    let mut effects: Vec<AnyEffect> = assumed.effects.clone();
    effects.extend(model.effects.iter().filter_map(EffectTerm::effect));
    Scenario { tissue: model.tissue.clone(), effects, motion: motion.clone(), ..assumed.clone() }
}
