//! The plan of the next insertion: `plan.json`.

use crate::error::PlanError;
use crate::information_state::{Information, InformationState};
use crate::limits::Limits;
use crate::motion_programs::StartConditions;
use crate::motion_search::{EvaluatedMotion, MotionSearchResult, search_motions};
use crate::repeats::{Repeats, plan_repeats};
use serde::Serialize;
use stylet_diagnose::EQUIVALENCE_NATS;
use stylet_identify::model::ParameterRole;
use stylet_scenario::Motion;

/// Two candidates and their separation.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Pair {
    /// One candidate.
    pub a: String,
    /// The other candidate.
    pub b: String,
    /// Expected gap of the log-likelihoods from the available recordings in nats.
    pub nats_before: f64,
    /// The same with the planned insertion included.
    pub nats_after: f64,
    /// Probability, before the insertion, that the diagnosis names the true one of the two; 0.5 if they are not
    /// distinguishable.
    pub p_correct_before: f64,
    /// The same after the insertion.
    pub p_correct_after: f64,
    /// Whether some motion within the limits distinguishes them.
    pub distinguishable: bool,
}

/// Interval of a parameter before and after the planned insertion.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct IntervalChange {
    /// Parameter, such as `layer 1 stiffness_n_per_m`.
    pub name: String,
    /// Half width of the 95 % interval before, relative to the assumed value, or in m for a position.
    pub half_width_before: f64,
    /// The same with the planned insertion included.
    pub half_width_after: f64,
}

/// Another motion.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Alternative {
    /// The motion.
    pub motion: Motion,
    /// Nats of the worst distinguishable pair.
    pub worst_pair_nats: f64,
    /// Probability that the next diagnosis decides, from the expected gaps.
    pub probability_decided: f64,
    /// Largest expected force in N.
    pub force_n: f64,
    /// Duration in s.
    pub duration_s: f64,
    /// Insertions simulated for the selection.
    pub simulated: usize,
    /// Those with a correct and unique diagnosis.
    pub correct: usize,
}

/// Simulated insertions of one candidate.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CandidateTrials {
    /// The candidate.
    pub candidate: String,
    /// Insertions simulated and diagnosed.
    pub trials: usize,
    /// Those with a correct and unique diagnosis.
    pub correct: usize,
}

/// The plan.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Plan {
    /// Pairs of candidates.
    pub pairs: Vec<Pair>,
    /// Probability that the next diagnosis names the correct single effect.
    pub probability_decided: f64,
    /// The same before the insertion.
    pub probability_now: f64,
    /// Source of the probability: `gaps` (expected gaps and the share of correct diagnoses when everything is
    /// identifiable) or `simulated` (insertions simulated and diagnosed).
    pub probability_source: String,
    /// Simulated insertions not used to select the motion.
    pub simulated: Vec<CandidateTrials>,
    /// Effects that the diagnosis has already named; every candidate includes them.
    pub already_named: Vec<String>,
    /// Candidates with their prior probabilities.
    pub candidates: Vec<(String, f64)>,
    /// The motion.
    pub motion: Motion,
    /// Its duration in s.
    pub duration_s: f64,
    /// Its deepest position in m.
    pub depth_m: f64,
    /// Largest force in N expected under any candidate, plus three standard deviations of the noise.
    pub force_n: f64,
    /// The limits that it satisfies.
    pub limits: Limits,
    /// The next best motions.
    pub alternatives: Vec<Alternative>,
    /// Effects that no motion within the limits shows at their typical size.
    pub never_detectable: Vec<String>,
    /// Intervals of the base parameters before and after.
    pub intervals: Vec<IntervalChange>,
    /// Repeated insertions and their speeds, when rupture forces scatter.
    pub repeats: Option<Repeats>,
    /// Number of evaluated motions.
    pub motions_evaluated: usize,
}

/// Share of correct unique diagnoses of one strong effect when everything is identifiable: 129 of 138 in
/// `docs/explanation/validation.md`, "One strong effect". An upper bound on the probability of every plan.
pub const P_CORRECT_WHEN_DETECTABLE: f64 = 0.93;

/// Probability that a gap with expectation `nats` exceeds the width of a class: its standard deviation is
/// `sqrt(2 nats)`.
#[must_use]
pub fn p_separated(nats: f64) -> f64 {
    if nats <= 0.0 { 0.0 } else { stylet_stats::normal::cdf((nats - EQUIVALENCE_NATS) / (2.0 * nats).sqrt()) }
}

/// Probability that the diagnosis names the true effect and nothing else, over the candidates in `distinguishable`, the
/// pairs that motions within the limits can distinguish.
#[must_use]
pub fn p_decided(
    state: &InformationState,
    information: &Information,
    distinguishable: &[(usize, usize)],
) -> f64 {
    let (mut sum, mut weights) = (0.0, 0.0);
    for (i, c) in state.candidates.iter().enumerate() {
        let of: Vec<f64> = distinguishable
            .iter()
            .filter(|(a, b)| *a == i || *b == i)
            .map(|(a, b)| p_separated(state.separation_nats(information, *a, *b)))
            .collect();
        if of.is_empty() {
            continue;
        }
        sum += c.probability * of.into_iter().fold(1.0, f64::min);
        weights += c.probability;
    }
    if weights > 0.0 { P_CORRECT_WHEN_DETECTABLE * sum / weights } else { P_CORRECT_WHEN_DETECTABLE }
}

/// Plans the next insertion.
///
/// # Errors
/// [`PlanError`] when the limits cannot be satisfied or the model cannot be replayed.
pub fn plan(
    state: &InformationState,
    limits: &Limits,
    begin: &StartConditions,
) -> Result<(Plan, MotionSearchResult), PlanError> {
    let found = search_motions(state, limits, begin)?;
    let plan = plan_with_motion(state, limits, &found, 0)?;
    Ok((plan, found))
}

/// The plan with one of the motions found.
///
/// # Errors
/// [`PlanError::NoForce`] when there is no such motion.
pub(crate) fn plan_with_motion(
    state: &InformationState,
    limits: &Limits,
    found: &MotionSearchResult,
    which: usize,
) -> Result<Plan, PlanError> {
    let Some(best) = found.best.get(which) else {
        return Err(PlanError::NoForce("no motion can be compared".to_owned()));
    };
    let known = state.current();
    let pairs: Vec<Pair> = state
        .pairs()
        .into_iter()
        .map(|(a, b)| {
            let (before, after) =
                (state.separation_nats(&known, a, b), state.separation_nats(&best.information, a, b));
            let even = |nats: f64| 0.5 + 0.5 * p_separated(nats);
            Pair {
                a: state.name(a).to_owned(),
                b: state.name(b).to_owned(),
                nats_before: before,
                nats_after: after,
                p_correct_before: even(before),
                p_correct_after: even(after),
                distinguishable: found.distinguishable.contains(&(a, b)),
            }
        })
        .collect();
    let worst = |f: &EvaluatedMotion| {
        found
            .distinguishable
            .iter()
            .map(|(a, b)| state.separation_nats(&f.information, *a, *b))
            .fold(f64::INFINITY, f64::min)
    };
    let alternatives = found
        .best
        .iter()
        .enumerate()
        .filter(|(k, _)| *k != which)
        .map(|(_, f)| Alternative {
            worst_pair_nats: if found.distinguishable.is_empty() { 0.0 } else { worst(f) },
            probability_decided: p_decided(state, &f.information, &found.distinguishable),
            force_n: f.force_n,
            duration_s: f.motion.plan().map_or(0.0, |p| p.duration_s()),
            motion: f.motion.clone(),
            simulated: 0,
            correct: 0,
        })
        .collect();
    let first = |a: usize, b: usize| if state.name(a) == crate::candidate::NONE { Some(b) } else { None };
    let never = found
        .indistinguishable
        .iter()
        .filter_map(|(a, b)| first(*a, *b))
        .map(|k| state.name(k).to_owned())
        .collect();
    let profile = best.motion.plan();
    Ok(Plan {
        pairs,
        probability_decided: p_decided(state, &best.information, &found.distinguishable),
        probability_now: p_decided(state, &known, &found.distinguishable),
        probability_source: "gaps".to_owned(),
        simulated: Vec::new(),
        already_named: state.base.effects.iter().map(|e| e.info.id.to_owned()).collect(),
        candidates: state.candidates.iter().map(|c| (c.name.clone(), c.probability)).collect(),
        motion: best.motion.clone(),
        duration_s: profile.as_ref().map_or(0.0, |p| p.duration_s()),
        depth_m: profile.as_ref().map_or(0.0, |p| p.deepest_m()),
        force_n: best.force_n,
        limits: *limits,
        alternatives,
        never_detectable: never,
        intervals: interval_changes(state, &known, &best.information),
        repeats: if state.scatter_assumed { None } else { plan_repeats(&state.base, limits) },
        motions_evaluated: found.motions_evaluated,
    })
}

fn interval_changes(
    state: &InformationState,
    before: &Information,
    after: &Information,
) -> Vec<IntervalChange> {
    let parameters = state.base.shared_parameters();
    parameters
        .iter()
        .zip(before.sds())
        .zip(after.sds())
        .map(|((n, before), after)| IntervalChange {
            name: match n.role {
                ParameterRole::Stiffness(l) => format!("layer {} stiffness_n_per_m", l + 1),
                ParameterRole::Friction(l) => format!("layer {} friction_ns_per_m2", l + 1),
                ParameterRole::Puncture(l) => format!("layer {} puncture_n", l + 1),
                ParameterRole::Thickness(l) => format!("layer {} thickness_m", l + 1),
                ParameterRole::Surface => "surface_m".to_owned(),
                ParameterRole::Effect { effect, parameter } => {
                    state.base.effects.get(effect).map_or_else(String::new, |e| {
                        format!("{}.{}", e.info.id, e.info.parameters.get(parameter).map_or("", |p| p.path))
                    })
                }
                ParameterRole::DaySurface(day) => format!("day {} surface_m", day + 1),
                ParameterRole::DayFriction(day) => format!("day {} friction", day + 1),
                ParameterRole::RecordingSurface
                | ParameterRole::RecordingFriction
                | ParameterRole::RecordingEffect(_)
                | ParameterRole::ZeroStep(_)
                | ParameterRole::RuptureTime(_) => String::new(),
            },
            half_width_before: stylet_stats::Z95 * before,
            half_width_after: stylet_stats::Z95 * after,
        })
        .collect()
}
