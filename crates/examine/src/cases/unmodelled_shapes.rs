//! Forces outside the effect library.
//!
//! Each is a function of the base's motion, of time, of depth or of the ruptures that no effect of docs/reference/model.md has. Their strength is the
//! residual of the base law re-fitted together with a constant, a drift, dry and drive friction, inertia, cutting and square laws
//! ([`RefitTerms::Common`](super::effect_strength::RefitTerms::Common)), so that the part that the library can explain is not counted.

use crate::simulator::insertion::UnmodelledForce;
use crate::simulator::motion_path::MotionState;
use core::f64::consts::TAU;

/// Names of the shapes.
pub const UNMODELLED_SHAPES: [&str; 16] = [
    "ripple_in_depth",
    "lumps_at_depths",
    "telegraph_in_time",
    "chirp_in_time",
    "dry_friction_that_fades",
    "slack_on_return",
    "acceleration_squared",
    "corrugated_friction",
    "wear_with_travel",
    "sawtooth_in_travel",
    "beats_in_time",
    "rough_field_in_depth",
    "play_in_depth",
    "ringing_after_ruptures",
    "healing_in_holds",
    "oscillation_in_speed",
];

/// A shape with its parameters and state.
#[derive(Clone, Debug)]
pub struct UnmodelledShape {
    /// Index into [`UNMODELLED_SHAPES`].
    pub kind: usize,
    /// Shape parameters in 0..1.
    pub u: [f64; 6],
    /// Size in N.
    pub size_n: f64,
    memory: MotionHistory,
}

#[derive(Clone, Debug, Default)]
struct MotionHistory {
    started: bool,
    t: f64,
    z: f64,
    deepest: f64,
    travel: f64,
    play: f64,
    rest_s: f64,
    healed: f64,
}

/// Speed in m/s below which the needle is at rest.
const REST_MPS: f64 = 1e-4;

impl UnmodelledShape {
    /// A shape in its initial state.
    #[must_use]
    pub fn new(kind: usize, u: [f64; 6], size_n: f64) -> Self {
        Self { kind: kind % UNMODELLED_SHAPES.len(), u, size_n, memory: MotionHistory::default() }
    }

    /// Its name.
    #[must_use]
    pub fn name(&self) -> &'static str {
        UNMODELLED_SHAPES[self.kind]
    }

    /// The same shape at another size.
    #[must_use]
    pub fn scaled_to(&self, size_n: f64) -> Self {
        Self { size_n, memory: MotionHistory::default(), ..self.clone() }
    }

    fn update_history(&mut self, p: &MotionState) {
        let m = &mut self.memory;
        if !m.started {
            *m = MotionHistory { started: true, t: p.t, z: p.z, deepest: p.z, ..MotionHistory::default() };
        }
        let (dt, dz) = (p.t - m.t, p.z - m.z);
        m.t = p.t;
        m.z = p.z;
        m.deepest = m.deepest.max(p.z);
        if p.z > 0.0 {
            m.travel += dz.abs();
        }
        let width = 1e-3 + 3e-3 * self.u[0];
        m.play = m.play.clamp(p.z - width, p.z + width);
        if p.v.abs() < REST_MPS && p.z > 0.0 {
            m.rest_s += dt;
            m.healed = 1.0 - libm::exp(-m.rest_s / (0.5 + self.u[1]));
        } else {
            m.healed *= libm::exp(-dz.abs() / (1e-3 + 3e-3 * self.u[2]));
            m.rest_s = 0.0;
        }
    }
}

impl UnmodelledForce for UnmodelledShape {
    fn force_n(&mut self, p: &MotionState, ruptures: &[f64]) -> f64 {
        self.update_history(p);
        let m = &self.memory;
        let u = self.u;
        let MotionState { t, z, v, a } = *p;
        let inside = (z / 0.05).clamp(0.0, 2.0);
        let wave = |x: f64| libm::sin(TAU * x);
        let shape = match self.kind {
            0 if z > 0.0 => wave(z / (0.004 + 0.01 * u[0]) + u[1]),
            1 => (0..3)
                .map(|k| {
                    let x = (z - 0.012 - 0.03 * k as f64 - 0.02 * u[k]) / (0.0012 + 0.002 * u[3]);
                    libm::exp(-x * x) * if u[4 + k % 2] < 0.5 { 2.0 } else { -2.0 }
                })
                .sum(),
            2 => {
                let k = libm::floor(t / (4.0 + 6.0 * u[0]) + u[1]);
                let s = wave(k * 0.381_966 + u[2]);
                s.signum() * (0.5 + 0.5 * s.abs())
            }
            3 => wave((0.05 + 0.2 * u[0]) * t * (1.0 + t / (25.0 + 25.0 * u[1])) + u[2]),
            4 => inside * libm::tanh(v / 5e-4) * libm::exp(-t / (5.0 + 8.0 * u[0])) * 2.0,
            5 => -2.0 * ((m.deepest - z) / (0.002 + 0.004 * u[0])).min(1.0),
            6 => {
                let x = a / (3e-3 + 4e-3 * u[0]);
                (x * x).min(9.0) - 0.5
            }
            7 if z > 0.0 => v / 3e-3 * wave(z / (0.006 + 0.012 * u[0]) + u[1]) * inside,
            8 => inside * libm::tanh(v / 1e-3) * wave(m.travel / (0.03 + 0.05 * u[0]) + u[1]),
            9 if z > 0.0 => {
                let x = m.travel / (0.003 + 0.006 * u[0]) + u[1];
                2.0 * (x - libm::floor(x)) - 1.0
            }
            10 => wave((0.3 + 2.0 * u[0]) * t) * wave((0.02 + 0.06 * u[1]) * t + u[2]) * 1.5,
            11 if z > 0.0 => (0..6)
                .map(|k| {
                    let x = u[k] + 0.618 * k as f64;
                    0.6 * wave(z / (0.005 * libm::pow(1.7, k as f64) * (0.8 + 0.4 * u[k])) + x)
                })
                .sum(),
            12 if z > 0.0 => (z - m.play) / (1e-3 + 3e-3 * u[0]),
            13 => ruptures
                .iter()
                .map(|r| {
                    let since = t - r;
                    4.0 * wave((1.0 + 3.0 * u[0]) * since) * libm::exp(-since / (0.6 + 1.5 * u[1]))
                })
                .sum(),
            14 => 2.5 * m.healed,
            15 => wave(v / (1e-3 + 1.5e-3 * u[0]) + u[1]) - wave(u[1]),
            _ => 0.0,
        };
        self.size_n * shape
    }
}
