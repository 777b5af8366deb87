//! Simulated insertions and recordings read from files.

use crate::arrays::insert_columns;
use crate::background_work::run_in_background;
use crate::callable::{CustomEffect, with_exceptions};
use crate::failure;
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::{Path, PathBuf};
use stylet::Scenario;
use stylet::core::config::Model;
use stylet::score::Trace;

/// A scenario from a file (`"path"`), from RON text (`"ron"`) or from JSON (`"json"`, what a dict becomes).
fn parse(kind: &str, source: &str) -> PyResult<Scenario> {
    match kind {
        "path" => Scenario::load(Path::new(source)).map_err(failure),
        "json" => {
            let scenario: Scenario = serde_json::from_str(source).map_err(|e| {
                let text = e.to_string();
                // The position refers to generated text.
                let what = text.split(" at line ").next().unwrap_or(&text).to_owned();
                failure(format!("scenario: {what}"))
            })?;
            Ok(CheckedScenario::new(scenario)?.scenario)
        }
        _ => Scenario::parse("scenario", source).map_err(failure),
    }
}

/// A checked scenario. It keeps its effects, also those that text could only name.
#[pyclass(frozen)]
pub struct CheckedScenario {
    scenario: Scenario,
}

impl CheckedScenario {
    pub fn new(scenario: Scenario) -> PyResult<Self> {
        scenario.check().map_err(|p| failure(format!("scenario: {}: {}", p.path, p.message)))?;
        Ok(Self { scenario })
    }
}

#[pymethods]
impl CheckedScenario {
    /// The scenario as RON with every default written out.
    fn to_ron(&self) -> PyResult<String> {
        self.scenario.to_ron().map_err(failure)
    }

    /// The scenario with further effects and candidates.
    fn with_effects(
        &self,
        effects: Vec<PyRef<'_, CustomEffect>>,
        candidates: Vec<PyRef<'_, CustomEffect>>,
    ) -> PyResult<Self> {
        let mut scenario = self.scenario.clone();
        scenario.effects.extend(effects.iter().map(|e| e.effect.clone()));
        scenario.candidates.extend(candidates.iter().map(|e| e.effect.clone()));
        Self::new(scenario)
    }
}

/// A scenario as the functions take it: checked, or kind and text as for [`load_scenario`].
#[derive(FromPyObject)]
pub enum ScenarioSource {
    /// Read before.
    Checked(Py<CheckedScenario>),
    /// Kind and text.
    Text(String, String),
}

impl ScenarioSource {
    pub fn read(&self) -> PyResult<Scenario> {
        match self {
            Self::Checked(checked) => Ok(checked.get().scenario.clone()),
            Self::Text(kind, text) => parse(kind, text),
        }
    }

    /// The path, where it is a file.
    pub fn path(&self) -> Option<&str> {
        match self {
            Self::Text(kind, path) if kind == "path" => Some(path),
            _ => None,
        }
    }
}

/// Reads a scenario.
#[pyfunction]
pub fn load_scenario(kind: &str, source: &str) -> PyResult<CheckedScenario> {
    CheckedScenario::new(parse(kind, source)?)
}

/// Reads a recording: columns and notes on the quality of the data.
#[pyfunction]
#[pyo3(signature = (path, columns=None, repair=false))]
pub fn read_csv<'py>(
    py: Python<'py>,
    path: PathBuf,
    columns: Option<PathBuf>,
    repair: bool,
) -> PyResult<(Bound<'py, PyDict>, Vec<String>)> {
    let columns = columns.map(|c| stylet::scenario::load(&c)).transpose().map_err(failure)?;
    let options = stylet::ReadOptions { columns, repair };
    let (recording, notes) = stylet::record::read_csv(&path, &options).map_err(failure)?;
    let dict = PyDict::new(py);
    insert_columns(
        py,
        &dict,
        &[
            ("time_s", &recording.time_s),
            ("position_m", &recording.position_m),
            ("force_n", &recording.force_n),
            ("velocity_mps", &recording.velocity_mps),
        ],
    )?;
    Ok((dict, notes.into_iter().map(|n| n.message).collect()))
}

/// A simulated and scored insertion.
#[pyclass(frozen)]
pub struct Run {
    run: stylet::Run,
    file: String,
}

/// Simulates a scenario, runs the core on it, scores it.
#[pyfunction]
#[pyo3(signature = (scenario, seed=None, compare=false))]
pub fn simulate(py: Python<'_>, scenario: ScenarioSource, seed: Option<u64>, compare: bool) -> PyResult<Run> {
    let file = scenario.path().unwrap_or("scenario.ron").to_owned();
    let mut scenario = scenario.read()?;
    scenario.seed = seed.unwrap_or(scenario.seed);
    if compare {
        scenario.compare = vec![Model::MultiLayer, Model::KelvinVoigt];
    }
    let named = file.clone();
    let run = run_in_background(py, None, move |_| stylet::simulate_from(&scenario, &named))?;
    let run = with_exceptions(py, run.map_err(failure))?;
    Ok(Run { run, file })
}

/// The core's outputs as columns, and its estimates, into a dict.
pub fn insert_trace(py: Python<'_>, dict: &Bound<'_, PyDict>, trace: &Trace) -> PyResult<()> {
    insert_columns(
        py,
        dict,
        &[
            ("enhanced_n", &trace.enhanced_n),
            ("reconstructed_n", &trace.reconstructed_n),
            ("error_n", &trace.error_n),
            ("stiffness_n_per_m", &trace.stiffness_n_per_m),
            ("friction", &trace.friction),
            ("cumulative_friction_ns_per_m", &trace.cumulative_friction_ns_per_m),
            ("cusum_n2", &trace.cusum_n2),
            ("derivative_n_per_s", &trace.derivative_n_per_s),
        ],
    )?;
    let state: Vec<u8> = trace.state.iter().map(|s| *s as u8).collect();
    dict.set_item("state", PyArray1::from_vec(py, state))
}

#[pymethods]
impl Run {
    /// Name of the scenario.
    #[getter]
    fn name(&self) -> &str {
        &self.run.scenario.name
    }

    /// Hash over all results.
    #[getter]
    fn hash(&self) -> &str {
        &self.run.hash
    }

    /// Combinations of algorithm, model and sensor, such as `paper/ml/force_torque`.
    #[getter]
    fn combinations(&self) -> Vec<String> {
        self.run.algorithm_runs.iter().map(|r| r.name.clone()).collect()
    }

    /// Recording, truth and the outputs of one combination (the first), one value per sample.
    #[pyo3(signature = (combination=0))]
    fn columns<'py>(&self, py: Python<'py>, combination: usize) -> PyResult<Bound<'py, PyDict>> {
        let dict = PyDict::new(py);
        let (recording, truth) = (&self.run.simulation.recording, &self.run.simulation.truth);
        insert_columns(
            py,
            &dict,
            &[
                ("time_s", &recording.time_s),
                ("position_m", &recording.position_m),
                ("velocity_mps", &recording.velocity_mps),
                ("force_n", &recording.force_n),
                ("true_tip_force_n", &truth.tip_force_n),
                ("true_elastic_n", &truth.elastic_n),
                ("true_friction_n", &truth.friction_n),
            ],
        )?;
        let active: Vec<u32> = truth.active_layer.iter().map(|l| *l as u32).collect();
        dict.set_item("true_active_layer", PyArray1::from_vec(py, active))?;
        let ran = self
            .run
            .algorithm_runs
            .get(combination)
            .ok_or_else(|| failure("there is no such combination"))?;
        insert_trace(py, &dict, &ran.trace)?;
        Ok(dict)
    }

    /// Instants of the true ruptures in s.
    fn true_ruptures_s(&self) -> Vec<f64> {
        self.run.simulation.truth.ruptures.iter().map(|r| r.time_s).collect()
    }

    /// Instants of the declared ruptures in s.
    #[pyo3(signature = (combination=0))]
    fn ruptures_s(&self, combination: usize) -> Vec<f64> {
        self.run
            .algorithm_runs
            .get(combination)
            .map_or(Vec::new(), |r| r.trace.detections.iter().map(|d| d.time_s).collect())
    }

    /// `score.json` as the command writes it.
    fn score_json(&self) -> PyResult<Vec<u8>> {
        self.run.score_json().map_err(failure)
    }

    /// `recording.csv` as the command writes it.
    fn recording_csv(&self) -> Vec<u8> {
        self.run.recording_csv().to_vec()
    }

    /// `scenario.ron`: every default written out.
    fn scenario_ron(&self) -> PyResult<String> {
        self.run.scenario_ron().map_err(failure)
    }

    /// The report as one HTML page.
    fn html(&self, py: Python<'_>) -> PyResult<String> {
        py.detach(|| self.run.report(&self.file).map(|report| report.to_html())).map_err(failure)
    }

    /// Writes the files of `stylet run` into a folder.
    fn write(&self, py: Python<'_>, folder: PathBuf) -> PyResult<()> {
        py.detach(|| self.run.output(&self.file).and_then(|o| o.write(&folder))).map_err(failure)
    }
}
