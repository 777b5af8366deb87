//! One pass over the rows: statistics of every column.

/// Running statistics of a column.
#[derive(Debug, Clone, Default)]
pub(super) struct ColumnScan {
    pub values: usize,
    pub missing: usize,
    pub min: f64,
    pub max: f64,
    pub first: f64,
    /// Steps up, down, and none.
    pub up: usize,
    pub down: usize,
    pub level: usize,
    sum: f64,
    squares: f64,
    /// Sum of the squared second differences.
    bends: f64,
    last: [f64; 2],
}

impl ColumnScan {
    pub(super) fn push(&mut self, x: f64) {
        if !x.is_finite() {
            self.missing += 1;
            return;
        }
        if self.values == 0 {
            (self.min, self.max, self.first) = (x, x, x);
        } else {
            let before = self.last[1];
            self.up += usize::from(x > before);
            self.down += usize::from(x < before);
            self.level += usize::from(x == before);
            if self.values > 1 {
                self.bends += (x - 2.0 * before + self.last[0]).powi(2);
            }
            self.min = self.min.min(x);
            self.max = self.max.max(x);
        }
        // Counted from the first value, so that a large offset costs no digits.
        self.sum += x - self.first;
        self.squares += (x - self.first).powi(2);
        self.last = [self.last[1], x];
        self.values += 1;
    }

    pub(super) fn range(&self) -> f64 {
        self.max - self.min
    }

    pub(super) fn variance(&self) -> f64 {
        let n = self.values.max(1) as f64;
        (self.squares / n - (self.sum / n).powi(2)).max(0.0)
    }

    /// Second differences over the range: near zero for a motion, larger for a noisy signal.
    pub(super) fn roughness(&self) -> f64 {
        let count = self.values.saturating_sub(2).max(1) as f64;
        (self.bends / count).sqrt() / self.range().max(f64::MIN_POSITIVE)
    }

    pub(super) fn is_constant(&self) -> bool {
        self.values == 0 || self.range() == 0.0
    }

    pub(super) fn is_constant_at(&self, value: f64) -> bool {
        self.values > 0 && self.min == value && self.max == value
    }

    /// Whether the values are consecutive integers.
    pub(super) fn is_counter(&self) -> bool {
        let steps = self.values.saturating_sub(1);
        steps > 1
            && self.up == steps
            && self.range() == steps as f64
            && self.first.fract() == 0.0
            && self.bends == 0.0
    }

    /// Whether the values increase like a clock: nearly always up, or level within bursts.
    pub(super) fn is_clock(&self) -> bool {
        let steps = (self.up + self.down + self.level).max(1) as f64;
        !self.is_constant() && (self.down as f64) < 0.02 * steps && self.up as f64 > 0.02 * steps
    }
}

/// Statistics of all columns.
#[derive(Debug, Clone, Default)]
pub(super) struct Scan {
    pub rows: usize,
    pub columns: Vec<ColumnScan>,
}

impl Scan {
    pub(super) fn new(columns: usize) -> Self {
        Self { rows: 0, columns: vec![ColumnScan::default(); columns] }
    }

    pub(super) fn push(&mut self, row: &[f64]) {
        self.rows += 1;
        self.columns.iter_mut().zip(row).for_each(|(column, x)| column.push(*x));
    }
}

/// Buckets of a thinned curve.
const BUCKETS: usize = 600;

/// Curves thinned to the extremes of the force and the position within buckets of rows.
#[derive(Debug, Default)]
pub(super) struct ThinnedCurves {
    per_bucket: usize,
    in_bucket: usize,
    /// Samples at the extremes of the bucket: force low, force high, position low, position high.
    extremes: Option<[[f64; 4]; 4]>,
    pub samples: Vec<[f64; 3]>,
    row: usize,
}

impl ThinnedCurves {
    pub(super) fn new(rows: usize) -> Self {
        Self { per_bucket: rows.div_ceil(BUCKETS).max(1), ..Self::default() }
    }

    pub(super) fn push(&mut self, time_s: f64, position_m: f64, force_n: f64) {
        if !(time_s.is_finite() && position_m.is_finite() && force_n.is_finite()) {
            return;
        }
        let sample = [self.row as f64, time_s, position_m, force_n];
        self.row += 1;
        let extremes = self.extremes.get_or_insert([sample; 4]);
        if force_n < extremes[0][3] {
            extremes[0] = sample;
        }
        if force_n > extremes[1][3] {
            extremes[1] = sample;
        }
        if position_m < extremes[2][2] {
            extremes[2] = sample;
        }
        if position_m > extremes[3][2] {
            extremes[3] = sample;
        }
        self.in_bucket += 1;
        if self.in_bucket >= self.per_bucket {
            self.flush();
        }
    }

    fn flush(&mut self) {
        self.in_bucket = 0;
        let Some(mut extremes) = self.extremes.take() else { return };
        extremes.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let mut last = f64::NAN;
        for sample in extremes {
            if sample[0] != last {
                self.samples.push([sample[1], sample[2], sample[3]]);
                last = sample[0];
            }
        }
    }

    pub(super) fn finish(mut self) -> super::Curves {
        self.flush();
        super::Curves {
            time_s: self.samples.iter().map(|s| s[0]).collect(),
            position_m: self.samples.iter().map(|s| s[1]).collect(),
            force_n: self.samples.iter().map(|s| s[2]).collect(),
        }
    }
}
