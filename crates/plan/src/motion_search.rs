//! Searches the motion that best separates the candidates: low-discrepancy sampling, then refinement.

use crate::error::PlanError;
use crate::information_state::{Information, InformationState};
use crate::limits::Limits;
use crate::motion_programs::{
    DIMENSIONS, StartConditions, infeasibility, low_discrepancy_point, motion_from_point,
};
use stylet_identify::block_averages::BlockAverages;
use stylet_scenario::Motion;
use stylet_stats::parallel::*;

/// Number of sampled motions.
const SAMPLED_MOTIONS: usize = 200;
/// Number of motions that are refined, steps of the refinement, and trials per step.
const REFINED_MOTIONS: usize = 2;
const REFINEMENT_STEPS: usize = 4;
const NEIGHBOURS_PER_STEP: usize = 8;
/// Nats from which on a pair counts as distinguishable.
pub const DISTINGUISHABLE_NATS: f64 = 10.0;
/// Nats beyond which a larger separation does not change a diagnosis.
const MAX_USEFUL_NATS: f64 = 400.0;
/// Weight of the mean over all pairs relative to the worst pair.
const MEAN_PAIR_WEIGHT: f64 = 0.02;

/// A motion with its information.
#[derive(Clone, Debug)]
pub struct EvaluatedMotion {
    /// The motion.
    pub motion: Motion,
    /// Information after the motion.
    pub information: Information,
    /// Objective: nats of the worst pair, or the gain of information without a pair.
    pub score: f64,
    /// Largest force in N expected under any candidate.
    pub force_n: f64,
    point: Vec<f64>,
}

/// Result of a search.
pub struct MotionSearchResult {
    /// The best motion first, then the next best ones.
    pub best: Vec<EvaluatedMotion>,
    /// Pairs that some motion within the limits distinguishes.
    pub distinguishable: Vec<(usize, usize)>,
    /// Pairs that no motion distinguishes.
    pub indistinguishable: Vec<(usize, usize)>,
    /// Number of evaluated motions.
    pub motions_evaluated: usize,
}

/// Objective of a motion.
fn score(state: &InformationState, information: &Information, pairs: &[(usize, usize)], known: f64) -> f64 {
    if pairs.is_empty() {
        return information.half_log_det() - known;
    }
    let (mut worst, mut sum) = (f64::INFINITY, 0.0);
    for (a, b) in pairs {
        let weight = |k: usize| state.candidates.get(k).map_or(0.05, |c| c.probability).max(1e-3);
        // Prior odds count as nats of the gap.
        let nats = state.separation_nats(information, *a, *b).min(MAX_USEFUL_NATS);
        worst = worst.min(nats - libm::log(weight(*a) * weight(*b)));
        sum += nats;
    }
    worst + MEAN_PAIR_WEIGHT * sum / pairs.len() as f64
}

/// Searches the best motions within limits.
///
/// # Errors
/// [`PlanError::Infeasible`] when no motion satisfies the limits, [`PlanError::NoForce`] when none can
/// be replayed.
pub fn search_motions(
    state: &InformationState,
    limits: &Limits,
    begin: &StartConditions,
) -> Result<MotionSearchResult, PlanError> {
    limits.check()?;
    if let Some((why, remedy)) = infeasibility(limits, begin) {
        return Err(PlanError::Infeasible { why, remedy });
    }
    let points: Vec<Vec<f64>> = (0..SAMPLED_MOTIONS).map(low_discrepancy_point).collect();
    let sampled: Vec<(Vec<f64>, Motion)> =
        points.into_iter().filter_map(|p| motion_from_point(&p, limits, begin).map(|m| (p, m))).collect();
    if sampled.is_empty() {
        return Err(PlanError::Infeasible {
            why: format!(
                "none of {SAMPLED_MOTIONS} sampled programs reaches {:.1} mm and stops within {} s",
                1e3 * limits.depth_m.min(begin.max_depth_m),
                limits.duration_s
            ),
            remedy: "give it more time, or allow a higher speed or acceleration".to_owned(),
        });
    }
    let blocks: Vec<Option<BlockAverages>> =
        sampled.par_iter().map(|(_, m)| state.motion_blocks(m)).collect();
    let forces: Vec<Option<f64>> =
        blocks.par_iter().map(|b| b.as_ref().and_then(|b| expected_peak_force_n(state, b))).collect();
    if forces.iter().all(Option::is_none) {
        return Err(PlanError::no_force());
    }
    let smallest_n = forces.iter().flatten().fold(f64::INFINITY, |m: f64, f| m.min(*f));
    let safe: Vec<((Vec<f64>, Motion), BlockAverages, f64)> = sampled
        .into_iter()
        .zip(blocks)
        .zip(forces)
        .filter_map(|((d, b), f)| Some((d, b?, f.filter(|f| *f <= limits.force_n)?)))
        .collect();
    if safe.is_empty() {
        return Err(PlanError::Infeasible {
            why: format!(
                "force_n is {} N, and every sampled motion to {:.1} mm is expected to need at least {smallest_n:.2} N",
                limits.force_n,
                1e3 * limits.depth_m.min(begin.max_depth_m)
            ),
            remedy: "allow more force, less depth (depth_m) or a lower speed (speed_mps)".to_owned(),
        });
    }
    let information: Vec<_> = safe
        .into_par_iter()
        .filter_map(|((point, motion), blocks, force_n)| {
            let information = state.after_blocks(&blocks)?;
            Some(EvaluatedMotion { motion, information, score: 0.0, force_n, point })
        })
        .collect();
    let (distinguishable, indistinguishable): (Vec<_>, Vec<_>) =
        state.pairs().into_iter().partition(|(a, b)| {
            information.iter().any(|f| state.separation_nats(&f.information, *a, *b) >= DISTINGUISHABLE_NATS)
        });
    let known = state.current().half_log_det();
    let mut all: Vec<EvaluatedMotion> = information
        .into_par_iter()
        .map(|f| EvaluatedMotion { score: score(state, &f.information, &distinguishable, known), ..f })
        .collect();
    if all.is_empty() {
        return Err(PlanError::NoForce("no motion can be compared".to_owned()));
    }
    let mut evaluated = all.len();
    all.sort_by(|a, b| b.score.total_cmp(&a.score));
    for k in 0..REFINED_MOTIONS.min(all.len()) {
        let (better, tried) = refine_motion(state, limits, begin, &all[k], &distinguishable, known, k);
        evaluated += tried;
        all[k] = better;
    }
    all.sort_by(|a, b| b.score.total_cmp(&a.score));
    all.truncate(5);
    Ok(MotionSearchResult { best: all, distinguishable, indistinguishable, motions_evaluated: evaluated })
}

/// Largest force in N expected under any candidate, plus three standard deviations of the noise.
fn expected_peak_force_n(state: &InformationState, blocks: &BlockAverages) -> Option<f64> {
    let most = state.peak_forces_n(blocks)?.into_iter().fold(0.0, f64::max);
    Some(most + 3.0 * state.noise.sd_n())
}

/// Improves a motion by trials from the same low-discrepancy sequence in a shrinking neighbourhood.
fn refine_motion(
    state: &InformationState,
    limits: &Limits,
    begin: &StartConditions,
    from: &EvaluatedMotion,
    distinguishable: &[(usize, usize)],
    known: f64,
    which: usize,
) -> (EvaluatedMotion, usize) {
    let mut best = from.clone();
    let mut tried = 0;
    for step in 0..REFINEMENT_STEPS {
        let reach = 0.25 * libm::pow(0.65, step as f64);
        let near: Vec<EvaluatedMotion> = (0..NEIGHBOURS_PER_STEP)
            .into_par_iter()
            .filter_map(|k| {
                let u = low_discrepancy_point(
                    SAMPLED_MOTIONS + (which * REFINEMENT_STEPS + step) * NEIGHBOURS_PER_STEP + k,
                );
                let point: Vec<f64> = (0..DIMENSIONS)
                    .map(|i| (best.point[i] + reach * (2.0 * u[i] - 1.0)).clamp(0.0, 1.0))
                    .collect();
                let motion = motion_from_point(&point, limits, begin)?;
                let blocks = state.motion_blocks(&motion)?;
                let force_n = expected_peak_force_n(state, &blocks).filter(|f| *f <= limits.force_n)?;
                let information = state.after_blocks(&blocks)?;
                let score = score(state, &information, distinguishable, known);
                Some(EvaluatedMotion { motion, information, score, force_n, point })
            })
            .collect();
        tried += near.len();
        if let Some(better) = near.into_iter().max_by(|a, b| a.score.total_cmp(&b.score))
            && better.score > best.score
        {
            best = better;
        }
    }
    (best, tried)
}
