//! Sampling of a file: rate, bursts, gaps, steps back, restarts.

use super::Sampling;
use crate::time_order::{GAP_INTERVALS, MIN_SAMPLE_NUMBERS, is_in_bursts, second_run_row};

/// The sampling of time stamps (s; NaN where a row has none). `to_s` are seconds per unit of the file, `line` gives the line of
/// a row.
pub(super) fn sampling(time_s: &[f64], to_s: f64, line: impl Fn(usize) -> Option<u64>) -> Option<Sampling> {
    let rows: Vec<usize> = (0..time_s.len()).filter(|row| time_s[*row].is_finite()).collect();
    let times: Vec<f64> = rows.iter().map(|row| time_s[*row]).collect();
    if times.len() < 2 {
        return None;
    }
    let line_of = |at: usize| line(rows[at]);
    let low = times.iter().copied().fold(f64::INFINITY, f64::min);
    let high = times.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let median_interval_s =
        stylet_stats::median_of(times.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > 0.0));
    let repeated = |pair: &&[f64]| pair[1] == pair[0];
    let backward = |pair: &&[f64]| pair[1] < pair[0];
    let pairs = || times.windows(2);
    let second_run = second_run_row(&times);
    // The rate of a file with two recordings is that of the first.
    let first = &times[..second_run.unwrap_or(times.len())];
    let duration_s = if second_run.is_some() { first.last()? - first.first()? } else { high - low };
    let bursts = is_in_bursts(&times);
    let stamps = pairs().filter(|pair| pair[1] != pair[0]).count() + 1;
    let intervals = pairs().map(|pair| pair[1] - pair[0]);
    let gap_s = GAP_INTERVALS * median_interval_s;
    Some(Sampling {
        samples: times.len(),
        duration_s,
        rate_hz: if duration_s > 0.0 { (first.len() - 1) as f64 / duration_s } else { 0.0 },
        median_interval_s: if median_interval_s.is_finite() { median_interval_s } else { 0.0 },
        repeated: pairs().filter(repeated).count(),
        repeated_line: pairs().position(|pair| pair[1] == pair[0]).and_then(|at| line_of(at + 1)),
        backward: pairs().filter(backward).count(),
        backward_line: pairs().position(|pair| pair[1] < pair[0]).and_then(|at| line_of(at + 1)),
        per_burst: bursts.then(|| times.len() as f64 / stamps as f64),
        gaps: intervals.clone().filter(|interval| *interval > gap_s).count(),
        largest_interval_s: intervals.fold(0.0, f64::max),
        second_run_line: second_run.and_then(line_of),
        counts_samples: times.len() >= MIN_SAMPLE_NUMBERS
            && pairs().all(|pair| ((pair[1] - pair[0]) / to_s - 1.0).abs() < 1e-9),
        alternating: false,
    })
}
