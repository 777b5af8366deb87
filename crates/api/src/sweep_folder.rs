//! A sweep in its folder: shards that outlive a kill, the tables made of them, one trial of it again.

use crate::error::Error;
use crate::folder::{self, Claim};
use crate::sweep::results;
use std::path::Path;
use std::time::Instant;
use stylet_scenario::Scenario;
use stylet_sweep::shard::{self, ShardNumber};
use stylet_sweep::{Columns, Drawer, Overrides, Row, Summary, Sweep, TrialsOnDisk, TrialsWriter, rows};

/// Trials of a shard when a whole sweep splits the work itself: what a kill can cost at most.
pub const SHARD_TRIALS: u64 = 1024;

/// Trials that are run to see how long one takes.
const PROBE: u64 = 32;

/// Refuses to mix a sweep of so many shards with what is unfinished in the folder.
///
/// # Errors
/// [`Error::Request`] with what would be right.
pub fn begin(sweep: &Sweep, columns: &Columns, out: &Path, of: u64, resume: bool) -> Result<(), Error> {
    let unfinished = shard::split_of(out);
    if let (Ok(split), false) = (&unfinished, resume) {
        let what = format!(
            "{}: holds an unfinished sweep in {split} shards; go on with --resume, or remove {}",
            out.display(),
            out.join(shard::FOLDER).display()
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
pub fn all_shards(
    sweep: &Sweep,
    columns: &Columns,
    out: &Path,
    of: u64,
    there: &(dyn Fn(u64) + Sync),
    done: &(dyn Fn(u64) + Sync),
) -> Result<TrialsOnDisk, Error> {
    let mut all = Gathered::new(columns, out)?;
    for shard in 1..=of {
        let number = ShardNumber { shard, of };
        if number.path(out).exists() {
            let rows = shard::read(sweep, columns, number, out)?;
            there(rows.len() as u64);
            all.take(&rows)?;
            continue;
        }
        let rows = rows(sweep, columns, number.range(sweep.trials()), done)?;
        shard::write(sweep, columns, number, &rows, out)?;
        all.take(&rows)?;
    }
    all.finish()
}

/// Rows of one shard after the other.
struct Gathered<'a> {
    out: &'a Path,
    rows: TrialsWriter,
}

impl<'a> Gathered<'a> {
    fn new(columns: &Columns, out: &'a Path) -> Result<Self, Error> {
        let rows = TrialsWriter::new(out, columns).map_err(|why| Error::output(out, why))?;
        Ok(Self { out, rows })
    }

    fn take(&mut self, rows: &[Row]) -> Result<(), Error> {
        rows.iter().try_for_each(|row| self.rows.push(row)).map_err(|why| Error::output(self.out, why))
    }

    fn finish(self) -> Result<TrialsOnDisk, Error> {
        self.rows.finish().map_err(|why| Error::output(self.out, why))
    }
}

/// Runs one shard and writes it; with `resume` a whole shard of this sweep stays as it is.
///
/// # Errors
/// As [`all_shards`]; [`Error::Busy`] when a whole sweep is written there.
pub fn one_shard(
    sweep: &Sweep,
    columns: &Columns,
    number: ShardNumber,
    out: &Path,
    resume: bool,
) -> Result<(), Error> {
    let _claim = Claim::shared(out)?;
    if resume && shard::read(sweep, columns, number, out).is_ok() {
        return Ok(());
    }
    let rows = rows(sweep, columns, number.range(sweep.trials()), &|_| {})?;
    Ok(shard::write(sweep, columns, number, &rows, out)?)
}

/// The rows of the shards in a folder.
///
/// # Errors
/// [`Error::Request`] when one is missing or foreign.
pub fn merged(sweep: &Sweep, columns: &Columns, out: &Path) -> Result<TrialsOnDisk, Error> {
    let of = shard::split_of(out)?;
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
pub fn conclude(
    sweep: &Sweep,
    columns: &Columns,
    rows: &TrialsOnDisk,
    (claim, out): (&Claim, &Path),
) -> Result<Summary, Error> {
    let (output, summary) = results(sweep, columns, rows, claim)?;
    output.write_to(claim)?;
    let _ = std::fs::remove_dir_all(out.join(shard::FOLDER));
    Ok(summary)
}

/// Seconds that a trial takes here on the threads that call, by running a few.
///
/// # Errors
/// [`Error::Trial`] for a trial that gives no row.
pub fn trial_s(sweep: &Sweep, columns: &Columns) -> Result<f64, Error> {
    let probe = PROBE.min(sweep.trials());
    let start = Instant::now();
    rows(sweep, columns, 0..probe, &|_| {})?;
    Ok(start.elapsed().as_secs_f64() / probe as f64)
}

/// The scenario of a trial of the sweep whose results a folder holds.
///
/// # Errors
/// [`Error::Request`] when it is no such folder or has no such trial, [`Error::NotOneSet`] when its files were changed.
pub fn trial_of(folder: &Path, trial: u64) -> Result<Scenario, Error> {
    let file = folder.join("sweep.ron");
    folder::settle(folder)?;
    if !file.exists() {
        let what = format!("{}: is not the folder of a sweep (it holds no sweep.ron)", folder.display());
        return Err(Error::Request(what));
    }
    folder::verify(folder, &["scenario.ron", "sweep.ron", "trials.csv"])?;
    let sweep = Sweep::load(&file, Overrides::default())?;
    if trial >= sweep.trials() {
        let what = format!("trial {trial}: the sweep has trials 0 to {}", sweep.trials() - 1);
        return Err(Error::Request(what));
    }
    let drawn = Drawer::new(&sweep).draw(trial).map_err(|e| Error::Request(e.to_string()))?;
    Ok(drawn.scenario)
}
