//! Estimates the probability of a correct diagnosis by simulation: the best motions are simulated under every
//! candidate and diagnosed together with the available recordings. The motion with the most correct diagnoses
//! is selected; separate simulations, not used for the selection, estimate its probability.

use crate::candidate::NONE;
use crate::error::PlanError;
use crate::information_state::InformationState;
use crate::insertion_plan::{CandidateTrials, Plan, plan_with_motion};
use crate::limits::Limits;
use crate::motion_search::MotionSearchResult;
use crate::starting_information::candidate_scenario;
use stylet_diagnose::{Diagnosis, NamedRecording, Options, Verdict, diagnose};
use stylet_scenario::{ForceTorque, Motion, Robot, Scenario, Sensor};
use stylet_stats::parallel::*;

/// Number of candidates under which the best motions are compared, most probable first.
const COMPARED_CANDIDATES: usize = 4;
/// Number of candidates under which the selected motion is tested, and tests per candidate.
const TESTED_CANDIDATES: usize = 6;
const TEST_ROUNDS: u64 = 2;
/// Total number of replayed blocks
/// ([`FitData::blocks_replayed`](stylet_identify::likelihood::FitData::blocks_replayed)), about a minute on two
/// cores. If diagnoses cost more, fewer motions and insertions are simulated.
const MAX_REPLAYED_BLOCKS: u64 = 1_200_000_000;
/// Weight of the probability from expected gaps, in simulated insertions.
const EXPECTED_GAP_WEIGHT: f64 = 6.0;
/// Seeds of the simulations for selection and for the test.
const SELECTION_SEED: u64 = 1000;
const TEST_SEED: u64 = 2000;

/// Inputs shared by all simulations.
struct SimulationCheck<'a> {
    assumed: &'a Scenario,
    information: &'a InformationState,
    recordings: &'a [NamedRecording],
    noise_n: f64,
}

/// Simulates the best motions of a search under the most probable candidates and diagnoses each with the
/// available recordings (without any, the scenario's own motion is simulated first). Returns the plan with the
/// motion after which most diagnoses are correct; ties go to the better score. `simulated` and the probability
/// come from insertions not used for the selection. `progress` receives a message per step. The plan does not
/// depend on the machine's speed.
///
/// # Errors
/// [`PlanError`] when a planned insertion can be neither simulated nor diagnosed.
pub fn check_by_simulation(
    found: &MotionSearchResult,
    limits: &Limits,
    assumed: &Scenario,
    state: &InformationState,
    available_recordings: &[NamedRecording],
    mut progress: impl FnMut(&str),
) -> Result<Plan, PlanError> {
    let check = SimulationCheck {
        assumed,
        information: state,
        recordings: available_recordings,
        noise_n: sensor_noise(state, assumed),
    };
    let mut order: Vec<usize> = (0..state.candidates.len()).collect();
    order.sort_by(|a, b| state.candidates[*b].probability.total_cmp(&state.candidates[*a].probability));
    order.truncate(TESTED_CANDIDATES);
    let compared = &order[..order.len().min(COMPARED_CANDIDATES)];
    let mut outcomes: Vec<Vec<bool>> = Vec::new();
    let mut spent = 0;
    for (k, motion) in found.best.iter().enumerate() {
        // Assumes equal cost per motion and leaves work for the test of the selected one.
        let each = spent / (k * compared.len()).max(1) as u64;
        if k > 0 && spent + each * (compared.len() + order.len()) as u64 > MAX_REPLAYED_BLOCKS {
            break;
        }
        let of = found.best.len();
        progress(&format!(
            "motion {} of {of}: simulating and diagnosing {} candidates",
            k + 1,
            compared.len()
        ));
        let jobs: Vec<(usize, u64)> = compared.iter().map(|c| (*c, SELECTION_SEED)).collect();
        outcomes.push(check.diagnose_all(&motion.motion, &jobs, &mut spent)?);
    }
    let each = spent / (outcomes.len() * compared.len()).max(1) as u64;
    // Weighted by the candidates' probabilities; the first of equals.
    let value = |of: &[bool]| -> f64 {
        compared
            .iter()
            .zip(of)
            .filter(|(_, correct)| **correct)
            .map(|(c, _)| state.candidates[*c].probability)
            .sum()
    };
    let which = outcomes
        .iter()
        .enumerate()
        .fold((0, f64::NEG_INFINITY), |best, (k, of)| {
            let value = value(of);
            if value > best.1 + 1e-9 { (k, value) } else { best }
        })
        .0;
    let mut plan = plan_with_motion(state, limits, found, which)?;
    let others = (0..found.best.len()).filter(|k| *k != which);
    for (alternative, k) in plan.alternatives.iter_mut().zip(others) {
        let of = outcomes.get(k).map_or(&[][..], Vec::as_slice);
        alternative.simulated = of.len();
        alternative.correct = of.iter().filter(|correct| **correct).count();
    }
    let mut tried: Vec<CandidateTrials> = order
        .iter()
        .map(|c| CandidateTrials { candidate: state.name(*c).to_owned(), trials: 0, correct: 0 })
        .collect();
    let mut tested = false;
    if let [single] = outcomes.as_slice() {
        // With a single motion nothing was selected, so its simulations count as a test.
        tested = spent + each * order.len() as u64 > MAX_REPLAYED_BLOCKS;
        for (tried, correct) in tried.iter_mut().zip(single) {
            tried.trials += 1;
            tried.correct += usize::from(*correct);
        }
    }
    for round in 0..TEST_ROUNDS {
        if tested && spent + each * order.len() as u64 > MAX_REPLAYED_BLOCKS {
            break;
        }
        progress(&format!(
            "the selected motion, test {} of {TEST_ROUNDS}: {} candidates",
            round + 1,
            order.len()
        ));
        let jobs: Vec<(usize, u64)> = order.iter().map(|c| (*c, TEST_SEED + round)).collect();
        for (tried, correct) in tried.iter_mut().zip(check.diagnose_all(&plan.motion, &jobs, &mut spent)?) {
            tried.trials += 1;
            tried.correct += usize::from(correct);
        }
        tested = true;
    }
    let weights: Vec<f64> = order.iter().map(|c| state.candidates[*c].probability).collect();
    let sum: f64 = weights.iter().sum();
    if sum > 0.0 {
        // One success and one failure added (Laplace).
        let share = |t: &CandidateTrials| (t.correct as f64 + 1.0) / (t.trials as f64 + 2.0);
        let share_correct = tried.iter().zip(&weights).map(|(t, w)| w * share(t)).sum::<f64>() / sum;
        let n = tried.iter().map(|t| t.trials).sum::<usize>() as f64;
        plan.probability_decided =
            (n * share_correct + EXPECTED_GAP_WEIGHT * plan.probability_decided) / (n + EXPECTED_GAP_WEIGHT);
        plan.probability_source = "simulated".to_owned();
    }
    plan.simulated = tried;
    Ok(plan)
}

impl SimulationCheck<'_> {
    /// Whether the diagnosis is correct after one insertion, per candidate and seed; adds the cost to `spent`.
    fn diagnose_all(
        &self,
        motion: &Motion,
        jobs: &[(usize, u64)],
        spent: &mut u64,
    ) -> Result<Vec<bool>, PlanError> {
        let one = |(candidate, seed): &(usize, u64)| self.diagnose_one(motion, *candidate, *seed);
        let outcomes: Vec<(bool, u64)> = jobs.par_iter().map(one).collect::<Result<_, PlanError>>()?;
        *spent += outcomes.iter().map(|s| s.1).sum::<u64>();
        Ok(outcomes.into_iter().map(|s| s.0).collect())
    }

    /// Whether the diagnosis is correct, and its cost in replayed blocks.
    fn diagnose_one(&self, motion: &Motion, candidate: usize, seed: u64) -> Result<(bool, u64), PlanError> {
        let mut recordings = self.recordings.to_vec();
        if recordings.is_empty() && self.assumed.motion.plan().is_some() {
            recordings.push(self.simulate(candidate, &self.assumed.motion, seed + 7)?);
        }
        recordings.push(self.simulate(candidate, motion, seed)?);
        let result =
            diagnose(self.assumed, &recordings, &Options { brief: true, ..Options::default() }, |_| {})?;
        Ok((is_correct(&result.diagnosis, self.information, candidate), result.search.data.blocks_replayed()))
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

/// Standard deviation of the noise of a sample in N.
fn sensor_noise(state: &InformationState, assumed: &Scenario) -> f64 {
    let samples = (stylet_identify::block_averages::BLOCK_S * state.sample_hz).round().max(1.0);
    assumed
        .sensor
        .force_torque()
        .map_or(0.0, |s| s.noise_n)
        .min(state.noise.sd_n() * samples.sqrt())
        .max(1e-4)
}

/// Whether a diagnosis names the candidate and, apart from it, only effects of the base model.
fn is_correct(diagnosis: &Diagnosis, state: &InformationState, which: usize) -> bool {
    let Some(candidate) = state.candidates.get(which) else { return false };
    let base: Vec<&str> = state.base.effects.iter().map(|e| e.info.id).collect();
    let mut additional = diagnosis.causes.iter().filter(|c| !base.contains(&c.effect.as_str()));
    if diagnosis.verdict == Verdict::Unknown {
        return false;
    }
    if candidate.name == NONE {
        return additional.next().is_none();
    }
    additional.next().is_some_and(|c| c.effect == candidate.name && c.equivalent.is_empty())
        && additional.next().is_none()
}
