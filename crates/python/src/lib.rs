//! The compiled half of the Python module `stylet`: takes arrays and text, gives arrays and text. What is convenient in
//! Python (data frames, plots, dicts) is written in Python, in `python/stylet`.
#![forbid(unsafe_code)]

mod arrays;
mod background_work;
mod callable;
mod diagnosis;
mod enhancer;
mod plan;
mod run;
mod sweep;

use pyo3::create_exception;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

create_exception!(
    stylet,
    StyletError,
    PyValueError,
    "What is wrong with the input, where, and what would be right: the sentence that the command prints."
);

/// An error of the library as the exception.
pub(crate) fn failure(error: impl std::fmt::Display) -> PyErr {
    StyletError::new_err(error.to_string())
}

#[pymodule]
mod _stylet {
    #[pymodule_export]
    use super::StyletError;
    #[pymodule_export]
    use super::callable::{CustomEffect, define_effect};
    #[pymodule_export]
    use super::diagnosis::{Diagnosis, check, diagnose, identify};
    #[pymodule_export]
    use super::enhancer::{Enhanced, Enhancer, Output, check_config, enhance};
    #[pymodule_export]
    use super::plan::{Plan, plan};
    #[pymodule_export]
    use super::run::{CheckedScenario, Run, load_scenario, read_csv, simulate};
    #[pymodule_export]
    use super::sweep::{Sweep, sweep};

    /// Version of the library.
    #[pymodule_export]
    #[allow(non_upper_case_globals, reason = "the Python name")]
    const __version__: &str = env!("CARGO_PKG_VERSION");
}
