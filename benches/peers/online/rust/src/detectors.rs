//! The two detectors of the crate changepoint on the residual of the force.

use changepoint::rv::prelude::*;
use changepoint::rv::process::gaussian::kernel::{
    AddKernel, ConstantKernel, ProductKernel, RBFKernel, WhiteKernel,
};
use changepoint::{Argpcp, BocpdLike, BocpdTruncated};

use crate::residual::{Peak, Residual};
use crate::Options;

type Kernel = AddKernel<ProductKernel<ConstantKernel, RBFKernel>, WhiteKernel>;

/// The crate's detectors begin again after so many samples without a change, since the work per sample grows with the run.
const LONGEST: usize = 300;
const LONGEST_PROCESS: usize = 100;

enum Detector {
    Bocpd(BocpdTruncated<f64, Gaussian, NormalGamma>),
    Process(Argpcp<Kernel>),
}

impl Detector {
    fn new(options: &Options, rate: f64) -> Self {
        if options.gaussian_process {
            let kernel = ConstantKernel::new_unchecked(0.5) * RBFKernel::new_unchecked(10.0)
                + WhiteKernel::new_unchecked(1.0);
            return Self::Process(Argpcp::new(kernel, 3, 2.0, 1.0, -5.0, 1.0, 1.0));
        }
        // The crate leaves out the last thousandth of the run lengths' probability: a rarer change would never be seen.
        let run = (options.run * rate).clamp(20.0, 500.0);
        // The residual has unit variance and zero mean; after a fall its mean may be anything of some standard deviations.
        let prior = NormalGamma::new_unchecked(0.0, 0.05, 5.0, 5.0);
        Self::Bocpd(BocpdTruncated::new(run, prior).with_cutoff(1e-12))
    }

    /// Probabilities of the run lengths, the shortest first.
    fn step(&mut self, residual: f64) -> &[f64] {
        match self {
            Self::Bocpd(detector) => detector.step(&residual),
            Self::Process(detector) => detector.step(&residual),
        }
    }
}

/// One stream of samples.
pub struct Stream {
    options: Options,
    rate: f64,
    time: f64,
    position: f64,
    speed: f64,
    usual: f64,
    block: usize,
    sum: f64,
    count: usize,
    residual: Residual,
    peak: Peak,
    detector: Detector,
    /// The residuals within the window, the newest last.
    recent: Vec<f64>,
    window: usize,
    run: usize,
}

impl Stream {
    pub fn new(rate: f64, options: Options) -> Self {
        let block = (rate / 1000.0).max(1.0) as usize;
        let slow = rate / block as f64;
        Self {
            options,
            rate,
            time: f64::INFINITY,
            position: 0.0,
            speed: 0.0,
            usual: 0.0,
            block,
            sum: 0.0,
            count: 0,
            residual: Residual::new(slow, options.trend),
            peak: Peak::new(slow, options.threshold),
            detector: Detector::new(&options, slow),
            recent: Vec::new(),
            window: ((options.window * slow).round() as usize).max(if options.gaussian_process {
                5
            } else {
                2
            }),
            run: 0,
        }
    }

    /// (Drop in N, confidence) of an event reported now.
    pub fn sample(&mut self, time: f64, position: f64, force: f64) -> Option<(f64, f64)> {
        let elapsed = time - self.time;
        if elapsed > (5.0 / self.rate).max(0.02) {
            let (speed, usual, position) = (self.speed, self.usual, self.position);
            *self = Self { speed, usual, position, ..Self::new(self.rate, self.options) };
        }
        if elapsed > 0.0 {
            self.speed += self.gain(0.01) * ((position - self.position) / elapsed - self.speed);
            self.usual += self.gain(0.3) * (self.speed - self.usual);
        }
        (self.time, self.position) = (time, position);
        self.sum += force;
        self.count += 1;
        if self.count < self.block {
            return None;
        }
        let force = self.sum / self.count as f64;
        (self.sum, self.count) = (0.0, 0);
        let residual = self.residual.next(force);
        let statistic = self.update(residual.clamp(-10.0, 10.0));
        let confidence = self.peak.next(statistic)?;
        let drop = -self.residual.deviation;
        self.residual.restart(force);
        self.renew();
        // What is seen in holds and retractions, or while the friction goes because the needle stops, is no puncture.
        (self.speed > (self.usual / 4.0).max(1e-4)).then_some((drop, confidence))
    }

    fn gain(&self, time_constant: f64) -> f64 {
        1.0 - (-1.0 / (time_constant * self.rate)).exp()
    }

    fn renew(&mut self) {
        self.detector = Detector::new(&self.options, self.rate / self.block as f64);
        self.recent.clear();
        self.run = 0;
    }

    /// Log-odds of a change within the window, if the residuals in it are below zero on average.
    fn update(&mut self, residual: f64) -> f64 {
        let longest = if self.options.gaussian_process { LONGEST_PROCESS } else { LONGEST };
        if self.run > longest {
            self.renew();
        }
        self.run += 1;
        self.recent.push(residual);
        if self.recent.len() > self.window {
            self.recent.remove(0);
        }
        let runs = self.detector.step(residual);
        // Until a run is longer than the window, every run is short.
        if self.run <= 2 * self.window || runs.len() <= self.window {
            return f64::NEG_INFINITY;
        }
        let (short, long) = runs.split_at(self.window);
        let (short, long): (f64, f64) = (short.iter().sum(), long.iter().sum());
        let mean = self.recent.iter().sum::<f64>() / self.recent.len() as f64;
        if mean < 0.0 {
            (short.max(1e-12) / long.max(1e-12)).ln()
        } else {
            f64::NEG_INFINITY
        }
    }
}
