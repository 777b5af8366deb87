//! From the tissue's force to the recorded one: arm and tool, then the sensor, then the recorded
//! position, in the order of SPEC section 6.
//!
//! tool (`m a`, drive friction) -> gain -> low-pass -> delay -> bias, drift -> interference ->
//! noise and spikes (drawn by the caller) -> saturation -> quantisation.

use crate::AnyEffect;
use crate::effect::{ChainStage, Effect, EffectState};
use alloc::vec::Vec;

/// The effects between tissue and recording: configuration only.
#[derive(Clone, Debug, PartialEq)]
pub struct MeasurementChain {
    tool: Vec<AnyEffect>,
    before_delay: Vec<AnyEffect>,
    delay_s: f64,
    before_noise: Vec<AnyEffect>,
    after_noise: Vec<AnyEffect>,
    position_factor: f64,
}

/// What a [`Measurement`] remembers between samples.
#[derive(Clone, Debug, PartialEq)]
pub struct MeasurementState {
    time_s: Option<f64>,
    /// One per effect before the delay.
    memory: Vec<EffectState>,
    /// Forces on their way, (time, force), used as a ring.
    ring: Vec<(f64, f64)>,
    oldest: usize,
    held: usize,
}

/// What there is to be measured in one sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SensorInput {
    /// Time in seconds; must not run backwards.
    pub time_s: f64,
    /// Velocity of the needle's base in m/s.
    pub velocity_mps: f64,
    /// Acceleration of the needle's base in m/s².
    pub acceleration_mps2: f64,
    /// Force of the tissue on the needle in N.
    pub tissue_n: f64,
    /// Noise and spikes in N, added before saturation and quantisation.
    pub noise_n: f64,
}

/// A span of time whose mean is measured.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AveragingInterval {
    /// Middle of the span in s.
    pub time_s: f64,
    /// Its length in s.
    pub span_s: f64,
    /// Samples that the sensor takes in it, evenly spaced.
    pub samples: f64,
    /// Mean velocity of the needle's base in m/s.
    pub velocity_mps: f64,
    /// Mean acceleration of the needle's base in m/s².
    pub acceleration_mps2: f64,
    /// Mean force of the tissue on the needle in N.
    pub tissue_n: f64,
}

impl MeasurementChain {
    /// The chain of those effects that act outside the tissue. Neutral effects and those of the
    /// tissue are left out.
    #[must_use]
    pub fn new(effects: &[AnyEffect]) -> Self {
        let mut active: Vec<&AnyEffect> =
            effects.iter().filter(|e| e.place() >= ChainStage::Tool && !e.is_neutral()).collect();
        active.sort_by_key(|e| e.rank());
        let mut chain = Self {
            tool: Vec::new(),
            before_delay: Vec::new(),
            delay_s: 0.0,
            before_noise: Vec::new(),
            after_noise: Vec::new(),
            position_factor: 1.0,
        };
        for effect in active {
            match (effect, effect.place()) {
                (AnyEffect::TimeDelay(delay), _) => chain.delay_s += delay.delay_s,
                (AnyEffect::ForceSpikes(_), _) => {}
                (AnyEffect::ForceGain(_) | AnyEffect::LowPassLag(_), _) => {
                    chain.before_delay.push(effect.clone());
                }
                (AnyEffect::Saturation(_) | AnyEffect::Quantisation(_), _) => {
                    chain.after_noise.push(effect.clone());
                }
                (_, ChainStage::Tool) => chain.tool.push(effect.clone()),
                (_, ChainStage::Position) => chain.position_factor *= effect.position_factor(),
                _ => chain.before_noise.push(effect.clone()),
            }
        }
        chain
    }

    /// The state before the first sample. `sample_hz` sizes the history of a delay: should samples
    /// come faster, the delay becomes as long as the history reaches.
    #[must_use]
    pub fn start(&self, sample_hz: f64) -> MeasurementState {
        let on_the_way = if self.delay_s > 0.0 {
            // A thousandth more for jitter; casts of floats saturate.
            (libm::ceil(self.delay_s * sample_hz * 1.001) as usize).min(1 << 24) + 3
        } else {
            0
        };
        MeasurementState {
            time_s: None,
            memory: alloc::vec![[0.0; 8]; self.before_delay.len()],
            ring: alloc::vec![(0.0, 0.0); on_the_way],
            oldest: 0,
            held: 0,
        }
    }

    /// The recorded force in N. Before the first sample the force is taken to have been constant.
    pub fn step(&self, state: &mut MeasurementState, reading: &SensorInput) -> f64 {
        let time_s = reading.time_s;
        let dt_s = (time_s - state.time_s.unwrap_or(time_s)).max(0.0);
        state.time_s = Some(time_s);
        let mut force = reading.tissue_n;
        for effect in &self.tool {
            force += effect.tool_force(reading.velocity_mps, reading.acceleration_mps2);
        }
        for (effect, memory) in self.before_delay.iter().zip(&mut state.memory) {
            force = effect.sense(time_s, dt_s, force, memory);
        }
        if self.delay_s > 0.0 {
            force = state.delayed(time_s, force, self.delay_s);
        }
        let mut none = [0.0; 8];
        for effect in &self.before_noise {
            force = effect.sense(time_s, dt_s, force, &mut none);
        }
        if reading.noise_n != 0.0 {
            force += reading.noise_n;
        }
        for effect in &self.after_noise {
            force = effect.sense(time_s, dt_s, force, &mut none);
        }
        force
    }

    /// Time in s by which the recorded force comes late.
    #[must_use]
    pub fn delay_s(&self) -> f64 {
        self.delay_s
    }

    /// Whether a jump of the force is smeared.
    #[must_use]
    pub fn has_lag(&self) -> bool {
        self.before_delay.iter().any(Effect::remembers)
    }

    /// The mean of the recorded force over a span of time, without delay, noise and what comes after the noise. Spans
    /// follow one another without gaps; a lag is integrated through them.
    pub fn mean_force(&self, state: &mut MeasurementState, cell: &AveragingInterval) -> f64 {
        let mut force = cell.tissue_n;
        for effect in &self.tool {
            force += effect.tool_force(cell.velocity_mps, cell.acceleration_mps2);
        }
        for (effect, memory) in self.before_delay.iter().zip(&mut state.memory) {
            force = effect.sense_mean(cell.time_s, cell.span_s, cell.samples, force, memory);
        }
        let mut none = [0.0; 8];
        for effect in &self.before_noise {
            force = effect.sense_mean(cell.time_s, cell.span_s, cell.samples, force, &mut none);
        }
        force
    }

    /// The recorded force at the end of a span whose means `cell` has, `cell.time_s` being that end: for stretches in which a mean over several
    /// samples is not what the samples give. The state is that of [`Measurement::mean`].
    pub fn force_at_end(&self, state: &mut MeasurementState, cell: &AveragingInterval) -> f64 {
        let mut force = cell.tissue_n;
        for effect in &self.tool {
            force += effect.tool_force(cell.velocity_mps, cell.acceleration_mps2);
        }
        for (effect, memory) in self.before_delay.iter().zip(&mut state.memory) {
            force = effect.sense_after(cell.time_s, cell.span_s, force, memory);
        }
        let mut none = [0.0; 8];
        for effect in &self.before_noise {
            force = effect.sense_after(cell.time_s, cell.span_s, force, &mut none);
        }
        force
    }

    /// The recorded position (or velocity) for a true one.
    #[must_use]
    #[inline]
    pub fn recorded_position(&self, true_m: f64) -> f64 {
        self.position_factor * true_m
    }

    /// The true position (or velocity) behind a recorded one.
    #[must_use]
    #[inline]
    pub fn true_position(&self, recorded_m: f64) -> f64 {
        recorded_m / self.position_factor
    }

    /// True when nothing acts on the force.
    #[must_use]
    pub fn is_plain(&self) -> bool {
        self.tool.is_empty()
            && self.before_delay.is_empty()
            && self.delay_s <= 0.0
            && self.before_noise.is_empty()
            && self.after_noise.is_empty()
    }
}

impl MeasurementState {
    /// Takes in the force at `time_s` and gives the one of `delay_s` before.
    fn delayed(&mut self, time_s: f64, force_n: f64, delay_s: f64) -> f64 {
        let size = self.ring.len();
        if size == 0 {
            return force_n;
        }
        if self.held == size {
            self.oldest = (self.oldest + 1) % size;
            self.held -= 1;
        }
        self.ring[(self.oldest + self.held) % size] = (time_s, force_n);
        self.held += 1;
        let wanted = time_s - delay_s;
        while self.held > 1 && self.ring[(self.oldest + 1) % size].0 <= wanted {
            self.oldest = (self.oldest + 1) % size;
            self.held -= 1;
        }
        let (t0, f0) = self.ring[self.oldest];
        if self.held == 1 || wanted <= t0 {
            return f0;
        }
        let (t1, f1) = self.ring[(self.oldest + 1) % size];
        f0 + (f1 - f0) * ((wanted - t0) / (t1 - t0))
    }
}
