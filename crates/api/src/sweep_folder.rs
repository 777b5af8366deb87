//! The folder of a sweep: resumable shards, the tables made of them, and single trials.

use crate::error::Error;
use crate::output_folder::{self, Inputs, OutputLock};
use crate::sweep::write_result_files;
use std::path::Path;
use std::time::Instant;
use stylet_scenario::Scenario;
use stylet_sweep::shard::{self, ShardNumber};
use stylet_sweep::{
    Columns, DiskTrialTable, Overrides, Summary, Sweep, TrialRow, TrialSampler, TrialTableWriter, run_trials,
};

/// Trials per shard of a whole sweep; an interruption loses at most one shard.
pub const SHARD_TRIALS: u64 = 1024;

/// Trials run to measure the time of one.
const PROBE_TRIALS: u64 = 32;

/// Rejects a folder with an unfinished sweep that was not split into `of` shards, or with the results of another command.
///
/// # Errors
/// [`Error::Request`] with the remedy, [`Error::OtherCommand`].
pub fn check_unfinished(
    sweep: &Sweep,
    columns: &Columns,
    out: &Path,
    of: u64,
    resume: bool,
) -> Result<(), Error> {
    output_folder::check_same_command(out, &["summary.json"])?;
    let unfinished = shard::shard_count(out);
    if let (Ok(split), false) = (&unfinished, resume) {
        let what = format!(
            "{}: holds an unfinished sweep in {split} shards; go on with --resume, or remove {}",
            out.display(),
            out.join(shard::SHARD_FOLDER).display()
        );
        return Err(Error::Request(what));
    }
    if let (Ok(split), true) = (&unfinished, resume)
        && *split != of
    {
        // Reading fails with a better message when the shard belongs to another sweep.
        shard::read(sweep, columns, ShardNumber { shard: 1, of: *split }, out)?;
        let what = format!(
            "{}: is split into {split} shards, not {of}; finish it with: stylet sweep merge",
            out.display()
        );
        return Err(Error::Request(what));
    }
    Ok(())
}

/// The rows of all shards, on disk in the folder: shards present in the folder are read (`present` is called with their trials), the others
/// are run and written there (`done` is called with finished trials).
///
/// # Errors
/// [`Error::Trial`] for a trial that fails, [`Error::Request`] for a shard of another sweep or one that cannot be written.
pub fn run_all_shards(
    sweep: &Sweep,
    columns: &Columns,
    out: &Path,
    of: u64,
    present: &(dyn Fn(u64) + Sync),
    done: &(dyn Fn(u64) + Sync),
) -> Result<DiskTrialTable, Error> {
    let mut all = ShardRowCollector::new(columns, out)?;
    for shard in 1..=of {
        let number = ShardNumber { shard, of };
        if number.path(out).exists() {
            let rows = shard::read(sweep, columns, number, out)?;
            present(rows.len() as u64);
            all.take(&rows)?;
            continue;
        }
        let rows = run_trials(sweep, columns, number.range(sweep.trials()), done)?;
        shard::write(sweep, columns, number, &rows, out)?;
        all.take(&rows)?;
    }
    all.finish()
}

/// A failure after which finished shards remain in the folder.
fn kept_shards_error(out: &Path, why: std::io::Error) -> Error {
    shard::ShardError::Write { path: out.display().to_string(), why }.into()
}

/// Collects the rows of the shards in order.
struct ShardRowCollector<'a> {
    out: &'a Path,
    rows: TrialTableWriter,
}

impl<'a> ShardRowCollector<'a> {
    fn new(columns: &Columns, out: &'a Path) -> Result<Self, Error> {
        let rows = TrialTableWriter::new(out, columns).map_err(|why| kept_shards_error(out, why))?;
        Ok(Self { out, rows })
    }

    fn take(&mut self, rows: &[TrialRow]) -> Result<(), Error> {
        rows.iter().try_for_each(|row| self.rows.push(row)).map_err(|why| kept_shards_error(self.out, why))
    }

    fn finish(self) -> Result<DiskTrialTable, Error> {
        self.rows.finish().map_err(|why| kept_shards_error(self.out, why))
    }
}

/// Runs one shard and writes it; with `resume` a complete shard of this sweep is kept.
///
/// # Errors
/// As [`run_all_shards`]; [`Error::Busy`] when a whole sweep uses the folder.
pub fn run_shard(
    sweep: &Sweep,
    columns: &Columns,
    number: ShardNumber,
    out: &Path,
    resume: bool,
) -> Result<(), Error> {
    let _claim = OutputLock::lock_shared(out)?;
    if resume && shard::read(sweep, columns, number, out).is_ok() {
        return Ok(());
    }
    let rows = run_trials(sweep, columns, number.range(sweep.trials()), &|_| {})?;
    Ok(shard::write(sweep, columns, number, &rows, out)?)
}

/// The rows of the shards in a folder.
///
/// # Errors
/// [`Error::Request`] when one is missing or of another sweep.
pub fn read_all_shards(sweep: &Sweep, columns: &Columns, out: &Path) -> Result<DiskTrialTable, Error> {
    let of = shard::shard_count(out)?;
    let mut all = ShardRowCollector::new(columns, out)?;
    for shard in 1..=of {
        all.take(&shard::read(sweep, columns, ShardNumber { shard, of }, out)?)?;
    }
    all.finish()
}

/// Writes the results into the locked folder `out` and removes the shards, but no other files.
///
/// # Errors
/// [`Error::Output`].
pub fn write_results(
    sweep: &Sweep,
    columns: &Columns,
    rows: &DiskTrialTable,
    (lock, out): (&OutputLock, &Path),
    inputs: Inputs,
) -> Result<Summary, Error> {
    let written = write_result_files(sweep, columns, rows, lock)
        .and_then(|(output, summary)| output.with_inputs(inputs).write_locked(lock).map(|()| summary));
    let summary = written.map_err(|error| match error {
        Error::Output { why, .. } => kept_shards_error(out, why),
        other => other,
    })?;
    shard::remove_all(out);
    Ok(summary)
}

/// Measures the time of a trial (s) on the calling threads by running a few.
///
/// # Errors
/// [`Error::Trial`] for a trial that fails.
pub fn measure_trial_s(sweep: &Sweep, columns: &Columns) -> Result<f64, Error> {
    let probe = PROBE_TRIALS.min(sweep.trials());
    let start = Instant::now();
    run_trials(sweep, columns, 0..probe, &|_| {})?;
    Ok(start.elapsed().as_secs_f64() / probe as f64)
}

/// The scenario of a trial of the sweep in a folder.
///
/// # Errors
/// [`Error::Request`] when the folder holds no sweep or no such trial, [`Error::InconsistentSet`] when its files were changed.
pub fn trial_scenario(folder: &Path, trial: u64) -> Result<Scenario, Error> {
    let file = folder.join("sweep.ron");
    output_folder::recover(folder)?;
    if !file.exists() {
        let what = format!("{}: is not the folder of a sweep (it holds no sweep.ron)", folder.display());
        return Err(Error::Request(what));
    }
    output_folder::verify_manifest(folder, &["scenario.ron", "sweep.ron", "trials.csv"])?;
    let sweep = Sweep::load(&file, Overrides::default())?;
    if trial >= sweep.trials() {
        let what = format!("trial {trial}: the sweep has trials 0 to {}", sweep.trials() - 1);
        return Err(Error::Request(what));
    }
    let drawn = TrialSampler::new(&sweep).draw(trial).map_err(|e| Error::Request(e.to_string()))?;
    Ok(drawn.scenario)
}
