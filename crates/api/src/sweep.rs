//! Many drawn insertions: rows, summary, the files of a sweep's folder.

use crate::error::Error;
use crate::output::Output;
use stylet_pages::sweep::page;
pub use stylet_sweep::Overrides;
use stylet_sweep::{Columns, Row, Summary, Sweep, csv, rows, summarise};

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
        page(sweep, &self.columns, &self.rows, &self.summary).to_html()
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
    let summary = summarise(sweep, &columns, &all, HERE);
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

/// Table, summary and report.
///
/// # Errors
/// [`Error::Internal`] when a value cannot be written.
pub fn results(sweep: &Sweep, columns: &Columns, rows: &[Row]) -> Result<(Output, Summary), Error> {
    let summary = summarise(sweep, columns, rows, HERE);
    let mut output = inputs(sweep)?;
    output.add("trials.csv", csv(columns, rows));
    #[cfg(feature = "parquet")]
    output.add("trials.parquet", stylet_sweep::parquet(columns, rows).map_err(Error::internal)?);
    output.add_json("summary.json", &summary)?;
    output.add("report.html", page(sweep, columns, rows, &summary).to_html());
    Ok((output, summary))
}
