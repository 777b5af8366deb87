//! `enhanced.csv`: the recording with the outputs of the first run, a row per sample.

use crate::error::Error;
use crate::run_report::AlgorithmRun;
use stylet_core::{Output, State, UnusedReason};
use stylet_record::csv_writer::{RowWriter, column_names};
use stylet_record::{RecordError, Recording};

/// Output columns, after those of the recording.
const OUTPUT_COLUMNS: [&str; 6] =
    ["enhanced_n", "low_n", "high_n", "reconstructed_n", "estimated_cumulative_friction_ns_per_m", "state"];

/// Appends the output columns to those of a recording.
pub(super) fn header(mut columns: Vec<String>) -> Vec<String> {
    columns.extend(OUTPUT_COLUMNS.map(str::to_owned));
    columns
}

/// The state of a sample, or why the core ignored it.
pub(super) fn state_word(state: State, unused: Option<UnusedReason>) -> &'static str {
    match unused {
        None => state.name(),
        Some(UnusedReason::NotFinite) => "unused: not finite",
        Some(UnusedReason::OutOfRange) => "unused: out of range",
        Some(UnusedReason::NotLater) => "unused: time not later",
        Some(UnusedReason::TimeJump) => "unused: time jump",
    }
}

/// Output values of a sample, without its state; empty where the core ignored it.
pub(super) fn enhanced_values(out: &Output) -> [f64; 5] {
    let [low, high] = out.band_n.unwrap_or([f64::NAN; 2]);
    [out.enhanced_n, low, high, out.reconstructed_n, out.cumulative_friction_ns_per_m]
}

/// The table of a recording in memory.
pub(super) fn enhanced_csv(recording: &Recording, runs: &[AlgorithmRun]) -> Result<Vec<u8>, Error> {
    let Some(AlgorithmRun { trace, .. }) = runs.first() else { return Ok(Vec::new()) };
    recording.check()?;
    let failed = |why: std::io::Error| RecordError::from(why);
    let mut table = RowWriter::new(&header(column_names(recording, None)), Vec::new()).map_err(failed)?;
    let mut row = Vec::new();
    for (at, sample) in recording.samples().enumerate() {
        row.clear();
        row.extend([sample.time_s, sample.position_m, sample.force_n]);
        row.extend(recording.velocity_measured.then_some(sample.velocity_mps));
        row.extend(recording.force_virtual_n.as_ref().and_then(|force_n| force_n.get(at)));
        row.extend(recording.joint_torque_nm.get(at).into_iter().flatten());
        let outputs = [
            trace.enhanced_n[at],
            trace.low_n[at],
            trace.high_n[at],
            trace.reconstructed_n[at],
            trace.cumulative_friction_ns_per_m[at],
        ];
        let word = state_word(trace.state[at], trace.unused_reason[at]);
        table.write_row(&row, &outputs, word).map_err(failed)?;
    }
    Ok(table.finish().map_err(failed)?)
}
