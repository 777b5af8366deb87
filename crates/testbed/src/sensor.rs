//! The force/torque sensor: from the force at the needle's base to the number that is recorded.
//!
//! Order of the chain (SPEC section 6): the effects on gain, lag and delay; bias and drift,
//! interference, noise and spikes; saturation, quantisation.

use crate::insertion::InsertionSample;
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal, StandardUniform};
use stylet_scenario::{ForceTorque, MotionPoint};
use stylet_tissue::{AnyEffect, Effect, Measurement, MeasurementState, Reading};

/// Stream of the generator from which the force/torque sensor draws.
const NOISE_STREAM: u64 = 1;
/// Stream from which spikes are drawn.
const SPIKE_STREAM: u64 = 2;

/// Standard normal numbers drawn at once: the generator's state stays in registers, and a sample
/// then costs a look-up.
const BLOCK: usize = 64;

/// White or first-order autoregressive Gaussian noise with a given marginal standard deviation.
#[derive(Debug)]
pub struct Noise {
    generator: ChaCha8Rng,
    normals: [f64; BLOCK],
    used: usize,
    sd_n: f64,
    pole: f64,
    innovation: f64,
    last: f64,
    started: bool,
}

impl Noise {
    /// Noise of marginal standard deviation `sd_n` (N) and pole `pole` (-1 to 1, zero: white).
    /// The same seed and stream give the same sequence.
    #[must_use]
    pub fn new(seed: u64, stream: u64, sd_n: f64, pole: f64) -> Self {
        let mut generator = ChaCha8Rng::seed_from_u64(seed);
        generator.set_stream(stream);
        Self {
            generator,
            normals: [0.0; BLOCK],
            used: BLOCK,
            sd_n,
            pole,
            innovation: libm::sqrt(1.0 - pole * pole),
            last: 0.0,
            started: false,
        }
    }

    /// The next value in N.
    #[inline]
    pub fn draw(&mut self) -> f64 {
        if self.used >= BLOCK {
            self.refill();
        }
        let w = self.normals[self.used];
        self.used += 1;
        // The first value is drawn from the stationary distribution.
        let unit = if self.started { self.pole * self.last + self.innovation * w } else { w };
        self.started = true;
        self.last = unit;
        self.sd_n * unit
    }

    #[inline(never)]
    fn refill(&mut self) {
        for normal in &mut self.normals {
            *normal = StandardNormal.sample(&mut self.generator);
        }
        self.used = 0;
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
        let reading = force_n + c.bias_n + c.drift_n_per_s * time_s + self.noise.draw();
        self.ends(reading)
    }

    /// What the sensor adds at `time_s`, in N: bias, drift, noise.
    #[inline]
    fn added(&mut self, time_s: f64) -> f64 {
        self.config.bias_n + self.config.drift_n_per_s * time_s + self.noise.draw()
    }

    /// Where the sensor's readings end, and its steps.
    #[inline]
    fn ends(&self, mut reading: f64) -> f64 {
        let c = &self.config;
        if let Some(limit) = c.range_n {
            reading = reading.clamp(-limit, limit);
        }
        if c.quantisation_n > 0.0 {
            reading = libm::rint(reading / c.quantisation_n) * c.quantisation_n;
        }
        reading
    }
}

/// The measuring end of an insertion: what arm and tool add, then the sensor with the effects that
/// act in it, then the recorded position (SPEC section 6).
#[derive(Debug)]
pub struct Measuring {
    chain: Measurement,
    state: MeasurementState,
    spikes: Option<Spikes>,
    /// Nothing but the sensor itself.
    plain: bool,
    sensor: ForceSensor,
}

impl Measuring {
    /// Effects outside the tissue around a force/torque sensor that is read at `sample_hz`.
    #[must_use]
    pub fn new(effects: &[AnyEffect], sensor: &ForceTorque, sample_hz: f64, seed: u64) -> Self {
        let chain = Measurement::new(effects);
        let spikes = Spikes::new(effects, sample_hz, seed);
        Self {
            state: chain.start(sample_hz),
            plain: chain.is_plain() && spikes.is_none(),
            chain,
            spikes,
            sensor: ForceSensor::new(sensor, seed),
        }
    }

    /// The reading for one sample, in N.
    #[inline]
    pub fn measure(&mut self, sample: &InsertionSample) -> f64 {
        let InsertionSample { time_s, position_m, velocity_mps, acceleration_mps2, .. } = *sample;
        let at = MotionPoint { position_m, velocity_mps, acceleration_mps2 };
        self.measure_force(time_s, &at, sample.force.total_n)
    }

    /// The reading, in N, of the tissue's force `tissue_n` (N) at `time_s` with the needle at `at`.
    #[inline]
    pub fn measure_force(&mut self, time_s: f64, at: &MotionPoint, tissue_n: f64) -> f64 {
        if self.plain {
            return self.sensor.measure(time_s, tissue_n);
        }
        self.measure_through_effects(time_s, at, tissue_n)
    }

    fn measure_through_effects(&mut self, time_s: f64, at: &MotionPoint, tissue_n: f64) -> f64 {
        let spike_n = self.spikes.as_mut().map_or(0.0, Spikes::draw);
        let reading = Reading {
            time_s,
            velocity_mps: at.velocity_mps,
            acceleration_mps2: at.acceleration_mps2,
            tissue_n,
            noise_n: self.sensor.added(time_s) + spike_n,
        };
        let force_n = self.chain.step(&mut self.state, &reading);
        self.sensor.ends(force_n)
    }

    /// The recorded position (m) or velocity (m/s) for a true one.
    #[must_use]
    #[inline]
    pub fn position(&self, true_m: f64) -> f64 {
        self.chain.position(true_m)
    }
}

/// Isolated outlying samples.
#[derive(Debug)]
struct Spikes {
    generator: ChaCha8Rng,
    per_sample: f64,
    size_n: f64,
}

impl Spikes {
    fn new(effects: &[AnyEffect], sample_hz: f64, seed: u64) -> Option<Self> {
        let spikes = effects.iter().find_map(|e| match e {
            AnyEffect::ForceSpikes(spikes) if !e.is_neutral() => Some(spikes),
            _ => None,
        })?;
        let mut generator = ChaCha8Rng::seed_from_u64(seed);
        generator.set_stream(SPIKE_STREAM);
        Some(Self { generator, per_sample: spikes.rate_hz / sample_hz, size_n: spikes.size_n })
    }

    /// Zero, or a spike in N.
    fn draw(&mut self) -> f64 {
        let u: f64 = StandardUniform.sample(&mut self.generator);
        if u < self.per_sample { self.size_n } else { 0.0 }
    }
}
