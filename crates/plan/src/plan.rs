//! The plan: `plan.json`.

use crate::draw::Begin;
use crate::error::PlanError;
use crate::ground::{Ground, Shown};
use crate::limits::Limits;
use crate::repeats::{Repeats, repeats};
use crate::search::{Found, Searched, search};
use serde::Serialize;
use stylet_diagnose::CLASS_NATS;
use stylet_identify::model::Role;
use stylet_scenario::Motion;

/// Two candidates, and how far apart they are.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Pair {
    /// One.
    pub a: String,
    /// The other.
    pub b: String,
    /// Expected gap of the log-likelihoods from what is at hand, in nats.
    pub nats_before: f64,
    /// The same once the planned insertion has been made as well.
    pub nats_after: f64,
    /// Probability that the truth among the two is the one named, before: one half when nothing tells them apart.
    pub right_before: f64,
    /// The same after.
    pub right_after: f64,
    /// Whether a motion within the limits tells them apart at all.
    pub told: bool,
}

/// A number of the law and how surely it is known.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Sharper {
    /// Such as `layer 1 stiffness_n_per_m`.
    pub name: String,
    /// Half width of the 95 % interval before, relative to what is assumed, or in m for a place.
    pub before: f64,
    /// The same once the planned insertion has been made as well.
    pub after: f64,
}

/// Another motion.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Alternative {
    /// The motion.
    pub motion: Motion,
    /// Nats of the worst pair that can be told apart.
    pub worst_nats: f64,
    /// Probability that the next diagnosis decides, after the gaps.
    pub probability_decided: f64,
    /// Largest force expected in N.
    pub force_n: f64,
    /// Duration in s.
    pub duration_s: f64,
    /// Insertions simulated and diagnosed when the best motions were set against each other.
    pub simulated: usize,
    /// Those after which the diagnosis was right and alone.
    pub decided: usize,
}

/// One candidate's simulated insertions.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Tried {
    /// The candidate.
    pub candidate: String,
    /// Insertions simulated and diagnosed.
    pub of: usize,
    /// Those after which the diagnosis names it alone.
    pub decided: usize,
}

/// The plan.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Plan {
    /// Pairs of candidates.
    pub pairs: Vec<Pair>,
    /// Probability that the next diagnosis names the right single cause.
    pub probability_decided: f64,
    /// The same before the insertion.
    pub probability_now: f64,
    /// Where that number comes from: `gaps` (the expected gaps and how often the diagnosis is right when everything can be
    /// seen) or `simulated` (insertions simulated and diagnosed).
    pub probability_from: String,
    /// Simulated insertions, none of which helped to choose the motion.
    pub simulated: Vec<Tried>,
    /// Candidates with their probabilities before.
    pub candidates: Vec<(String, f64)>,
    /// The motion.
    pub motion: Motion,
    /// Its duration in s.
    pub duration_s: f64,
    /// Its deepest position in m.
    pub depth_m: f64,
    /// Largest force in N that is expected under any candidate, three standard deviations of the noise included.
    pub force_n: f64,
    /// The limits that it keeps.
    pub limits: Limits,
    /// The next best motions.
    pub alternatives: Vec<Alternative>,
    /// Effects that no motion within the limits shows at their typical size.
    pub never: Vec<String>,
    /// Numbers of the law, how surely they are known before and after.
    pub intervals: Vec<Sharper>,
    /// How many insertions at which speeds, when forces at rupture scatter.
    pub repeats: Option<Repeats>,
    /// Motions looked at.
    pub looked_at: usize,
}

/// How often the diagnosis names one strong effect right and alone when everything can be seen: 129 of 138 in
/// `docs/diagnosis.md`, "The present engine". No plan is surer than that.
pub const SEEN_AND_RIGHT: f64 = 0.93;

/// Probability that a gap expected to be `nats` comes out above a class's width: it scatters by `sqrt(2 nats)`.
#[must_use]
pub fn decided(nats: f64) -> f64 {
    if nats <= 0.0 { 0.0 } else { stylet_stats::normal::cdf((nats - CLASS_NATS) / (2.0 * nats).sqrt()) }
}

/// Probability that the diagnosis names what is the case and nothing else, whatever that is among what motions within the limits
/// can tell (`told`: pairs).
#[must_use]
pub fn probability(ground: &Ground, shown: &Shown, told: &[(usize, usize)]) -> f64 {
    let (mut sum, mut weights) = (0.0, 0.0);
    for (i, c) in ground.candidates.iter().enumerate() {
        let of: Vec<f64> = told
            .iter()
            .filter(|(a, b)| *a == i || *b == i)
            .map(|(a, b)| decided(ground.nats(shown, *a, *b)))
            .collect();
        if of.is_empty() {
            continue;
        }
        sum += c.weight * of.into_iter().fold(1.0, f64::min);
        weights += c.weight;
    }
    if weights > 0.0 { SEEN_AND_RIGHT * sum / weights } else { SEEN_AND_RIGHT }
}

/// Plans the next insertion.
///
/// # Errors
/// [`PlanError`] when limits cannot be kept or the law cannot be replayed.
pub fn plan(ground: &Ground, limits: &Limits, begin: &Begin) -> Result<(Plan, Searched), PlanError> {
    let found = search(ground, limits, begin)?;
    let plan = chosen(ground, limits, &found, 0)?;
    Ok((plan, found))
}

/// The plan with one of the motions that were found.
///
/// # Errors
/// [`PlanError::NoForce`] when there is no such motion.
pub(crate) fn chosen(
    ground: &Ground,
    limits: &Limits,
    found: &Searched,
    which: usize,
) -> Result<Plan, PlanError> {
    let Some(best) = found.best.get(which) else {
        return Err(PlanError::NoForce("no motion can be compared".to_owned()));
    };
    let known = ground.known();
    let pairs: Vec<Pair> = ground
        .pairs()
        .into_iter()
        .map(|(a, b)| {
            let (before, after) = (ground.nats(&known, a, b), ground.nats(&best.shown, a, b));
            let even = |nats: f64| 0.5 + 0.5 * decided(nats);
            Pair {
                a: ground.name(a).to_owned(),
                b: ground.name(b).to_owned(),
                nats_before: before,
                nats_after: after,
                right_before: even(before),
                right_after: even(after),
                told: found.told.contains(&(a, b)),
            }
        })
        .collect();
    let worst = |f: &Found| {
        found.told.iter().map(|(a, b)| ground.nats(&f.shown, *a, *b)).fold(f64::INFINITY, f64::min)
    };
    let alternatives = found
        .best
        .iter()
        .enumerate()
        .filter(|(k, _)| *k != which)
        .map(|(_, f)| Alternative {
            worst_nats: if found.told.is_empty() { 0.0 } else { worst(f) },
            probability_decided: probability(ground, &f.shown, &found.told),
            force_n: f.force_n,
            duration_s: f.motion.plan().map_or(0.0, |p| p.duration_s()),
            motion: f.motion.clone(),
            simulated: 0,
            decided: 0,
        })
        .collect();
    let first = |a: usize, b: usize| if ground.name(a) == crate::candidate::NONE { Some(b) } else { None };
    let never =
        found.never.iter().filter_map(|(a, b)| first(*a, *b)).map(|k| ground.name(k).to_owned()).collect();
    let course = best.motion.plan();
    Ok(Plan {
        pairs,
        probability_decided: probability(ground, &best.shown, &found.told),
        probability_now: probability(ground, &known, &found.told),
        probability_from: "gaps".to_owned(),
        simulated: Vec::new(),
        candidates: ground.candidates.iter().map(|c| (c.name.clone(), c.weight)).collect(),
        motion: best.motion.clone(),
        duration_s: course.as_ref().map_or(0.0, |p| p.duration_s()),
        depth_m: course.as_ref().map_or(0.0, |p| p.deepest_m()),
        force_n: best.force_n,
        limits: *limits,
        alternatives,
        never,
        intervals: intervals(ground, &known, &best.shown),
        repeats: if ground.scatter_assumed { None } else { repeats(&ground.stem, limits) },
        looked_at: found.looked_at,
    })
}

fn intervals(ground: &Ground, before: &Shown, after: &Shown) -> Vec<Sharper> {
    let numbers = ground.stem.shared();
    numbers
        .iter()
        .zip(before.sds())
        .zip(after.sds())
        .map(|((n, before), after)| Sharper {
            name: match n.role {
                Role::Stiffness(l) => format!("layer {} stiffness_n_per_m", l + 1),
                Role::Friction(l) => format!("layer {} friction_ns_per_m2", l + 1),
                Role::Puncture(l) => format!("layer {} puncture_n", l + 1),
                Role::Thickness(l) => format!("layer {} thickness_m", l + 1),
                Role::Surface => "surface_m".to_owned(),
                Role::Effect { effect, parameter } => {
                    ground.stem.effects.get(effect).map_or_else(String::new, |e| {
                        format!("{}.{}", e.info.id, e.info.parameters.get(parameter).map_or("", |p| p.path))
                    })
                }
                Role::DaySurface(day) => format!("day {} surface_m", day + 1),
                Role::DayFriction(day) => format!("day {} friction", day + 1),
                Role::OwnSurface | Role::OwnFriction | Role::OwnEffect(_) | Role::Instant(_) => String::new(),
            },
            before: stylet_stats::Z95 * before,
            after: stylet_stats::Z95 * after,
        })
        .collect()
}
