//! From the force at the needle's base to the recorded one (docs/reference/model.md): arm and tool, gain, low-pass, delay, bias
//! and drift, interference, noise, saturation, quantisation. Lag and delay are exact for a force that is linear between knots,
//! including jumps.

use super::effect::Effect;
use super::force_law::ForceKnot;
use super::plain_world::sgn;
use core::f64::consts::TAU;
use std::collections::VecDeque;

/// Configuration of the instrument.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SensorModel {
    mass_kg: f64,
    drive_n: f64,
    gain: f64,
    lag_s: f64,
    delay_s: f64,
    bias_n: f64,
    drift_n_per_s: f64,
    /// Steps of the zero: time (s) and size (N).
    zero_steps: Vec<(f64, f64)>,
    /// Forces linear in position: slope, position without force.
    guides: Vec<(f64, f64)>,
    interference: Vec<(f64, f64, f64)>,
    limit_n: Option<f64>,
    steps_n: Vec<f64>,
    scale: f64,
}

impl SensorModel {
    /// The sensor with these effects and a further delay `late_s`.
    #[must_use]
    pub fn new(effects: &[Effect], late_s: f64) -> Self {
        let mut it = Self { gain: 1.0, scale: 1.0, delay_s: late_s, ..Self::default() };
        for effect in effects {
            match *effect {
                Effect::ToolInertia { mass_kg } => it.mass_kg += mass_kg,
                Effect::DriveFriction { force_n } => it.drive_n += force_n,
                Effect::ForceGain { eps } => it.gain *= 1.0 + eps,
                Effect::LowPassLag { time_constant_s } => it.lag_s = time_constant_s,
                Effect::TimeDelay { delay_s } => it.delay_s += delay_s,
                Effect::ForceBias { force_n } => it.bias_n += force_n,
                Effect::ForceDrift { rate_n_per_s } => it.drift_n_per_s += rate_n_per_s,
                Effect::ZeroStep { time_s, step_n } => it.zero_steps.push((time_s, step_n)),
                Effect::PositionDependentForce { stiffness_n_per_m, rest_m } => {
                    it.guides.push((stiffness_n_per_m, rest_m));
                }
                Effect::PeriodicInterference { amplitude_n, frequency_hz, phase_rad } => {
                    it.interference.push((amplitude_n, frequency_hz, phase_rad));
                }
                Effect::Saturation { limit_n } => it.limit_n = Some(limit_n),
                Effect::Quantisation { step_n } => it.steps_n.push(step_n),
                Effect::PositionScale { eps } => it.scale *= 1.0 + eps,
                _ => {}
            }
        }
        it
    }

    /// Rounds to a further step in N: a coarse converter.
    #[must_use]
    pub fn with_rounding(mut self, step_n: f64) -> Self {
        self.steps_n.push(step_n);
        self
    }

    /// Force between arm and sensor at base position `z`, velocity `v` and acceleration `a`.
    #[must_use]
    pub fn tool_n(&self, z: f64, v: f64, a: f64) -> f64 {
        let guides: f64 = self.guides.iter().map(|(slope, rest)| slope * (z - rest)).sum();
        self.mass_kg * a + self.drive_n * sgn(v) + guides
    }

    /// The recorded position for a true one.
    #[must_use]
    pub fn position_m(&self, z: f64) -> f64 {
        self.scale * z
    }

    /// Sensor reading at `t` for a force after gain, lag and delay, with its noise.
    #[must_use]
    pub fn reading_n(&self, t: f64, force_n: f64, noise_n: f64) -> f64 {
        let mut f = force_n + self.bias_n + self.drift_n_per_s * t;
        f += self.zero_steps.iter().filter(|s| t >= s.0).map(|s| s.1).sum::<f64>();
        for (amplitude, hz, phase) in &self.interference {
            f += amplitude * libm::sin(TAU * hz * t + phase);
        }
        f += noise_n;
        if let Some(limit) = self.limit_n {
            f = f.clamp(-limit, limit);
        }
        for step in &self.steps_n {
            f = libm::round(f / step) * step;
        }
        f
    }

    /// Initial state.
    #[must_use]
    pub fn start(&self) -> SensorState {
        SensorState { gain: self.gain, lag_s: self.lag_s, delay_s: self.delay_s, ..SensorState::default() }
    }
}

/// State of gain, lag and delay.
#[derive(Clone, Debug, Default)]
pub struct SensorState {
    gain: f64,
    lag_s: f64,
    delay_s: f64,
    started: bool,
    last: (f64, f64),
    lagged: f64,
    decay: (f64, f64),
    on_the_way: VecDeque<(f64, f64)>,
}

impl SensorState {
    /// Adds a knot.
    pub fn add_knot(&mut self, knot: ForceKnot) {
        let f = self.gain * knot.force_n;
        if !self.started {
            // The force before the first knot is assumed to be constant.
            self.started = true;
            self.lagged = f;
        } else if self.lag_s > 0.0 {
            let dt = knot.t - self.last.0;
            if dt > 0.0 {
                if (dt - self.decay.0).abs() > 1e-9 * dt {
                    self.decay = (dt, libm::exp(-dt / self.lag_s));
                }
                let keep = self.decay.1;
                let ramp = 1.0 - (1.0 - keep) * self.lag_s / dt;
                self.lagged = keep * self.lagged + (1.0 - keep) * self.last.1 + ramp * (f - self.last.1);
            }
        } else {
            self.lagged = f;
        }
        self.last = (knot.t, f);
        if self.delay_s > 0.0 {
            self.on_the_way.push_back((knot.t, self.lagged));
        }
    }

    /// Output at `t`, the time of the last knot.
    pub fn read(&mut self, t: f64) -> f64 {
        if self.delay_s <= 0.0 {
            return self.lagged;
        }
        let wanted = t - self.delay_s;
        while self.on_the_way.len() > 1 && self.on_the_way[1].0 <= wanted {
            self.on_the_way.pop_front();
        }
        match (self.on_the_way.front(), self.on_the_way.get(1)) {
            (Some(&(t0, f0)), Some(&(t1, f1))) if wanted > t0 => f0 + (f1 - f0) * (wanted - t0) / (t1 - t0),
            (Some(&(_, f0)), _) => f0,
            _ => self.lagged,
        }
    }
}
