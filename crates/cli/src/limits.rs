//! What a command will need, told before it begins: refused above a limit, said when it is much.

use crate::exit::Failure;
use crate::terminal::tell;
use clap::Args;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use stylet_report::significant;
use stylet_scenario::{Robot, Scenario};
use stylet_sweep::{Columns, Sweep};

/// Most threads that can be asked for.
pub const MOST_THREADS: u64 = 1024;

/// Bytes that `run` holds per sample: columns, truth, traces of one model, the page. Measured with 1.6e5 samples: 970.
const RUN_BYTES: f64 = 1000.0;
/// Bytes that `enhance` holds per sample of one model. Measured with 1e5 samples: 770.
const ENHANCE_BYTES: f64 = 800.0;
/// Bytes per sample for each further model. Measured: 290.
const MODEL_BYTES: f64 = 300.0;
/// Bytes that `diagnose` holds per sample that it reads.
const DIAGNOSE_BYTES: f64 = 300.0;
/// Times that a sweep's rows lie in memory at the end: rows, table, page. Measured with 2e4 trials: 4.2.
const ROWS: f64 = 5.0;
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

/// What is said without being asked: so many bytes, so many seconds.
const MUCH_BYTES: f64 = 5e8;
const LONG_S: f64 = 60.0;

/// How much a command may take.
#[derive(Clone, Copy, Debug, Args)]
pub struct Limits {
    /// Refuse work that needs more memory, as estimated beforehand: 500MB, 2GB.
    #[arg(long, value_name = "SIZE", default_value = "2GB", value_parser = size)]
    pub limit_memory: f64,
    /// Refuse work that takes longer, as estimated beforehand: 90s, 10min, 2h [default: no limit].
    #[arg(long, value_name = "TIME", value_parser = duration)]
    pub limit_time: Option<f64>,
}

impl Default for Limits {
    fn default() -> Self {
        Self { limit_memory: 2e9, limit_time: None }
    }
}

/// What some work needs.
#[derive(Clone, Debug)]
pub struct Need {
    /// What makes it much, for people: `3.5e8 samples (3500 s at 1e5 Hz)`.
    pub what: String,
    /// Memory in bytes.
    pub bytes: f64,
    /// Time in s.
    pub seconds: f64,
    /// What would make it less.
    pub remedy: &'static str,
}

impl Limits {
    /// Refuses what is over a limit; says on standard error what will take long.
    ///
    /// # Errors
    /// [`Failure::Check`] with the estimate, the limit and what would help.
    pub fn allow(&self, at: &Path, need: &Need, quiet: bool) -> Result<(), Failure> {
        let at = at.display();
        let Need { what, bytes, seconds, remedy } = need;
        if *bytes > self.limit_memory {
            return Err(Failure::Check(format!(
                "{at}: {what} need about {} of memory, and the limit is {}: {remedy}, or raise --limit-memory",
                memory(*bytes),
                memory(self.limit_memory)
            )));
        }
        if let Some(limit) = self.limit_time.filter(|limit| seconds > limit) {
            return Err(Failure::Check(format!(
                "{at}: {what} take about {}, and the limit is {}: {remedy}, or raise --limit-time",
                time(*seconds),
                time(limit)
            )));
        }
        if !quiet && (*bytes > MUCH_BYTES || *seconds > LONG_S) {
            let mut text = String::new();
            let _ = writeln!(text, "{at}: {what}: about {} of memory and {}", memory(*bytes), time(*seconds));
            tell(&text);
        }
        Ok(())
    }
}

/// What `stylet run` needs; nothing for a motion that is recorded, which it refuses by itself.
pub fn of_run(scenario: &Scenario) -> Option<Need> {
    let seconds = scenario.motion.plan()?.duration_s();
    let samples = seconds * scenario.sample_hz;
    let (steps, each_s) = match &scenario.robot {
        Robot::Replay => (samples, 0.0),
        Robot::Arm(_) => (seconds * scenario.physics_hz, ARM_S),
        _ => (seconds * scenario.physics_hz, SLIDE_S),
    };
    let models = scenario.compare.len().max(1) as f64;
    Some(Need {
        what: format!(
            "{} samples and {} physics steps in {} s",
            significant(samples, 3),
            significant(steps, 3),
            significant(seconds, 4)
        ),
        bytes: samples * (RUN_BYTES + (models - 1.0) * MODEL_BYTES),
        seconds: samples * SAMPLE_S * models + steps * each_s,
        remedy: "shorten the motion, lower sample_hz or physics_hz",
    })
}

/// What `stylet sweep` needs; 0 threads are one per core.
pub fn of_sweep(sweep: &Sweep, columns: &Columns, threads: usize) -> Need {
    let trials = sweep.trials() as f64;
    let seconds = sweep.template.motion.plan().map_or(0.0, |plan| plan.duration_s());
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let threads = if threads == 0 { cores } else { threads.min(cores) };
    Need {
        what: format!("{} trials", significant(trials, 3)),
        bytes: trials * (columns.width() + 3) as f64 * 8.0 * ROWS,
        seconds: trials * seconds * sweep.template.sample_hz * TRIAL_SAMPLE_S / threads as f64,
        remedy: "run fewer (--trials)",
    }
}

/// What `stylet enhance` needs for a recording with so many models.
pub fn of_enhance(data: &Path, models: usize) -> Option<Need> {
    let samples = samples(data)?;
    Some(Need {
        what: format!("about {} samples", significant(samples, 2)),
        bytes: samples * (ENHANCE_BYTES + (models as f64 - 1.0) * MODEL_BYTES),
        seconds: samples * SAMPLE_S * models as f64,
        remedy: "cut the recording to the insertion",
    })
}

/// What `stylet diagnose` needs for these recordings.
pub fn of_diagnose(data: &[PathBuf]) -> Need {
    let each: Vec<f64> = data.iter().filter_map(|path| samples(path)).collect();
    let all: f64 = each.iter().sum();
    // Beyond that they are thinned.
    let used: f64 = each.iter().map(|n| n.min(stylet_record::thin::MOST_SAMPLES as f64)).sum();
    Need {
        what: format!("about {} samples in {} recording(s)", significant(all, 2), data.len()),
        bytes: all * DIAGNOSE_BYTES,
        seconds: used * DIAGNOSE_S,
        remedy: "cut the recordings to the insertion",
    }
}

/// What `stylet predict` needs for these recordings.
pub fn of_predict(data: &[PathBuf]) -> Need {
    let need = of_diagnose(data);
    Need { seconds: need.seconds * PREDICT_SHARE, ..need }
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

fn memory(bytes: f64) -> String {
    if bytes >= 1e9 {
        format!("{} GB", significant(bytes / 1e9, 2))
    } else {
        format!("{} MB", significant(bytes / 1e6, 2))
    }
}

fn time(seconds: f64) -> String {
    match seconds {
        s if s < 120.0 => format!("{} s", significant(s, 2)),
        s if s < 7200.0 => format!("{} min", significant(s / 60.0, 2)),
        s => format!("{} h", significant(s / 3600.0, 2)),
    }
}

fn with_unit(text: &str, units: &[(&str, f64)]) -> Option<f64> {
    let lower = text.trim().to_lowercase();
    let (number, factor) =
        units.iter().find_map(|(unit, factor)| Some((lower.strip_suffix(unit)?, *factor)))?;
    number.trim().parse::<f64>().ok().map(|x| x * factor).filter(|x| x.is_finite() && *x > 0.0)
}

fn size(text: &str) -> Result<f64, String> {
    with_unit(text, &[("kb", 1e3), ("mb", 1e6), ("gb", 1e9), ("tb", 1e12)])
        .ok_or_else(|| "must be a size like 500MB or 2GB".to_owned())
}

fn duration(text: &str) -> Result<f64, String> {
    with_unit(text, &[("min", 60.0), ("h", 3600.0), ("s", 1.0)])
        .ok_or_else(|| "must be a time like 90s, 10min or 2h".to_owned())
}

/// A number of threads; 0 is one per core.
pub fn threads(text: &str) -> Result<usize, String> {
    match text.parse::<u64>() {
        Ok(n) if n <= MOST_THREADS => Ok(n as usize),
        _ => Err(format!(
            "must be a number of threads up to {MOST_THREADS}; 0 is one per core, and more than cores gain nothing"
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_and_times_are_read_with_their_units_and_refused_without() {
        assert_eq!((size("2GB"), size("500 mb"), size("1.5kB")), (Ok(2e9), Ok(5e8), Ok(1500.0)));
        assert_eq!((duration("90s"), duration("10min"), duration("2h")), (Ok(90.0), Ok(600.0), Ok(7200.0)));
        for wrong in ["2", "GB", "-1GB", "NaNGB", "1e400GB", ""] {
            assert!(size(wrong).is_err(), "{wrong}");
        }
        assert!(duration("10").is_err() && duration("0s").is_err());
        assert!(
            threads("0").is_ok()
                && threads("1024").is_ok()
                && threads("100000").is_err()
                && threads("-1").is_err()
        );
    }

    #[test]
    fn what_is_over_a_limit_is_refused_with_the_estimate_and_what_would_help() {
        let need = Need {
            what: "1e9 trials".to_owned(),
            bytes: 8e11,
            seconds: 7300.0,
            remedy: "run fewer (--trials)",
        };
        let said = Limits::default().allow(Path::new("a.ron"), &need, true).expect_err("800 GB").to_string();
        for word in ["a.ron: 1e9 trials", "800 GB", "2 GB", "--trials", "--limit-memory"] {
            assert!(said.contains(word), "{said}");
        }
        let all = Limits { limit_memory: 1e12, limit_time: None };
        assert!(all.allow(Path::new("a.ron"), &need, true).is_ok());
        let hour = Limits { limit_time: Some(3600.0), ..all };
        let said = hour.allow(Path::new("a.ron"), &need, true).expect_err("two hours").to_string();
        assert!(said.contains("2 h") && said.contains("60 min") && said.contains("--limit-time"), "{said}");
    }
}
