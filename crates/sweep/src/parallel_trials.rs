//! Runs trials in parallel. Rows are in order and have the same bits for any number of threads.

use crate::sample_trial::{SamplingError, TrialSampler};
use crate::sweep_file::Sweep;
use crate::trial_row::{Columns, TrialRow};
use crate::trial_simulation::{self, Workspace};
use rayon::prelude::*;
use std::ops::Range;
use stylet_testbed::SimulateError;

/// Error of a trial.
#[derive(Debug, thiserror::Error)]
pub enum TrialError {
    /// No draw was valid.
    #[error(transparent)]
    Draw(#[from] SamplingError),
    /// The scenario cannot be replayed.
    #[error("trial {trial}: {why}")]
    Simulate {
        /// Number of the trial.
        trial: u64,
        /// Reason and remedy.
        why: SimulateError,
    },
}

/// Trials per task.
const CHUNK: u64 = 16;

/// Runs the trials of `range` in the current thread pool; `done` is called with the number of finished trials.
///
/// # Errors
/// The [`TrialError`] of the first trial that failed.
pub fn run_trials(
    sweep: &Sweep,
    columns: &Columns,
    range: Range<u64>,
    done: &(dyn Fn(u64) + Sync),
) -> Result<Vec<TrialRow>, TrialError> {
    let drawer = TrialSampler::new(sweep);
    let chunks = (range.end - range.start).div_ceil(CHUNK);
    let chunks: Vec<Result<Vec<TrialRow>, TrialError>> = (0..chunks)
        .into_par_iter()
        .map_init(Workspace::default, |workspace, chunk| {
            let first = range.start + chunk * CHUNK;
            let chunk = first..(first + CHUNK).min(range.end);
            let count = chunk.end - chunk.start;
            let rows = chunk.map(|trial| run_trial(&drawer, columns, trial, workspace)).collect();
            done(count);
            rows
        })
        .collect();
    let mut rows = Vec::with_capacity((range.end - range.start) as usize);
    for chunk in chunks {
        rows.extend(chunk?);
    }
    Ok(rows)
}

fn run_trial(
    drawer: &TrialSampler<'_>,
    columns: &Columns,
    trial: u64,
    workspace: &mut Workspace,
) -> Result<TrialRow, TrialError> {
    let drawn = drawer.draw(trial)?;
    let score = trial_simulation::run(&drawn.scenario, workspace)
        .map_err(|why| TrialError::Simulate { trial, why })?;
    Ok(columns.row(&drawn, &score))
}

/// As [`run_trials`] in a pool with `threads` threads; 0 means one per core.
///
/// # Errors
/// As [`run_trials`]; if the pool cannot be created, the current one is used.
pub fn run_trials_with_threads(
    sweep: &Sweep,
    columns: &Columns,
    range: Range<u64>,
    threads: usize,
    done: &(dyn Fn(u64) + Sync),
) -> Result<Vec<TrialRow>, TrialError> {
    match rayon::ThreadPoolBuilder::new().num_threads(threads).build() {
        Ok(pool) => pool.install(|| run_trials(sweep, columns, range, done)),
        Err(_) => run_trials(sweep, columns, range, done),
    }
}
