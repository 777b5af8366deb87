//! Compiles custom effects from their text.

use crate::custom_equation::{CustomDefinition, MAX_PARAMETERS, MAX_STATES};
use crate::custom_names::{GrowingList, static_name};
use crate::custom_text::{CustomText, ParameterText, Place, Prior};
use crate::effect_info::{EffectInfo, ParameterInfo};
use crate::effects::Custom;
use crate::formula_equation::{FormulaEquation, TRAVEL, VARIABLES, value_unit};
use alloc::boxed::Box;
use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;
use stylet_formula::{Formula, FormulaError, Unit, solve_unknown_units};

/// What is wrong with the text of a custom effect.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CustomError {
    /// Path of the field inside the effect, such as `force` or `parameters.k.unit`.
    pub path: String,
    /// First byte of the part of the field's formula that is wrong, and the byte behind it.
    pub place: Option<(usize, usize)>,
    /// Cause and remedy.
    pub message: String,
}

impl CustomError {
    fn new(path: impl Into<String>, message: impl Into<String>) -> Self {
        Self { path: path.into(), place: None, message: message.into() }
    }

    /// An error in a formula that begins at byte `from` of the field.
    fn formula(path: impl Into<String>, text: &str, from: usize, error: &FormulaError) -> Self {
        let part = error.part(text);
        let says_it = part.is_empty() || error.message.starts_with(&format!("`{part}`"));
        let message = if says_it { error.message.clone() } else { format!("`{part}`: {}", error.message) };
        Self { path: path.into(), place: Some((from + error.start, from + error.end)), message }
    }
}

impl core::fmt::Display for CustomError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{}: {}", self.path, self.message)?;
        match self.place {
            Some((start, _)) => write!(f, " (character {} of the text)", start + 1),
            None => Ok(()),
        }
    }
}

impl core::error::Error for CustomError {}

/// Search range of a parameter without a prior, as a factor of its start value.
const DEFAULT_FACTOR: f64 = 10.0;
/// Standard deviations from the mean to the ends of the search range.
const SEARCH_SDS: f64 = 1.96;

/// A text with the definition that it was compiled to.
struct Compiled {
    text: CustomText,
    effect: Custom,
}

static COMPILED: GrowingList<Compiled> = GrowingList::new();

impl Custom {
    /// Compiles a text. Texts that differ only in parameter values share one definition.
    ///
    /// # Errors
    /// [`CustomError`] with the field, and the place in its formula.
    pub fn from_text(text: &CustomText) -> Result<Self, CustomError> {
        let mut shared = text.clone();
        for (_, parameter) in &mut shared.parameters.0 {
            parameter.value = None;
        }
        let compiled = COMPILED.find_or_add(
            |known| known.text == shared,
            || compile(&shared).map(|effect| Compiled { text: shared.clone(), effect }),
        )?;
        let values: Vec<f64> = text.parameters.0.iter().map(|(_, p)| p.value.unwrap_or(p.start)).collect();
        let info = compiled.effect.entry();
        Self::with_values(info, &values)
            .ok_or_else(|| CustomError::new("parameters", "do not fit the definition"))
    }

    /// The text with the present values, when the effect was compiled from one.
    #[must_use]
    pub fn text(&self) -> Option<CustomText> {
        let mut text = self.entry().custom?.text.clone()?;
        for ((_, parameter), value) in text.parameters.0.iter_mut().zip(self.values()) {
            parameter.value = (*value != parameter.start).then_some(*value);
        }
        Some(text)
    }
}

fn compile(text: &CustomText) -> Result<Custom, CustomError> {
    let parameters = &text.parameters.0;
    if parameters.len() > MAX_PARAMETERS {
        let what = format!("has {} entries; at most {MAX_PARAMETERS} are possible", parameters.len());
        return Err(CustomError::new("parameters", what));
    }
    if text.state.0.len() > MAX_STATES {
        let what = format!("has {} entries; at most {MAX_STATES} are possible", text.state.0.len());
        return Err(CustomError::new("state", what));
    }
    if text.place == Place::Motion && !text.state.is_empty() {
        return Err(CustomError::new(
            "state",
            "is not possible at `Motion`: the motion of the tissue depends on time and position",
        ));
    }
    let mut names: Vec<&str> = VARIABLES.iter().map(|v| v.name).collect();
    let mut units: Vec<Unit> = VARIABLES.iter().map(|v| Unit::parse(v.unit).unwrap_or(Unit::NONE)).collect();
    let mut infos = Vec::new();
    for (name, parameter) in parameters {
        let path = format!("parameters.{name}");
        free(&names, name, &path)?;
        names.push(name);
        units.push(Unit::parse(&parameter.unit).map_err(|e| CustomError::new(format!("{path}.unit"), e))?);
        infos.push(parameter_info(name, parameter, &path)?);
    }
    for (name, _) in &text.state.0 {
        free(&names, name, &format!("state.{name}"))?;
        names.push(name);
    }
    let value = parse("force", &text.force, 0, &names, text.place)?;
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
        Some((0, error)) => CustomError::formula("force", &text.force, 0, &error),
        Some((k, error)) => {
            let (name, start) = (&text.state.0[k - 1].0, starts[k - 1]);
            CustomError::formula(format!("state.{name}"), rates[k - 1].text(), start, &error)
        }
        None => CustomError::new(
            "state",
            "the unit of a state does not follow from the formulas; use it in `force`",
        ),
    })?;
    if !infos.iter().any(|p| p.strength) {
        let what = "no parameter is a strength; give one an inactive value, at which the effect vanishes";
        return Err(CustomError::new("parameters", what));
    }
    vanishes(text, &value, &infos)?;
    let uses_travel = value.uses(TRAVEL) || rates.iter().any(|r| r.uses(TRAVEL));
    let states = rates.len();
    let definition = CustomDefinition {
        place: text.place,
        states,
        uses_travel,
        equation: Box::new(FormulaEquation { value, rates, parameters: infos.len() }),
        text: Some(text.clone()),
    };
    let info = EffectInfo {
        id: static_name(&text.name),
        equation: static_name(&equation_of(text)),
        source: if text.source.is_empty() { "defined by the user" } else { static_name(&text.source) },
        signature: "defined by the user",
        parameters: infos.leak(),
        ..EffectInfo::DEFAULTS
    };
    Custom::define(info, definition).map_err(|what| CustomError::new("name", what))
}

/// The equation for listings.
fn equation_of(text: &CustomText) -> String {
    let force = &text.force;
    let mut out = match text.place {
        Place::Elastic => format!("f_K -> f_K + {force}"),
        Place::Friction | Place::Tip => format!("+ {force}"),
        Place::Sensor => format!("f -> {force}"),
        Place::Motion => format!("z -> z - ({force})"),
    };
    for (_, equation) in &text.state.0 {
        out.push_str(", ");
        out.push_str(equation);
    }
    out
}

/// Checks that a name is not taken.
fn free(names: &[&str], name: &str, path: &str) -> Result<(), CustomError> {
    if names.contains(&name) {
        return Err(CustomError::new(
            path,
            format!("`{name}` is already the name of something else; use another name"),
        ));
    }
    if name == "pi" {
        return Err(CustomError::new(path, "`pi` is a number; use another name"));
    }
    // A name that no formula can contain.
    match Formula::parse(name, &[name]) {
        Ok(formula) if formula.uses(0) => Ok(()),
        _ => Err(CustomError::new(path, format!("`{name}` is no name; use letters, digits and `_`"))),
    }
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

fn parameter_info(name: &str, p: &ParameterText, path: &str) -> Result<ParameterInfo, CustomError> {
    let wrong = |field: &str, what: &str| Err(CustomError::new(format!("{path}.{field}"), what));
    let start = p.start;
    if !start.is_finite() || start == 0.0 {
        return wrong("start", "must be a typical value, finite and not zero: a search starts there");
    }
    let strength = p.inactive.is_some();
    if p.inactive.is_some_and(|x| !x.is_finite() || x == start) {
        return wrong("inactive", "must be finite, and not the start value");
    }
    let infinity = f64::INFINITY;
    let (search, (low, high), log, measured) = match p.prior {
        None if start > 0.0 => {
            ((start / DEFAULT_FACTOR, start * DEFAULT_FACTOR), (0.0, infinity), true, None)
        }
        None => ((start * DEFAULT_FACTOR, start / DEFAULT_FACTOR), (-infinity, infinity), false, None),
        Some(Prior::Normal { mean, sd }) => {
            if !(mean.is_finite() && sd.is_finite() && sd > 0.0) {
                return wrong("prior", "must have a finite mean and an `sd` above zero");
            }
            ((mean - SEARCH_SDS * sd, mean + SEARCH_SDS * sd), (-infinity, infinity), false, Some((mean, sd)))
        }
        Some(Prior::LogNormal { median, factor }) => {
            if !(median.is_finite() && median > 0.0 && factor.is_finite() && factor > 1.0) {
                return wrong("prior", "must have a `median` above zero and a `factor` above one");
            }
            let far = libm::pow(factor, SEARCH_SDS);
            let measured = Some((libm::log(median), libm::log(factor)));
            ((median / far, median * far), (0.0, infinity), true, measured)
        }
        Some(Prior::Uniform { low, high }) => {
            if !(low.is_finite() && high.is_finite() && low < high) {
                return wrong("prior", "must have a finite `low` below a finite `high`");
            }
            ((low, high), (low, high), false, None)
        }
    };
    let allowed = (p.inactive.map_or(low, |x| low.min(x)), p.inactive.map_or(high, |x| high.max(x)));
    if !(allowed.0..=allowed.1).contains(&start) {
        return wrong("start", "lies outside the prior");
    }
    let (meaning, unit) = (if p.meaning.is_empty() { name } else { &p.meaning }, static_name(&p.unit));
    let info = if strength { ParameterInfo::strength } else { ParameterInfo::shape };
    let info = info(static_name(name), unit, static_name(meaning)).allowed(allowed.0, allowed.1);
    let info = ParameterInfo {
        // The search is for the absence of an effect as well, so a strength has no prior in the fit.
        measured_prior: measured.filter(|_| !strength),
        log,
        ..info.search(start, search.0, search.1).inactive(p.inactive.unwrap_or(start))
    };
    Ok(info)
}

/// Samples at which an inactive effect must vanish: time, position, velocity, acceleration, forces.
const PROBES: [[f64; 5]; 4] = [
    [0.0, -0.004, 0.0, 0.0, 0.0],
    [1.3, 0.011, 0.004, 0.1, 0.7],
    [7.1, 0.023, -0.002, -0.3, 0.2],
    [20.7, 0.048, 0.011, 0.0, 2.9],
];

/// Checks that the effect vanishes at its inactive values.
fn vanishes(text: &CustomText, value: &Formula, infos: &[ParameterInfo]) -> Result<(), CustomError> {
    let sensor = text.place == Place::Sensor;
    for [t, z, v, a, force] in PROBES {
        let (depth, elastic) = (z - 0.01, 0.6 * force);
        let mut inputs: Vec<f64> =
            [t, z, v, a, depth, 1.0, 0.4 * z.abs(), z.max(0.0), elastic, force - elastic, force, force]
                .into();
        inputs.extend(infos.iter().map(|p| if p.strength { p.inactive } else { p.start }));
        inputs.extend([0.0; MAX_STATES]);
        let left = value.program().evaluate(&inputs) - if sensor { force } else { 0.0 };
        // Where a formula has no value, it is refused with its parameters.
        if left.is_finite() && left.abs() > 1e-12 {
            let what = if sensor { "must be `force`" } else { "must be zero" };
            let message = format!(
                "{what} where every strength has its inactive value, and is not: it is off by {left:e} at t = {t}, z = {z}, v = {v}"
            );
            return Err(CustomError::new("force", message));
        }
    }
    Ok(())
}

#[cfg(feature = "serde")]
impl serde::Serialize for Custom {
    fn serialize<S: serde::Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        use serde::ser::Error;
        match self.text() {
            Some(text) => text.serialize(to),
            None => Err(S::Error::custom(format_args!(
                "{}: an effect that is defined by code cannot be written to a file",
                self.entry().id
            ))),
        }
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
