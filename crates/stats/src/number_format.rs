//! Number formatting for reports: significant digits, the same on every machine.

/// `value` rounded to `digits` significant digits, in decimal or exponent form, whichever suits its size. A value that is not finite
/// becomes an en dash.
#[must_use]
pub fn significant(value: f64, digits: usize) -> String {
    let mut out = String::new();
    if value.is_finite() {
        push_rounded(&mut out, value, digits);
    } else {
        out.push('–');
    }
    out
}

/// A value with the half width of its interval, where that is known: `40 ± 0.15`.
#[must_use]
pub fn plus_minus(value: f64, half_width: Option<f64>, digits: usize) -> String {
    let value = significant(value, digits);
    half_width.map_or_else(|| value.clone(), |d| format!("{value} ± {}", significant(d, 2)))
}

/// A p-value: `p = 0.012`. Below 1e-12, where the tail of the noise distribution is not known, `p < 1e-12`.
#[must_use]
pub fn p_value(p: f64) -> String {
    if p < 1e-12 { "p < 1e-12".to_owned() } else { format!("p = {}", significant(p, 2)) }
}

/// A ratio in per cent with two significant digits (three from 10 % on): `0.0361` gives `3.6 %`.
#[must_use]
pub fn percent(ratio: f64) -> String {
    let digits = if ratio.abs() >= 0.1 { 3 } else { 2 };
    format!("{} %", significant(ratio * 100.0, digits).replace('-', "−"))
}

/// Appends a finite value rounded to `digits` significant digits; exponent form below 1e-4 and from 1e9 on.
pub fn push_rounded(out: &mut String, value: f64, digits: usize) {
    if value == 0.0 {
        out.push('0');
        return;
    }
    let exponent_form = format!("{:.*e}", digits.saturating_sub(1), value);
    // The parse cannot fail: the text was just printed from a finite number.
    let rounded: f64 = exponent_form.parse().unwrap_or(value);
    let size = rounded.abs();
    if (1e-4..1e9).contains(&size) {
        let plain = format!("{rounded}");
        out.push_str(&plain);
    } else {
        out.push_str(&format!("{rounded:e}"));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentages_keep_two_or_three_digits() {
        assert_eq!(percent(0.036_12), "3.6 %");
        assert_eq!(percent(-0.381_4), "−38.1 %");
        assert_eq!(percent(f64::NAN), "– %");
    }
}
