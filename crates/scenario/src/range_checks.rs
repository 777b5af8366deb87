//! Checks of single values. RON reads `NaN` and `-inf` and turns `1e400` into infinity, so every number is checked.

use crate::load_ron::FieldError;

pub(crate) type CheckResult = Result<(), FieldError>;

pub(crate) fn check(path: impl Into<String>, value: f64, ok: bool, right: &str) -> CheckResult {
    if ok && value.is_finite() { Ok(()) } else { Err(FieldError::new(path, format!("is {value}; {right}"))) }
}

pub(crate) fn positive(path: impl Into<String>, value: f64, unit: &str) -> CheckResult {
    check(path, value, value > 0.0, &format!("it must be a positive number of {unit}"))
}

pub(crate) fn not_negative(path: impl Into<String>, value: f64, unit: &str) -> CheckResult {
    check(path, value, value >= 0.0, &format!("it must be zero or a positive number of {unit}"))
}

pub(crate) fn finite(path: impl Into<String>, value: f64, unit: &str) -> CheckResult {
    check(path, value, true, &format!("it must be a finite number of {unit}"))
}
