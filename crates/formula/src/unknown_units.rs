//! Inference of unknown units from the equations in which their quantities occur.

use crate::formula::Formula;
use crate::formula_error::FormulaError;
use crate::unit::Unit;
use crate::unit_check::{Dimension, MAX_UNKNOWN, UnitCheck, dimensions};
use alloc::format;
use alloc::vec::Vec;

/// The units of the last `unknown` inputs for which every formula has its required unit: a given unit, times the unit of the
/// state with an index, if there is one. The other inputs have the units `known`.
///
/// # Errors
/// The index of a formula with its error, or `None` in place of the index and the error when the unit of a state does not
/// follow.
pub fn solve_unknown_units(
    required: &[(&Formula, Unit, Option<usize>)],
    known: &[Unit],
    unknown: usize,
) -> Result<Vec<Unit>, Option<(usize, FormulaError)>> {
    let mut solved: Vec<Option<Unit>> = alloc::vec![None; unknown.min(MAX_UNKNOWN)];
    loop {
        let of_state = |k: usize| match solved.get(k).copied().flatten() {
            Some(unit) => Dimension::known(unit),
            None => {
                Dimension { unit: Unit::NONE, unknown: core::array::from_fn(|j| f64::from(u8::from(j == k))) }
            }
        };
        let mut inputs = dimensions(known);
        inputs.extend((0..solved.len()).map(of_state));
        let mut walk = UnitCheck { inputs: &inputs, equal_to_none: Vec::new() };
        for (index, (formula, unit, state)) in required.iter().enumerate() {
            let found = walk.of(formula.tree()).map_err(|e| Some((index, e)))?;
            let expected = state.map_or(Dimension::NONE, of_state).combine(Dimension::known(*unit), 1.0);
            walk.same(found, Some(expected), formula.tree().place, |found, expected| {
                format!("the formula has {found}, and {expected} is expected")
            })
            .map_err(|e| Some((index, e)))?;
        }
        let equations = walk.equal_to_none;
        let next = equations.iter().find_map(|e| {
            let mut factors = e.unknown.iter().enumerate().filter(|(_, u)| **u != 0.0);
            let (k, u) = factors.next()?;
            factors.next().is_none().then(|| (k, e.unit.power(-1.0 / u)))
        });
        match next {
            Some((k, unit)) => solved[k] = Some(unit),
            None => return solved.into_iter().collect::<Option<Vec<Unit>>>().ok_or(None),
        }
    }
}
