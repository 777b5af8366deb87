//! All runs over all seeds, once: claims, tables and figures only read them.
//!
//! The required runs are found by evaluating these on a study without runs first, which records every combination that is
//! looked up.

use crate::algorithm_variant::{Ablation, Sensor, Setup, Variant};
use crate::assumed_value_changes::Change;
use crate::detection_tuning::{TUNING_FIRST_SEED, TUNING_SEEDS, TUNING_SEEDS_ARM};
use crate::paper_experiments::Case;
use crate::run_outcome::{Offline, Outcome};
use crate::simulated_insertion::Insertion;
use crate::tuned_thresholds::Tuning;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Mutex;
use stylet_scenario::InputError;
use stylet_stats::parallel::*;
use stylet_testbed::SimulateError;

/// Default noise of the force/torque sensor in mN: the laboratory's standard deviation of the error in ordinary insertion.
pub const NOISE_MN: u32 = 10;
/// Noise levels in mN of the comparison with the truth: half the default, the default, twice (as in the shipped scenarios),
/// and one at which the algorithm breaks down.
pub const NOISE_LEVELS_MN: [u32; 4] = [5, 10, 20, 50];

/// Error of a reproduction, caused by a mistake in the shipped files.
#[derive(Debug, thiserror::Error)]
pub enum ReproduceError {
    /// A shipped scenario is wrong.
    #[error(transparent)]
    Scenario(#[from] InputError),
    /// A shipped scenario cannot be simulated.
    #[error(transparent)]
    Simulate(#[from] SimulateError),
    /// The requested runs were not made.
    #[error("no runs of {0}")]
    NotRun(String),
    /// The claims cannot be written.
    #[error("claims: {0}")]
    Json(#[from] serde_json::Error),
}

/// Key of a recording: experiment, change of an assumed value if any, and noise of the force/torque sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct RecordingKey {
    /// Experiment.
    pub case: Case,
    /// The changed value, if any.
    pub change: Option<Change>,
    /// Noise of the force/torque sensor in mN.
    pub noise_mn: u32,
}

/// Key of a run: recording, sensor, and variant of the algorithm.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct RunKey {
    /// The recording.
    pub recording_key: RecordingKey,
    /// Sensor.
    pub sensor: Sensor,
    /// Model and protocol.
    pub variant: Variant,
}

/// Lookups of a planning study, with their number of seeds.
#[derive(Clone, Debug, Default)]
struct RequestedRuns {
    runs: BTreeMap<RunKey, u64>,
    offline: BTreeMap<RecordingKey, u64>,
}

/// The outcomes of every run, by seed.
#[derive(Debug, Default)]
pub struct Study {
    /// First noise seed.
    pub first_seed: u64,
    /// Number of noise seeds.
    pub seeds: u64,
    runs: BTreeMap<RunKey, Vec<Outcome>>,
    offline: BTreeMap<RecordingKey, Vec<Offline>>,
    tunings: BTreeMap<(RecordingKey, Sensor), Tuning>,
    requested: Option<Mutex<RequestedRuns>>,
}

/// Recordings that share one simulation, or on the arm the seeds' simulations.
type Group = (Case, Option<Change>);

/// One recording of one seed, with all requested runs.
struct Job<'a> {
    recording_key: RecordingKey,
    insertion: &'a Insertion,
    seed: u64,
    runs: Vec<RunKey>,
    offline: bool,
}

/// Result of a job.
#[derive(Default)]
struct JobResult {
    runs: Vec<(RunKey, Outcome)>,
    offline: Option<(RecordingKey, Offline)>,
}

/// A plan: all requested runs.
#[derive(Clone, Debug)]
pub struct Plan {
    first_seed: u64,
    seeds: u64,
    requested: RequestedRuns,
}

impl Plan {
    /// The recordings with their number of seeds, expensive ones first, so that all threads finish at about the same time.
    fn recordings(&self) -> Vec<(RecordingKey, u64)> {
        let mut all: BTreeMap<RecordingKey, u64> = self.requested.offline.clone();
        for (key, seeds) in &self.requested.runs {
            let most = all.entry(key.recording_key).or_default();
            *most = (*most).max(*seeds);
        }
        let mut list: Vec<(RecordingKey, u64)> = all.into_iter().collect();
        list.sort_by_key(|(r, _)| (!r.case.on_arm(), !r.case.is_liver()));
        list
    }

    /// Number of recordings over all seeds, for progress.
    #[must_use]
    pub fn recording_count(&self) -> u64 {
        self.recordings().iter().map(|(_, seeds)| seeds).sum()
    }

    /// Number of runs of the algorithm over all seeds, without those of the tuning.
    #[must_use]
    pub fn run_count(&self) -> u64 {
        self.requested.runs.values().sum()
    }

    fn insertions(&self) -> Result<BTreeMap<Group, Insertion>, ReproduceError> {
        let groups: BTreeSet<Group> = self.recordings().iter().map(|(r, _)| (r.case, r.change)).collect();
        let made: Vec<(Group, Insertion)> = groups
            .into_par_iter()
            .map(|(case, change)| {
                let mut scenario = case.scenario()?;
                if let Some(change) = change {
                    change.apply(&mut scenario);
                }
                Ok::<_, ReproduceError>(((case, change), Insertion::of(&scenario, self.first_seed)?))
            })
            .collect::<Result<_, _>>()?;
        Ok(made.into_iter().collect())
    }

    /// The required tunings by sensor, and whether the threshold of the triggered reset is tuned too.
    fn required_tunings(&self) -> BTreeMap<RecordingKey, BTreeMap<Sensor, bool>> {
        let mut all: BTreeMap<RecordingKey, BTreeMap<Sensor, bool>> = BTreeMap::new();
        for key in self.requested.runs.keys().filter(|k| k.variant.is_tuned()) {
            let sensors = all.entry(unchanged_on_arm(key.recording_key)).or_default();
            *sensors.entry(key.sensor).or_default() |= key.variant.ablation == Ablation::Trace;
        }
        all
    }
}

/// On the arm a changed phantom is run with the tuning of the unchanged one.
fn unchanged_on_arm(recording_key: RecordingKey) -> RecordingKey {
    if recording_key.case.on_arm() { RecordingKey { change: None, ..recording_key } } else { recording_key }
}

impl Study {
    /// A planning study: without runs, it records the lookups.
    #[must_use]
    pub fn planning(first_seed: u64, seeds: u64) -> Self {
        Self { first_seed, seeds, requested: Some(Mutex::default()), ..Self::default() }
    }

    /// Whether this is a planning study.
    #[must_use]
    pub const fn is_planning(&self) -> bool {
        self.requested.is_some()
    }

    /// The lookups of a study made by [`Study::planning`].
    #[must_use]
    pub fn plan(self) -> Plan {
        let requested = self.requested.and_then(|w| w.into_inner().ok()).unwrap_or_default();
        Plan { first_seed: self.first_seed, seeds: self.seeds, requested }
    }

    /// Runs everything in a plan; `done` is called once for each of [`Plan::recording_count`], from any
    /// thread. The result does not depend on the number of threads.
    ///
    /// # Errors
    /// [`ReproduceError`] when a shipped scenario is wrong.
    pub fn run(plan: &Plan, done: &(dyn Fn() + Sync)) -> Result<Self, ReproduceError> {
        let insertions = plan.insertions()?;
        let missing = |r: &RecordingKey| ReproduceError::NotRun(r.case.name().to_owned());
        let tunings: Vec<Vec<Tuned>> = plan
            .required_tunings()
            .into_par_iter()
            .map(|(recording_key, sensors)| {
                let insertion = insertions.get(&(recording_key.case, recording_key.change));
                tune(recording_key, insertion.ok_or_else(|| missing(&recording_key))?, &sensors)
            })
            .collect::<Result<_, _>>()?;
        let tunings: BTreeMap<(RecordingKey, Sensor), Tuning> = tunings.into_iter().flatten().collect();
        let mut jobs = Vec::new();
        for (recording_key, seeds) in plan.recordings() {
            let insertion = insertions
                .get(&(recording_key.case, recording_key.change))
                .ok_or_else(|| missing(&recording_key))?;
            for index in 0..seeds {
                let wants = |most: &u64| *most > index;
                let runs =
                    plan.requested.runs.iter().filter(|(k, n)| k.recording_key == recording_key && wants(n));
                jobs.push(Job {
                    recording_key,
                    insertion,
                    seed: plan.first_seed + index,
                    runs: runs.map(|(k, _)| *k).collect(),
                    offline: plan.requested.offline.get(&recording_key).is_some_and(wants),
                });
            }
        }
        let first = plan.first_seed;
        let outcomes: Vec<JobResult> = jobs
            .into_par_iter()
            .map(|job| {
                let found = run_job(&job, first, &tunings);
                done();
                found
            })
            .collect::<Result<_, _>>()?;
        let mut runs: BTreeMap<RunKey, Vec<Outcome>> = BTreeMap::new();
        let mut offline: BTreeMap<RecordingKey, Vec<Offline>> = BTreeMap::new();
        for done in outcomes {
            for (key, outcome) in done.runs {
                runs.entry(key).or_default().push(outcome);
            }
            if let Some((recording_key, found)) = done.offline {
                offline.entry(recording_key).or_default().push(found);
            }
        }
        Ok(Self { first_seed: first, seeds: plan.seeds, runs, offline, tunings, requested: None })
    }

    /// The outcomes of one combination, by seed, at most `seeds` of them; recorded in a planning study.
    #[must_use]
    pub fn runs(&self, key: RunKey, seeds: u64) -> &[Outcome] {
        let seeds = seeds.min(self.seeds);
        if let Some(mut requested) = self.requested.as_ref().and_then(|w| w.lock().ok()) {
            let most = requested.runs.entry(key).or_default();
            *most = (*most).max(seeds);
        }
        let all = self.runs.get(&key).map_or(&[][..], Vec::as_slice);
        &all[..all.len().min(seeds as usize)]
    }

    /// The offline estimates of a recording, as [`Study::runs`].
    #[must_use]
    pub fn offline(&self, recording_key: RecordingKey, seeds: u64) -> &[Offline] {
        let seeds = seeds.min(self.seeds);
        if let Some(mut requested) = self.requested.as_ref().and_then(|w| w.lock().ok()) {
            let most = requested.offline.entry(recording_key).or_default();
            *most = (*most).max(seeds);
        }
        let all = self.offline.get(&recording_key).map_or(&[][..], Vec::as_slice);
        &all[..all.len().min(seeds as usize)]
    }

    /// The tuned thresholds of a phantom; the published defaults if it was not tuned.
    #[must_use]
    pub fn tuning(&self, recording_key: RecordingKey, sensor: Sensor) -> Tuning {
        self.tunings.get(&(unchanged_on_arm(recording_key), sensor)).copied().unwrap_or_default()
    }

    /// All tunings.
    pub fn tunings(&self) -> impl Iterator<Item = (&(RecordingKey, Sensor), &Tuning)> {
        self.tunings.iter()
    }
}

/// Tuned recordings with their thresholds.
type Tuned = ((RecordingKey, Sensor), Tuning);

/// The tunings of a recording; on the arm one simulation of each tuning seed serves every sensor.
fn tune(
    recording_key: RecordingKey,
    insertion: &Insertion,
    sensors: &BTreeMap<Sensor, bool>,
) -> Result<Vec<Tuned>, ReproduceError> {
    let on_arm = recording_key.case.on_arm();
    let seeds: Vec<u64> = (0..if on_arm { TUNING_SEEDS_ARM } else { TUNING_SEEDS })
        .map(|index| TUNING_FIRST_SEED + index)
        .collect();
    let made: Vec<Insertion> = if on_arm {
        seeds.par_iter().map(|seed| Insertion::of(&insertion.scenario, *seed)).collect::<Result<_, _>>()?
    } else {
        Vec::new()
    };
    let of = |sensor: Sensor, trace: bool| {
        let recording = |(index, seed): (usize, &u64)| {
            let insertion = made.get(index).unwrap_or(insertion);
            (insertion, samples_of(insertion, *seed, recording_key.noise_mn, sensor))
        };
        let recordings: Vec<_> = seeds.iter().enumerate().map(recording).collect();
        ((recording_key, sensor), Tuning::of(&recordings, sensor, trace))
    };
    Ok(sensors.iter().map(|(sensor, trace)| of(*sensor, *trace)).collect())
}

fn samples_of(insertion: &Insertion, seed: u64, noise_mn: u32, sensor: Sensor) -> Vec<stylet_core::Sample> {
    match sensor {
        Sensor::ForceTorque => insertion.samples(&insertion.reading(seed, noise_mn)),
        Sensor::Virtual => insertion.samples(insertion.force_n(sensor)),
    }
}

fn run_job(
    job: &Job<'_>,
    first_seed: u64,
    tunings: &BTreeMap<(RecordingKey, Sensor), Tuning>,
) -> Result<JobResult, ReproduceError> {
    let mut done = JobResult::default();
    // On the arm the torque noise moves the needle, so each seed is a separate insertion.
    let fresh;
    let insertion = if job.recording_key.case.on_arm() && job.seed != first_seed {
        fresh = Insertion::of(&job.insertion.scenario, job.seed)?;
        &fresh
    } else {
        job.insertion
    };
    for sensor in [Sensor::ForceTorque, Sensor::Virtual] {
        let runs_of_sensor = job.runs.iter().filter(|k| k.sensor == sensor);
        if !(job.offline && sensor == Sensor::ForceTorque) && runs_of_sensor.clone().next().is_none() {
            continue;
        }
        let samples = samples_of(insertion, job.seed, job.recording_key.noise_mn, sensor);
        let tuning = tunings.get(&(unchanged_on_arm(job.recording_key), sensor)).copied().unwrap_or_default();
        let mut shares = Vec::new();
        for key in runs_of_sensor {
            let outcome = insertion.run(&samples, sensor, key.variant, &tuning);
            if key.variant == Variant::ml(Setup::Tuned) {
                shares.clone_from(&outcome.shares);
            }
            done.runs.push((*key, outcome));
        }
        if job.offline && sensor == Sensor::ForceTorque {
            done.offline = Some((job.recording_key, Offline::of(insertion, &samples, &shares)));
        }
    }
    Ok(done)
}
