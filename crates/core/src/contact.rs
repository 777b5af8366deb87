//! First contact found from the data \[D\]: bias and noise are learnt in air, contact is declared
//! when the low-passed force stands out of the noise for several samples, and its position is
//! traced back along the loading line to zero force.

use crate::config::ContactConfig;
use crate::filter::Coefficients;
use crate::line::Line;
use crate::sample::Sample;

/// Time over which bias and noise in air are forgotten, in s.
const FORGET_S: f64 = 5.0;

/// What the search knows.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ContactSearch {
    /// Of the low-pass on the force, and of what is forgotten of bias and noise.
    coefficients: Coefficients<2>,
    elapsed_s: f64,
    force_n: f64,
    // Welford's running mean and variance of the force in air.
    count: f64,
    mean_n: f64,
    m2: f64,
    above: usize,
    line: Line,
    first: u64,
    declared_m: Option<f64>,
}

/// What the search says after a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Found {
    /// Still in air.
    Nothing,
    /// Contact declared; the position is the present best guess.
    Provisional { surface_m: f64, first: u64 },
    /// Contact settled.
    Settled { surface_m: f64, first: u64 },
}

impl ContactSearch {
    pub(crate) fn new(config: &ContactConfig) -> Self {
        Self {
            coefficients: Coefficients::new([config.time_constant_s, FORGET_S]),
            elapsed_s: 0.0,
            force_n: 0.0,
            count: 0.0,
            mean_n: 0.0,
            m2: 0.0,
            above: 0,
            line: Line::default(),
            first: 0,
            declared_m: None,
        }
    }

    fn noise_n(&self, config: &ContactConfig) -> f64 {
        if self.count < 2.0 {
            return f64::INFINITY;
        }
        libm::sqrt(self.m2 / (self.count - 1.0)).max(config.smallest_noise_n)
    }

    /// Takes sample number `number`.
    pub(crate) fn update(&mut self, config: &ContactConfig, dt_s: f64, sample: Sample, number: u64) -> Found {
        self.elapsed_s += dt_s;
        let [low_pass, forget] = *self.coefficients.at(dt_s);
        if self.count == 0.0 && self.declared_m.is_none() {
            self.force_n = sample.force_n;
        }
        self.force_n += low_pass * (sample.force_n - self.force_n);
        let noise = self.noise_n(config);
        let lift = self.force_n - self.mean_n;
        let learning = self.elapsed_s < config.learn_s || self.count < 10.0;
        if let Some(declared_m) = self.declared_m {
            self.line.add(sample.position_m, sample.force_n);
            let surface_m = self.surface_m(config, declared_m);
            let first = self.first;
            return if (sample.position_m - declared_m).abs() >= config.extrapolate_over_m {
                Found::Settled { surface_m, first }
            } else {
                Found::Provisional { surface_m, first }
            };
        }
        // The loading line begins where the force starts to stand out.
        if !learning && lift > 2.0 * noise {
            if self.line.count == 0.0 {
                self.first = number;
            }
            self.line.add(sample.position_m, sample.force_n);
        } else {
            self.line = Line::default();
            self.learn(forget, learning, sample.force_n);
        }
        self.above = if !learning && lift > config.noise_sds * noise { self.above + 1 } else { 0 };
        if self.above < config.samples.max(1) {
            return Found::Nothing;
        }
        self.declared_m = Some(sample.position_m);
        Found::Provisional { surface_m: self.surface_m(config, sample.position_m), first: self.first }
    }

    /// Bias and noise: by Welford's recursion at first, then slowly forgetting, so that a drift in air
    /// is followed and a loading line is not.
    fn learn(&mut self, share: f64, learning: bool, force_n: f64) {
        if learning {
            self.count += 1.0;
            let delta = force_n - self.mean_n;
            self.mean_n += delta / self.count;
            self.m2 += delta * (force_n - self.mean_n);
            return;
        }
        let delta = force_n - self.mean_n;
        self.mean_n += share * delta;
        self.m2 += share * ((self.count - 1.0) * delta * delta - self.m2);
    }

    /// Zero-force end of the loading line (where contact was declared, when nothing is extrapolated), never beyond the declaration and at most 5 mm before.
    fn surface_m(&self, config: &ContactConfig, declared_m: f64) -> f64 {
        if config.extrapolate_over_m <= 0.0 {
            return declared_m;
        }
        match self.line.reaches(self.mean_n) {
            Some(at) if self.line.slope() > 0.0 => at.clamp(declared_m - 0.005, declared_m),
            _ => declared_m,
        }
    }
}
