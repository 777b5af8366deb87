//! Sweeps: insertions with random parameters.

use crate::background_work::run_in_background;
use crate::callable::with_exceptions;
use crate::failure;
use crate::run::ScenarioSource;
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;
use stylet::{SweepResult, sweep::input_files};

/// The rows and the summary of a sweep.
#[pyclass(frozen)]
pub struct Sweep {
    swept: SweepResult,
    sweep: stylet::Sweep,
}

/// Runs a sweep: a file, or a `Sweep(...)` as JSON with its scenario as a separate argument.
#[pyfunction]
#[pyo3(signature = (path=None, json=None, scenario=None, trials=None, seed=None, progress=None))]
#[allow(clippy::too_many_arguments, reason = "keyword arguments of a Python function")]
pub fn sweep(
    py: Python<'_>,
    path: Option<PathBuf>,
    json: Option<&str>,
    scenario: Option<ScenarioSource>,
    trials: Option<u64>,
    seed: Option<u64>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Sweep> {
    let sweep = match (path, json, scenario) {
        (Some(path), None, None) => {
            stylet::Sweep::load(&path, stylet::sweep::Overrides { trials, seed }).map_err(failure)?
        }
        (None, Some(json), Some(scenario)) => {
            let mut file: stylet::SweepFile =
                serde_json::from_str(json).map_err(|e| failure(format!("sweep: {e}")))?;
            file.trials = trials.unwrap_or(file.trials);
            file.seed = seed.unwrap_or(file.seed);
            stylet::Sweep::new("sweep".to_owned(), file, scenario.read()?)
                .map_err(|p| failure(format!("sweep: {}: {}", p.path, p.message)))?
        }
        _ => return Err(failure("a sweep is either a file, or a dict and a scenario")),
    };
    let ran = run_in_background(py, progress, move |callback| {
        let swept = stylet::sweep(&sweep, |done| callback.report("trials", done));
        (sweep, swept)
    })?;
    let (sweep, swept) = ran;
    let swept =
        with_exceptions(py, swept.map_err(failure))?.ok_or_else(|| failure("the sweep was stopped"))?;
    Ok(Sweep { swept, sweep })
}

#[pymethods]
impl Sweep {
    /// One row per insertion: trial, seed, varied parameters, scores.
    fn columns<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let dict = PyDict::new(py);
        let (columns, rows) = (&self.swept.columns, &self.swept.rows);
        dict.set_item("trial", PyArray1::from_iter(py, rows.iter().map(|r| r.trial)))?;
        dict.set_item("seed", PyArray1::from_iter(py, rows.iter().map(|r| r.seed)))?;
        dict.set_item("redrawn", PyArray1::from_iter(py, rows.iter().map(|r| r.redrawn)))?;
        for (i, name) in columns.drawn.iter().chain(&columns.scores).enumerate() {
            let column = rows.iter().map(|r| r.values.get(i).copied().unwrap_or(f64::NAN));
            dict.set_item(name, PyArray1::from_iter(py, column))?;
        }
        Ok(dict)
    }

    /// `summary.json` as the command writes it.
    fn summary_json(&self) -> PyResult<String> {
        serde_json::to_string_pretty(&self.swept.summary).map_err(failure)
    }

    /// The report as one HTML page.
    fn html(&self) -> String {
        self.swept.html(&self.sweep)
    }

    /// `sweep.ron` and `scenario.ron`, which repeat the sweep.
    fn inputs(&self) -> PyResult<Vec<(String, String)>> {
        let output = input_files(&self.sweep).map_err(failure)?;
        Ok(output.files().map(|(n, c)| (n.to_owned(), String::from_utf8_lossy(c).into_owned())).collect())
    }
}
