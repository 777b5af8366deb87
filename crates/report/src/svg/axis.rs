//! Coordinates and axis ticks of a still picture.

/// A coordinate of an SVG: at most two decimals, no negative zero, no trailing zeros.
pub(super) fn svg_coordinate(value: f64) -> String {
    if !value.is_finite() {
        return "0".to_owned();
    }
    let hundredths = (value * 100.0).round() / 100.0;
    if hundredths == 0.0 { "0".to_owned() } else { format!("{hundredths}") }
}

/// Round values inside `[low, high]`, about `count` of them, in steps of 1, 2 or 5 times a power of ten.
pub(super) fn axis_ticks(low: f64, high: f64, count: usize) -> Vec<f64> {
    let span = high - low;
    if !(span.is_finite() && span > 0.0) || count == 0 {
        return Vec::new();
    }
    let raw = span / count as f64;
    let power = libm::pow(10.0, libm::floor(libm::log10(raw)));
    let step =
        [1.0, 2.0, 5.0, 10.0].iter().map(|m| m * power).find(|s| *s >= raw * 0.999).unwrap_or(10.0 * power);
    let first = (low / step - 1e-9).ceil() as i64;
    let last = (high / step + 1e-9).floor() as i64;
    (first..=last).map(|i| i as f64 * step).collect()
}

#[cfg(test)]
mod tests {
    use super::axis_ticks;

    #[test]
    fn ticks_are_round_and_cover_the_range() {
        assert_eq!(axis_ticks(0.0, 50.0, 5), vec![0.0, 10.0, 20.0, 30.0, 40.0, 50.0]);
        assert_eq!(axis_ticks(-0.3, 4.1, 4), vec![0.0, 2.0, 4.0]);
        assert!(axis_ticks(1.0, 1.0, 4).is_empty());
        assert!(axis_ticks(f64::NAN, 1.0, 4).is_empty());
    }
}
