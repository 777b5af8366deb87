//! Layer parameters as one Gaussian state, updated with every sample since contact: the layer being traversed, the layer
//! before it, and the cumulative friction of all layers passed.
//!
//! Unknowns `[D, K, b, K', b', f0, d, g]`. In a layer that starts at depth `s`, with `x = z - s` and the friction drive `u`,
//!
//! ```text
//! f = f0 + D u + K x + b x u          D: friction of the passed layers
//! f = f0 + p + q u + K x + b x u      first layer: p, q = K, b times the depth at which contact was detected
//! ```
//!
//! With a moving baseline, `d t + g z` (since contact) is added: the error of the drift and line already subtracted.
//!
//! (`p` and `q` take the places of `D` and `K'`.) `f0` is the sensor bias, with a prior from the samples in air. At a
//! rupture after a travel `d` the friction becomes `D + b d` (`q + b d` in the first layer) and the ruptured layer's `K, b`
//! become `K', b'`: a linear map of the state. Samples after the rupture therefore still inform the split of the ruptured
//! layer into stiffness and friction, and samples before it inform `D`: the joint least-squares solution without a buffer.

use super::baseline_fit::BaselineFit;
use super::force_predictor::MEMORY_M;
use super::gaussian::{Gaussian, Innovation, MAX_VARIANCE_RATIO};
use super::noise_estimator::NoiseEstimator;
use crate::bounds::{at_least, at_most};
use crate::sample::MAX_LAYERS;

pub(crate) const D: usize = 0;
pub(crate) const K: usize = 1;
pub(crate) const B: usize = 2;
pub(crate) const K_PREV: usize = 3;
pub(crate) const B_PREV: usize = 4;
pub(super) const BIAS: usize = 5;
pub(super) const DRIFT: usize = 6;
pub(super) const LINE: usize = 7;
const N: usize = 8;
/// Standard deviations (99.9 %) from the onset of the load beyond which a loading line does not begin there.
const ONSET_SDS: f64 = 3.29;
/// Unknowns in use where the baseline is constant.
const WITHOUT_BASELINE: usize = 6;
/// Innovation of the estimator.
pub(super) type LayerInnovation = Innovation<N>;

#[derive(Clone, Copy, Debug)]
pub(crate) struct LayerEstimator {
    pub(crate) state: Gaussian<N>,
    /// Start of the active layer in m.
    pub(crate) start_m: f64,
    /// Ruptures so far.
    pub(crate) passed_count: usize,
    pub(crate) previous_thickness_m: f64,
    /// The tip is in a gap or beyond the last layer: a force that grows with travel is friction.
    pub(super) tip_free: bool,
    /// Log densities of the two free-tip hypotheses when the active layer began, see [`super::free_tip`].
    pub(super) initial_log_densities: [f64; 2],
    /// The data confirm that a layer has begun.
    pub(super) layer_confirmed: bool,
    /// Place of the last rupture in m and its standard deviation.
    pub(super) rupture_m: f64,
    pub(super) rupture_sd_m: f64,
    /// Travel of the gap behind the previous layer, over which its friction kept growing, and its standard deviation.
    pub(super) gap_m: f64,
    pub(super) gap_sd_m: f64,
    /// Standard deviation of the start of the active layer and of the previous one, in m.
    pub(super) start_sd_m: f64,
    pub(super) previous_start_sd_m: f64,
    /// Prior scale of the active layer's slope in N/m.
    slope_scale: f64,
    contact_drive: f64,
    /// Position of the contact in m and its standard deviation as estimated from the force in air.
    onset_m: Option<(f64, f64)>,
    /// Depth, drive, force and time since contact of the previous sample.
    last: Option<[f64; 4]>,
    /// The baseline moves: drift and line are unknowns.
    moving_baseline: bool,
    /// Variance in N² that steps of the zero have added to the bias.
    pub(super) zero_step_variance: f64,
    /// Position of the contact in m, and time since then in s.
    contact_m: f64,
    pub(super) elapsed_s: f64,
}

/// Start, end and friction per metre of each passed layer, as estimated at the rupture after it.
pub(crate) type PassedLayers = [[f64; 3]; MAX_LAYERS];

impl LayerEstimator {
    /// Initial state at a contact at `start_m`, where a force `force_n` with standard deviation `sd_n` acts; `slope` in N/m is the
    /// scale of the priors of stiffness and friction.
    pub(crate) fn at_contact(
        start_m: f64,
        force_n: f64,
        sd_n: f64,
        slope: f64,
        drive: f64,
        noise: &NoiseEstimator,
    ) -> Self {
        let unit = 1.0 / noise.variance;
        let sd_n = sd_n.min(libm::sqrt(MAX_VARIANCE_RATIO / unit));
        let slope = slope.min(max_slope(unit));
        let friction = slope / drive;
        let half = 0.5 * force_n;
        let variance = [
            sd_n * sd_n * unit,
            slope * slope * unit,
            friction * friction * unit,
            sd_n * sd_n / (drive * drive) * unit,
            1.0,
            noise.bias_variance() * unit,
            0.0,
            0.0,
        ];
        let mean = [half, 0.5 * slope, 0.5 * friction, half / drive, 0.0, noise.bias_n(), 0.0, 0.0];
        Self {
            state: Gaussian::new(mean, variance),
            start_m,
            passed_count: 0,
            previous_thickness_m: 0.0,
            tip_free: false,
            initial_log_densities: [0.0; 2],
            layer_confirmed: false,
            rupture_m: start_m,
            rupture_sd_m: 0.0,
            gap_m: 0.0,
            gap_sd_m: 0.0,
            start_sd_m: 0.0,
            previous_start_sd_m: 0.0,
            slope_scale: slope,
            contact_drive: drive,
            onset_m: None,
            last: None,
            moving_baseline: false,
            zero_step_variance: 0.0,
            contact_m: start_m,
            elapsed_s: 0.0,
        }
    }

    /// Makes drift and line unknowns, with the covariance of `fit`; their fitted values are subtracted from the force from here on.
    pub(super) fn set_baseline(&mut self, fit: &BaselineFit, noise: &NoiseEstimator) {
        let unit = 1.0 / noise.variance;
        let g = &mut self.state;
        for (i, row) in [BIAS, DRIFT, LINE].into_iter().zip(fit.p) {
            g.reset_component(i, if i == BIAS { noise.bias_n() } else { 0.0 }, row[i - BIAS] * unit);
        }
        for (i, row) in [BIAS, DRIFT, LINE].into_iter().zip(fit.p) {
            for j in BIAS..i {
                g.p[i][j] = row[j - BIAS] * unit;
            }
        }
        self.moving_baseline = true;
    }

    /// Adds a variance in N² to the sensor bias.
    pub(super) fn widen_bias(&mut self, variance: f64, noise: &NoiseEstimator) {
        self.state.p[BIAS][BIAS] += variance / noise.variance;
    }

    /// Error of the subtracted drift and line at a position, in N, and its variance in N²; `None` with a constant baseline.
    #[inline(always)]
    pub(super) fn baseline_residual_n(&self, position_m: f64, noise: &NoiseEstimator) -> Option<(f64, f64)> {
        if !self.moving_baseline {
            return None;
        }
        let (g, t, z) = (&self.state, self.elapsed_s, position_m - self.contact_m);
        let variance = t * t * g.p[DRIFT][DRIFT] + z * (z * g.p[LINE][LINE] + 2.0 * t * g.p[LINE][DRIFT]);
        Some((t * g.x[DRIFT] + z * g.x[LINE], at_least(0.0, variance) * noise.variance))
    }

    fn transform(&mut self, map: &[[f64; N]; N]) {
        self.state = if self.moving_baseline {
            self.state.leading_transformed::<N>(map)
        } else {
            self.state.leading_transformed::<WITHOUT_BASELINE>(map)
        };
    }

    /// Multiplications and additions of a rupture or bend beyond those with a constant baseline.
    pub(super) fn extra_operations(&self) -> u32 {
        if self.moving_baseline { 2 * (512 - 216) + 2 * (288 - 126) } else { 0 }
    }

    /// Corrections of the subtracted drift (N/s) and line (N/m), and their standard deviations; zero with a constant baseline.
    pub(super) fn baseline_residual(&self, noise: &NoiseEstimator) -> ([f64; 2], [f64; 2]) {
        if !self.moving_baseline {
            return Default::default();
        }
        let g = &self.state;
        let sd = |i: usize| libm::sqrt(at_least(0.0, g.p[i][i]) * noise.variance);
        ([g.x[DRIFT], g.x[LINE]], [sd(DRIFT), sd(LINE)])
    }

    /// The tip may be in a gap or still in air.
    #[inline(always)]
    pub(super) fn may_be_free(&self) -> bool {
        !self.layer_confirmed
    }

    #[inline(always)]
    fn regressor(&self, x: f64, drive: f64, elapsed_s: f64) -> [f64; N] {
        let (a, q) = if self.passed_count > 0 { (drive, 0.0) } else { (1.0, drive) };
        [a, x, x * drive, q, 0.0, 1.0, elapsed_s, x + (self.start_m - self.contact_m)]
    }

    /// Total friction per unit of drive, including the active layer.
    pub(crate) fn friction(&self, position_m: f64) -> f64 {
        let passed = self.state.x[if self.passed_count > 0 { D } else { K_PREV }];
        passed + self.state.x[B] * (position_m - self.start_m)
    }

    /// Force in N that the base law predicts.
    #[inline(always)]
    pub(crate) fn predict(&self, position_m: f64, drive: f64) -> f64 {
        let w = self.regressor(position_m - self.start_m, drive, self.elapsed_s);
        w.iter().zip(&self.state.x).map(|(w, x)| w * x).sum()
    }

    /// Measurement update; returns the innovation in N and its variance in units of the noise variance.
    #[inline(always)]
    pub(crate) fn update(&mut self, position_m: f64, drive: f64, force_n: f64, rho: f64) -> (f64, f64) {
        let innovation = self.innovation(position_m, drive, force_n, rho);
        self.apply(&innovation, position_m, drive, force_n)
    }

    /// Innovation of a sample, whitened with the previous one.
    #[inline(always)]
    pub(crate) fn innovation(&self, position_m: f64, drive: f64, force_n: f64, rho: f64) -> LayerInnovation {
        const R: usize = WITHOUT_BASELINE;
        let x = position_m - self.start_m;
        let (mut w, mut y, mut r) = (self.regressor(x, drive, self.elapsed_s), force_n, 1.0);
        if rho != 0.0 {
            if let Some([x, drive, force_n, elapsed_s]) = self.last {
                for (w, before) in w.iter_mut().zip(self.regressor(x, drive, elapsed_s)) {
                    *w -= rho * before;
                }
                y -= rho * force_n;
            } else {
                r = 1.0 / (1.0 - rho * rho);
            }
        }
        if self.moving_baseline {
            let columns = [D, K, B, K_PREV, BIAS, DRIFT, LINE];
            return self.state.innovation(columns, columns.map(|i| w[i]), y, r);
        }
        if self.passed_count > 0 {
            self.state.leading_innovation::<R, 4>([D, K, B, BIAS], [w[D], w[K], w[B], w[BIAS]], y, r)
        } else {
            let columns = [D, K, B, K_PREV, BIAS];
            self.state.leading_innovation::<R, 5>(columns, columns.map(|i| w[i]), y, r)
        }
    }

    /// Measurement update with the innovation of [`LayerEstimator::innovation`].
    #[inline(always)]
    pub(crate) fn apply(
        &mut self,
        innovation: &LayerInnovation,
        position_m: f64,
        drive: f64,
        force_n: f64,
    ) -> (f64, f64) {
        if self.moving_baseline {
            self.state.update(innovation);
        } else {
            self.state.leading_update::<WITHOUT_BASELINE>(innovation);
        }
        self.last = Some([position_m - self.start_m, drive, force_n, self.elapsed_s]);
        (innovation.e, innovation.s)
    }

    pub(crate) fn skip_sample(&mut self) {
        self.last = None;
    }

    /// Slope of the force with travel in N/m.
    pub(crate) fn slope(&self, drive: f64) -> f64 {
        self.state.x[K] + self.state.x[B] * drive
    }

    /// Penalty in nats for negative stiffness or friction of the active and the previous layer: about minus the log probability that
    /// they are positive.
    pub(super) fn negative_nats(&self, noise: &NoiseEstimator) -> f64 {
        let g = &self.state;
        let one = |i: usize| {
            let x = at_most(0.0, g.x[i]);
            0.5 * x * x / at_least(1e-300, g.p[i][i] * noise.variance)
        };
        let before = if self.passed_count > 0 { one(K_PREV) + one(B_PREV) } else { 0.0 };
        one(K) + one(B) + before
    }

    /// Slope and its standard deviation.
    pub(super) fn slope_and_sd(&self, drive: f64, noise: &NoiseEstimator) -> (f64, f64) {
        let g = &self.state;
        let variance = g.p[K][K] + drive * (2.0 * g.cov(B, K) + drive * g.p[B][B]);
        (self.slope(drive), libm::sqrt(at_least(0.0, variance) * noise.variance))
    }

    /// Transforms the state at a rupture at `position_m` with standard deviation `sd_m`.
    pub(crate) fn rupture(
        &mut self,
        position_m: f64,
        sd_m: f64,
        drive: f64,
        noise: &NoiseEstimator,
        passed_layers: &mut PassedLayers,
    ) {
        let unit = 1.0 / noise.variance;
        let mut d = (position_m - self.start_m).max(1e-6);
        let first = self.passed_count == 0;
        let mut depth_at_contact = 0.0;
        if first {
            // Depth at which contact was detected: initial force over slope. It implies p = K depth.
            let [p, k, b, q, ..] = self.state.x;
            let (force, slope) = (p + q * self.contact_drive, k + b * self.contact_drive);
            if force > 0.0 && slope > 0.0 {
                depth_at_contact = self.depth_at_contact(force / slope).min(d);
                let g = &self.state.p;
                let u0 = self.contact_drive;
                let variance = (g[D][D] + 2.0 * u0 * g[K_PREV][D] + u0 * u0 * g[K_PREV][K_PREV]).max(1e-6);
                let constraint = self.state.innovation([D, K], [1.0, -depth_at_contact], 0.0, variance);
                self.state.update(&constraint);
            }
        }
        let slope = if self.tip_free { self.slope_scale } else { self.slope(drive).abs().max(1.0) };
        if self.tip_free {
            self.reopen_split(drive, unit);
        }
        let slope = slope.min(max_slope(unit));
        let ruptured_friction = self.state.x[B_PREV].max(0.0);
        let b = at_least(-slope / drive, at_most(slope / drive, self.state.x[B]));
        let stiffness = self.stiffness_rms(slope, unit);
        let mut map = [[0.0; N]; N];
        map[D][if first { K_PREV } else { D }] = 1.0;
        map[D][B] = d;
        map[K_PREV][K] = 1.0;
        map[B_PREV][B] = 1.0;
        for i in [BIAS, DRIFT, LINE] {
            map[i][i] = 1.0;
        }
        self.transform(&map);
        if self.start_sd_m > 0.0 {
            // The bias estimate has absorbed the error in the ruptured layer's start.
            let variance = noise.bias_variance() + self.zero_step_variance;
            self.state.reset_component(BIAS, noise.bias_n(), variance * unit);
        }
        self.start_layer(slope, sd_m, (stiffness, b), drive, unit);
        (self.previous_start_sd_m, self.start_sd_m, self.gap_m) = (self.start_sd_m, 0.0, 0.0);
        self.gap_sd_m = 0.0;
        d += depth_at_contact;
        // Later samples do not inform the layer before the ruptured one: store its friction.
        if let Some(before) = self.passed_count.checked_sub(1).and_then(|i| passed_layers.get_mut(i)) {
            before[2] = ruptured_friction;
        }
        if let Some(slot) = passed_layers.get_mut(self.passed_count) {
            *slot = [position_m - d, position_m, 0.0];
        }
        self.start_m = position_m;
        (self.rupture_m, self.rupture_sd_m) = (position_m, sd_m);
        self.previous_thickness_m = d;
        self.passed_count += 1;
        self.last = None;
        self.initial_log_densities =
            [self.log_density_of_free(true, noise), self.log_density_of_free(false, noise)];
    }

    /// Sets the position of the contact that follows from the force in air, with its standard deviation.
    pub(super) fn set_onset(&mut self, onset_m: (f64, f64)) {
        self.onset_m = Some(onset_m);
    }

    /// Depth in m at which the contact was detected: where the loading line of the whole layer meets the baseline, which is accurate if the
    /// base law holds, or the onset of the load where that is incompatible. In tissue that relaxes the loading curve is not straight.
    fn depth_at_contact(&self, along_line_m: f64) -> f64 {
        match self.onset_m {
            Some((onset_m, sd_m)) if (self.start_m - along_line_m - onset_m).abs() > ONSET_SDS * sd_m => {
                at_least(0.0, self.start_m - onset_m)
            }
            _ => along_line_m,
        }
    }

    /// Reverts the free-tip assumption after a drop: moves half of the slope, with that sd, from friction to stiffness.
    pub(super) fn reopen_split(&mut self, drive: f64, unit: f64) {
        let widest = max_slope(unit);
        let half = at_least(-widest, at_most(widest, 0.5 * self.slope(drive)));
        let g = &mut self.state;
        (g.x[K], g.x[B]) = (g.x[K] + half, g.x[B] - half / drive);
        let variance = half * half * unit;
        g.p[K][K] += variance;
        g.p[B][B] += variance / (drive * drive);
        g.p[B][K] -= variance / drive;
        self.tip_free = false;
    }

    /// Root mean square of the active layer's stiffness in N/m, at most `max`.
    fn stiffness_rms(&self, max: f64, unit: f64) -> f64 {
        let g = &self.state;
        libm::sqrt(g.x[K] * g.x[K] + g.p[K][K] / unit).min(max)
    }

    /// Starts a layer of unknown stiffness and friction at a place with standard deviation `sd_m`, where friction per drive
    /// changes its growth by `friction` per metre.
    fn start_layer(
        &mut self,
        scale: f64,
        sd_m: f64,
        (stiffness, friction): (f64, f64),
        drive: f64,
        unit: f64,
    ) {
        let wide = (3.0 * scale).min(max_slope(unit));
        let g = &mut self.state;
        g.reset_component(K, 0.5 * scale, wide * wide * unit);
        g.reset_component(B, 0.5 * scale / drive, wide * wide / (drive * drive) * unit);
        // The uncertain place adds uncertain friction, and an uncertain elastic force that looks like a change of the bias.
        let place = sd_m * sd_m * unit;
        g.p[D][D] += friction * friction * place;
        g.p[BIAS][BIAS] += stiffness * stiffness * place;
        (self.tip_free, self.layer_confirmed, self.slope_scale) = (false, false, scale);
    }

    /// The force has bent at `position_m` while the tip was free: upwards where a layer begins, downwards where the previous
    /// layer ends and friction stops growing.
    pub(super) fn start_after_bend(
        &mut self,
        position_m: f64,
        sd_m: f64,
        up: bool,
        drive: f64,
        noise: &NoiseEstimator,
        passed_layers: &mut PassedLayers,
    ) {
        let unit = 1.0 / noise.variance;
        let travel = (position_m - self.start_m).max(0.0);
        let b = self.state.x[B];
        let mut map = [[0.0; N]; N];
        for (i, row) in map.iter_mut().enumerate() {
            row[i] = 1.0;
        }
        map[D][B] = travel;
        self.transform(&map);
        // The previous layer reaches to here if its friction kept growing.
        if let Some(slot) = self.passed_count.checked_sub(1).and_then(|i| passed_layers.get_mut(i))
            && b > 0.5 * self.state.x[B_PREV]
        {
            slot[1] = position_m;
            self.gap_m += travel;
            self.gap_sd_m = sd_m;
        }
        if up {
            self.start_sd_m = sd_m;
            self.start_layer(self.slope_scale, sd_m, (self.slope_scale, b), drive, unit);
        } else {
            let g = &mut self.state;
            g.reset_component(B, 0.0, b * b * unit);
            g.p[D][D] += b * b * sd_m * sd_m * unit;
        }
        self.start_m = position_m;
        self.last = None;
    }

    /// Log density of the state, up to a constant, at `K = 0` and `b = b'` (`follows`) or `b = 0`.
    pub(super) fn log_density_of_free(&self, follows: bool, noise: &NoiseEstimator) -> f64 {
        let g = &self.state;
        let (mut b, mut vb, mut cov) = (g.x[B], g.p[B][B], g.cov(B, K));
        if follows {
            b -= g.x[B_PREV];
            vb += g.p[B_PREV][B_PREV] - 2.0 * g.cov(B_PREV, B);
            cov -= g.cov(B_PREV, K);
        }
        let (k, vk) = (g.x[K], g.p[K][K]);
        let determinant = (vk * vb - cov * cov).max(1e-12 * vk * vb);
        let square = (k * k * vb - 2.0 * k * b * cov + b * b * vk) / determinant;
        -0.5 * (libm::log(determinant) + square / noise.variance)
    }
}

/// Largest prior slope in N/m, with the noise precision `unit` in N⁻².
fn max_slope(unit: f64) -> f64 {
    libm::sqrt(MAX_VARIANCE_RATIO / unit) / MEMORY_M
}

#[cfg(test)]
mod tests;
