//! Recursive least-squares fit of a straight line.

/// Sums of the points, about the first `x` to avoid cancellation.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct LineFit {
    pub(crate) count: f64,
    origin: f64,
    sx: f64,
    sy: f64,
    sxx: f64,
    sxy: f64,
}

impl LineFit {
    #[inline]
    pub(crate) fn add(&mut self, x: f64, y: f64) {
        if self.count == 0.0 {
            self.origin = x;
        }
        let x = x - self.origin;
        self.count += 1.0;
        self.sx += x;
        self.sy += y;
        self.sxx += x * x;
        self.sxy += x * y;
    }

    /// Slope; zero when all points have the same `x`.
    pub(crate) fn slope(&self) -> f64 {
        let spread = self.sxx - self.sx * self.sx / self.count.max(1.0);
        if self.count < 2.0 || spread <= 0.0 {
            return 0.0;
        }
        (self.sxy - self.sx * self.sy / self.count) / spread
    }

    /// Value at `x`; `None` without points.
    pub(crate) fn y_at(&self, x: f64) -> Option<f64> {
        if self.count == 0.0 {
            return None;
        }
        let mean_x = self.origin + self.sx / self.count;
        Some(self.sy / self.count + self.slope() * (x - mean_x))
    }

    /// Where the line reaches `y`; `None` for a horizontal line.
    pub(crate) fn x_at(&self, y: f64) -> Option<f64> {
        let slope = self.slope();
        if slope == 0.0 {
            return None;
        }
        let mean_x = self.origin + self.sx / self.count;
        Some(mean_x + (y - self.sy / self.count) / slope)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn residuals_and_their_moment_sum_to_zero() {
        // Far from the origin: sum and moment of the residuals vanish.
        let points = [(100.01, 3.0), (100.02, 3.5), (100.03, 3.1), (100.05, 4.2), (100.08, 4.0)];
        let mut line = LineFit::default();
        points.iter().for_each(|(x, y)| line.add(*x, *y));
        let rest = |x: f64, y: f64| y - line.y_at(x).expect("points");
        let sum: f64 = points.iter().map(|(x, y)| rest(*x, *y)).sum();
        let moment: f64 = points.iter().map(|(x, y)| (x - 100.0) * rest(*x, *y)).sum();
        assert!(sum.abs() < 1e-9 && moment.abs() < 1e-9, "{sum} {moment}");
        let rise = line.y_at(101.0).expect("points") - line.y_at(100.0).expect("points");
        assert!((line.slope() - rise).abs() < 1e-9);
        for y in [-2.0, 3.3, 10.0] {
            let x = line.x_at(y).expect("a slope");
            assert!((line.y_at(x).expect("points") - y).abs() < 1e-9);
        }
    }

    #[test]
    fn without_points_or_spread_there_is_no_slope() {
        let mut line = LineFit::default();
        assert_eq!((line.y_at(1.0), line.x_at(1.0), line.slope()), (None, None, 0.0));
        line.add(2.0, 5.0);
        assert_eq!((line.y_at(7.0), line.x_at(1.0), line.slope()), (Some(5.0), None, 0.0));
        line.add(2.0, 7.0);
        assert_eq!((line.y_at(7.0), line.x_at(1.0), line.slope()), (Some(6.0), None, 0.0));
    }

    #[test]
    fn the_fit_solves_the_normal_equations() {
        // Means 0.275 and 1.15, sums 0.0975 and 0.06375.
        let mut line = LineFit::default();
        for (x, y) in [(0.125, 1.0), (0.25, 0.9), (0.25, 1.2), (0.475, 1.5)] {
            line.add(x, y);
        }
        let slope = 0.0975 / 0.063_75;
        let near =
            |found: f64, expected: f64| assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        near(line.slope(), slope);
        near(line.y_at(0.7).expect("points"), 1.15 + slope * 0.425);
        near(line.x_at(2.4).expect("a slope"), 0.275 + 1.25 / slope);
        assert_eq!(line.count, 4.0);
        // Invariant to a shift.
        let mut far = LineFit::default();
        for (x, y) in [(0.125, 1.0), (0.25, 0.9), (0.25, 1.2), (0.475, 1.5)] {
            far.add(x - 3.0, y);
        }
        near(far.slope(), slope);
        near(far.y_at(-2.3).expect("points"), 1.15 + slope * 0.425);
        near(far.x_at(2.4).expect("a slope"), -2.725 + 1.25 / slope);
        // Two points define a line.
        let mut two = LineFit::default();
        two.add(1.0, 3.0);
        two.add(1.5, 2.0);
        near(two.slope(), -2.0);
    }
}
