//! Diagnosis of measured recordings.

use crate::arrays::{Column, recording};
use crate::background_work::run_in_background;
use crate::callable::with_exceptions;
use crate::failure;
use crate::run::{CheckedScenario, ScenarioSource};
use numpy::PyArray1;
use pyo3::prelude::*;
use std::path::PathBuf;
use stylet::record::read_csv;
use stylet::{DiagnosisReport, NamedRecording, ReadOptions, Scenario};

/// One recording: a file, or a name with time, position, force and velocity (or none).
#[derive(FromPyObject)]
pub enum Measured<'py> {
    /// A CSV file.
    File(PathBuf),
    /// Columns under a name.
    Columns(String, Column<'py>, Column<'py>, Column<'py>, Option<Column<'py>>),
}

/// Result of a diagnosis.
#[pyclass(frozen)]
pub struct Diagnosis {
    found: Parts,
    assumed: String,
}

/// The parts that are kept; the intermediate results stay on the worker thread.
struct Parts {
    json: Vec<u8>,
    extended: Scenario,
    ron: String,
    html: String,
}

/// Compares an assumed scenario with measured recordings.
#[pyfunction]
#[pyo3(signature = (scenario, measured, columns=None, repair=false, force=false, progress=None))]
#[allow(clippy::too_many_arguments, reason = "arguments by name")]
pub fn diagnose(
    py: Python<'_>,
    scenario: ScenarioSource,
    measured: Vec<Measured<'_>>,
    columns: Option<PathBuf>,
    repair: bool,
    force: bool,
    progress: Option<Py<PyAny>>,
) -> PyResult<Diagnosis> {
    let path = scenario.path().map(str::to_owned);
    let scenario = scenario.read()?;
    let recordings = to_recordings(&measured, columns, repair)?;
    let options = stylet::DiagnoseOptions { force, ..stylet::DiagnoseOptions::default() };
    let assumed = path.unwrap_or_else(|| scenario.name.clone());
    let named = assumed.clone();
    let found = run_in_background(py, progress, move |callback| {
        let mut done = 0;
        let found: Result<DiagnosisReport, stylet::Error> =
            stylet::diagnose(&scenario, &recordings, &options, |what| {
                done += 1;
                callback.report_or_stop(what, done);
            });
        found.and_then(|found| {
            let (json, ron) = (found.json()?, found.extended_ron(&named)?);
            let html = found.html(&scenario, &named, "stylet.diagnose".to_owned());
            Ok(Parts { json, ron, html, extended: found.extended })
        })
    })?;
    let found = with_exceptions(py, found.map_err(failure))?;
    Ok(Diagnosis { found, assumed })
}

/// Finds the layers that recordings show, and diagnoses what is left.
#[pyfunction]
#[pyo3(signature = (measured, layers=None, columns=None, repair=false, progress=None))]
pub fn identify(
    py: Python<'_>,
    measured: Vec<Measured<'_>>,
    layers: Option<usize>,
    columns: Option<PathBuf>,
    repair: bool,
    progress: Option<Py<PyAny>>,
) -> PyResult<Diagnosis> {
    let recordings = to_recordings(&measured, columns, repair)?;
    let name =
        recordings.first().map_or("phantom", |r| r.name.rsplit_once('.').map_or(&*r.name, |(stem, _)| stem));
    let assumed = name.to_owned();
    let named = assumed.clone();
    let found = run_in_background(py, progress, move |callback| {
        let mut done = 0;
        let found = stylet::identify(&named, &recordings, layers, |what| {
            done += 1;
            callback.report_or_stop(what, done);
        });
        found.and_then(|(scenario, found)| {
            let (json, ron) = (found.json()?, found.extended_ron(&named)?);
            let html = found.html(&scenario, &named, "stylet.identify".to_owned());
            Ok(Parts { json, ron, html, extended: found.extended })
        })
    })?;
    Ok(Diagnosis { found: found.map_err(failure)?, assumed })
}

/// What recordings can show, before a diagnosis: `check.json` and the report.
#[pyfunction]
#[pyo3(signature = (scenario, measured, columns=None, repair=false))]
pub fn check(
    py: Python<'_>,
    scenario: ScenarioSource,
    measured: Vec<Measured<'_>>,
    columns: Option<PathBuf>,
    repair: bool,
) -> PyResult<(String, String)> {
    let scenario = scenario.read()?;
    let recordings = to_recordings(&measured, columns, repair)?;
    let found = run_in_background(py, None, move |_| stylet::check(&scenario, &recordings))?;
    let found = with_exceptions(py, found.map_err(failure))?;
    let file = |name: &str| {
        let content =
            found.output.files().find(|(file, _)| *file == name).map_or(&[][..], |(_, bytes)| bytes);
        String::from_utf8_lossy(content).into_owned()
    };
    Ok((file("check.json"), file("report.html")))
}

/// Reads recordings from files or columns.
pub fn to_recordings(
    measured: &[Measured<'_>],
    columns: Option<PathBuf>,
    repair: bool,
) -> PyResult<Vec<NamedRecording>> {
    let columns = columns.map(|c| stylet::scenario::load(&c)).transpose().map_err(failure)?;
    let options = ReadOptions { columns, repair };
    let files: Vec<PathBuf> = measured
        .iter()
        .filter_map(|m| match m {
            Measured::File(path) => Some(path.clone()),
            Measured::Columns(..) => None,
        })
        .collect();
    let mut recordings = Vec::with_capacity(measured.len());
    for one in measured {
        recordings.push(match one {
            Measured::File(path) => {
                let (recording, notes) = read_csv(path, &options).map_err(failure)?;
                NamedRecording { name: stylet::recording_name(path, &files), recording, notes }
            }
            Measured::Columns(name, time_s, position_m, force_n, velocity_mps) => NamedRecording {
                name: name.clone(),
                recording: recording(time_s, position_m, force_n, velocity_mps.as_ref())?,
                notes: Vec::new(),
            },
        });
    }
    Ok(recordings)
}

#[pymethods]
impl Diagnosis {
    /// `diagnosis.json` as the command writes it.
    fn json(&self) -> &[u8] {
        &self.found.json
    }

    /// `extended.ron` as the command writes it.
    fn extended_ron(&self) -> &str {
        &self.found.ron
    }

    /// The extended scenario.
    fn extended(&self) -> PyResult<CheckedScenario> {
        CheckedScenario::new(self.found.extended.clone())
    }

    /// The report.
    fn html(&self) -> &str {
        &self.found.html
    }

    /// The assumed scenario.
    #[getter]
    fn assumed(&self) -> &str {
        &self.assumed
    }

    /// Force (N) of the extended scenario along a recorded motion.
    #[pyo3(signature = (time_s, position_m, velocity_mps=None))]
    fn predict<'py>(
        &self,
        py: Python<'py>,
        time_s: Column<'py>,
        position_m: Column<'py>,
        velocity_mps: Option<Column<'py>>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let motion = recording(&time_s, &position_m, &time_s, velocity_mps.as_ref())?;
        let extended = &self.found.extended;
        let force_n = py.detach(|| stylet::force_along_motion(extended, &motion)).map_err(failure);
        let force_n = with_exceptions(py, force_n)?;
        Ok(PyArray1::from_vec(py, force_n))
    }
}
