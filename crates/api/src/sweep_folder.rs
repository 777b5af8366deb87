//! A sweep in its folder: shards that outlive a kill, the tables made of them, one trial of it again.

use crate::error::Error;
use crate::output_folder::{self, OutputLock};
use crate::sweep::write_result_files;
use std::path::Path;
use std::time::Instant;
use stylet_scenario::Scenario;
use stylet_sweep::shard::{self, ShardNumber};
use stylet_sweep::{
    Columns, DiskTrialTable, Overrides, Summary, Sweep, TrialRow, TrialSampler, TrialTableWriter, run_trials,
};

/// Trials of a shard when a whole sweep splits the work itself: what a kill can cost at most.
pub const SHARD_TRIALS: u64 = 1024;

/// Trials that are run to see how long one takes.
const PROBE: u64 = 32;

/// Refuses to mix a sweep of so many shards with what is unfinished in the folder.
///
/// # Errors
/// [`Error::Request`] with what would be right.
pub fn check_unfinished(
    sweep: &Sweep,
    columns: &Columns,
    out: &Path,
    of: u64,
    resume: bool,
) -> Result<(), Error> {
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
        // A shard of another split is foreign, whatever it holds.
        shard::read(sweep, columns, ShardNumber { shard: 1, of: *split }, out)?;
        let what = format!(
            "{}: is split into {split} shards, not {of}; finish it with: stylet sweep merge",
            out.display()
        );
        return Err(Error::Request(what));
    }
    Ok(())
}

/// The rows of all shards: those that are in the folder (`there` is told of their trials), and new ones, which are written there (`done` is
/// told of them). They lie on disk, in the folder.
///
/// # Errors
/// [`Error::Trial`] for a trial that gives no row, [`Error::Request`] for a shard that is foreign or cannot be written.
pub fn run_all_shards(
    sweep: &Sweep,
    columns: &Columns,
    out: &Path,
    of: u64,
    there: &(dyn Fn(u64) + Sync),
    done: &(dyn Fn(u64) + Sync),
) -> Result<DiskTrialTable, Error> {
    let mut all = Gathered::new(columns, out)?;
    for shard in 1..=of {
        let number = ShardNumber { shard, of };
        if number.path(out).exists() {
            let rows = shard::read(sweep, columns, number, out)?;
            there(rows.len() as u64);
            all.take(&rows)?;
            continue;
        }
        let rows = run_trials(sweep, columns, number.range(sweep.trials()), done)?;
        shard::write(sweep, columns, number, &rows, out)?;
        all.take(&rows)?;
    }
    all.finish()
}

/// Rows of one shard after the other.
struct Gathered<'a> {
    out: &'a Path,
    rows: TrialTableWriter,
}

impl<'a> Gathered<'a> {
    fn new(columns: &Columns, out: &'a Path) -> Result<Self, Error> {
        let rows = TrialTableWriter::new(out, columns).map_err(|why| Error::output(out, why))?;
        Ok(Self { out, rows })
    }

    fn take(&mut self, rows: &[TrialRow]) -> Result<(), Error> {
        rows.iter().try_for_each(|row| self.rows.push(row)).map_err(|why| Error::output(self.out, why))
    }

    fn finish(self) -> Result<DiskTrialTable, Error> {
        self.rows.finish().map_err(|why| Error::output(self.out, why))
    }
}

/// Runs one shard and writes it; with `resume` a whole shard of this sweep stays as it is.
///
/// # Errors
/// As [`all_shards`]; [`Error::Busy`] when a whole sweep is written there.
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
/// [`Error::Request`] when one is missing or foreign.
pub fn read_all_shards(sweep: &Sweep, columns: &Columns, out: &Path) -> Result<DiskTrialTable, Error> {
    let of = shard::shard_count(out)?;
    let mut all = Gathered::new(columns, out)?;
    for shard in 1..=of {
        all.take(&shard::read(sweep, columns, ShardNumber { shard, of }, out)?)?;
    }
    all.finish()
}

/// Writes the results into the claimed folder `out` and removes the shards.
///
/// # Errors
/// [`Error::Output`].
pub fn write_results(
    sweep: &Sweep,
    columns: &Columns,
    rows: &DiskTrialTable,
    (claim, out): (&OutputLock, &Path),
) -> Result<Summary, Error> {
    let (output, summary) = write_result_files(sweep, columns, rows, claim)?;
    output.write_locked(claim)?;
    let _ = std::fs::remove_dir_all(out.join(shard::SHARD_FOLDER));
    Ok(summary)
}

/// Seconds that a trial takes here on the threads that call, by running a few.
///
/// # Errors
/// [`Error::Trial`] for a trial that gives no row.
pub fn measure_trial_s(sweep: &Sweep, columns: &Columns) -> Result<f64, Error> {
    let probe = PROBE.min(sweep.trials());
    let start = Instant::now();
    run_trials(sweep, columns, 0..probe, &|_| {})?;
    Ok(start.elapsed().as_secs_f64() / probe as f64)
}

/// The scenario of a trial of the sweep whose results a folder holds.
///
/// # Errors
/// [`Error::Request`] when it is no such folder or has no such trial, [`Error::NotOneSet`] when its files were changed.
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
