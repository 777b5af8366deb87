//! Ranges of effect parameters, from the library of effects.

use crate::load_ron::FieldError;
use crate::range_checks::CheckResult;
use crate::scenario::Scenario;
use stylet_tissue::{AnyEffect, Effect, ForceLaw, ParameterError};

/// Checks the effects of a scenario.
pub(crate) fn effects(s: &Scenario) -> CheckResult {
    for (i, effect) in s.effects.iter().enumerate() {
        let at = format!("effects[{i}]");
        if s.effects.iter().take(i).any(|other| other.id() == effect.id() && other.info() != effect.info()) {
            let what = format!("is another effect of the name `{}`; give it a name of its own", effect.id());
            return Err(FieldError::new(format!("{at}.name"), what));
        }
        finite(&at, effect)?;
        effect.check().map_err(|error| problem(&at, effect, &error))?;
        if let AnyEffect::BoundaryShift(shift) = effect
            && shift.layer >= s.tissue.layers.len()
        {
            let layers = s.tissue.layers.len();
            let what = if layers < 2 {
                "names a face between two layers, but there is only one layer; leave the effect out"
                    .to_owned()
            } else {
                format!(
                    "is {}; it must lie between 1 and {}: the face is the one behind this layer",
                    shift.layer,
                    layers - 1
                )
            };
            return Err(FieldError::new(format!("{at}.layer"), what));
        }
    }
    for i in 0..s.candidates.len() {
        candidate(s, i, &format!("candidates[{i}]"))?;
    }
    ForceLaw::new(&s.tissue, &s.effects)
        .map(drop)
        .map_err(|e| FieldError::new("effects", format!("{e}; leave some out")))
}

/// Checks candidate `i`, which its file names `at`.
pub(crate) fn candidate(s: &Scenario, i: usize, at: &str) -> CheckResult {
    let Some(effect) = s.candidates.get(i) else { return Ok(()) };
    if !matches!(effect, AnyEffect::Custom(_)) {
        let what = "is an effect of the library, which is a candidate anyway; leave it out";
        return Err(FieldError::new(at, what));
    }
    let others = s.effects.iter().chain(s.candidates.iter().take(i));
    let taken = others.clone().any(|other| other.id() == effect.id() && other.info() != effect.info())
        || s.candidates.iter().take(i).any(|other| other.id() == effect.id());
    if taken {
        let what = format!("is another effect of the name `{}`; give it a name of its own", effect.id());
        return Err(FieldError::new(format!("{at}.name"), what));
    }
    finite(at, effect)?;
    effect.check().map_err(|error| problem(at, effect, &error))
}

/// The library's path `terms.0.fraction` as written in files: `terms[0].fraction`.
fn path(at: &str, path: &str) -> String {
    let mut written = at.to_owned();
    for part in path.split('.') {
        if part.bytes().all(|c| c.is_ascii_digit()) {
            written.push_str(&format!("[{part}]"));
        } else {
            written.push('.');
            written.push_str(part);
        }
    }
    written
}

/// The path of a parameter of an effect, as its file has it.
fn parameter_path(at: &str, effect: &AnyEffect, parameter: &str) -> String {
    match effect {
        AnyEffect::Custom(_) => format!("{at}.parameters.{parameter}.value"),
        _ => path(at, parameter),
    }
}

fn unit(effect: &AnyEffect, parameter: &str) -> String {
    let unit = effect.info().parameter(parameter).map_or("", |p| p.unit);
    if unit.is_empty() { String::new() } else { format!(" {unit}") }
}

/// Ranges without an upper limit do not exclude infinity.
fn finite(at: &str, effect: &AnyEffect) -> CheckResult {
    for (parameter, value) in effect.info().parameters.iter().zip(effect.parameters()) {
        if !value.is_finite() {
            let what = format!("is {value}; it must be a finite number, for example {}", parameter.start);
            return Err(FieldError::new(parameter_path(at, effect, parameter.path), what));
        }
    }
    Ok(())
}

fn problem(at: &str, effect: &AnyEffect, error: &ParameterError) -> FieldError {
    let ParameterError { path: parameter, value, allowed: (low, high), .. } = error;
    let what = if *parameter == "terms" {
        format!("has {value} terms; give one or two, `(fraction: 0.3, time_constant_s: 2.7)`")
    } else {
        let unit = unit(effect, parameter);
        if *high == f64::INFINITY {
            format!("is {value}; it must be at least {low}{unit}")
        } else {
            format!("is {value}; it must lie between {low} and {high}{unit}")
        }
    };
    FieldError::new(parameter_path(at, effect, parameter), what)
}
