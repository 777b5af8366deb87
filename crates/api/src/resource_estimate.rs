//! What a command will need, reckoned before it begins.

use std::path::{Path, PathBuf};
use stylet_report::significant;
use stylet_scenario::{Robot, Scenario};
use stylet_sweep::Sweep;

/// Bytes that `run` holds per sample: columns, truth, traces of one model, the page. Measured with 1.6e5 samples: 970.
const RUN_BYTES: f64 = 1000.0;
/// Bytes that `enhance` holds per sample of one model. Measured with 1e5 samples: 770.
const ENHANCE_BYTES: f64 = 800.0;
/// Bytes per sample for each further model. Measured: 290.
const MODEL_BYTES: f64 = 300.0;
/// Samples of a CSV file above which `enhance` keeps them on disk. Below, the page draws every sample that it can.
const LONG_SAMPLES: f64 = 1e6;
/// Bytes that it holds then, however long the recording is. `tests/enhance_long.sh` measures it.
const LONG_BYTES: f64 = 1e8;
/// Bytes that `diagnose` holds per sample that it reads.
const DIAGNOSE_BYTES: f64 = 300.0;
/// Bytes that a sweep holds however many trials it has: a shard and a block of rows (`tests/sweep_large.sh`).
const SWEEP_BYTES: f64 = 5e7;
/// Bytes per trial at the end, when a few values of every trial are ranked at a time. Measured from 1e5 to 1e6 trials: 70.
const TRIAL_BYTES: f64 = 100.0;
/// Seconds per sample of `run` and `enhance`; an optimised build is faster.
const SAMPLE_S: f64 = 6e-6;
/// Seconds per physics step of the slide and of the arm.
const SLIDE_S: f64 = 4e-6;
const ARM_S: f64 = 25e-6;
/// Seconds per sample of a sweep's trial.
const TRIAL_SAMPLE_S: f64 = 1.5e-7;
/// Seconds per sample that a diagnosis compares; the search makes more or less of it.
const DIAGNOSE_S: f64 = 2e-4;
/// A prediction takes this share of a diagnosis' time.
const PREDICT_SHARE: f64 = 0.1;

/// What some work needs.
#[derive(Clone, Debug)]
pub struct ResourceEstimate {
    /// What makes it much, for people: `3.5e8 samples (3500 s at 1e5 Hz)`.
    pub description: String,
    /// Memory in bytes.
    pub memory_bytes: f64,
    /// Time in s.
    pub duration_s: f64,
    /// What would make it less.
    pub remedy: &'static str,
}

/// What `stylet run` needs; nothing for a motion that is recorded, which it refuses by itself.
#[must_use]
pub fn estimate_run(scenario: &Scenario) -> Option<ResourceEstimate> {
    let seconds = scenario.motion.plan()?.duration_s();
    let samples = seconds * scenario.sample_hz;
    let (steps, each_s) = match &scenario.robot {
        Robot::Replay => (samples, 0.0),
        Robot::Arm(_) => (seconds * scenario.physics_hz, ARM_S),
        _ => (seconds * scenario.physics_hz, SLIDE_S),
    };
    let models = scenario.compare.len().max(1) as f64;
    Some(ResourceEstimate {
        description: format!(
            "{} samples and {} physics steps in {} s",
            significant(samples, 3),
            significant(steps, 3),
            significant(seconds, 4)
        ),
        memory_bytes: samples * (RUN_BYTES + (models - 1.0) * MODEL_BYTES),
        duration_s: samples * SAMPLE_S * models + steps * each_s,
        remedy: "shorten the motion, lower sample_hz or physics_hz",
    })
}

/// What `stylet sweep` needs; 0 threads are one per core.
#[must_use]
pub fn estimate_sweep(sweep: &Sweep, threads: usize) -> ResourceEstimate {
    let trials = sweep.trials() as f64;
    let seconds = sweep.template.motion.plan().map_or(0.0, |plan| plan.duration_s());
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let threads = if threads == 0 { cores } else { threads.min(cores) };
    ResourceEstimate {
        description: format!("{} trials", significant(trials, 3)),
        memory_bytes: SWEEP_BYTES + trials * TRIAL_BYTES,
        duration_s: trials * seconds * sweep.template.sample_hz * TRIAL_SAMPLE_S / threads as f64,
        remedy: "run fewer (--trials)",
    }
}

/// What `stylet enhance` needs for a recording with so many models.
#[must_use]
pub fn estimate_enhance(data: &Path, models: usize) -> Option<ResourceEstimate> {
    let samples = samples(data)?;
    Some(ResourceEstimate {
        description: format!("about {} samples", significant(samples, 2)),
        memory_bytes: samples * (ENHANCE_BYTES + (models as f64 - 1.0) * MODEL_BYTES),
        duration_s: samples * SAMPLE_S * models as f64,
        remedy: "cut the recording to the insertion",
    })
}

/// What `stylet enhance` needs for a recording that is long enough to be kept on disk.
#[must_use]
pub fn estimate_long_enhance(data: &Path, models: usize) -> Option<ResourceEstimate> {
    let need = estimate_enhance(data, models)?;
    (samples(data)? > LONG_SAMPLES).then_some(ResourceEstimate { memory_bytes: LONG_BYTES, ..need })
}

/// What `stylet diagnose` needs for these recordings.
#[must_use]
pub fn estimate_diagnose(data: &[PathBuf]) -> ResourceEstimate {
    let each: Vec<f64> = data.iter().filter_map(|path| samples(path)).collect();
    let all: f64 = each.iter().sum();
    // Beyond that they are thinned.
    let used: f64 = each.iter().map(|n| n.min(stylet_record::downsample::MAX_SAMPLES as f64)).sum();
    ResourceEstimate {
        description: format!("about {} samples in {} recording(s)", significant(all, 2), data.len()),
        memory_bytes: all * DIAGNOSE_BYTES,
        duration_s: used * DIAGNOSE_S,
        remedy: "cut the recordings to the insertion",
    }
}

/// What `stylet predict` needs for these recordings.
#[must_use]
pub fn estimate_predict(data: &[PathBuf]) -> ResourceEstimate {
    let need = estimate_diagnose(data);
    ResourceEstimate { duration_s: need.duration_s * PREDICT_SHARE, ..need }
}

/// Samples of a CSV file, by its size and the length of its first lines. Nothing for what is no plain file.
fn samples(path: &Path) -> Option<f64> {
    use std::io::Read as _;
    const HEAD: u64 = 1 << 16;
    let file = std::fs::File::open(path).ok()?;
    let size = file.metadata().ok().filter(std::fs::Metadata::is_file)?.len();
    let mut head = Vec::new();
    file.take(HEAD).read_to_end(&mut head).ok()?;
    let lines = head.iter().filter(|b| **b == b'\n').count().max(1);
    Some(size as f64 * lines as f64 / head.len().max(1) as f64)
}
