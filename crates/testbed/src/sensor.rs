//! The force/torque sensor: from the force at the needle's base to the number that is recorded.
//!
//! Order of the chain (SPEC section 6): bias and drift, noise, saturation, quantisation.

use crate::insertion::InsertionSample;
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use stylet_scenario::ForceTorque;
use stylet_tissue::{AnyEffect, Effect, Place};

/// Stream of the generator from which the force/torque sensor draws.
const NOISE_STREAM: u64 = 1;

/// White or first-order autoregressive Gaussian noise with a given marginal standard deviation.
#[derive(Debug)]
pub struct Noise {
    generator: ChaCha8Rng,
    sd_n: f64,
    pole: f64,
    innovation: f64,
    value: Option<f64>,
}

impl Noise {
    /// Noise of marginal standard deviation `sd_n` (N) and pole `pole` (-1 to 1, zero: white).
    /// The same seed and stream give the same sequence.
    #[must_use]
    pub fn new(seed: u64, stream: u64, sd_n: f64, pole: f64) -> Self {
        let mut generator = ChaCha8Rng::seed_from_u64(seed);
        generator.set_stream(stream);
        Self { generator, sd_n, pole, innovation: libm::sqrt(1.0 - pole * pole), value: None }
    }

    /// The next value in N.
    #[inline]
    pub fn draw(&mut self) -> f64 {
        let w: f64 = StandardNormal.sample(&mut self.generator);
        let unit = match self.value {
            // The first value is drawn from the stationary distribution.
            None => w,
            Some(last) => self.pole * last + self.innovation * w,
        };
        self.value = Some(unit);
        self.sd_n * unit
    }
}

/// A force/torque sensor at work.
#[derive(Debug)]
pub struct ForceSensor {
    config: ForceTorque,
    noise: Noise,
}

impl ForceSensor {
    /// A sensor that draws its noise from `seed`.
    #[must_use]
    pub fn new(config: &ForceTorque, seed: u64) -> Self {
        Self { noise: Noise::new(seed, NOISE_STREAM, config.noise_n, config.ar1), config: config.clone() }
    }

    /// What the sensor reports at `time_s` for a force of `force_n`, in N.
    #[inline]
    pub fn measure(&mut self, time_s: f64, force_n: f64) -> f64 {
        let c = &self.config;
        let mut reading = force_n + c.bias_n + c.drift_n_per_s * time_s + self.noise.draw();
        if let Some(limit) = c.range_n {
            reading = reading.clamp(-limit, limit);
        }
        if c.quantisation_n > 0.0 {
            reading = libm::rint(reading / c.quantisation_n) * c.quantisation_n;
        }
        reading
    }
}

/// The measuring end of an insertion: what arm and tool add, then the sensor.
#[derive(Debug)]
pub struct Measuring {
    tool: Vec<AnyEffect>,
    sensor: ForceSensor,
}

impl Measuring {
    /// Tool effects of a scenario in front of a force/torque sensor.
    #[must_use]
    pub fn new(effects: &[AnyEffect], sensor: &ForceTorque, seed: u64) -> Self {
        let tool = effects.iter().filter(|e| e.place() == Place::Tool && !e.is_neutral()).cloned().collect();
        Self { tool, sensor: ForceSensor::new(sensor, seed) }
    }

    /// The reading for one sample, in N.
    #[inline]
    pub fn measure(&mut self, sample: &InsertionSample) -> f64 {
        let tool: f64 =
            self.tool.iter().map(|e| e.tool_force(sample.velocity_mps, sample.acceleration_mps2)).sum();
        self.sensor.measure(sample.time_s, sample.force.total_n + tool)
    }
}
