//! Planning of the next insertion.

use crate::background_work::run_in_background;
use crate::callable::with_exceptions;
use crate::diagnosis::{Measured, to_recordings};
use crate::failure;
use crate::run::ScenarioSource;
use pyo3::prelude::*;
use std::cell::Cell;
use std::path::{Path, PathBuf};
use stylet::Limits;

/// A planned insertion.
#[pyclass(frozen)]
pub struct Plan {
    json: Vec<u8>,
    motion: String,
    html: String,
}

/// The limits of a motion: from a file, RON text or JSON.
fn limits(kind: &str, source: &str) -> PyResult<Limits> {
    let limits: Limits = match kind {
        "path" => stylet::scenario::load(Path::new(source)).map_err(failure)?,
        "json" => serde_json::from_str(source).map_err(|e| failure(format!("limits: {e}")))?,
        _ => stylet::scenario::parse("limits", source).map_err(failure)?,
    };
    limits.check().map_err(|e| failure(format!("limits: {e}")))?;
    Ok(limits)
}

/// Plans the next insertion, after the given recordings if any. `read`: column map of the files, and whether rows with backward time stamps are
/// dropped.
#[pyfunction]
#[pyo3(signature = (scenario, measured, within, read, simulated=true, progress=None))]
pub fn plan(
    py: Python<'_>,
    scenario: ScenarioSource,
    measured: Vec<Measured<'_>>,
    within: (String, String),
    read: (Option<PathBuf>, bool),
    simulated: bool,
    progress: Option<Py<PyAny>>,
) -> PyResult<Plan> {
    let assumed = scenario.read()?;
    let limits = limits(&within.0, &within.1)?;
    let recordings = to_recordings(&measured, read.0, read.1)?;
    let name = scenario.path().unwrap_or("scenario").to_owned();
    let planned = run_in_background(py, progress, move |callback| {
        let done = Cell::new(0);
        let report_stage = |what: &str| {
            done.set(done.get() + 1);
            callback.report_or_stop(what, done.get());
        };
        let at = [Path::new(&name), Path::new("limits")];
        let planned =
            stylet::plan_after_recordings(assumed, &recordings, &limits, simulated, at, &report_stage)?;
        Ok(Plan { json: planned.json()?, motion: planned.motion_ron()?, html: planned.html() })
    })?;
    with_exceptions(py, planned.map_err(|e: stylet::Error| failure(e)))
}

#[pymethods]
impl Plan {
    /// `plan.json` as the command writes it.
    fn json(&self) -> &[u8] {
        &self.json
    }

    /// The motion as RON.
    fn motion_ron(&self) -> &str {
        &self.motion
    }

    /// The report.
    fn html(&self) -> &str {
        &self.html
    }
}
