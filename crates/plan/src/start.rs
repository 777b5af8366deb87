//! Where planning starts: from a diagnosis, or from a scenario that nothing has been compared with.

use crate::candidate::{Candidate, typical};
use crate::draw::Begin;
use crate::error::PlanError;
use crate::ground::{Ground, sampled};
use std::sync::Arc;
use stylet_diagnose::{CLASS_NATS, Examined, Verdict, belief};
use stylet_identify::blocks::{BLOCK_S, Blocks};
use stylet_identify::forward::free;
use stylet_identify::model::{Choice, Model};
use stylet_identify::noise::Noise;
use stylet_identify::objective::pieces;
use stylet_scenario::{Motion, Scenario};
use stylet_tissue::{AnyEffect, Effect, library};

/// What may be the case beside what was named has this probability in all.
const UNSEEN: f64 = 0.5;
/// The needle starts this far in m before the surface when no recording says otherwise.
const AIR_M: f64 = 0.005;
/// No motion goes further than this in m beyond the tissue.
const BEYOND_M: f64 = 0.003;
/// Noise in N where the scenario's sensor does not state one.
const NOISE_N: f64 = 0.05;

/// Where an insertion may start.
#[must_use]
pub fn begin(scenario: &Scenario, start_m: Option<f64>) -> Begin {
    let surface_m = scenario.tissue.surface_m;
    let depth_m: f64 = scenario.tissue.layers.iter().map(|l| l.thickness_m).sum();
    Begin {
        start_m: start_m.unwrap_or(surface_m - AIR_M).min(surface_m - 0.001),
        surface_m,
        end_m: surface_m + depth_m + BEYOND_M,
        sample_hz: scenario.sample_hz,
    }
}

/// What is known and what may be the case after a diagnosis: the class that it could not split, or, when there is none, what it
/// could not see. Gains are left out: a gain of the sensor is other coefficients, whatever the motion.
///
/// # Errors
/// [`PlanError::NoForce`] when the model cannot be replayed.
pub fn from_diagnosis(scenario: &Scenario, examined: &Examined) -> Result<(Ground, Begin), PlanError> {
    let d = &examined.diagnosis;
    let search = &examined.search;
    let best = &search.best.model;
    let ambiguous = d
        .causes
        .iter()
        .filter(|c| !c.equivalent.is_empty())
        .find_map(|c| best.effects.iter().position(|e| e.info.id == c.effect));
    let mut candidates = Vec::new();
    let mut stem = best.clone();
    if let Some(k) = ambiguous {
        stem = best.without(k);
        candidates.push(Candidate::of(best.effects[k].clone(), 1.0));
        for rival in examined.classes.get(k).into_iter().flatten().filter(|r| r.behind < CLASS_NATS) {
            candidates.push(Candidate::of(rival.choice.clone(), libm::exp(-rival.behind.max(-3.0))));
        }
    } else {
        candidates.push(Candidate::none(1.0));
    }
    let sum: f64 = candidates.iter().map(|c| c.weight).sum();
    let named: Vec<&str> = stem.effects.iter().map(|e| e.info.id).collect();
    let hidden: Vec<Choice> = library()
        .filter(|i| d.invisible.iter().any(|n| n == i.id) && !named.contains(&i.id))
        .filter(|i| candidates.iter().all(|c| c.name != i.id))
        .filter_map(typical)
        .collect();
    let unseen = if hidden.is_empty() {
        0.0
    } else if ambiguous.is_some() {
        0.5 * UNSEEN
    } else {
        UNSEEN
    };
    candidates.iter_mut().for_each(|c| c.weight *= (1.0 - unseen) / sum);
    let each = unseen / hidden.len().max(1) as f64;
    candidates.extend(hidden.into_iter().map(|c| Candidate::of(c, each)));
    let unknown = (d.verdict == Verdict::Unknown).then_some(d.gain.rmse_after_n.max(d.noise.sd_n));
    let first = |b: &Blocks| b.raw_t.first().map(|t| b.motion.at(*t).0);
    let start = search.data.blocks.iter().filter_map(first).fold(f64::INFINITY, f64::min);
    let ground = Ground::new(
        stem,
        candidates,
        unknown.filter(|n| n.is_finite()),
        &search.data.blocks,
        (*search.data.noise).clone(),
        scenario.sample_hz,
    )
    .ok_or_else(|| PlanError::NoForce("check stiffness, friction and effects of the scenario".to_owned()))?;
    Ok((ground, begin(scenario, start.is_finite().then_some(start))))
}

/// Every effect of the library at its typical size beside what a diagnosis settled, over the recordings at hand: what they can show.
///
/// # Errors
/// [`PlanError::NoForce`] when the model cannot be replayed.
pub fn of_recordings(scenario: &Scenario, examined: &Examined) -> Result<Ground, PlanError> {
    let search = &examined.search;
    let stem = search.best.model.clone();
    let mut candidates = vec![Candidate::none(1.0 - UNSEEN)];
    let found = |id: &str| stem.effects.iter().any(|e| e.info.id == id);
    candidates.extend(library().filter(|i| !found(i.id)).filter_map(typical).map(|c| Candidate::of(c, 0.02)));
    let noise = (*search.data.noise).clone();
    Ground::new(stem, candidates, None, &search.data.blocks, noise, scenario.sample_hz)
        .ok_or_else(|| PlanError::NoForce("check stiffness, friction and effects of the scenario".to_owned()))
}

/// What may be the case before any measurement: nothing, or any one effect of the library at its typical size. The scenario's own
/// motion, or the one given, counts as made.
///
/// # Errors
/// [`PlanError::NoForce`] when the law cannot be replayed along the motion.
pub fn from_scenario(scenario: &Scenario, made: Option<&Motion>) -> Result<(Ground, Begin), PlanError> {
    let made = made.unwrap_or(&scenario.motion);
    let recording = sampled(made, scenario.sample_hz);
    let start = recording.as_ref().and_then(|r| r.position_m.first().copied());
    let old: Vec<Blocks> = recording.iter().map(|r| Blocks::new(r, &[], BLOCK_S)).collect();
    let mut stem = Model::base(Arc::new(belief(scenario)), old.len().max(1));
    let failed = || PlanError::NoForce("check stiffness, friction and effects of the scenario".to_owned());
    for (r, b) in old.iter().enumerate() {
        let compiled = stem.compile(r).ok_or_else(failed)?;
        stem.instants[r] = free(&compiled, &pieces(&compiled, b));
    }
    let given: Vec<&str> = scenario.effects.iter().map(|e| e.info().id).collect();
    let choices: Vec<Choice> = library().filter(|i| !given.contains(&i.id)).filter_map(typical).collect();
    let each = UNSEEN / choices.len().max(1) as f64;
    let mut candidates = vec![Candidate::none(1.0 - UNSEEN)];
    candidates.extend(choices.into_iter().map(|c| Candidate::of(c, each)));
    let ground =
        Ground::new(stem, candidates, None, &old, noise(scenario), scenario.sample_hz).ok_or_else(failed)?;
    Ok((ground, begin(scenario, start)))
}

/// The noise of blocks that a scenario's sensor makes: an autoregression of first order is white over a block, and as large as it
/// adds up to.
fn noise(scenario: &Scenario) -> Noise {
    let (sd_n, pole) = scenario.sensor.force_torque().map_or((NOISE_N, 0.0), |s| (s.noise_n, s.ar1));
    let samples = (BLOCK_S * scenario.sample_hz).round().max(1.0);
    let pole = pole.clamp(-0.95, 0.95);
    Noise::white((sd_n.max(1e-4) * ((1.0 + pole) / (1.0 - pole)).sqrt() / samples.sqrt()).max(1e-5))
}

/// A candidate as a scenario that can be simulated.
#[must_use]
pub fn scenario_of(believed: &Scenario, ground: &Ground, which: usize, motion: &Motion) -> Scenario {
    let model = ground.model(which);
    let mut effects: Vec<AnyEffect> = believed.effects.clone();
    effects.extend(model.effects.iter().filter_map(Choice::effect));
    Scenario { tissue: model.tissue.clone(), effects, motion: motion.clone(), ..believed.clone() }
}
