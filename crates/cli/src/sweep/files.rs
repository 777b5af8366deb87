//! The files of a sweep's folder.

use crate::exit::Failure;
use crate::output::Output;
use stylet_sweep::{Columns, Row, Summary, Sweep, csv, page, summarise};

/// Folder name in replay commands: results do not depend on where they lie.
const HERE: &str = "DIR";

fn internal(e: &dyn std::fmt::Display) -> Failure {
    Failure::Internal(e.to_string())
}

/// What repeats the sweep.
pub fn inputs(sweep: &Sweep) -> Result<Output, Failure> {
    let mut output = Output::default();
    output.add("scenario.ron", sweep.scenario().to_ron().map_err(|e| internal(&e))?);
    output.add("sweep.ron", sweep.to_ron());
    Ok(output)
}

/// Table, summary and report.
pub fn results(sweep: &Sweep, columns: &Columns, rows: &[Row]) -> Result<(Output, Summary), Failure> {
    let summary = summarise(sweep, columns, rows, HERE);
    let mut json = serde_json::to_vec_pretty(&summary).map_err(|e| internal(&e))?;
    json.push(b'\n');
    let mut output = inputs(sweep)?;
    output.add("trials.csv", csv(columns, rows));
    #[cfg(feature = "parquet")]
    output.add("trials.parquet", stylet_sweep::parquet(columns, rows).map_err(|e| internal(&e))?);
    output.add("summary.json", json);
    output.add("report.html", page(sweep, columns, rows, &summary).to_html());
    Ok((output, summary))
}
