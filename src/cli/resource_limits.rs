//! Limits on memory and time, checked against the estimate before the work starts.

use crate::cli::exit_codes::{Failure, INPUT_WRONG};
use crate::cli::terminal_output::print_error;
use clap::Args;
use std::fmt::Write as _;
use std::path::Path;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;
use stylet_api::resource_estimate::ResourceEstimate;
use stylet_report::significant;

/// Upper bound of `--threads`.
const MAX_THREADS: u64 = 1024;

/// Memory (bytes) above which the estimate is printed.
const PRINT_ABOVE_BYTES: f64 = 5e8;
/// Time (s) above which the estimate is printed.
const PRINT_ABOVE_S: f64 = 60.0;

/// Limits on memory and time of a command.
#[derive(Clone, Copy, Debug, Args)]
pub struct ResourceLimits {
    /// Refuse work that needs more memory, as estimated beforehand: 500MB, 2GB.
    #[arg(long, value_name = "SIZE", default_value = "2GB", value_parser = parse_size)]
    pub limit_memory: f64,
    /// Refuse work that takes longer, as estimated beforehand; a diagnosis that has begun is stopped then, and writes nothing:
    /// 90s, 10min, 2h [default: no limit].
    #[arg(long, value_name = "TIME", value_parser = parse_duration)]
    pub limit_time: Option<f64>,
}

impl Default for ResourceLimits {
    fn default() -> Self {
        Self { limit_memory: 2e9, limit_time: None }
    }
}

impl ResourceLimits {
    /// Rejects work above a limit; prints the estimate of large work to standard error.
    ///
    /// # Errors
    /// [`Failure::Check`] with the estimate, the limit and the remedy.
    pub fn check(&self, at: &Path, estimate: &ResourceEstimate, quiet: bool) -> Result<(), Failure> {
        let at = at.display();
        let ResourceEstimate { description, memory_bytes: bytes, duration_s: seconds, remedy } = estimate;
        if *bytes > self.limit_memory {
            return Err(Failure::Check(format!(
                "{at}: {description} need about {} of memory, and the limit is {}: {remedy}, or raise --limit-memory",
                memory(*bytes),
                memory(self.limit_memory)
            )));
        }
        if let Some(limit) = self.limit_time.filter(|limit| seconds > limit) {
            return Err(Failure::Check(format!(
                "{at}: {description} take about {}, and the limit is {}: {remedy}, or raise --limit-time",
                time(*seconds),
                time(limit)
            )));
        }
        if !quiet && (*bytes > PRINT_ABOVE_BYTES || *seconds > PRINT_ABOVE_S) {
            let mut text = String::new();
            let _ = writeln!(
                text,
                "{at}: {description}: about {} of memory and {}",
                memory(*bytes),
                time(*seconds)
            );
            print_error(&text);
        }
        Ok(())
    }
}

/// Ends the command when its work takes longer than `--limit-time`, before anything is written. Dropping it disarms it.
pub struct TimeLimit {
    disarm: Option<Sender<()>>,
    watch: Option<JoinHandle<()>>,
}

impl ResourceLimits {
    /// Starts the limit on the time of work that begins now; `at` names its input.
    #[must_use]
    pub fn start_time_limit(&self, at: &Path) -> TimeLimit {
        let Some(limit_s) = self.limit_time else { return TimeLimit { disarm: None, watch: None } };
        let (disarm, disarmed) = channel::<()>();
        let at = at.display().to_string();
        let watch = std::thread::spawn(move || {
            let waited = Duration::try_from_secs_f64(limit_s).unwrap_or(Duration::MAX);
            if disarmed.recv_timeout(waited) == Err(RecvTimeoutError::Timeout) {
                print_error(&format!(
                    "{at}: stopped after the limit of {}; nothing was written: cut the recordings to the insertion, or raise --limit-time\n",
                    time(limit_s)
                ));
                std::process::exit(i32::from(INPUT_WRONG));
            }
        });
        TimeLimit { disarm: Some(disarm), watch: Some(watch) }
    }
}

impl Drop for TimeLimit {
    fn drop(&mut self) {
        drop(self.disarm.take());
        if let Some(watch) = self.watch.take() {
            let _ = watch.join();
        }
    }
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

fn parse_size(text: &str) -> Result<f64, String> {
    with_unit(text, &[("kb", 1e3), ("mb", 1e6), ("gb", 1e9), ("tb", 1e12)])
        .ok_or_else(|| "must be a size like 500MB or 2GB".to_owned())
}

fn parse_duration(text: &str) -> Result<f64, String> {
    with_unit(text, &[("min", 60.0), ("h", 3600.0), ("s", 1.0)])
        .ok_or_else(|| "must be a time like 90s, 10min or 2h".to_owned())
}

/// A number of threads; 0 is one per core.
pub fn parse_threads(text: &str) -> Result<usize, String> {
    match text.parse::<u64>() {
        Ok(n) if n <= MAX_THREADS => Ok(n as usize),
        _ => Err(format!(
            "must be a number of threads up to {MAX_THREADS}; 0 is one per core, and more than cores gain nothing"
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_and_times_are_read_with_their_units_and_refused_without() {
        assert_eq!(
            (parse_size("2GB"), parse_size("500 mb"), parse_size("1.5kB")),
            (Ok(2e9), Ok(5e8), Ok(1500.0))
        );
        assert_eq!(
            (parse_duration("90s"), parse_duration("10min"), parse_duration("2h")),
            (Ok(90.0), Ok(600.0), Ok(7200.0))
        );
        for wrong in ["2", "GB", "-1GB", "NaNGB", "1e400GB", ""] {
            assert!(parse_size(wrong).is_err(), "{wrong}");
        }
        assert!(parse_duration("10").is_err() && parse_duration("0s").is_err());
        assert!(
            parse_threads("0").is_ok()
                && parse_threads("1024").is_ok()
                && parse_threads("100000").is_err()
                && parse_threads("-1").is_err()
        );
    }

    #[test]
    fn work_above_a_limit_is_refused_with_estimate_and_remedy() {
        let estimate = ResourceEstimate {
            description: "1e9 trials".to_owned(),
            memory_bytes: 8e11,
            duration_s: 7300.0,
            remedy: "run fewer (--trials)",
        };
        let message = ResourceLimits::default()
            .check(Path::new("a.ron"), &estimate, true)
            .expect_err("800 GB")
            .to_string();
        for word in ["a.ron: 1e9 trials", "800 GB", "2 GB", "--trials", "--limit-memory"] {
            assert!(message.contains(word), "{message}");
        }
        let all = ResourceLimits { limit_memory: 1e12, limit_time: None };
        assert!(all.check(Path::new("a.ron"), &estimate, true).is_ok());
        let hour = ResourceLimits { limit_time: Some(3600.0), ..all };
        let message = hour.check(Path::new("a.ron"), &estimate, true).expect_err("two hours").to_string();
        assert!(
            message.contains("2 h") && message.contains("60 min") && message.contains("--limit-time"),
            "{message}"
        );
    }
}
