//! Weighted sums over block averages, and regressions from them.

use crate::bounds::at_least;

/// Share of a regressor's square that projection must leave.
pub(super) const MIN_REMAINING_SHARE: f64 = 1e-9;

/// Averages of `count` samples.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Block {
    pub(super) count: f64,
    pub(super) time_s: f64,
    pub(super) position_m: f64,
    pub(super) force_n: f64,
}

impl Block {
    pub(super) fn merged(&self, other: &Block) -> Block {
        let count = self.count + other.count;
        let share = if count > 0.0 { other.count / count } else { 0.5 };
        let mix = |a: f64, b: f64| a + share * (b - a);
        Block {
            count,
            time_s: mix(self.time_s, other.time_s),
            position_m: mix(self.position_m, other.position_m),
            force_n: mix(self.force_n, other.force_n),
        }
    }
}

/// Form of a baseline.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Form {
    Constant,
    Drift,
    Line,
}

/// Weighted sums over blocks, about their means.
#[derive(Clone, Copy, Debug)]
pub(super) struct Totals {
    pub(super) weight: f64,
    pub(super) time_s: f64,
    pub(super) position_m: f64,
    pub(super) force_n: f64,
    pub(super) tt: f64,
    pub(super) zz: f64,
    pub(super) tz: f64,
    pub(super) tf: f64,
    pub(super) zf: f64,
    pub(super) ff: f64,
}

impl Totals {
    pub(super) fn new(blocks: &[Block], sample_weight: f64) -> Self {
        let (mut w, mut t, mut z, mut f) = (0.0, 0.0, 0.0, 0.0);
        for b in blocks {
            let v = sample_weight * b.count;
            (w, t, z, f) = (w + v, t + v * b.time_s, z + v * b.position_m, f + v * b.force_n);
        }
        let unit = 1.0 / at_least(1e-300, w);
        let mut out = Self {
            weight: w,
            time_s: unit * t,
            position_m: unit * z,
            force_n: unit * f,
            tt: 0.0,
            zz: 0.0,
            tz: 0.0,
            tf: 0.0,
            zf: 0.0,
            ff: 0.0,
        };
        for b in blocks {
            let v = sample_weight * b.count;
            let (t, z, f) = (b.time_s - out.time_s, b.position_m - out.position_m, b.force_n - out.force_n);
            (out.tt, out.zz, out.tz) = (out.tt + v * t * t, out.zz + v * z * z, out.tz + v * t * z);
            (out.tf, out.zf, out.ff) = (out.tf + v * t * f, out.zf + v * z * f, out.ff + v * f * f);
        }
        out
    }

    pub(super) fn scaled(&self, by: f64) -> Self {
        Self {
            weight: by * self.weight,
            tt: by * self.tt,
            zz: by * self.zz,
            tz: by * self.tz,
            tf: by * self.tf,
            zf: by * self.zf,
            ff: by * self.ff,
            ..*self
        }
    }

    /// Without the blocks of an event.
    pub(super) fn before(&self, event: &Suffix) -> Self {
        let weight = self.weight - event.n;
        let unit = 1.0 / at_least(1e-300, weight);
        // Means of what remains, about those of all.
        let (t, z, f) = (-unit * event.t, -unit * event.z, -unit * event.f);
        Self {
            weight,
            time_s: self.time_s + t,
            position_m: self.position_m + z,
            force_n: self.force_n + f,
            tt: at_least(0.0, self.tt - event.tt - weight * t * t),
            zz: at_least(0.0, self.zz - event.zz - weight * z * z),
            tz: self.tz - event.tz - weight * t * z,
            tf: self.tf - event.tf - weight * t * f,
            zf: self.zf - event.zf - weight * z * f,
            ff: self.ff,
        }
    }

    /// With the force before a step moved to the level behind it.
    pub(super) fn without_step(&self, event: &Suffix, size_n: f64) -> Self {
        Self {
            force_n: self.force_n + size_n * (1.0 - event.n / at_least(1e-300, self.weight)),
            tf: self.tf - size_n * event.t,
            zf: self.zf - size_n * event.z,
            ..*self
        }
    }

    /// Squared slope regressor and its product with the force.
    pub(super) fn slope(&self, form: Form) -> (f64, f64) {
        match form {
            Form::Constant => (0.0, 0.0),
            Form::Drift => (self.tt, self.tf),
            Form::Line => (self.zz, self.zf),
        }
    }

    /// Residual sum of squares of the baseline in units of the noise variance.
    pub(super) fn residual(&self, form: Form) -> f64 {
        let (square, product) = self.slope(form);
        at_least(0.0, self.ff - if square > 0.0 { product * product / square } else { 0.0 })
    }
}

/// Weighted sums over the last blocks, about the means of all.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Suffix {
    pub(super) n: f64,
    pub(super) t: f64,
    pub(super) z: f64,
    pub(super) f: f64,
    pub(super) tt: f64,
    pub(super) tz: f64,
    pub(super) zz: f64,
    pub(super) tf: f64,
    pub(super) zf: f64,
}

impl Suffix {
    pub(super) fn add(&mut self, block: &Block, sample_weight: f64, total: &Totals) {
        let w = sample_weight * block.count;
        let (t, z) = (block.time_s - total.time_s, block.position_m - total.position_m);
        let (f, wz) = (block.force_n - total.force_n, w * z);
        self.n += w;
        let wt = w * t;
        self.t += wt;
        self.z += wz;
        self.f += w * f;
        self.tt += wt * t;
        self.tf += wt * f;
        self.tz += wz * t;
        self.zz += wz * z;
        self.zf += wz * f;
    }

    /// Reduction of the sum of squares by a step at the first of these blocks, and its size.
    pub(super) fn step_gain(&self, form: Form, total: &Totals) -> Option<(f64, f64)> {
        let (square, product) = total.slope(form);
        let along = match form {
            Form::Constant => 0.0,
            Form::Drift => self.t,
            Form::Line => self.z,
        };
        remaining((self.n, self.f, self.n, along), total.weight, square, product)
    }

    /// As [`Suffix::step_gain`] for a bend at `onset`.
    pub(super) fn bend_gain(&self, form: Form, total: &Totals, onset: f64) -> Option<(f64, f64)> {
        let (square, product) = total.slope(form);
        let along = match form {
            Form::Constant => 0.0,
            Form::Drift => self.tz - onset * self.t,
            Form::Line => self.zz - onset * self.z,
        };
        let own = self.zz - onset * (2.0 * self.z - onset * self.n);
        remaining(
            (own, self.zf - onset * self.f, self.z - onset * self.n, along),
            total.weight,
            square,
            product,
        )
    }
}

/// Regression on a further regressor with the square `own`, the product `with` with the force, `mean` with one and `along` with
/// the slope regressor.
fn remaining(
    (own, with, mean, along): (f64, f64, f64, f64),
    weight: f64,
    square: f64,
    product: f64,
) -> Option<(f64, f64)> {
    let (mut s, mut y) = (own - mean * mean / weight, with);
    if square > 0.0 {
        s -= along * along / square;
        y -= along * product / square;
    }
    (s > MIN_REMAINING_SHARE * own).then(|| (y * y / s, y / s))
}
