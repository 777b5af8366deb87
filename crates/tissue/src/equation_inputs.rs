//! What formulas and code have in common: the names, units and parameters of an equation, and that an inactive effect vanishes.

use crate::custom_equation::{Equation, EquationSample, MAX_PARAMETERS, MAX_STATES};
use crate::custom_error::CustomError;
use crate::custom_names::static_name;
use crate::custom_text::{CustomText, ParameterText, Place, Prior};
use crate::effect_info::ParameterInfo;
use crate::formula_equation::VARIABLES;
use alloc::format;
use alloc::vec::Vec;
use stylet_formula::{Formula, Unit};

/// Search range of a parameter without a prior, as a factor of its start value.
const DEFAULT_FACTOR: f64 = 10.0;
/// Standard deviations from the mean to the ends of the search range.
const SEARCH_SDS: f64 = 1.96;

/// The inputs of an equation.
pub(crate) struct EquationInputs<'a> {
    /// Names of the variables, then of the parameters, then of the states.
    pub names: Vec<&'a str>,
    /// Units of the variables, then of the parameters.
    pub units: Vec<Unit>,
    /// Parameters.
    pub parameters: Vec<ParameterInfo>,
}

impl<'a> EquationInputs<'a> {
    /// Reads and checks all of a text but its equations.
    pub(crate) fn new(text: &'a CustomText) -> Result<Self, CustomError> {
        let given = &text.parameters.0;
        if given.len() > MAX_PARAMETERS {
            let what = format!("has {} entries; at most {MAX_PARAMETERS} are possible", given.len());
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
        let mut units: Vec<Unit> =
            VARIABLES.iter().map(|v| Unit::parse(v.unit).unwrap_or(Unit::NONE)).collect();
        let mut parameters = Vec::new();
        for (name, parameter) in given {
            let path = format!("parameters.{name}");
            free(&names, name, &path)?;
            names.push(name);
            units
                .push(Unit::parse(&parameter.unit).map_err(|e| CustomError::new(format!("{path}.unit"), e))?);
            parameters.push(parameter_info(name, parameter, &path)?);
        }
        for (name, _) in &text.state.0 {
            free(&names, name, &format!("state.{name}"))?;
            names.push(name);
        }
        if !parameters.iter().any(|p| p.strength) {
            let what = "no parameter is a strength; give one an inactive value, at which the effect vanishes";
            return Err(CustomError::new("parameters", what));
        }
        Ok(Self { names, units, parameters })
    }
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
pub(crate) fn check_vanishing(
    place: Place,
    equation: &dyn Equation,
    parameters: &[ParameterInfo],
) -> Result<(), CustomError> {
    let sensor = place == Place::Sensor;
    let inactive: Vec<f64> =
        parameters.iter().map(|p| if p.strength { p.inactive } else { p.start }).collect();
    for [t, z, v, a, force] in PROBES {
        let elastic_n = 0.6 * force;
        let sample = EquationSample {
            time_s: t,
            dt_s: 0.0,
            z_m: z,
            v_mps: v,
            a_mps2: a,
            depth_m: z - 0.01,
            layer: 1.0,
            travel_m: 0.4 * z.abs(),
            inserted_m: z.max(0.0),
            elastic_n,
            friction_n: force - elastic_n,
            force_n: force,
        };
        let left = equation.value(&sample, &inactive, &[0.0; MAX_STATES]) - if sensor { force } else { 0.0 };
        // Where an equation has no value, it is refused with its parameters.
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
