//! Noise of the force sensor: autoregressive, heavy-tailed, force-dependent; mains hum; spikes.

use rand::RngExt;
use rand::rngs::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// The noise of a force sensor.
#[derive(Clone, Debug, PartialEq)]
pub struct SensorNoise {
    /// Marginal standard deviation of the coloured part in N.
    pub sd_n: f64,
    /// Autoregressive coefficients, per sample.
    pub ar: [f64; 2],
    /// Share of the variance that comes from a Student t of 3 degrees of freedom.
    pub tails: f64,
    /// Additional standard deviation as a share of the force.
    pub growing: f64,
    /// Standard deviation of a 1/f drift in N.
    pub wander_n: f64,
    /// Amplitude in N of mains hum, and the frequency in Hz about which it drifts.
    pub hum: Option<(f64, f64)>,
    /// Spikes: rate in Hz and size in N.
    pub spikes: Option<(f64, f64)>,
}

impl SensorNoise {
    /// White noise.
    #[must_use]
    pub fn white(sd_n: f64) -> Self {
        Self { sd_n, ar: [0.0; 2], tails: 0.0, growing: 0.0, wander_n: 0.0, hum: None, spikes: None }
    }
}

/// Time constants in s of the components of the 1/f drift, two per decade.
const WANDER_S: [f64; 6] = [0.1, 0.316, 1.0, 3.16, 10.0, 31.6];
/// Time constant in s of the mean-reverting frequency of the hum ...
const HUM_S: f64 = 20.0;
/// ... and its standard deviation in Hz.
const HUM_HZ: f64 = 0.1;

/// Generator of the noise with its state.
pub struct NoiseGenerator<'a> {
    noise: &'a SensorNoise,
    rng: &'a mut ChaCha8Rng,
    inner: f64,
    past: [f64; 2],
    wander: [f64; WANDER_S.len()],
    last_s: f64,
    hum_hz: f64,
    hum_phase: f64,
}

impl<'a> NoiseGenerator<'a> {
    /// A generator in its stationary state.
    pub fn new(noise: &'a SensorNoise, rng: &'a mut ChaCha8Rng) -> Self {
        let [a1, a2] = noise.ar;
        let rho = a1 / (1.0 - a2);
        let inner = (1.0 - a1 * rho - a2 * (a2 + a1 * rho)).max(0.0).sqrt();
        let mut it = Self {
            noise,
            inner,
            past: [0.0; 2],
            wander: [0.0; WANDER_S.len()],
            last_s: 0.0,
            hum_hz: noise.hum.map_or(0.0, |h| h.1),
            hum_phase: rng.random::<f64>() * core::f64::consts::TAU,
            rng,
        };
        for w in &mut it.wander {
            *w = StandardNormal.sample(it.rng);
        }
        for _ in 0..100 {
            it.coloured();
        }
        it
    }

    fn normal(&mut self) -> f64 {
        StandardNormal.sample(self.rng)
    }

    fn coloured(&mut self) -> f64 {
        let mut w = self.normal();
        if self.noise.tails > 0.0 {
            // Student t of three degrees has variance three.
            let chi: f64 = (0..3).map(|_| self.normal()).map(|x| x * x).sum();
            let t = self.normal() / (chi / 3.0).max(1e-12).sqrt() / 3f64.sqrt();
            w = (1.0 - self.noise.tails).sqrt() * w + self.noise.tails.sqrt() * t;
        }
        let [a1, a2] = self.noise.ar;
        let e = a1 * self.past[0] + a2 * self.past[1] + self.inner * w;
        self.past = [e, self.past[0]];
        e
    }

    /// The noise of the sample at `t`, where the force is `force_n`; `interval_s` is the typical time between samples.
    pub fn next(&mut self, t: f64, force_n: f64, interval_s: f64) -> f64 {
        let mut x = self.noise.sd_n * self.coloured();
        let dt = (t - self.last_s).max(0.0);
        self.last_s = t;
        if self.noise.growing > 0.0 {
            x += self.noise.growing * force_n.abs() * self.normal();
        }
        if self.noise.wander_n > 0.0 {
            let share = self.noise.wander_n / (WANDER_S.len() as f64).sqrt();
            for (k, tau) in WANDER_S.iter().enumerate() {
                let keep = libm::exp(-dt / tau);
                self.wander[k] = keep * self.wander[k] + (1.0 - keep * keep).sqrt() * self.normal();
                x += share * self.wander[k];
            }
        }
        if let Some((amplitude, middle)) = self.noise.hum {
            let keep = libm::exp(-dt / HUM_S);
            self.hum_hz =
                middle + keep * (self.hum_hz - middle) + HUM_HZ * (1.0 - keep * keep).sqrt() * self.normal();
            self.hum_phase += core::f64::consts::TAU * self.hum_hz * dt;
            x += amplitude * libm::sin(self.hum_phase);
        }
        if let Some((rate, size)) = self.noise.spikes
            && self.rng.random::<f64>() < rate * interval_s
        {
            x += if self.rng.random::<bool>() { size } else { -size };
        }
        x
    }
}
