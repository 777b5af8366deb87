//! All runs over all seeds, once: claims, tables and figures only read them.

use crate::case::Case;
use crate::outcome::Outcome;
use crate::variant::{Protocol, Sensor, TRACE_THRESHOLDS, Variant};
use rayon::prelude::*;
use std::collections::BTreeMap;
use stylet_scenario::{InputError, Scenario};
use stylet_score::{LayerTruth, Trace, score_run};
use stylet_testbed::{InsertionSample, Measuring, SimulateError, Simulation, simulate};
use stylet_tissue::TissueForce;

/// Noise of the force/torque sensor in mN where nothing else is said: that of every shipped scenario.
pub const NOISE_MN: u32 = 20;
/// Noise levels of the force/torque sensor, in mN, that the comparison with the truth goes through.
pub const NOISE_LEVELS_MN: [u32; 4] = [5, 10, 20, 50];

/// Why nothing could be reproduced: a mistake in what is shipped.
#[derive(Debug, thiserror::Error)]
pub enum ReproduceError {
    /// A shipped scenario is wrong.
    #[error(transparent)]
    Scenario(#[from] InputError),
    /// A shipped scenario cannot be simulated.
    #[error(transparent)]
    Simulate(#[from] SimulateError),
    /// No such runs were made.
    #[error("no runs of {0}")]
    NotRun(String),
    /// The claims cannot be written.
    #[error("claims: {0}")]
    Json(#[from] serde_json::Error),
}

/// What was run: experiment, noise, sensor, variant.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Key {
    /// Experiment.
    pub case: Case,
    /// Noise of the force/torque sensor in mN.
    pub noise_mn: u32,
    /// Sensor.
    pub sensor: Sensor,
    /// Model and protocol.
    pub variant: Variant,
}

/// One experiment at one noise level with all that is run on its recordings.
struct Job {
    case: Case,
    noise_mn: u32,
    sensors: &'static [Sensor],
    variants: Vec<Variant>,
}

/// A scenario, simulated, with its layers.
#[derive(Clone, Debug)]
pub struct Insertion {
    /// The scenario.
    pub scenario: Scenario,
    /// Recording and truth.
    pub simulation: Simulation,
    /// The layers as the law has them.
    pub layers: Vec<LayerTruth>,
}

impl Insertion {
    /// Simulates a scenario with the noise of a seed.
    ///
    /// # Errors
    /// [`SimulateError`] when it cannot be simulated.
    pub fn of(scenario: &Scenario, seed: u64) -> Result<Self, SimulateError> {
        let simulation = simulate(scenario, seed)?;
        let layers = simulation
            .slabs
            .iter()
            .map(|s| LayerTruth {
                front_m: s.front_m,
                thickness_m: s.thickness_m,
                stiffness_n_per_m: s.stiffness_n_per_m,
                friction_ns_per_m2: s.friction_ns_per_m2,
            })
            .collect();
        Ok(Self { scenario: scenario.clone(), simulation, layers })
    }

    /// The same insertion as another seed's force/torque sensor records it: on the slide the noise moves
    /// nothing, so that the motion need not be simulated again.
    fn reading(&self, seed: u64) -> Vec<f64> {
        let Some(sensor) = self.scenario.sensor.force_torque() else { return Vec::new() };
        let mut measuring = Measuring::new(&self.scenario.effects, sensor, seed, self.scenario.sample_hz);
        let Simulation { recording, truth, .. } = &self.simulation;
        let samples = recording.samples().zip(&truth.tissue_force_n);
        samples
            .map(|(s, &total_n)| {
                measuring.measure(&InsertionSample {
                    time_s: s.time_s,
                    position_m: s.position_m,
                    velocity_mps: s.velocity_mps,
                    acceleration_mps2: 0.0,
                    force: TissueForce { total_n, ..TissueForce::default() },
                })
            })
            .collect()
    }

    /// Runs the algorithm on a force.
    #[must_use]
    pub fn run(&self, force_n: &[f64], sensor: Sensor, variant: Variant) -> (Trace, Outcome) {
        let Simulation { recording, truth, .. } = &self.simulation;
        let config = variant.config(&self.scenario, sensor);
        let (trace, score) = score_run(recording, force_n, truth, &self.layers, &config);
        let outcome = Outcome::of(recording, force_n, truth, &self.layers, &trace, score);
        (trace, outcome)
    }

    /// What a sensor recorded.
    #[must_use]
    pub fn force_n(&self, sensor: Sensor) -> &[f64] {
        self.simulation.readings.iter().find(|r| r.sensor == sensor.key()).map_or(&[], |r| &r.force_n)
    }
}

/// The outcomes of every run, by seed.
#[derive(Debug, Default)]
pub struct Study {
    /// Number of noise seeds.
    pub seeds: u64,
    runs: BTreeMap<Key, Vec<Outcome>>,
    none: Vec<Outcome>,
}

fn plan() -> Vec<Job> {
    use Protocol::{KnownDepth, NoReweight, NoReweightKnown, OnlyRuptures, Paper, Sensitive};
    const TOUCH: &[Sensor] = &[Sensor::ForceTorque];
    const BOTH: &[Sensor] = &[Sensor::ForceTorque, Sensor::Virtual];
    let both = |p: Protocol| [Variant::kv(p), Variant::ml(p)];
    let ablations = [Paper, OnlyRuptures, NoReweight].map(Variant::ml);
    let traces = (0..TRACE_THRESHOLDS.len()).map(|i| Variant::ml(Protocol::Trace(i)));
    let mut jobs = Vec::new();
    // The dear ones first, so that no thread is left alone with one at the end.
    for case in [Case::LiverArm, Case::LiverArmFriction, Case::AbdomenArm, Case::AbdomenArmFriction] {
        jobs.push(Job { case, noise_mn: NOISE_MN, sensors: BOTH, variants: both(Paper).to_vec() });
    }
    let mut on_slide = |case: Case, noise_mn: u32, variants: Vec<Variant>| {
        jobs.push(Job { case, noise_mn, sensors: TOUCH, variants });
    };
    for case in Case::GELS.into_iter().flatten() {
        let mut variants: Vec<Variant> = [Paper, KnownDepth, Sensitive].into_iter().flat_map(both).collect();
        variants.extend([OnlyRuptures, NoReweight, NoReweightKnown].map(Variant::ml));
        if case == Case::Gel70Constant {
            variants.extend(traces.clone());
        }
        on_slide(case, NOISE_MN, variants);
    }
    for case in [Case::LatexConstant, Case::LatexSinusoidal, Case::Liver, Case::Abdomen] {
        for noise_mn in NOISE_LEVELS_MN {
            let mut variants = both(Paper).to_vec();
            if noise_mn == NOISE_MN {
                variants.extend([OnlyRuptures, NoReweight].map(Variant::ml));
                variants.extend(traces.clone());
            }
            on_slide(case, noise_mn, variants);
        }
    }
    on_slide(Case::LiverQuadratic, NOISE_MN, ablations.to_vec());
    jobs
}

impl Study {
    /// Number of insertions for a number of seeds: what progress counts.
    #[must_use]
    pub fn insertions(seeds: u64) -> u64 {
        plan().len() as u64 * seeds
    }

    /// Runs everything over the noise seeds `1..=seeds`; `done` is called once per insertion, from any
    /// thread. The result does not depend on the number of threads.
    ///
    /// # Errors
    /// [`ReproduceError`] when a shipped scenario is wrong.
    pub fn run(seeds: u64, done: &(dyn Fn() + Sync)) -> Result<Self, ReproduceError> {
        let prepared: Vec<(Job, Insertion)> = plan()
            .into_par_iter()
            .map(|job| {
                let mut scenario = job.case.scenario()?;
                if let stylet_scenario::Sensor::ForceTorque(sensor) = &mut scenario.sensor {
                    sensor.noise_n = f64::from(job.noise_mn) * 1e-3;
                }
                let insertion = Insertion::of(&scenario, 1)?;
                Ok::<_, ReproduceError>((job, insertion))
            })
            .collect::<Result<_, _>>()?;
        let pairs: Vec<(&Job, &Insertion, u64)> =
            prepared.iter().flat_map(|(job, once)| (1..=seeds).map(move |seed| (job, once, seed))).collect();
        let outcomes: Vec<Vec<(Key, Outcome)>> = pairs
            .into_par_iter()
            .with_max_len(1)
            .map(|(job, once, seed)| {
                let found = one(job, once, seed);
                done();
                found
            })
            .collect::<Result<_, _>>()?;
        let mut runs: BTreeMap<Key, Vec<Outcome>> = BTreeMap::new();
        for (key, outcome) in outcomes.into_iter().flatten() {
            runs.entry(key).or_default().push(outcome);
        }
        Ok(Self { seeds, runs, none: Vec::new() })
    }

    /// The outcomes of one combination, by seed; empty when it was not run.
    #[must_use]
    pub fn runs(&self, case: Case, noise_mn: u32, sensor: Sensor, variant: Variant) -> &[Outcome] {
        self.runs.get(&Key { case, noise_mn, sensor, variant }).unwrap_or(&self.none)
    }

    /// The same for the force/torque sensor at the ordinary noise.
    #[must_use]
    pub fn at(&self, case: Case, variant: Variant) -> &[Outcome] {
        self.runs(case, NOISE_MN, Sensor::ForceTorque, variant)
    }
}

fn one(job: &Job, once: &Insertion, seed: u64) -> Result<Vec<(Key, Outcome)>, ReproduceError> {
    let mut found = Vec::new();
    let mut listen = |insertion: &Insertion, force_n: &[f64], sensor: Sensor| {
        for &variant in &job.variants {
            let key = Key { case: job.case, noise_mn: job.noise_mn, sensor, variant };
            found.push((key, insertion.run(force_n, sensor, variant).1));
        }
    };
    if job.case.on_arm() {
        // The torques' noise moves the arm: each seed is an insertion of its own.
        let fresh = if seed == 1 { once.clone() } else { Insertion::of(&once.scenario, seed)? };
        for &sensor in job.sensors {
            listen(&fresh, fresh.force_n(sensor), sensor);
        }
    } else {
        listen(once, &once.reading(seed), Sensor::ForceTorque);
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_drawn_apart_is_the_noise_of_a_simulation_of_its_own() {
        let scenario = Case::Gel25Constant.scenario().expect("valid");
        let once = Insertion::of(&scenario, 1).expect("a simulation");
        for seed in [1, 7] {
            let whole = simulate(&scenario, seed).expect("a simulation");
            assert_eq!(once.reading(seed), whole.recording.force_n, "seed {seed}");
        }
        assert_ne!(once.reading(1), once.reading(2));
    }
}
