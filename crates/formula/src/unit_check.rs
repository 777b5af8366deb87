//! The unit of a formula.

use crate::formula_error::FormulaError;
use crate::function::Function;
use crate::syntax_tree::{Node, NodeKind};
use crate::unit::Unit;
use alloc::format;
use alloc::vec::Vec;

/// Largest number of unknown units.
pub(crate) const MAX_UNKNOWN: usize = 4;

/// A unit times powers of unknown units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Dimension {
    pub unit: Unit,
    pub unknown: [f64; MAX_UNKNOWN],
}

impl Dimension {
    pub const NONE: Self = Self::known(Unit::NONE);

    pub const fn known(unit: Unit) -> Self {
        Self { unit, unknown: [0.0; MAX_UNKNOWN] }
    }

    pub fn combine(self, other: Self, sign: f64) -> Self {
        Self {
            unit: self.unit.times(other.unit.power(sign)),
            unknown: core::array::from_fn(|k| self.unknown[k] + sign * other.unknown[k]),
        }
    }

    fn power(self, exponent: f64) -> Self {
        Self { unit: self.unit.power(exponent), unknown: self.unknown.map(|u| u * exponent) }
    }

    fn is_known(&self) -> bool {
        self.unknown.iter().all(|u| *u == 0.0)
    }
}

/// State of the unit check of a formula. Every `Dimension` in `equal_to_none` must have no unit.
pub(crate) struct UnitCheck<'a> {
    pub inputs: &'a [Dimension],
    pub equal_to_none: Vec<Dimension>,
}

/// The dimension of a part; `None` for zero, which fits every unit.
pub(crate) type PartDimension = Result<Option<Dimension>, FormulaError>;

impl UnitCheck<'_> {
    /// Requires two dimensions to be equal; `problem` explains what is wrong if they are not.
    pub fn same(
        &mut self,
        a: Option<Dimension>,
        b: Option<Dimension>,
        place: (usize, usize),
        problem: impl FnOnce(Unit, Unit) -> alloc::string::String,
    ) -> PartDimension {
        let (Some(left), Some(right)) = (a, b) else { return Ok(a.or(b)) };
        let ratio = left.combine(right, -1.0);
        if !ratio.is_known() {
            self.equal_to_none.push(ratio);
        } else if ratio.unit != Unit::NONE {
            return Err(FormulaError::new(place, problem(left.unit, right.unit)));
        }
        Ok(Some(left))
    }

    pub fn of(&mut self, node: &Node) -> PartDimension {
        let (function, arguments) = match &node.kind {
            NodeKind::Number(x) => return Ok((*x != 0.0).then_some(Dimension::NONE)),
            NodeKind::Input(k) => return Ok(Some(self.inputs.get(*k).copied().unwrap_or(Dimension::NONE))),
            NodeKind::Call(function, arguments) => (*function, arguments),
        };
        let [first, rest @ ..] = &arguments[..] else { return Ok(Some(Dimension::NONE)) };
        let x = self.of(first)?;
        let none = Some(Dimension::NONE);
        match (function, rest) {
            (Function::Negate | Function::Abs, _) => Ok(x),
            (Function::Sqrt, _) => Ok(x.map(|x| x.power(0.5))),
            (Function::Sign, _) => Ok(none),
            (Function::Sgn, _) => {
                let velocity = Some(Dimension::known(Unit::METRE_PER_SECOND));
                self.same(x, velocity, first.place, |found, _| {
                    format!("`sgn` takes a velocity, and this has {found}; use `sign` for the sign of anything else")
                })?;
                Ok(none)
            }
            (Function::Multiply | Function::Divide, [second]) => {
                let sign = if function == Function::Multiply { 1.0 } else { -1.0 };
                let y = self.of(second)?;
                Ok(x.zip(y).map(|(x, y)| x.combine(y, sign)))
            }
            (Function::Power, [exponent]) => self.power(x, first, exponent),
            (
                Function::Add
                | Function::Subtract
                | Function::Less
                | Function::Greater
                | Function::Min
                | Function::Max,
                [second],
            ) => {
                let y = self.of(second)?;
                let out = self.same(x, y, second.place, |a, b| {
                    format!(
                        "units do not fit: this has {b}, and what it is combined with has {a}{}",
                        remedy(a, b)
                    )
                })?;
                Ok(if matches!(function, Function::Less | Function::Greater) { none } else { out })
            }
            (Function::If, [yes, no]) => {
                self.same(x, none, first.place, |found, _| {
                    format!("the condition of `if` is a comparison, and this has {found}")
                })?;
                let (yes, place) = (self.of(yes)?, no.place);
                let no = self.of(no)?;
                self.same(yes, no, place, |a, b| {
                    format!("units do not fit: this has {b}, the other case {a}")
                })
            }
            _ => {
                self.same(x, none, first.place, |found, _| {
                    format!(
                        "the argument of `{}` must have no unit, and this has {found}; divide it by a parameter of the same unit",
                        crate::function::name(function)
                    )
                })?;
                Ok(none)
            }
        }
    }

    fn power(&mut self, base: Option<Dimension>, base_node: &Node, exponent: &Node) -> PartDimension {
        let of_exponent = self.of(exponent)?;
        self.same(of_exponent, Some(Dimension::NONE), exponent.place, |found, _| {
            format!("an exponent must have no unit, and this has {found}")
        })?;
        let Some(base) = base else { return Ok(None) };
        if base == Dimension::NONE {
            return Ok(Some(base));
        }
        match exponent.number() {
            Some(number) => Ok(Some(base.power(number))),
            None => {
                let what = format!(
                    "a quantity with a unit ({}) can only be raised to a number; divide it by a parameter of the same unit",
                    base.unit
                );
                Err(FormulaError::new(base_node.place, what))
            }
        }
    }
}

/// A hint where one of two units is missing.
fn remedy(a: Unit, b: Unit) -> &'static str {
    if a == Unit::NONE || b == Unit::NONE {
        "; a number has no unit: make it a parameter with a unit"
    } else {
        ""
    }
}

pub(crate) fn dimensions(inputs: &[Unit]) -> Vec<Dimension> {
    inputs.iter().map(|unit| Dimension::known(*unit)).collect()
}

/// The unit of a formula for inputs with these units.
pub(crate) fn unit_of(tree: &Node, inputs: &[Unit]) -> Result<Option<Unit>, FormulaError> {
    let inputs = dimensions(inputs);
    let mut walk = UnitCheck { inputs: &inputs, equal_to_none: Vec::new() };
    Ok(walk.of(tree)?.map(|found| found.unit))
}

/// Checks the unit of a formula.
pub(crate) fn expect_unit(tree: &Node, inputs: &[Unit], expected: Unit) -> Result<(), FormulaError> {
    match unit_of(tree, inputs)? {
        Some(found) if found != expected => {
            let what = format!("the formula has {found}, and {expected} is expected");
            Err(FormulaError::new(tree.place, what))
        }
        _ => Ok(()),
    }
}
