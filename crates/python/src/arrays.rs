//! Columns between NumPy and the library.

use crate::failure;
use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use stylet::Recording;

/// A column as it comes from Python; `numpy.ascontiguousarray(x, dtype=float)` before.
pub type Column<'py> = PyReadonlyArray1<'py, f64>;

/// A recording from its columns. Without a velocity it is taken from the positions, as the command does.
pub fn recording(
    time_s: &Column<'_>,
    position_m: &Column<'_>,
    force_n: &Column<'_>,
    velocity_mps: Option<&Column<'_>>,
) -> PyResult<Recording> {
    let own = |c: &Column<'_>| c.as_slice().map(<[f64]>::to_vec).map_err(failure);
    let velocity = velocity_mps.map(own).transpose()?;
    Recording::from_columns(own(time_s)?, own(position_m)?, own(force_n)?, velocity).map_err(failure)
}

/// Columns into a dict of arrays.
pub fn insert_columns<'py>(
    py: Python<'py>,
    dict: &Bound<'py, PyDict>,
    columns: &[(&str, &[f64])],
) -> PyResult<()> {
    for (name, column) in columns {
        dict.set_item(name, PyArray1::from_slice(py, column))?;
    }
    Ok(())
}
