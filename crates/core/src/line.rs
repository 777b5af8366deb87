//! Straight line by least squares, accumulated sample by sample.

/// Sums for `y = mean_y + slope (x - mean_x)`, kept about a reference to avoid cancellation.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Line {
    pub(crate) count: f64,
    origin: f64,
    sx: f64,
    sy: f64,
    sxx: f64,
    sxy: f64,
}

impl Line {
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

    /// Slope; zero when the points do not spread in `x`.
    pub(crate) fn slope(&self) -> f64 {
        let spread = self.sxx - self.sx * self.sx / self.count.max(1.0);
        if self.count < 2.0 || spread <= 0.0 {
            return 0.0;
        }
        (self.sxy - self.sx * self.sy / self.count) / spread
    }

    /// Value of the line at `x`; `None` without points.
    pub(crate) fn at(&self, x: f64) -> Option<f64> {
        if self.count == 0.0 {
            return None;
        }
        let mean_x = self.origin + self.sx / self.count;
        Some(self.sy / self.count + self.slope() * (x - mean_x))
    }

    /// Where the line reaches `y`; `None` when it never does.
    pub(crate) fn reaches(&self, y: f64) -> Option<f64> {
        let slope = self.slope();
        if slope == 0.0 {
            return None;
        }
        let mean_x = self.origin + self.sx / self.count;
        Some(mean_x + (y - self.sy / self.count) / slope)
    }
}
