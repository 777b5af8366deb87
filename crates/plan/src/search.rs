//! The motion under which what may be the case differs most: drawn evenly, then refined.

use crate::draw::{Begin, NUMBERS, even, impossible, motion};
use crate::error::PlanError;
use crate::ground::{Ground, Shown};
use crate::limits::Limits;
use rayon::prelude::*;
use stylet_identify::blocks::Blocks;
use stylet_scenario::Motion;

/// Motions drawn.
const DRAWN: usize = 200;
/// The best that are refined, and steps of the refinement; every step tries some neighbours at once.
const REFINED: usize = 2;
const STEPS: usize = 4;
const NEIGHBOURS: usize = 8;
/// A pair is asked for when some motion tells it apart by so many nats.
pub const TELLING_NATS: f64 = 10.0;
/// More nats than this between two candidates add nothing to a verdict.
const ENOUGH_NATS: f64 = 400.0;
/// What a nat of the mean over all pairs counts beside one of the worst.
const BESIDE: f64 = 0.02;

/// A motion that was found.
#[derive(Clone, Debug)]
pub struct Found {
    /// The motion.
    pub motion: Motion,
    /// What it shows together with what is known.
    pub shown: Shown,
    /// How good it is: nats of the worst pair, or of knowledge when there is no pair.
    pub score: f64,
    /// Largest force in N expected under any candidate.
    pub force_n: f64,
    point: Vec<f64>,
}

/// What a search gives.
pub struct Searched {
    /// The best motion first, then the next best that differ from it.
    pub best: Vec<Found>,
    /// Pairs that some motion within the limits tells apart.
    pub told: Vec<(usize, usize)>,
    /// Pairs that none does.
    pub never: Vec<(usize, usize)>,
    /// Motions that were looked at.
    pub looked_at: usize,
}

/// How good a motion is.
fn score(ground: &Ground, shown: &Shown, pairs: &[(usize, usize)], known: f64) -> f64 {
    if pairs.is_empty() {
        return shown.knowledge() - known;
    }
    let (mut worst, mut sum) = (f64::INFINITY, 0.0);
    for (a, b) in pairs {
        let weight = |k: usize| ground.candidates.get(k).map_or(0.05, |c| c.weight).max(1e-3);
        // Odds before the insertion count as nats of the gap.
        let nats = ground.nats(shown, *a, *b).min(ENOUGH_NATS);
        worst = worst.min(nats - libm::log(weight(*a) * weight(*b)));
        sum += nats;
    }
    worst + BESIDE * sum / pairs.len() as f64
}

/// Searches for the best motions within limits.
///
/// # Errors
/// [`PlanError::Impossible`] when no motion keeps the limits, [`PlanError::NoForce`] when none can be replayed.
pub fn search(ground: &Ground, limits: &Limits, begin: &Begin) -> Result<Searched, PlanError> {
    limits.check()?;
    if let Some((why, remedy)) = impossible(limits, begin) {
        return Err(PlanError::Impossible { why, remedy });
    }
    let points: Vec<Vec<f64>> = (0..DRAWN).map(even).collect();
    let drawn: Vec<(Vec<f64>, Motion)> =
        points.into_iter().filter_map(|p| motion(&p, limits, begin).map(|m| (p, m))).collect();
    if drawn.is_empty() {
        return Err(PlanError::Impossible {
            why: format!(
                "none of {DRAWN} programs of two to six parts gets to {:.1} mm and back to rest in {} s",
                1e3 * limits.depth_m.min(begin.end_m),
                limits.duration_s
            ),
            remedy: "give it more time, or allow a higher speed or acceleration".to_owned(),
        });
    }
    let seen: Vec<Option<Blocks>> = drawn.par_iter().map(|(_, m)| ground.blocks(m)).collect();
    let forces: Vec<Option<f64>> =
        seen.par_iter().map(|b| b.as_ref().and_then(|b| force_n(ground, b))).collect();
    if forces.iter().all(Option::is_none) {
        return Err(PlanError::NoForce("check stiffness, friction and effects of the scenario".to_owned()));
    }
    let weakest = forces.iter().flatten().fold(f64::INFINITY, |m: f64, f| m.min(*f));
    let safe: Vec<((Vec<f64>, Motion), Blocks, f64)> = drawn
        .into_iter()
        .zip(seen)
        .zip(forces)
        .filter_map(|((d, b), f)| Some((d, b?, f.filter(|f| *f <= limits.force_n)?)))
        .collect();
    if safe.is_empty() {
        return Err(PlanError::Impossible {
            why: format!(
                "force_n is {} N, and the gentlest of the motions to {:.1} mm is expected to need {weakest:.2} N",
                limits.force_n,
                1e3 * limits.depth_m.min(begin.end_m)
            ),
            remedy: "allow more force, less depth (depth_m) or a lower speed (speed_mps)".to_owned(),
        });
    }
    let shown: Vec<_> = safe
        .into_par_iter()
        .filter_map(|((point, motion), blocks, force_n)| {
            let shown = ground.after_blocks(&blocks)?;
            Some(Found { motion, shown, score: 0.0, force_n, point })
        })
        .collect();
    let (told, never): (Vec<_>, Vec<_>) = ground
        .pairs()
        .into_iter()
        .partition(|(a, b)| shown.iter().any(|f| ground.nats(&f.shown, *a, *b) >= TELLING_NATS));
    let known = ground.known().knowledge();
    let mut all: Vec<Found> =
        shown.into_par_iter().map(|f| Found { score: score(ground, &f.shown, &told, known), ..f }).collect();
    if all.is_empty() {
        return Err(PlanError::NoForce("no motion can be compared".to_owned()));
    }
    let mut looked_at = all.len();
    all.sort_by(|a, b| b.score.total_cmp(&a.score));
    for k in 0..REFINED.min(all.len()) {
        let (better, tried) = refined(ground, limits, begin, &all[k], &told, known, k);
        looked_at += tried;
        all[k] = better;
    }
    all.sort_by(|a, b| b.score.total_cmp(&a.score));
    all.truncate(5);
    Ok(Searched { best: all, told, never, looked_at })
}

/// Largest force in N expected under any candidate, three standard deviations of the noise included.
fn force_n(ground: &Ground, blocks: &Blocks) -> Option<f64> {
    let most = ground.largest_n(blocks)?.into_iter().fold(0.0, f64::max);
    Some(most + 3.0 * ground.noise.sd_n())
}

/// Goes uphill from a motion: neighbours from the same even sequence, nearer with every step.
fn refined(
    ground: &Ground,
    limits: &Limits,
    begin: &Begin,
    from: &Found,
    told: &[(usize, usize)],
    known: f64,
    which: usize,
) -> (Found, usize) {
    let mut best = from.clone();
    let mut tried = 0;
    for step in 0..STEPS {
        let reach = 0.25 * libm::pow(0.65, step as f64);
        let near: Vec<Found> = (0..NEIGHBOURS)
            .into_par_iter()
            .filter_map(|k| {
                let u = even(DRAWN + (which * STEPS + step) * NEIGHBOURS + k);
                let point: Vec<f64> = (0..NUMBERS)
                    .map(|i| (best.point[i] + reach * (2.0 * u[i] - 1.0)).clamp(0.0, 1.0))
                    .collect();
                let motion = motion(&point, limits, begin)?;
                let blocks = ground.blocks(&motion)?;
                let force_n = force_n(ground, &blocks).filter(|f| *f <= limits.force_n)?;
                let shown = ground.after_blocks(&blocks)?;
                let score = score(ground, &shown, told, known);
                Some(Found { motion, shown, score, force_n, point })
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
