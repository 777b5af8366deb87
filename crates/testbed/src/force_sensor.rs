//! The force/torque sensor: measurement chain of `stylet_tissue::MeasurementChain` with random noise and spikes.

use crate::slide_insertion::InsertionSample;
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use stylet_scenario::{ForceTorque, MotionPoint};
use stylet_tissue::{
    AnyEffect, Effect, ForceBias, ForceDrift, MeasurementChain, MeasurementState, Quantisation, Saturation,
    SensorInput,
};

/// Generator stream of the noise.
const NOISE_STREAM: u64 = 1;
/// First of the generator streams of spikes.
const SPIKES_STREAM: u64 = 1000;

/// Values drawn at once, for speed.
const BLOCK_SAMPLES: usize = 64;

/// White or first-order autoregressive Gaussian noise with a given marginal standard deviation.
#[derive(Debug)]
pub struct SensorNoise {
    generator: ChaCha8Rng,
    /// Values drawn ahead, in N.
    values_n: [f64; BLOCK_SAMPLES],
    used: usize,
    sd_n: f64,
    pole: f64,
    innovation: f64,
    last: f64,
    started: bool,
}

impl SensorNoise {
    /// Noise of marginal standard deviation `sd_n` (N) and pole `pole` (-1 to 1, zero: white).
    /// The same seed and stream give the same sequence.
    #[must_use]
    pub fn new(seed: u64, stream: u64, sd_n: f64, pole: f64) -> Self {
        let mut generator = ChaCha8Rng::seed_from_u64(seed);
        generator.set_stream(stream);
        Self {
            generator,
            values_n: [0.0; BLOCK_SAMPLES],
            used: BLOCK_SAMPLES,
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
        if self.used >= BLOCK_SAMPLES {
            self.refill();
        }
        let value_n = self.values_n[self.used];
        self.used += 1;
        value_n
    }

    #[inline(never)]
    fn refill(&mut self) {
        let mut values = self.values_n.iter_mut();
        let mut last = self.last;
        if !self.started {
            // The first value is drawn from the stationary distribution.
            self.started = true;
            last = StandardNormal.sample(&mut self.generator);
            if let Some(first) = values.next() {
                *first = self.sd_n * last;
            }
        }
        for value in values {
            let normal: f64 = StandardNormal.sample(&mut self.generator);
            last = self.pole * last + self.innovation * normal;
            *value = self.sd_n * last;
        }
        self.last = last;
        self.used = 0;
    }
}

/// Isolated outliers: at each sample a spike of either sign with the probability `rate_hz / sample_hz`.
#[derive(Debug)]
struct Spikes {
    generator: ChaCha8Rng,
    probability: f64,
    size_n: f64,
}

impl Spikes {
    fn draw(&mut self) -> f64 {
        let spike = self.generator.random::<f64>() < self.probability;
        let sign = if self.generator.random::<bool>() { 1.0 } else { -1.0 };
        if spike { sign * self.size_n } else { 0.0 }
    }
}

/// Tool and force/torque sensor (`docs/reference/model.md`, *Measurement chain*).
#[derive(Debug)]
pub struct ForceSensor {
    chain: MeasurementChain,
    state: MeasurementState,
    noise: SensorNoise,
    spikes: Vec<Spikes>,
    /// The chain consists of noise only.
    plain: bool,
}

impl ForceSensor {
    /// Tool, sensor and position effects of a scenario, with bias, drift, noise, range and quantisation of the sensor. Noise and spikes are drawn
    /// from `seed`, for samples at `sample_hz`.
    #[must_use]
    pub fn new(effects: &[AnyEffect], sensor: &ForceTorque, seed: u64, sample_hz: f64) -> Self {
        let mut chain: Vec<AnyEffect> = vec![
            ForceBias { force_n: sensor.bias_n }.into(),
            ForceDrift { rate_n_per_s: sensor.drift_n_per_s }.into(),
            Saturation { limit_n: sensor.range_n.unwrap_or(f64::INFINITY) }.into(),
            Quantisation { step_n: sensor.quantisation_n }.into(),
        ];
        chain.extend_from_slice(effects);
        let chain = MeasurementChain::new(&chain);
        let spikes = effects.iter().filter_map(|effect| match effect {
            AnyEffect::ForceSpikes(spikes) if !effect.is_inactive() => Some(spikes),
            _ => None,
        });
        let spikes: Vec<Spikes> = spikes
            .zip(SPIKES_STREAM..)
            .map(|(spikes, stream)| {
                let mut generator = ChaCha8Rng::seed_from_u64(seed);
                generator.set_stream(stream);
                Spikes { generator, probability: spikes.rate_hz / sample_hz, size_n: spikes.size_n }
            })
            .collect();
        Self {
            state: chain.start(sample_hz),
            plain: chain.is_plain() && spikes.is_empty(),
            chain,
            noise: SensorNoise::new(seed, NOISE_STREAM, sensor.noise_n, sensor.ar1),
            spikes,
        }
    }

    /// The recorded force (N) of one sample.
    #[inline]
    pub fn measure(&mut self, sample: &InsertionSample) -> f64 {
        let InsertionSample { time_s, position_m, velocity_mps, acceleration_mps2, .. } = *sample;
        let at = MotionPoint { position_m, velocity_mps, acceleration_mps2 };
        self.measure_force(time_s, &at, sample.force.total_n)
    }

    /// The recorded force (N) for the tissue force `tissue_n` (N) at `time_s`, with the needle at `at`.
    #[inline]
    pub fn measure_force(&mut self, time_s: f64, at: &MotionPoint, tissue_n: f64) -> f64 {
        if self.plain {
            return tissue_n + self.noise.draw();
        }
        self.measure_through_effects(time_s, at, tissue_n)
    }

    fn measure_through_effects(&mut self, time_s: f64, at: &MotionPoint, tissue_n: f64) -> f64 {
        let spikes: f64 = self.spikes.iter_mut().map(Spikes::draw).sum();
        let reading = SensorInput {
            time_s,
            position_m: at.position_m,
            velocity_mps: at.velocity_mps,
            acceleration_mps2: at.acceleration_mps2,
            tissue_n,
            noise_n: self.noise.draw() + spikes,
        };
        self.chain.step(&mut self.state, &reading)
    }

    /// The recorded position (m) or velocity (m/s) for a true one.
    #[must_use]
    #[inline]
    pub fn position(&self, true_m: f64) -> f64 {
        self.chain.recorded_position(true_m)
    }
}
