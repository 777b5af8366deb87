//! Many drawn insertions: rows, summary, the files of a sweep's folder.

use crate::error::Error;
use crate::output_files::OutputFiles;
use crate::output_folder::OutputLock;
use std::io;
use stylet_report::pages::sweep::page;
pub use stylet_sweep::Overrides;
use stylet_sweep::{Columns, DiskTrialTable, Summary, Sweep, TrialRow, run_trials, summarise, write_csv};

/// What a sweep gives.
pub struct SweepResult {
    /// What the columns of a row are called.
    pub columns: Columns,
    /// One row per insertion.
    pub rows: Vec<TrialRow>,
    /// Rates with intervals, distributions, worst trials, what explains them.
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

/// Trials between two questions whether to go on.
const BATCH: u64 = 256;

/// Runs all trials of a sweep on all cores; `progress` is told how many are done, and ends the sweep (`None`) by `false`.
///
/// # Errors
/// [`Error::Trial`] for the first trial that gives no row.
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
    let Ok(summary) = summarise(sweep, &columns, &all[..], HERE);
    Ok(Some(SweepResult { columns, rows: all, summary }))
}

/// Folder name in replay commands: results do not depend on where they lie.
const HERE: &str = "DIR";

/// What repeats the sweep.
///
/// # Errors
/// [`Error::Internal`] when a value cannot be written.
pub fn input_files(sweep: &Sweep) -> Result<OutputFiles, Error> {
    let mut output = OutputFiles::default();
    output.add("scenario.ron", sweep.scenario().to_ron().map_err(Error::internal)?);
    output.add("sweep.ron", sweep.to_ron());
    Ok(output)
}

/// Table, summary and report. The table is written into the claimed folder at once, as part of a set that is announced when the output is
/// written there.
///
/// # Errors
/// [`Error::Output`] when the folder does not take the table or give the rows, [`Error::Internal`] when a value cannot be written.
pub fn write_result_files(
    sweep: &Sweep,
    columns: &Columns,
    rows: &DiskTrialTable,
    claim: &OutputLock,
) -> Result<(OutputFiles, Summary), Error> {
    let out_of = |why: io::Error| Error::output(claim.folder(), why);
    let summary = summarise(sweep, columns, rows, HERE).map_err(out_of)?;
    let mut output = input_files(sweep)?;
    let mut table = claim.stage_file("trials.csv")?;
    write_csv(columns, rows, &mut table).map_err(out_of)?;
    output.add_staged(table.finish()?);
    #[cfg(feature = "parquet")]
    {
        let mut table = claim.stage_file("trials.parquet")?;
        stylet_sweep::write_parquet(columns, rows, &mut table).map_err(out_of)?;
        output.add_staged(table.finish()?);
    }
    output.add_json("summary.json", &summary)?;
    output.add("report.html", page(sweep, columns, rows, &summary).map_err(out_of)?.to_html());
    Ok((output, summary))
}
