//! The honest probability: the best motions simulated under every candidate and diagnosed together with what is at hand. The one after
//! which the diagnosis is right most often is taken; insertions that had no part in that choice say how often it decides.

use crate::candidate::NONE;
use crate::error::PlanError;
use crate::ground::Ground;
use crate::limits::Limits;
use crate::plan::{Plan, Tried, chosen};
use crate::search::Searched;
use crate::start::scenario_of;
use rayon::prelude::*;
use stylet_diagnose::{Diagnosis, Evidence, Options, Verdict, diagnose};
use stylet_scenario::{ForceTorque, Motion, Robot, Scenario, Sensor};

/// Candidates under which the best motions are set against each other, likeliest first.
const RACED: usize = 4;
/// Candidates under which the chosen motion is tried, and how often each.
const TRIED: usize = 6;
const ROUNDS: u64 = 2;
/// Blocks that are replayed in all ([`Data::work`](stylet_identify::objective::Data::work)): some 40 s of two cores. Where diagnoses cost
/// more, fewer motions are raced and fewer insertions judge.
const WORK: u64 = 1_200_000_000;
/// What the expected gaps count for, in simulated insertions.
const GAPS_WEIGH: f64 = 6.0;
/// Seeds of the insertions that choose, and of those that judge.
const CHOOSE: u64 = 1000;
const JUDGE: u64 = 2000;

/// What is at hand when a motion is simulated.
struct Bench<'a> {
    believed: &'a Scenario,
    ground: &'a Ground,
    old: &'a [Evidence],
    noise_n: f64,
}

/// Simulates the best motions of a search under the likeliest candidates, diagnoses each with the recordings at hand (without any the
/// scenario's own motion is simulated first), and gives the plan with the motion after which most are right; ties go to the better
/// score. `simulated` and the probability come from insertions that were not used to choose. `progress` is told what is being done.
/// The same inputs give the same plan, whatever the machine's speed.
///
/// # Errors
/// [`PlanError`] when a planned insertion can be neither simulated nor diagnosed.
pub fn check(
    found: &Searched,
    limits: &Limits,
    believed: &Scenario,
    ground: &Ground,
    old: &[Evidence],
    mut progress: impl FnMut(&str),
) -> Result<Plan, PlanError> {
    let bench = Bench { believed, ground, old, noise_n: sensor_noise(ground, believed) };
    let mut order: Vec<usize> = (0..ground.candidates.len()).collect();
    order.sort_by(|a, b| ground.candidates[*b].weight.total_cmp(&ground.candidates[*a].weight));
    order.truncate(TRIED);
    let raced = &order[..order.len().min(RACED)];
    let mut outcomes: Vec<Vec<bool>> = Vec::new();
    let mut spent = 0;
    for (k, motion) in found.best.iter().enumerate() {
        // As dear as those before, and the chosen motion's own insertions have to be affordable, too.
        let each = spent / (k * raced.len()).max(1) as u64;
        if k > 0 && spent + each * (raced.len() + order.len()) as u64 > WORK {
            break;
        }
        let of = found.best.len();
        progress(&format!("motion {} of {of}: simulating and diagnosing {} candidates", k + 1, raced.len()));
        let jobs: Vec<(usize, u64)> = raced.iter().map(|c| (*c, CHOOSE)).collect();
        outcomes.push(bench.try_all(&motion.motion, &jobs, &mut spent)?);
    }
    let each = spent / (outcomes.len() * raced.len()).max(1) as u64;
    // Weighed by how likely each candidate is; the first of equals.
    let worth = |of: &[bool]| -> f64 {
        raced.iter().zip(of).filter(|(_, right)| **right).map(|(c, _)| ground.candidates[*c].weight).sum()
    };
    let which = outcomes
        .iter()
        .enumerate()
        .fold((0, f64::NEG_INFINITY), |best, (k, of)| {
            let worth = worth(of);
            if worth > best.1 + 1e-9 { (k, worth) } else { best }
        })
        .0;
    let mut plan = chosen(ground, limits, found, which)?;
    let others = (0..found.best.len()).filter(|k| *k != which);
    for (alternative, k) in plan.alternatives.iter_mut().zip(others) {
        let of = outcomes.get(k).map_or(&[][..], Vec::as_slice);
        alternative.simulated = of.len();
        alternative.decided = of.iter().filter(|right| **right).count();
    }
    let mut tried: Vec<Tried> =
        order.iter().map(|c| Tried { candidate: ground.name(*c).to_owned(), of: 0, decided: 0 }).collect();
    let mut judged = false;
    if let [only] = outcomes.as_slice() {
        // Nothing was chosen by them.
        judged = spent + each * order.len() as u64 > WORK;
        for (tried, right) in tried.iter_mut().zip(only) {
            tried.of += 1;
            tried.decided += usize::from(*right);
        }
    }
    for round in 0..ROUNDS {
        if judged && spent + each * order.len() as u64 > WORK {
            break;
        }
        progress(&format!("the chosen motion, {} of {ROUNDS}: {} candidates", round + 1, order.len()));
        let jobs: Vec<(usize, u64)> = order.iter().map(|c| (*c, JUDGE + round)).collect();
        for (tried, right) in tried.iter_mut().zip(bench.try_all(&plan.motion, &jobs, &mut spent)?) {
            tried.of += 1;
            tried.decided += usize::from(right);
        }
        judged = true;
    }
    let weights: Vec<f64> = order.iter().map(|c| ground.candidates[*c].weight).collect();
    let sum: f64 = weights.iter().sum();
    if sum > 0.0 {
        // One success and one failure beforehand (Laplace): a few insertions make nobody sure.
        let share = |t: &Tried| (t.decided as f64 + 1.0) / (t.of as f64 + 2.0);
        let seen = tried.iter().zip(&weights).map(|(t, w)| w * share(t)).sum::<f64>() / sum;
        let n = tried.iter().map(|t| t.of).sum::<usize>() as f64;
        plan.probability_decided = (n * seen + GAPS_WEIGH * plan.probability_decided) / (n + GAPS_WEIGH);
        plan.probability_from = "simulated".to_owned();
    }
    plan.simulated = tried;
    Ok(plan)
}

impl Bench<'_> {
    /// Whether the diagnosis is right after one insertion, per candidate and seed; what it costs goes to `spent`.
    fn try_all(
        &self,
        motion: &Motion,
        jobs: &[(usize, u64)],
        spent: &mut u64,
    ) -> Result<Vec<bool>, PlanError> {
        let one = |(candidate, seed): &(usize, u64)| self.once(motion, *candidate, *seed);
        let said: Vec<(bool, u64)> = jobs.par_iter().map(one).collect::<Result<_, PlanError>>()?;
        *spent += said.iter().map(|s| s.1).sum::<u64>();
        Ok(said.into_iter().map(|s| s.0).collect())
    }

    /// Whether the diagnosis is right, and what it cost.
    fn once(&self, motion: &Motion, candidate: usize, seed: u64) -> Result<(bool, u64), PlanError> {
        let mut evidence = self.old.to_vec();
        if evidence.is_empty() && self.believed.motion.plan().is_some() {
            evidence.push(self.simulated(candidate, &self.believed.motion, seed + 7)?);
        }
        evidence.push(self.simulated(candidate, motion, seed)?);
        let examined = diagnose(self.believed, &evidence, &Options { brief: true }, |_| {})?;
        Ok((right(&examined.diagnosis, self.ground, candidate), examined.search.data.work()))
    }

    fn simulated(&self, candidate: usize, motion: &Motion, seed: u64) -> Result<Evidence, PlanError> {
        let mut scenario = scenario_of(self.believed, self.ground, candidate, motion);
        scenario.robot = Robot::Replay;
        scenario.sensor =
            Sensor::ForceTorque(ForceTorque { noise_n: self.noise_n, ..ForceTorque::default() });
        let recording = stylet_testbed::simulate(&scenario, seed)?.recording;
        Ok(Evidence { name: format!("planned {seed}"), recording, notes: Vec::new() })
    }
}

/// Standard deviation of a sample's noise in N.
fn sensor_noise(ground: &Ground, believed: &Scenario) -> f64 {
    let samples = (stylet_identify::blocks::BLOCK_S * ground.sample_hz).round().max(1.0);
    believed
        .sensor
        .force_torque()
        .map_or(0.0, |s| s.noise_n)
        .min(ground.noise.sd_n() * samples.sqrt())
        .max(1e-4)
}

/// Whether a diagnosis names the candidate, and beside it only what the stem has.
fn right(said: &Diagnosis, ground: &Ground, which: usize) -> bool {
    let Some(candidate) = ground.candidates.get(which) else { return false };
    let stem: Vec<&str> = ground.stem.effects.iter().map(|e| e.info.id).collect();
    let mut beside = said.causes.iter().filter(|c| !stem.contains(&c.effect.as_str()));
    if said.verdict == Verdict::Unknown {
        return false;
    }
    if candidate.name == NONE {
        return beside.next().is_none();
    }
    beside.next().is_some_and(|c| c.effect == candidate.name && c.equivalent.is_empty())
        && beside.next().is_none()
}
