//! Curves on the terminal, in Braille dots.

/// Dots per character: two across, four down.
const DOTS: [[u8; 4]; 2] = [[0x01, 0x02, 0x04, 0x40], [0x08, 0x10, 0x20, 0x80]];
/// The empty Braille pattern.
const BRAILLE: u32 = 0x2800;

/// A curve in `width` by `height` characters, with its extremes on the left; consecutive samples are joined.
#[must_use]
pub fn plot(x: &[f64], y: &[f64], width: usize, height: usize, label: impl Fn(f64) -> String) -> String {
    let points: Vec<(f64, f64)> =
        x.iter().copied().zip(y.iter().copied()).filter(|(x, y)| x.is_finite() && y.is_finite()).collect();
    let bounds = |of: fn(&(f64, f64)) -> f64| {
        points
            .iter()
            .map(of)
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)))
    };
    let ((x0, x1), (y0, y1)) = (bounds(|p| p.0), bounds(|p| p.1));
    if points.is_empty() || width == 0 || height == 0 {
        return String::new();
    }
    let mut cells = vec![vec![0_u8; width]; height];
    let across = (2 * width - 1) as f64;
    let down = (4 * height - 1) as f64;
    let place = |p: &(f64, f64)| {
        let share = |v: f64, low: f64, high: f64| if high > low { (v - low) / (high - low) } else { 0.5 };
        ((share(p.0, x0, x1) * across).round(), ((1.0 - share(p.1, y0, y1)) * down).round())
    };
    let mut dot = |column: f64, row: f64| {
        let (column, row) = (column as usize, row as usize);
        if let Some(cell) = cells.get_mut(row / 4).and_then(|line| line.get_mut(column / 2)) {
            *cell |= DOTS[column % 2][row % 4];
        }
    };
    let mut before: Option<(f64, f64)> = None;
    for point in &points {
        let (column, row) = place(point);
        let (from_column, from_row) = before.replace((column, row)).unwrap_or((column, row));
        let steps = (column - from_column).abs().max((row - from_row).abs()).max(1.0) as usize;
        for step in 0..=steps {
            let share = step as f64 / steps as f64;
            dot(
                (from_column + share * (column - from_column)).round(),
                (from_row + share * (row - from_row)).round(),
            );
        }
    }
    let (top, bottom) = (label(y1), label(y0));
    let margin = top.chars().count().max(bottom.chars().count());
    let mut out = String::new();
    for (at, line) in cells.iter().enumerate() {
        let text = match at {
            0 => top.as_str(),
            _ if at + 1 == height => bottom.as_str(),
            _ => "",
        };
        let dots: String =
            line.iter().filter_map(|cell| char::from_u32(BRAILLE + u32::from(*cell))).collect();
        out.push_str(&format!("  {text:>margin$} {}\n", dots.trim_end_matches('\u{2800}')));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rising_line_goes_from_the_lower_left_to_the_upper_right() {
        let x: Vec<f64> = (0..40).map(f64::from).collect();
        let drawn = plot(&x, &x, 10, 3, |v| format!("{v:.0}"));
        let lines: Vec<&str> = drawn.lines().collect();
        assert_eq!(lines.len(), 3);
        assert!(lines[0].starts_with("  39 ") && lines[2].starts_with("   0 "), "{drawn}");
        assert!(lines[0].ends_with(|c: char| c != '\u{2800}' && c > '\u{2800}'), "{drawn}");
        assert!(lines[2].chars().nth(5).is_some_and(|c| c > '\u{2800}'), "{drawn}");
    }

    #[test]
    fn constant_and_empty_curves_are_no_error() {
        assert_eq!(plot(&[], &[], 10, 3, |v| v.to_string()), "");
        assert_eq!(plot(&[0.0, 1.0], &[2.0, 2.0], 4, 2, |v| v.to_string()).lines().count(), 2);
        assert_eq!(plot(&[f64::NAN], &[1.0], 4, 2, |v| v.to_string()), "");
    }
}
