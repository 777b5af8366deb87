//! Numbers as text: short, the same on every machine, `null` where there is none.

/// `value` rounded to `digits` significant digits in the shortest decimal or exponent form, for people and SVG.
/// What is not finite becomes a dash.
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

/// A number with what it may be off by, where that is known: `40 ± 0.15`.
#[must_use]
pub fn plus_minus(value: f64, doubt: Option<f64>, digits: usize) -> String {
    let value = significant(value, digits);
    doubt.map_or_else(|| value.clone(), |d| format!("{value} ± {}", significant(d, 2)))
}

/// A p-value: `p = 0.012`. Below 1e-12 nobody knows the tails of noise: `p < 1e-12`.
#[must_use]
pub fn p_value(p: f64) -> String {
    if p < 1e-12 { "p < 1e-12".to_owned() } else { format!("p = {}", significant(p, 2)) }
}

/// A ratio as percentage with two significant digits (three from 10 % on): `0.0361` gives `3.6 %`.
#[must_use]
pub fn percent(ratio: f64) -> String {
    let digits = if ratio.abs() >= 0.1 { 3 } else { 2 };
    format!("{} %", significant(ratio * 100.0, digits).replace('-', "−"))
}

/// Appends a JSON array of numbers rounded to `digits` significant digits; not-a-number and infinity become `null`.
pub(crate) fn push_json_array(out: &mut String, values: &[f64], digits: usize) {
    out.push('[');
    for (index, &value) in values.iter().enumerate() {
        if index > 0 {
            out.push(',');
        }
        if value.is_finite() {
            push_rounded(out, value, digits);
        } else {
            out.push_str("null");
        }
    }
    out.push(']');
}

/// Appends a finite number: the exponent form decides the digits, the shorter spelling wins.
fn push_rounded(out: &mut String, value: f64, digits: usize) {
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

/// A coordinate of an SVG: at most two decimals, no negative zero, no trailing zeros.
pub(crate) fn svg_coordinate(value: f64) -> String {
    if !value.is_finite() {
        return "0".to_owned();
    }
    let hundredths = (value * 100.0).round() / 100.0;
    if hundredths == 0.0 { "0".to_owned() } else { format!("{hundredths}") }
}

/// Steps of 1, 2 or 5 times a power of ten: the round values inside `[low, high]`, about `count` of them.
pub(crate) fn axis_ticks(low: f64, high: f64, count: usize) -> Vec<f64> {
    let span = high - low;
    if !(span.is_finite() && span > 0.0) || count == 0 {
        return Vec::new();
    }
    let raw = span / count as f64;
    let power = 10f64.powf(raw.log10().floor());
    let step =
        [1.0, 2.0, 5.0, 10.0].iter().map(|m| m * power).find(|s| *s >= raw * 0.999).unwrap_or(10.0 * power);
    let first = (low / step - 1e-9).ceil() as i64;
    let last = (high / step + 1e-9).floor() as i64;
    (first..=last).map(|i| i as f64 * step).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn six_digits_are_kept_and_what_is_not_finite_becomes_null() {
        let mut out = String::new();
        push_json_array(
            &mut out,
            &[1.234_567_89, f64::NAN, -0.0, 1.0e-7, f64::INFINITY, 123_456_789.0, 0.1 + 0.2],
            6,
        );
        assert_eq!(out, "[1.23457,null,0,1e-7,null,123457000,0.3]");
    }

    #[test]
    fn ticks_are_round_and_cover_the_range() {
        assert_eq!(axis_ticks(0.0, 50.0, 5), vec![0.0, 10.0, 20.0, 30.0, 40.0, 50.0]);
        assert_eq!(axis_ticks(-0.3, 4.1, 4), vec![0.0, 2.0, 4.0]);
        assert!(axis_ticks(1.0, 1.0, 4).is_empty());
        assert!(axis_ticks(f64::NAN, 1.0, 4).is_empty());
    }

    #[test]
    fn percentages_keep_two_or_three_digits() {
        assert_eq!(percent(0.036_12), "3.6 %");
        assert_eq!(percent(-0.381_4), "−38.1 %");
        assert_eq!(percent(f64::NAN), "– %");
    }
}
