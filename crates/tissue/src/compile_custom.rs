//! Compiles custom effects from their text.

use crate::custom_error::CustomError;
use crate::custom_names::GrowingList;
use crate::custom_text::{CustomText, Place};
use crate::define_custom::{add_definition, defined_in_code};
use crate::effect_info::EffectInfo;
use crate::effects::Custom;
use crate::equation_inputs::EquationInputs;
use crate::formula_equation::{FormulaEquation, VARIABLES, value_unit};
use alloc::boxed::Box;
use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;
use stylet_formula::{Formula, FormulaError, Unit, solve_unknown_units};

/// A text with the definition that it was compiled to.
struct Compiled {
    text: CustomText,
    info: &'static EffectInfo,
}

static COMPILED: GrowingList<Compiled> = GrowingList::new();

impl Custom {
    /// Compiles a text. Texts that differ only in parameter values share one definition.
    ///
    /// A text without `force` gives the effect of this name that was [defined](Custom::define) last.
    ///
    /// # Errors
    /// [`CustomError`] with the field, and the place in its formula.
    pub fn from_text(text: &CustomText) -> Result<Self, CustomError> {
        let shared = text.without_values();
        let info = match &shared.force {
            Some(force) => {
                let compiled = COMPILED.find_or_add(
                    |known| known.text == shared,
                    || compile(&shared, force).map(|info| Compiled { text: shared.clone(), info }),
                )?;
                compiled.info
            }
            None => defined_in_code(&shared)?,
        };
        Self::with_values_of(text, info)
    }

    /// The effect of a definition with the values of a text.
    pub(crate) fn with_values_of(text: &CustomText, info: &'static EffectInfo) -> Result<Self, CustomError> {
        let values: Vec<f64> = text.parameters.0.iter().map(|(_, p)| p.value.unwrap_or(p.start)).collect();
        Self::with_values(info, &values)
            .ok_or_else(|| CustomError::new("parameters", "do not fit the definition"))
    }

    /// The text with the present values.
    #[must_use]
    pub fn text(&self) -> CustomText {
        let mut text = self.definition().text.clone();
        for ((_, parameter), value) in text.parameters.0.iter_mut().zip(self.values()) {
            parameter.value = (*value != parameter.start).then_some(*value);
        }
        text
    }
}

fn compile(text: &CustomText, force: &str) -> Result<&'static EffectInfo, CustomError> {
    let EquationInputs { names, units, parameters } = EquationInputs::new(text)?;
    let value = parse("force", force, 0, &names, text.place)?;
    let mut rates = Vec::new();
    let mut starts = Vec::new();
    for (name, equation) in &text.state.0 {
        let path = format!("state.{name}");
        let start = right_side(name, equation, &path)?;
        rates.push(parse(&path, equation, start, &names, text.place)?);
        starts.push(start);
    }
    let mut required = alloc::vec![(&value, value_unit(text.place), None)];
    required.extend(rates.iter().enumerate().map(|(k, rate)| (rate, Unit::SECOND.power(-1.0), Some(k))));
    solve_unknown_units(&required, &units, rates.len()).map_err(|e| match e {
        Some((0, error)) => CustomError::formula("force", force, 0, &error),
        Some((k, error)) => {
            let (name, start) = (&text.state.0[k - 1].0, starts[k - 1]);
            CustomError::formula(format!("state.{name}"), rates[k - 1].text(), start, &error)
        }
        None => CustomError::new(
            "state",
            "the unit of a state does not follow from the formulas; use it in `force`",
        ),
    })?;
    let equation = FormulaEquation { value, rates, parameters: parameters.len() };
    add_definition(text, parameters, Box::new(equation))
}

/// The formula of a field from byte `start` on, with the variables of a place.
fn parse(path: &str, text: &str, start: usize, names: &[&str], place: Place) -> Result<Formula, CustomError> {
    let formula_text = text.get(start..).unwrap_or_default();
    let formula = Formula::parse(formula_text, names)
        .map_err(|e| CustomError::formula(path, formula_text, start, &e))?;
    for (index, variable) in VARIABLES.iter().enumerate().filter(|(_, v)| !v.places.contains(&place)) {
        if let Some(found) = formula.place_of(index) {
            let there: Vec<&str> =
                VARIABLES.iter().filter(|v| v.places.contains(&place)).map(|v| v.name).collect();
            let what =
                format!("is not available at `{place:?}`, where formulas can use {}", there.join(", "));
            let error = FormulaError::new(found, what);
            debug_assert_eq!(error.part(formula_text), variable.name);
            return Err(CustomError::formula(path, formula_text, start, &error));
        }
    }
    Ok(formula)
}

/// Where the right side of `"dx/dt = ..."` begins.
fn right_side(name: &str, equation: &str, path: &str) -> Result<usize, CustomError> {
    let wrong = || CustomError::new(path, format!("must be an equation of its rate, `\"d{name}/dt = ...\"`"));
    let at = equation.find('=').ok_or_else(wrong)?;
    let left: String = equation[..at].chars().filter(|c| !c.is_whitespace()).collect();
    if left == format!("d{name}/dt") { Ok(at + 1) } else { Err(wrong()) }
}

#[cfg(feature = "serde")]
impl serde::Serialize for Custom {
    fn serialize<S: serde::Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        self.text().serialize(to)
    }
}

#[cfg(feature = "serde")]
impl<'de> serde::Deserialize<'de> for Custom {
    fn deserialize<D: serde::Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        use alloc::string::ToString;
        use serde::de::Error;
        let text = CustomText::deserialize(from)?;
        Self::from_text(&text).map_err(|e| D::Error::custom(e.to_string()))
    }
}
