//! Checks of single values. RON reads `NaN` and `-inf` and turns `1e400` into infinity, so every number is checked.

use crate::load_ron::FieldError;

pub(crate) type CheckResult = Result<(), FieldError>;

pub(crate) fn check(path: impl Into<String>, value: f64, ok: bool, right: &str) -> CheckResult {
    if ok && value.is_finite() {
        Ok(())
    } else {
        Err(FieldError::new(path, format!("is {}; {right}", number_text(value))))
    }
}

/// A number as text; very large and small ones with an exponent instead of hundreds of digits.
pub(crate) fn number_text(value: f64) -> String {
    let size = value.abs();
    if size != 0.0 && !(1e-6..1e9).contains(&size) { format!("{value:e}") } else { value.to_string() }
}

/// Checks that a value is not negative and at most `most`; larger values are wrong units or typing errors.
pub(crate) fn plausible(path: impl Into<String>, value: f64, most: f64, unit: &str) -> CheckResult {
    let right = format!("it must be zero or a positive number of {unit}, at most {most:e}");
    check(path, value, (0.0..=most).contains(&value), &right)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_of_any_size_is_shown_in_few_characters() {
        for value in [1e300, -1e308, 5e-324, f64::INFINITY, f64::NAN, 0.0, 0.25, 123_456_789.0] {
            assert!(number_text(value).len() < 12, "{}", number_text(value));
        }
        assert_eq!(
            (number_text(1e300), number_text(-0.02), number_text(0.0)),
            ("1e300".into(), "-0.02".into(), "0".into())
        );
    }

    #[test]
    fn a_value_beyond_the_largest_plausible_one_is_refused() {
        assert!(plausible("k", 1e9, 1e9, "N/m").is_ok() && plausible("k", 0.0, 1e9, "N/m").is_ok());
        for value in [1.1e9, 1e308, -1e-9, f64::NAN] {
            assert!(plausible("k", value, 1e9, "N/m").is_err(), "{value}");
        }
    }
}
