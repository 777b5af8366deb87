//! Custom effects whose equation is Python code.

use crate::background_work::start_calling_threads;
use crate::{StyletError, failure};
use pyo3::exceptions::{PyArithmeticError, PyAttributeError, PyRuntimeWarning, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::sync::MutexExt;
use std::collections::BTreeMap;
use std::ffi::CString;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use stylet::tissue::{AnyEffect, Custom, CustomText, Equation, EquationSample, Place, VARIABLES};

/// Held during a call, so that callables run one after the other, and taken before the interpreter, so that no thread waits for it
/// with the interpreter. The engine therefore runs detached.
static CALLS: Mutex<()> = Mutex::new(());

/// What callables raised since the last report, by the name of the effect.
static CALLABLE_EXCEPTIONS: Mutex<BTreeMap<String, CallableExceptions>> = Mutex::new(BTreeMap::new());

/// Exceptions of one effect.
struct CallableExceptions {
    first: PyErr,
    calls: usize,
}

/// Named numbers as attributes: a sample, parameters or states.
#[pyclass(frozen)]
struct Values {
    names: Arc<[String]>,
    values: Vec<f64>,
}

#[pymethods]
impl Values {
    fn __getattr__(&self, name: &str) -> PyResult<f64> {
        let named = self.names.iter().zip(&self.values).find(|(known, _)| *known == name);
        named.map(|(_, value)| *value).ok_or_else(|| {
            PyAttributeError::new_err(format!("there is no `{name}` here, but {}", self.names.join(", ")))
        })
    }

    fn __dir__(&self) -> Vec<String> {
        self.names.to_vec()
    }

    fn __repr__(&self) -> String {
        let pairs = self.names.iter().zip(&self.values).map(|(name, value)| format!("{name}={value:?}"));
        format!("({})", pairs.collect::<Vec<_>>().join(", "))
    }
}

/// Callables `(sample, parameters, state) -> number` as an equation.
#[derive(Debug)]
struct PythonEquation {
    effect: String,
    force: Py<PyAny>,
    rates: Vec<Py<PyAny>>,
    place: Place,
    variables: Arc<[String]>,
    parameters: Arc<[String]>,
    states: Arc<[String]>,
}

/// Step of the derivative of a rate by its state, in the unit of the state for states up to 1 and relative to larger ones: a
/// millionth, where the errors of rounding and of the quotient are both near 1e-10.
const DERIVATIVE_STEP: f64 = 1e-6;

impl PythonEquation {
    fn new(text: &CustomText, force: Py<PyAny>, rates: Vec<Py<PyAny>>) -> Self {
        let available = VARIABLES.iter().filter(|v| v.places.contains(&text.place));
        Self {
            effect: text.name.clone(),
            force,
            rates,
            place: text.place,
            variables: available.map(|v| v.name.to_owned()).collect(),
            parameters: text.parameters.0.iter().map(|(name, _)| name.clone()).collect(),
            states: text.state.0.iter().map(|(name, _)| name.clone()).collect(),
        }
    }

    fn call(
        &self,
        py: Python<'_>,
        function: &Py<PyAny>,
        sample: &EquationSample,
        parameters: &[f64],
        states: &[f64],
    ) -> PyResult<f64> {
        let available = VARIABLES.iter().zip(sample.variables());
        let available = available.filter(|(v, _)| v.places.contains(&self.place)).map(|(_, value)| value);
        let values = |names: &Arc<[String]>, values: Vec<f64>| Values { names: names.clone(), values };
        let arguments = (
            values(&self.variables, available.collect()),
            values(&self.parameters, parameters.to_vec()),
            values(&self.states, states.to_vec()),
        );
        let result = function.call1(py, arguments)?;
        result.extract(py).map_err(|_| {
            let shown = result.bind(py).repr().map_or_else(|_| "something".to_owned(), |r| r.to_string());
            PyTypeError::new_err(format!("the result is {shown}, where a number is expected"))
        })
    }

    /// The result of a call; NaN and a note of the exception where it raised one.
    fn number(
        &self,
        function: &Py<PyAny>,
        sample: &EquationSample,
        parameters: &[f64],
        states: &[f64],
    ) -> f64 {
        let _held = CALLS.lock().unwrap_or_else(PoisonError::into_inner);
        // An interpreter that is ending takes no calls, and nobody waits for the result.
        let result = Python::try_attach(|py| {
            self.call(py, function, sample, parameters, states).unwrap_or_else(|first| {
                callable_exceptions(py)
                    .entry(self.effect.clone())
                    .or_insert(CallableExceptions { first, calls: 0 })
                    .calls += 1;
                f64::NAN
            })
        });
        result.unwrap_or(f64::NAN)
    }

    /// Calls everything once with zeros in the sample: what is misspelt shows at once. Errors of arithmetic need not concern
    /// other samples.
    fn call_once_with_zeros(&self, py: Python<'_>, parameters: &[f64]) -> PyResult<()> {
        let states = vec![0.0; self.states.len()];
        for function in std::iter::once(&self.force).chain(&self.rates) {
            let result = self.call(py, function, &EquationSample::default(), parameters, &states);
            let of_this_sample = |raised: &PyErr| {
                raised.is_instance_of::<PyArithmeticError>(py) || raised.is_instance_of::<PyValueError>(py)
            };
            if let Err(raised) = result
                && !of_this_sample(&raised)
            {
                return Err(caused_by(py, format!("effect `{}`: {raised}", self.effect), &raised));
            }
        }
        Ok(())
    }
}

impl Equation for PythonEquation {
    fn value(&self, sample: &EquationSample, parameters: &[f64], states: &[f64]) -> f64 {
        self.number(&self.force, sample, parameters, states)
    }

    fn rate(&self, index: usize, sample: &EquationSample, parameters: &[f64], states: &[f64]) -> (f64, f64) {
        let Some(rate) = self.rates.get(index) else { return (0.0, 0.0) };
        let here = states.get(index).copied().unwrap_or(0.0);
        let at = |state: f64| {
            let mut moved = states.to_vec();
            if let Some(slot) = moved.get_mut(index) {
                *slot = state;
            }
            self.number(rate, sample, parameters, &moved)
        };
        let step = DERIVATIVE_STEP * here.abs().max(1.0);
        (at(here), (at(here + step) - at(here - step)) / (2.0 * step))
    }
}

/// A custom effect with its values.
#[pyclass(frozen)]
pub struct CustomEffect {
    pub effect: AnyEffect,
}

/// The effect of a text in JSON: compiled from its formulas, or with `force` and `rates` as its equation.
#[pyfunction]
#[pyo3(signature = (text, force, rates))]
pub fn define_effect(
    py: Python<'_>,
    text: &str,
    force: Option<Py<PyAny>>,
    rates: Vec<Py<PyAny>>,
) -> PyResult<CustomEffect> {
    let text: CustomText = serde_json::from_str(text).map_err(|e| {
        let text = e.to_string();
        // The position refers to generated text.
        failure(text.split(" at line ").next().unwrap_or(&text))
    })?;
    let effect = match force {
        None => Custom::from_text(&text),
        Some(force) => {
            let equation = PythonEquation::new(&text, force, rates);
            let start: Vec<f64> = text.parameters.0.iter().map(|(_, p)| p.start).collect();
            equation.call_once_with_zeros(py, &start)?;
            py.detach(start_calling_threads).map_err(failure)?;
            py.detach(|| Custom::define(&text, Box::new(equation)))
        }
    };
    // The definition has tried samples at which the equation may have no value.
    drop(callable_exceptions(py).remove(&text.name));
    effect.map(|effect| CustomEffect { effect: effect.into() }).map_err(failure)
}

/// The result of work that may have called callables. What they raised is the cause of an error, otherwise a warning.
pub fn with_exceptions<T>(py: Python<'_>, result: PyResult<T>) -> PyResult<T> {
    let raised = std::mem::take(&mut *callable_exceptions(py));
    let text = |(effect, r): (&String, &CallableExceptions)| {
        format!("effect `{effect}` raised {} ({} calls)", r.first, r.calls)
    };
    let Some(first) = raised.values().next() else { return result };
    let all = raised.iter().map(text).collect::<Vec<_>>().join("; ");
    match result {
        // Not where the user ended the work.
        Err(error) if !error.is_instance_of::<StyletError>(py) => Err(error),
        Err(error) => Err(caused_by(py, format!("{}; {all}", error.value(py)), &first.first)),
        Ok(value) => {
            let message = format!("{all}; the values of the parameters in these calls were rejected");
            // Text of Python holds no zero bytes, except on purpose.
            let message = CString::new(message.replace('\0', " ")).unwrap_or_default();
            // The caller of the function of the package.
            PyErr::warn(py, &py.get_type::<PyRuntimeWarning>(), &message, 2)?;
            Ok(value)
        }
    }
}

/// [`CALLABLE_EXCEPTIONS`], for one statement.
fn callable_exceptions(py: Python<'_>) -> MutexGuard<'static, BTreeMap<String, CallableExceptions>> {
    CALLABLE_EXCEPTIONS.lock_py_attached(py).unwrap_or_else(PoisonError::into_inner)
}

/// An error of the package with an exception as its cause.
fn caused_by(py: Python<'_>, text: String, cause: &PyErr) -> PyErr {
    let error = failure(text);
    error.set_cause(py, Some(cause.clone_ref(py)));
    error
}
