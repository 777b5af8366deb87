//! The force/torque sensor: from the force at the needle's base to the number that is recorded.
//!
//! The chain of SPEC section 6 is `stylet_tissue::Measurement`; what is random is drawn here.

use crate::insertion::InsertionSample;
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use stylet_scenario::ForceTorque;
use stylet_tissue::{
    AnyEffect, Effect, ForceBias, ForceDrift, Measurement, MeasurementState, Quantisation, Reading,
    Saturation,
};

/// Stream of the generator from which the force/torque sensor draws.
const NOISE_STREAM: u64 = 1;
/// First of the streams from which spikes are drawn.
const SPIKES_STREAM: u64 = 1000;

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

/// Isolated outlying samples: at each sample, with the effect's rate, a spike of its size and of
/// either sign.
#[derive(Debug)]
struct Spikes {
    generator: ChaCha8Rng,
    chance: f64,
    size_n: f64,
}

impl Spikes {
    fn draw(&mut self) -> f64 {
        let hit = self.generator.random::<f64>() < self.chance;
        let sign = if self.generator.random::<bool>() { 1.0 } else { -1.0 };
        if hit { sign * self.size_n } else { 0.0 }
    }
}

/// The measuring end of an insertion: what arm and tool add, then the force/torque sensor with its
/// effects, noise and limits, in the order of SPEC section 6.
#[derive(Debug)]
pub struct Measuring {
    chain: Measurement,
    state: MeasurementState,
    noise: Noise,
    spikes: Vec<Spikes>,
}

impl Measuring {
    /// The tool, sensor and position effects of a scenario together with the sensor's own bias,
    /// drift, noise, range and quantisation. Noise and spikes are drawn from `seed`, for samples at
    /// `sample_hz`.
    #[must_use]
    pub fn new(effects: &[AnyEffect], sensor: &ForceTorque, seed: u64, sample_hz: f64) -> Self {
        let mut chain: Vec<AnyEffect> = vec![
            ForceBias { force_n: sensor.bias_n }.into(),
            ForceDrift { rate_n_per_s: sensor.drift_n_per_s }.into(),
            Saturation { limit_n: sensor.range_n.unwrap_or(f64::INFINITY) }.into(),
            Quantisation { step_n: sensor.quantisation_n }.into(),
        ];
        chain.extend_from_slice(effects);
        let chain = Measurement::new(&chain);
        let spikes = effects.iter().filter_map(|effect| match effect {
            AnyEffect::ForceSpikes(spikes) if !effect.is_neutral() => Some(spikes),
            _ => None,
        });
        let spikes = spikes
            .zip(SPIKES_STREAM..)
            .map(|(spikes, stream)| {
                let mut generator = ChaCha8Rng::seed_from_u64(seed);
                generator.set_stream(stream);
                Spikes { generator, chance: spikes.rate_hz / sample_hz, size_n: spikes.size_n }
            })
            .collect();
        Self {
            state: chain.start(sample_hz),
            chain,
            noise: Noise::new(seed, NOISE_STREAM, sensor.noise_n, sensor.ar1),
            spikes,
        }
    }

    /// The reading for one sample, in N.
    #[inline]
    pub fn measure(&mut self, sample: &InsertionSample) -> f64 {
        let spikes: f64 = self.spikes.iter_mut().map(Spikes::draw).sum();
        let reading = Reading {
            time_s: sample.time_s,
            velocity_mps: sample.velocity_mps,
            acceleration_mps2: sample.acceleration_mps2,
            tissue_n: sample.force.total_n,
            noise_n: self.noise.draw() + spikes,
        };
        self.chain.step(&mut self.state, &reading)
    }

    /// The recorded position (m) or velocity (m/s) for a true one.
    #[must_use]
    #[inline]
    pub fn position(&self, true_m: f64) -> f64 {
        self.chain.position(true_m)
    }
}
