//! Estimates of the memory and time of a command, made before it starts.

use std::path::{Path, PathBuf};
use stylet_report::significant;
use stylet_scenario::{Robot, Scenario};
use stylet_sweep::Sweep;

/// Memory of `run` per sample (bytes): columns, truth, traces of one model, report. Measured with 1.6e5 samples: 970.
const RUN_BYTES: f64 = 1000.0;
/// Memory of `enhance` per sample with one model (bytes). Measured with 1e5 samples: 770.
const ENHANCE_BYTES: f64 = 800.0;
/// Memory per sample for each further model (bytes). Measured: 290.
const MODEL_BYTES: f64 = 300.0;
/// Number of samples of a CSV file above which `enhance` streams them from disk.
const LONG_SAMPLES: f64 = 1e6;
/// Memory of `enhance` when it streams (bytes). Measured by `tests/enhance_long.sh`.
const LONG_BYTES: f64 = 1e8;
/// Memory of `diagnose` per sample read (bytes).
const DIAGNOSE_BYTES: f64 = 300.0;
/// Memory of a sweep independent of the number of trials (bytes): a shard and a block of rows. Measured by `tests/sweep_large.sh`.
const SWEEP_BYTES: f64 = 5e7;
/// Memory of a sweep per trial (bytes), for ranking. Measured from 1e5 to 1e6 trials: 70.
const TRIAL_BYTES: f64 = 100.0;
/// Time of `run` and `enhance` per sample (s).
const SAMPLE_S: f64 = 6e-6;
/// Time per physics step of the slide (s).
const SLIDE_S: f64 = 4e-6;
/// Time per physics step of the arm (s).
const ARM_S: f64 = 25e-6;
/// Time of a sweep's trial per sample (s).
const TRIAL_SAMPLE_S: f64 = 1.5e-7;
/// Time of a diagnosis per sample (s) on two cores. Measured: 1e-5 without an effect, 2 to 4e-5 with one.
const DIAGNOSE_S: f64 = 2.5e-5;
/// The same for repeats, with nested cross-validation. Measured: 29 000 samples in 190 s.
const REPEATS_S: f64 = 6.5e-3;
/// Time of a prediction relative to a diagnosis.
const PREDICT_SHARE: f64 = 0.1;

/// Estimated memory and time of a command.
#[derive(Clone, Debug)]
pub struct ResourceEstimate {
    /// Amount of work, such as `1e6 trials`.
    pub description: String,
    /// Memory (bytes).
    pub memory_bytes: f64,
    /// Time (s).
    pub duration_s: f64,
    /// How to reduce it.
    pub remedy: &'static str,
}

/// Estimate for `stylet run`; `None` for a motion `Recorded`, which cannot be simulated.
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

/// Estimate for `stylet sweep`; 0 threads are one per core.
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

/// Estimate for `stylet enhance` with this number of models.
#[must_use]
pub fn estimate_enhance(data: &Path, models: usize) -> Option<ResourceEstimate> {
    let samples = samples(data)?;
    let description = format!("about {} samples", significant(samples, 2));
    Some(ResourceEstimate { description, ..estimate_enhance_samples(samples, models) })
}

/// As [`estimate_enhance`] for a known number of samples; for pipes and foreign formats it is known only after reading.
#[must_use]
pub fn estimate_enhance_samples(samples: f64, models: usize) -> ResourceEstimate {
    ResourceEstimate {
        description: format!("{samples} samples"),
        memory_bytes: samples * (ENHANCE_BYTES + (models as f64 - 1.0) * MODEL_BYTES),
        duration_s: samples * SAMPLE_S * models as f64,
        remedy: "cut the recording to the insertion",
    }
}

/// Estimate for `stylet enhance` when the recording is long enough to be streamed, else `None`.
#[must_use]
pub fn estimate_long_enhance(data: &Path, models: usize) -> Option<ResourceEstimate> {
    let need = estimate_enhance(data, models)?;
    (samples(data)? > LONG_SAMPLES).then_some(ResourceEstimate { memory_bytes: LONG_BYTES, ..need })
}

/// Estimate for `stylet diagnose`.
#[must_use]
pub fn estimate_diagnose(data: &[PathBuf]) -> ResourceEstimate {
    let each: Vec<f64> = data.iter().filter_map(|path| samples(path)).collect();
    let all: f64 = each.iter().sum();
    let description = format!("about {} samples in {} recording(s)", significant(all, 2), data.len());
    ResourceEstimate { description, ..estimate_diagnose_samples(&each) }
}

/// As [`estimate_diagnose`] for known numbers of samples; for pipes and foreign formats they are known only after reading.
#[must_use]
pub fn estimate_diagnose_samples(each: &[f64]) -> ResourceEstimate {
    let all: f64 = each.iter().sum();
    // Longer recordings are downsampled.
    let used: f64 = each.iter().map(|n| n.min(stylet_record::downsample::MAX_SAMPLES as f64)).sum();
    ResourceEstimate {
        description: format!("{all} samples in {} recording(s)", each.len()),
        memory_bytes: all * DIAGNOSE_BYTES,
        duration_s: used * DIAGNOSE_S,
        remedy: "cut the recordings to the insertion",
    }
}

/// Estimate for `stylet diagnose` on repeats.
#[must_use]
pub fn estimate_diagnose_repeats(data: &[PathBuf]) -> ResourceEstimate {
    let need = estimate_diagnose(data);
    ResourceEstimate { duration_s: need.duration_s * REPEATS_S / DIAGNOSE_S, ..need }
}

/// Estimate for `stylet predict`.
#[must_use]
pub fn estimate_predict(data: &[PathBuf]) -> ResourceEstimate {
    let need = estimate_diagnose(data);
    ResourceEstimate { duration_s: need.duration_s * PREDICT_SHARE, ..need }
}

/// Number of samples of a text file, from its size and the length of its first lines; `None` unless it is a plain file of text.
fn samples(path: &Path) -> Option<f64> {
    use std::io::Read as _;
    const HEAD: u64 = 1 << 16;
    let file = std::fs::File::open(path).ok()?;
    let size = file.metadata().ok().filter(std::fs::Metadata::is_file)?.len();
    let mut head = Vec::new();
    file.take(HEAD).read_to_end(&mut head).ok()?;
    if head.contains(&0) {
        return None;
    }
    let lines = head.iter().filter(|b| **b == b'\n').count().max(1);
    Some(size as f64 * lines as f64 / head.len().max(1) as f64)
}
