//! From the force of the tissue to the recorded one: tool, sensor, recorded position (docs/reference/model.md, Measurement
//! chain).
//!
//! tool (`m a`, drive friction, force linear in position) -> gain -> low-pass -> delay -> bias, drift, steps of the zero -> interference -> noise and spikes (drawn by
//! the caller) -> saturation -> quantisation.

use crate::chain_stage::ChainStage;
use crate::effect::{BaseMotion, Effect, EffectState};
use crate::effects::AnyEffect;
use alloc::vec::Vec;

/// The effects between tissue and recording: configuration only, stepped with a [`MeasurementState`].
#[derive(Clone, Debug, PartialEq)]
pub struct MeasurementChain {
    tool: Vec<AnyEffect>,
    before_delay: Vec<AnyEffect>,
    delay_s: f64,
    before_noise: Vec<AnyEffect>,
    after_noise: Vec<AnyEffect>,
    position_factor: f64,
}

/// State of a [`MeasurementChain`] between samples.
#[derive(Clone, Debug, PartialEq)]
pub struct MeasurementState {
    time_s: Option<f64>,
    /// One per effect of the tool; none when no such effect has a state.
    tool: Vec<EffectState>,
    /// One per effect before the delay.
    effects: Vec<EffectState>,
    /// Delayed forces, (time, force), as a ring buffer.
    ring: Vec<(f64, f64)>,
    oldest: usize,
    held: usize,
}

/// Input of the chain in one sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SensorInput {
    /// Time in seconds; must not run backwards.
    pub time_s: f64,
    /// Position of the needle's base in m.
    pub position_m: f64,
    /// Velocity of the needle's base in m/s.
    pub velocity_mps: f64,
    /// Acceleration of the needle's base in m/s².
    pub acceleration_mps2: f64,
    /// Force of the tissue on the needle in N.
    pub tissue_n: f64,
    /// Noise and spikes in N, added before saturation and quantisation.
    pub noise_n: f64,
}

/// Input of the chain averaged over an interval.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AveragingInterval {
    /// Middle of the interval in s.
    pub time_s: f64,
    /// Length of the interval in s.
    pub span_s: f64,
    /// Number of sensor samples in it, evenly spaced.
    pub samples: f64,
    /// Mean position of the needle's base in m.
    pub position_m: f64,
    /// Mean velocity of the needle's base in m/s.
    pub velocity_mps: f64,
    /// Mean acceleration of the needle's base in m/s².
    pub acceleration_mps2: f64,
    /// Mean force of the tissue on the needle in N.
    pub tissue_n: f64,
}

impl AveragingInterval {
    fn base_motion(&self) -> BaseMotion {
        BaseMotion {
            time_s: self.time_s,
            dt_s: self.span_s,
            z_m: self.position_m,
            v_mps: self.velocity_mps,
            a_mps2: self.acceleration_mps2,
        }
    }
}

impl MeasurementChain {
    /// The chain of the effects that act outside the tissue. Inactive effects and those of the tissue are left out.
    #[must_use]
    pub fn new(effects: &[AnyEffect]) -> Self {
        let mut active: Vec<&AnyEffect> =
            effects.iter().filter(|e| e.stage() >= ChainStage::Tool && !e.is_inactive()).collect();
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
            match (effect, effect.stage()) {
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

    /// The state before the first sample. `sample_hz` sizes the buffer of a delay; at a higher rate the delay is limited to
    /// the length of the buffer.
    #[must_use]
    pub fn start(&self, sample_hz: f64) -> MeasurementState {
        let length = if self.delay_s > 0.0 {
            // A thousandth more for jitter; casts of floats saturate.
            (libm::ceil(self.delay_s * sample_hz * 1.001) as usize).min(1 << 24) + 3
        } else {
            0
        };
        MeasurementState {
            time_s: None,
            tool: alloc::vec![[0.0; 8]; if self.tool.iter().any(Effect::has_state) { self.tool.len() } else { 0 }],
            effects: alloc::vec![[0.0; 8]; self.before_delay.len()],
            ring: alloc::vec![(0.0, 0.0); length],
            oldest: 0,
            held: 0,
        }
    }

    /// The recorded force in N. Before the first sample the force is assumed constant.
    pub fn step(&self, state: &mut MeasurementState, reading: &SensorInput) -> f64 {
        let time_s = reading.time_s;
        let dt_s = (time_s - state.time_s.unwrap_or(time_s)).max(0.0);
        state.time_s = Some(time_s);
        let base = BaseMotion {
            time_s,
            dt_s,
            z_m: reading.position_m,
            v_mps: reading.velocity_mps,
            a_mps2: reading.acceleration_mps2,
        };
        let mut force = self.force_of_tool(&mut state.tool, &base, reading.tissue_n);
        for (effect, state_of_effect) in self.before_delay.iter().zip(&mut state.effects) {
            force = effect.sensor_output(time_s, dt_s, force, state_of_effect);
        }
        if self.delay_s > 0.0 {
            force = state.delayed(time_s, force, self.delay_s);
        }
        let mut none = [0.0; 8];
        for effect in &self.before_noise {
            force = effect.sensor_output(time_s, dt_s, force, &mut none);
        }
        if reading.noise_n != 0.0 {
            force += reading.noise_n;
        }
        for effect in &self.after_noise {
            force = effect.sensor_output(time_s, dt_s, force, &mut none);
        }
        force
    }

    /// The force in N after the effects of the tool.
    #[inline]
    fn force_of_tool(&self, states: &mut [EffectState], base: &BaseMotion, tissue_n: f64) -> f64 {
        let mut force = tissue_n;
        let mut none = [0.0; 8];
        for (k, effect) in self.tool.iter().enumerate() {
            force += effect.tool_force(base, force, states.get_mut(k).unwrap_or(&mut none));
        }
        force
    }

    /// Delay of the recorded force in s.
    #[must_use]
    pub fn delay_s(&self) -> f64 {
        self.delay_s
    }

    /// Whether a lag smears a jump of the force.
    #[must_use]
    pub fn has_lag(&self) -> bool {
        self.before_delay.iter().any(Effect::has_state)
    }

    /// Mean recorded force in N over an interval, without delay, noise, saturation and quantisation. Intervals follow one
    /// another without gaps; a lag is integrated through them.
    pub fn mean_force(&self, state: &mut MeasurementState, interval: &AveragingInterval) -> f64 {
        let mut force = self.force_of_tool(&mut state.tool, &interval.base_motion(), interval.tissue_n);
        for (effect, state_of_effect) in self.before_delay.iter().zip(&mut state.effects) {
            force = effect.mean_sensor_output(
                interval.time_s,
                interval.span_s,
                interval.samples,
                force,
                state_of_effect,
            );
        }
        let mut none = [0.0; 8];
        for effect in &self.before_noise {
            force = effect.mean_sensor_output(
                interval.time_s,
                interval.span_s,
                interval.samples,
                force,
                &mut none,
            );
        }
        force
    }

    /// Recorded force in N at the end `interval.time_s` of an interval with the means `interval`, where a mean over several samples
    /// does not represent them. The state is that of [`MeasurementChain::mean_force`].
    pub fn force_at_end(&self, state: &mut MeasurementState, interval: &AveragingInterval) -> f64 {
        let mut force = self.force_of_tool(&mut state.tool, &interval.base_motion(), interval.tissue_n);
        for (effect, state_of_effect) in self.before_delay.iter().zip(&mut state.effects) {
            force = effect.sensor_output_at_end(interval.time_s, interval.span_s, force, state_of_effect);
        }
        let mut none = [0.0; 8];
        for effect in &self.before_noise {
            force = effect.sensor_output_at_end(interval.time_s, interval.span_s, force, &mut none);
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

    /// Whether no effect acts on the force.
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
    /// Stores the force at `time_s` and returns the force of `delay_s` earlier.
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
