//! The honest probability: planned insertions simulated under every candidate and diagnosed together with what is at hand.

use crate::candidate::NONE;
use crate::error::PlanError;
use crate::ground::Ground;
use crate::plan::{Plan, Tried};
use crate::start::scenario_of;
use std::time::Instant;
use stylet_diagnose::{Diagnosis, Evidence, Options, Verdict, diagnose};
use stylet_scenario::{ForceTorque, Robot, Scenario, Sensor};

/// A check ends after so many s at the latest, once each of the likeliest candidates has been tried.
const LONGEST_S: f64 = 45.0;
/// Candidates that are tried, likeliest first.
const MOST: usize = 6;
/// Rounds at most.
const ROUNDS: u64 = 3;

/// Simulates the planned insertion and diagnoses it with the recordings at hand; without any the scenario's own motion is
/// simulated first. Fills the plan's `simulated` and its probability. `progress` is told what is being done.
///
/// # Errors
/// [`PlanError`] when a planned insertion can be neither simulated nor diagnosed.
pub fn check(
    plan: &mut Plan,
    believed: &Scenario,
    ground: &Ground,
    old: &[Evidence],
    mut progress: impl FnMut(&str),
) -> Result<(), PlanError> {
    let begun = Instant::now();
    let mut order: Vec<usize> = (0..ground.candidates.len()).collect();
    order.sort_by(|a, b| ground.candidates[*b].weight.total_cmp(&ground.candidates[*a].weight));
    order.truncate(MOST);
    let mut tried: Vec<Tried> =
        order.iter().map(|k| Tried { candidate: ground.name(*k).to_owned(), of: 0, decided: 0 }).collect();
    let sd_n = sensor_noise(ground, believed);
    'rounds: for round in 0..ROUNDS {
        for (k, tried) in order.iter().zip(&mut tried) {
            if round > 0 && begun.elapsed().as_secs_f64() > LONGEST_S * round as f64 / (round + 1) as f64 {
                break 'rounds;
            }
            progress(&format!("simulating and diagnosing: {} ({})", tried.candidate, round + 1));
            let mut evidence = old.to_vec();
            if evidence.is_empty() && believed.motion.plan().is_some() {
                evidence.push(simulated(believed, ground, *k, &believed.motion, sd_n, 7 + round)?);
            }
            evidence.push(simulated(believed, ground, *k, &plan.motion, sd_n, 1000 + round)?);
            let said = diagnose(believed, &evidence, &Options { brief: true }, |_| {})?.diagnosis;
            tried.of += 1;
            tried.decided += usize::from(right(&said, ground, *k));
        }
    }
    let weight = |name: &str| ground.candidates.iter().find(|c| c.name == name).map_or(0.0, |c| c.weight);
    let sum: f64 = tried.iter().filter(|t| t.of > 0).map(|t| weight(&t.candidate)).sum();
    if sum > 0.0 {
        // One success and one failure beforehand (Laplace): a few insertions make nobody sure.
        let share = |t: &Tried| (t.decided as f64 + 1.0) / (t.of as f64 + 2.0);
        let seen: f64 =
            tried.iter().filter(|t| t.of > 0).map(|t| weight(&t.candidate) * share(t)).sum::<f64>() / sum;
        let count: usize = tried.iter().map(|t| t.of).sum();
        // Gaps weigh as much as six insertions.
        let n = count as f64;
        plan.probability_decided = (n * seen + 6.0 * plan.probability_decided) / (n + 6.0);
        plan.probability_from = "simulated".to_owned();
    }
    plan.simulated = tried;
    Ok(())
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

fn simulated(
    believed: &Scenario,
    ground: &Ground,
    which: usize,
    motion: &stylet_scenario::Motion,
    noise_n: f64,
    seed: u64,
) -> Result<Evidence, PlanError> {
    let mut scenario = scenario_of(believed, ground, which, motion);
    scenario.robot = Robot::Replay;
    scenario.sensor = Sensor::ForceTorque(ForceTorque { noise_n, ..ForceTorque::default() });
    let recording = stylet_testbed::simulate(&scenario, seed)?.recording;
    Ok(Evidence { name: format!("planned {seed}"), recording, notes: Vec::new() })
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
