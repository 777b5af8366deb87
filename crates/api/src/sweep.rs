//! Sweeps: trials with random parameters, their summary, and the result files.

use crate::error::Error;
use crate::output_files::OutputFiles;
use crate::output_folder::OutputLock;
use std::io;
use stylet_report::pages::sweep::page;
pub use stylet_sweep::Overrides;
use stylet_sweep::{Columns, DiskTrialTable, Summary, Sweep, TrialRow, run_trials, summarise, write_csv};

/// Result of a sweep.
pub struct SweepResult {
    /// Names of the columns of a row.
    pub columns: Columns,
    /// One row per insertion.
    pub rows: Vec<TrialRow>,
    /// Rates with intervals, distributions, worst trials, sensitivity.
    pub summary: Summary,
}

impl SweepResult {
    /// The report as one HTML page.
    #[must_use]
    pub fn html(&self, sweep: &Sweep) -> String {
        let Ok(page) = page(sweep, &self.columns, &self.rows[..], &self.summary);
        page.to_html()
    }
}

/// Trials between two calls of `progress`.
const BATCH: u64 = 256;

/// Runs all trials of a sweep on all cores. `progress` is called with the number of finished trials; `false` ends the sweep (`None`).
///
/// # Errors
/// [`Error::Trial`] for the first trial that fails.
pub fn sweep(sweep: &Sweep, mut progress: impl FnMut(u64) -> bool) -> Result<Option<SweepResult>, Error> {
    let columns = Columns::new(sweep);
    let mut all: Vec<TrialRow> = Vec::with_capacity(sweep.trials() as usize);
    while (all.len() as u64) < sweep.trials() {
        let from = all.len() as u64;
        all.extend(run_trials(sweep, &columns, from..(from + BATCH).min(sweep.trials()), &|_| {})?);
        if !progress(all.len() as u64) {
            return Ok(None);
        }
    }
    let Ok(summary) = summarise(sweep, &columns, &all[..], FOLDER_PLACEHOLDER);
    Ok(Some(SweepResult { columns, rows: all, summary }))
}

/// Folder name in replay commands, so that results do not depend on their folder.
const FOLDER_PLACEHOLDER: &str = "DIR";

/// The files that repeat the sweep.
///
/// # Errors
/// [`Error::Internal`] when a value cannot be written.
pub fn input_files(sweep: &Sweep) -> Result<OutputFiles, Error> {
    let mut output = OutputFiles::default();
    output.add("scenario.ron", sweep.scenario().to_ron().map_err(Error::internal)?);
    output.add("sweep.ron", sweep.to_ron());
    Ok(output)
}

/// Table, summary and report. The table is staged in the locked folder; writing the returned files there commits it.
///
/// # Errors
/// [`Error::Output`] when the table cannot be written or the rows cannot be read, [`Error::Internal`] when a value cannot be written.
pub fn write_result_files(
    sweep: &Sweep,
    columns: &Columns,
    rows: &DiskTrialTable,
    lock: &OutputLock,
) -> Result<(OutputFiles, Summary), Error> {
    let out_of = |why: io::Error| Error::output(lock.folder(), why);
    let summary = summarise(sweep, columns, rows, FOLDER_PLACEHOLDER).map_err(out_of)?;
    let mut output = input_files(sweep)?;
    let mut table = lock.stage_file("trials.csv")?;
    write_csv(columns, rows, &mut table).map_err(out_of)?;
    output.add_staged(table.finish()?);
    #[cfg(feature = "parquet")]
    {
        let mut table = lock.stage_file("trials.parquet")?;
        stylet_sweep::write_parquet(columns, rows, &mut table).map_err(out_of)?;
        output.add_staged(table.finish()?);
    }
    output.add_json("summary.json", &summary)?;
    output.add("report.html", page(sweep, columns, rows, &summary).map_err(out_of)?.to_html());
    Ok((output, summary))
}
