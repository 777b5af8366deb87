//! The online algorithm, sample by sample or over arrays.

use crate::arrays::{Column, insert_columns, recording};
use crate::failure;
use crate::run::insert_trace;
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::Path;
use stylet::core::{Enhancer as Core, Output as CoreOutput, Sample};
use stylet::enhancement::{EnhancementResult, ResultSource, enhance_recording};
use stylet::{EnhancerConfigFile, record::differentiate};

/// Reads a configuration: a file (`"path"`), RON or JSON text, or the defaults (empty text).
fn parse(kind: &str, source: &str) -> PyResult<EnhancerConfigFile> {
    match kind {
        "path" => EnhancerConfigFile::load(Path::new(source)).map_err(failure),
        "json" => {
            let text = serde_json::from_str::<EnhancerConfigFile>(source)
                .map_err(|e| failure(format!("config: {e}")))
                .map(|file| stylet::scenario::ron_options().to_string(&file))?;
            EnhancerConfigFile::parse("config", &text.map_err(failure)?).map_err(failure)
        }
        _ if source.trim().is_empty() => Ok(EnhancerConfigFile::default()),
        _ => EnhancerConfigFile::parse("config", source).map_err(failure),
    }
}

/// Checks a configuration; raises what is wrong.
#[pyfunction]
pub fn check_config(kind: &str, source: &str) -> PyResult<()> {
    parse(kind, source).map(drop)
}

/// Output of one step.
#[pyclass(frozen)]
pub struct Output {
    out: CoreOutput,
}

#[pymethods]
impl Output {
    /// Enhanced force in N.
    #[getter]
    fn enhanced_n(&self) -> f64 {
        self.out.enhanced_n
    }
    /// Reconstructed force in N.
    #[getter]
    fn reconstructed_n(&self) -> f64 {
        self.out.reconstructed_n
    }
    /// Innovation in N.
    #[getter]
    fn error_n(&self) -> f64 {
        self.out.error_n
    }
    /// Stiffness estimate of the layer being traversed in N/m.
    #[getter]
    fn stiffness_n_per_m(&self) -> f64 {
        self.out.theta[0]
    }
    /// Friction estimate of the layer being traversed in the model's unit.
    #[getter]
    fn friction(&self) -> f64 {
        self.out.theta[1]
    }
    /// Cumulative friction in N s/m.
    #[getter]
    fn cumulative_friction_ns_per_m(&self) -> f64 {
        self.out.cumulative_friction_ns_per_m
    }
    /// State by name.
    #[getter]
    fn state(&self) -> &'static str {
        self.out.state.name()
    }
    /// Ruptures declared so far.
    #[getter]
    fn ruptures(&self) -> usize {
        self.out.ruptures
    }
    /// True at the sample that declares a rupture.
    #[getter]
    fn ruptured(&self) -> bool {
        self.out.detection.is_some()
    }
    /// Position of the first contact in m, or None.
    #[getter]
    fn contact_m(&self) -> Option<f64> {
        self.out.contact_m
    }
    /// The layer whose estimate became available at this sample: (layer, thickness_m, stiffness_n_per_m, friction), or None.
    #[getter]
    fn estimate(&self) -> Option<(usize, f64, f64, f64)> {
        self.out.estimate.map(|e| (e.layer, e.thickness_m, e.stiffness_n_per_m, e.friction))
    }
    /// False when the sample was ignored; the values are then those of the sample before.
    #[getter]
    fn used(&self) -> bool {
        self.out.used
    }
    /// Why the sample was ignored, or None.
    #[getter]
    fn unused_reason(&self) -> Option<&'static str> {
        self.out.unused_reason.map(stylet::core::UnusedReason::message)
    }
    /// True at the first sample after a restart because of a new clock.
    #[getter]
    fn restarted(&self) -> bool {
        self.out.restarted
    }
    fn __repr__(&self) -> String {
        format!(
            "Output(enhanced_n={}, state={}, ruptures={})",
            self.out.enhanced_n,
            self.out.state.name(),
            self.out.ruptures
        )
    }
}

/// The online algorithm.
#[pyclass]
pub struct Enhancer {
    core: Core<Vec<Sample>>,
    config: EnhancerConfigFile,
    storage: usize,
}

#[pymethods]
impl Enhancer {
    #[new]
    #[pyo3(signature = (kind="ron", source="", storage=16384))]
    fn new(kind: &str, source: &str, storage: usize) -> PyResult<Self> {
        let config = parse(kind, source)?;
        if storage < 2 {
            return Err(failure("storage: must hold at least 2 samples; 16384 hold 80 s at 200 Hz"));
        }
        let core = Core::new(config.enhance.clone(), config.surface_m, vec![Sample::default(); storage]);
        Ok(Self { core, config, storage })
    }

    /// Processes one sample.
    #[pyo3(signature = (*, time_s, position_m, velocity_mps, force_n))]
    #[inline]
    fn step(&mut self, time_s: f64, position_m: f64, velocity_mps: f64, force_n: f64) -> Output {
        Output { out: self.core.step(Sample { time_s, position_m, velocity_mps, force_n }) }
    }

    /// Processes one sample and returns only the enhanced force (N), NaN for an ignored sample: the fastest call.
    #[pyo3(signature = (*, time_s, position_m, velocity_mps, force_n))]
    #[inline]
    fn enhanced(&mut self, time_s: f64, position_m: f64, velocity_mps: f64, force_n: f64) -> f64 {
        let out = self.core.step_brief(Sample { time_s, position_m, velocity_mps, force_n });
        if out.used { out.enhanced_n } else { f64::NAN }
    }

    /// Processes many samples, continuing from the last state.
    #[pyo3(signature = (*, time_s, position_m, velocity_mps, force_n))]
    fn run<'py>(
        &mut self,
        py: Python<'py>,
        time_s: Column<'py>,
        position_m: Column<'py>,
        velocity_mps: Option<Column<'py>>,
        force_n: Column<'py>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let (t, z, f) = (time_s.as_slice()?, position_m.as_slice()?, force_n.as_slice()?);
        let differentiated;
        let v: &[f64] = match &velocity_mps {
            Some(v) => v.as_slice()?,
            None => {
                let (times, places) = (t.to_vec(), z.to_vec());
                differentiated = differentiate(&times, &places, stylet::record::DEFAULT_HALF_WIDTH_S);
                &differentiated
            }
        };
        let n = t.len();
        if z.len() != n || v.len() != n || f.len() != n {
            return Err(failure(format!(
                "the columns have different lengths: time_s {n}, position_m {}, velocity_mps {}, force_n {}",
                z.len(),
                v.len(),
                f.len()
            )));
        }
        let (mut enhanced, mut error) = (Vec::with_capacity(n), Vec::with_capacity(n));
        let (mut state, mut ruptures) = (Vec::with_capacity(n), Vec::with_capacity(n));
        let core = &mut self.core;
        py.detach(|| {
            /// Samples per block, small enough for the cache.
            const BLOCK: usize = 256;
            let mut block = [Sample::default(); BLOCK];
            let mut from = 0;
            while from < n {
                let count = BLOCK.min(n - from);
                for (k, sample) in block[..count].iter_mut().enumerate() {
                    let i = from + k;
                    *sample = Sample { time_s: t[i], position_m: z[i], velocity_mps: v[i], force_n: f[i] };
                }
                core.run(&block[..count], |out| {
                    // The values of an ignored sample are not current.
                    enhanced.push(if out.used { out.enhanced_n } else { f64::NAN });
                    error.push(if out.used { out.error_n } else { f64::NAN });
                    state.push(out.state as u8);
                    ruptures.push(out.ruptures as u32);
                });
                from += count;
            }
        });
        let dict = PyDict::new(py);
        dict.set_item("enhanced_n", PyArray1::from_vec(py, enhanced))?;
        dict.set_item("error_n", PyArray1::from_vec(py, error))?;
        dict.set_item("state", PyArray1::from_vec(py, state))?;
        dict.set_item("ruptures", PyArray1::from_vec(py, ruptures))?;
        Ok(dict)
    }

    /// Forgets every sample.
    fn reset(&mut self) {
        let storage = vec![Sample::default(); self.storage];
        self.core = Core::new(self.config.enhance.clone(), self.config.surface_m, storage);
    }
}

/// Outputs of the online algorithm on a recording.
#[pyclass(frozen)]
pub struct Enhanced {
    enhancement: EnhancementResult,
    json: Vec<u8>,
    html: String,
}

/// Runs the online algorithm on a recording.
#[pyfunction]
#[pyo3(signature = (kind, source, time_s, position_m, force_n, velocity_mps=None))]
pub fn enhance(
    py: Python<'_>,
    kind: &str,
    source: &str,
    time_s: Column<'_>,
    position_m: Column<'_>,
    force_n: Column<'_>,
    velocity_mps: Option<Column<'_>>,
) -> PyResult<Enhanced> {
    let config = parse(kind, source)?;
    let recording = recording(&time_s, &position_m, &force_n, velocity_mps.as_ref())?;
    let model = config.enhance.model;
    py.detach(|| {
        let enhancement = enhance_recording(recording, Vec::new(), config, &[model], None)?;
        let named =
            ResultSource { data: Path::new("recording"), config: None, command: "stylet.enhance".to_owned() };
        let (json, html) = (enhancement.json("recording")?, enhancement.report(&named)?.to_html());
        Ok(Enhanced { enhancement, json, html })
    })
    .map_err(|e: stylet::Error| failure(e))
}

#[pymethods]
impl Enhanced {
    /// `enhance.json` as the command writes it.
    fn json(&self) -> &[u8] {
        &self.json
    }

    /// The report.
    fn html(&self) -> &str {
        &self.html
    }

    /// Recording and outputs, one value per sample.
    fn columns<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let (dict, recording) = (PyDict::new(py), &self.enhancement.recording);
        let measured: [(&str, &[f64]); 4] = [
            ("time_s", &recording.time_s),
            ("position_m", &recording.position_m),
            ("velocity_mps", &recording.velocity_mps),
            ("force_n", &recording.force_n),
        ];
        insert_columns(py, &dict, &measured)?;
        if let Some(ran) = self.enhancement.algorithm_runs.first() {
            insert_columns(py, &dict, &[("low_n", &ran.trace.low_n), ("high_n", &ran.trace.high_n)])?;
            insert_trace(py, &dict, &ran.trace)?;
        }
        Ok(dict)
    }
}
