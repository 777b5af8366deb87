//! The honest probability: the best motions simulated under every candidate and diagnosed together with what is at hand. The one after
//! which the diagnosis is right most often is taken; insertions that had no part in that choice say how often it decides.

use crate::candidate::NONE;
use crate::error::PlanError;
use crate::information_state::InformationState;
use crate::insertion_plan::{CandidateTrials, Plan, plan_with_motion};
use crate::limits::Limits;
use crate::motion_search::MotionSearchResult;
use crate::starting_information::candidate_scenario;
use rayon::prelude::*;
use stylet_diagnose::{Diagnosis, NamedRecording, Options, Verdict, diagnose};
use stylet_scenario::{ForceTorque, Motion, Robot, Scenario, Sensor};

/// Candidates under which the best motions are set against each other, likeliest first.
const COMPARED_CANDIDATES: usize = 4;
/// Candidates under which the chosen motion is tried, and how often each.
const TESTED_CANDIDATES: usize = 6;
const TEST_ROUNDS: u64 = 2;
/// Blocks that are replayed in all ([`Data::work`](stylet_identify::objective::Data::work)): some 40 s of two cores. Where diagnoses cost
/// more, fewer motions are raced and fewer insertions judge.
const MAX_REPLAYED_BLOCKS: u64 = 1_200_000_000;
/// What the expected gaps count for, in simulated insertions.
const EXPECTED_GAP_WEIGHT: f64 = 6.0;
/// Seeds of the insertions that choose, and of those that judge.
const SELECTION_SEED: u64 = 1000;
const TEST_SEED: u64 = 2000;

/// What is at hand when a motion is simulated.
struct SimulationCheck<'a> {
    assumed: &'a Scenario,
    information: &'a InformationState,
    recordings: &'a [NamedRecording],
    noise_n: f64,
}

/// Simulates the best motions of a search under the likeliest candidates, diagnoses each with the recordings at hand (without any the
/// scenario's own motion is simulated first), and gives the plan with the motion after which most are right; ties go to the better
/// score. `simulated` and the probability come from insertions that were not used to choose. `progress` is told what is being done.
/// The same inputs give the same plan, whatever the machine's speed.
///
/// # Errors
/// [`PlanError`] when a planned insertion can be neither simulated nor diagnosed.
pub fn check_by_simulation(
    found: &MotionSearchResult,
    limits: &Limits,
    believed: &Scenario,
    ground: &InformationState,
    old: &[NamedRecording],
    mut progress: impl FnMut(&str),
) -> Result<Plan, PlanError> {
    let bench = SimulationCheck {
        assumed: believed,
        information: ground,
        recordings: old,
        noise_n: sensor_noise(ground, believed),
    };
    let mut order: Vec<usize> = (0..ground.candidates.len()).collect();
    order.sort_by(|a, b| ground.candidates[*b].probability.total_cmp(&ground.candidates[*a].probability));
    order.truncate(TESTED_CANDIDATES);
    let raced = &order[..order.len().min(COMPARED_CANDIDATES)];
    let mut outcomes: Vec<Vec<bool>> = Vec::new();
    let mut spent = 0;
    for (k, motion) in found.best.iter().enumerate() {
        // As dear as those before, and the chosen motion's own insertions have to be affordable, too.
        let each = spent / (k * raced.len()).max(1) as u64;
        if k > 0 && spent + each * (raced.len() + order.len()) as u64 > MAX_REPLAYED_BLOCKS {
            break;
        }
        let of = found.best.len();
        progress(&format!("motion {} of {of}: simulating and diagnosing {} candidates", k + 1, raced.len()));
        let jobs: Vec<(usize, u64)> = raced.iter().map(|c| (*c, SELECTION_SEED)).collect();
        outcomes.push(bench.diagnose_all(&motion.motion, &jobs, &mut spent)?);
    }
    let each = spent / (outcomes.len() * raced.len()).max(1) as u64;
    // Weighed by how likely each candidate is; the first of equals.
    let worth = |of: &[bool]| -> f64 {
        raced
            .iter()
            .zip(of)
            .filter(|(_, right)| **right)
            .map(|(c, _)| ground.candidates[*c].probability)
            .sum()
    };
    let which = outcomes
        .iter()
        .enumerate()
        .fold((0, f64::NEG_INFINITY), |best, (k, of)| {
            let worth = worth(of);
            if worth > best.1 + 1e-9 { (k, worth) } else { best }
        })
        .0;
    let mut plan = plan_with_motion(ground, limits, found, which)?;
    let others = (0..found.best.len()).filter(|k| *k != which);
    for (alternative, k) in plan.alternatives.iter_mut().zip(others) {
        let of = outcomes.get(k).map_or(&[][..], Vec::as_slice);
        alternative.simulated = of.len();
        alternative.correct = of.iter().filter(|right| **right).count();
    }
    let mut tried: Vec<CandidateTrials> = order
        .iter()
        .map(|c| CandidateTrials { candidate: ground.name(*c).to_owned(), trials: 0, correct: 0 })
        .collect();
    let mut judged = false;
    if let [only] = outcomes.as_slice() {
        // Nothing was chosen by them.
        judged = spent + each * order.len() as u64 > MAX_REPLAYED_BLOCKS;
        for (tried, right) in tried.iter_mut().zip(only) {
            tried.trials += 1;
            tried.correct += usize::from(*right);
        }
    }
    for round in 0..TEST_ROUNDS {
        if judged && spent + each * order.len() as u64 > MAX_REPLAYED_BLOCKS {
            break;
        }
        progress(&format!("the chosen motion, {} of {TEST_ROUNDS}: {} candidates", round + 1, order.len()));
        let jobs: Vec<(usize, u64)> = order.iter().map(|c| (*c, TEST_SEED + round)).collect();
        for (tried, right) in tried.iter_mut().zip(bench.diagnose_all(&plan.motion, &jobs, &mut spent)?) {
            tried.trials += 1;
            tried.correct += usize::from(right);
        }
        judged = true;
    }
    let weights: Vec<f64> = order.iter().map(|c| ground.candidates[*c].probability).collect();
    let sum: f64 = weights.iter().sum();
    if sum > 0.0 {
        // One success and one failure beforehand (Laplace): a few insertions make nobody sure.
        let share = |t: &CandidateTrials| (t.correct as f64 + 1.0) / (t.trials as f64 + 2.0);
        let seen = tried.iter().zip(&weights).map(|(t, w)| w * share(t)).sum::<f64>() / sum;
        let n = tried.iter().map(|t| t.trials).sum::<usize>() as f64;
        plan.probability_decided =
            (n * seen + EXPECTED_GAP_WEIGHT * plan.probability_decided) / (n + EXPECTED_GAP_WEIGHT);
        plan.probability_source = "simulated".to_owned();
    }
    plan.simulated = tried;
    Ok(plan)
}

impl SimulationCheck<'_> {
    /// Whether the diagnosis is right after one insertion, per candidate and seed; what it costs goes to `spent`.
    fn diagnose_all(
        &self,
        motion: &Motion,
        jobs: &[(usize, u64)],
        spent: &mut u64,
    ) -> Result<Vec<bool>, PlanError> {
        let one = |(candidate, seed): &(usize, u64)| self.diagnose_one(motion, *candidate, *seed);
        let said: Vec<(bool, u64)> = jobs.par_iter().map(one).collect::<Result<_, PlanError>>()?;
        *spent += said.iter().map(|s| s.1).sum::<u64>();
        Ok(said.into_iter().map(|s| s.0).collect())
    }

    /// Whether the diagnosis is right, and what it cost.
    fn diagnose_one(&self, motion: &Motion, candidate: usize, seed: u64) -> Result<(bool, u64), PlanError> {
        let mut evidence = self.recordings.to_vec();
        if evidence.is_empty() && self.assumed.motion.plan().is_some() {
            evidence.push(self.simulate(candidate, &self.assumed.motion, seed + 7)?);
        }
        evidence.push(self.simulate(candidate, motion, seed)?);
        let examined = diagnose(self.assumed, &evidence, &Options { brief: true }, |_| {})?;
        Ok((
            is_correct(&examined.diagnosis, self.information, candidate),
            examined.search.data.blocks_replayed(),
        ))
    }

    fn simulate(&self, candidate: usize, motion: &Motion, seed: u64) -> Result<NamedRecording, PlanError> {
        let mut scenario = candidate_scenario(self.assumed, self.information, candidate, motion);
        scenario.robot = Robot::Replay;
        scenario.sensor =
            Sensor::ForceTorque(ForceTorque { noise_n: self.noise_n, ..ForceTorque::default() });
        let recording = stylet_testbed::simulate(&scenario, seed)?.recording;
        Ok(NamedRecording { name: format!("planned {seed}"), recording, notes: Vec::new() })
    }
}

/// Standard deviation of a sample's noise in N.
fn sensor_noise(ground: &InformationState, believed: &Scenario) -> f64 {
    let samples = (stylet_identify::block_averages::BLOCK_S * ground.sample_hz).round().max(1.0);
    believed
        .sensor
        .force_torque()
        .map_or(0.0, |s| s.noise_n)
        .min(ground.noise.sd_n() * samples.sqrt())
        .max(1e-4)
}

/// Whether a diagnosis names the candidate, and beside it only what the stem has.
fn is_correct(said: &Diagnosis, ground: &InformationState, which: usize) -> bool {
    let Some(candidate) = ground.candidates.get(which) else { return false };
    let stem: Vec<&str> = ground.base.effects.iter().map(|e| e.info.id).collect();
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
