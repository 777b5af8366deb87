//! Many drawn insertions: rows, summary, the files of a sweep's folder.

use crate::error::Error;
use crate::folder::Claim;
use crate::output::Output;
use std::io;
use stylet_pages::sweep::page;
pub use stylet_sweep::Overrides;
use stylet_sweep::{Columns, Row, Summary, Sweep, TrialsOnDisk, csv, rows, summarise};

/// What a sweep gives.
pub struct Swept {
    /// What the columns of a row are called.
    pub columns: Columns,
    /// One row per insertion.
    pub rows: Vec<Row>,
    /// Rates with intervals, distributions, worst trials, what explains them.
    pub summary: Summary,
}

impl Swept {
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
pub fn sweep(sweep: &Sweep, mut progress: impl FnMut(u64) -> bool) -> Result<Option<Swept>, Error> {
    let columns = Columns::new(sweep);
    let mut all: Vec<Row> = Vec::with_capacity(sweep.trials() as usize);
    while (all.len() as u64) < sweep.trials() {
        let from = all.len() as u64;
        all.extend(rows(sweep, &columns, from..(from + BATCH).min(sweep.trials()), &|_| {})?);
        if !progress(all.len() as u64) {
            return Ok(None);
        }
    }
    let Ok(summary) = summarise(sweep, &columns, &all[..], HERE);
    Ok(Some(Swept { columns, rows: all, summary }))
}

/// Folder name in replay commands: results do not depend on where they lie.
const HERE: &str = "DIR";

/// What repeats the sweep.
///
/// # Errors
/// [`Error::Internal`] when a value cannot be written.
pub fn inputs(sweep: &Sweep) -> Result<Output, Error> {
    let mut output = Output::default();
    output.add("scenario.ron", sweep.scenario().to_ron().map_err(Error::internal)?);
    output.add("sweep.ron", sweep.to_ron());
    Ok(output)
}

/// Table, summary and report. The table is written into the claimed folder at once, as part of a set that is announced when the output is
/// written there.
///
/// # Errors
/// [`Error::Output`] when the folder does not take the table or give the rows, [`Error::Internal`] when a value cannot be written.
pub fn results(
    sweep: &Sweep,
    columns: &Columns,
    rows: &TrialsOnDisk,
    claim: &Claim,
) -> Result<(Output, Summary), Error> {
    let out_of = |why: io::Error| Error::output(claim.folder(), why);
    let summary = summarise(sweep, columns, rows, HERE).map_err(out_of)?;
    let mut output = inputs(sweep)?;
    let mut table = claim.begin("trials.csv")?;
    csv(columns, rows, &mut table).map_err(out_of)?;
    output.add_part(table.finish()?);
    #[cfg(feature = "parquet")]
    {
        let mut table = claim.begin("trials.parquet")?;
        stylet_sweep::parquet(columns, rows, &mut table).map_err(out_of)?;
        output.add_part(table.finish()?);
    }
    output.add_json("summary.json", &summary)?;
    output.add("report.html", page(sweep, columns, rows, &summary).map_err(out_of)?.to_html());
    Ok((output, summary))
}
