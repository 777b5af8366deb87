//! Commanded motions of the needle, as in scenarios.

use serde::{Deserialize, Serialize};

/// Default phase of a sinusoid in radians: -90 degrees, from rest.
pub const PHASE_FROM_REST_RAD: f64 = -core::f64::consts::FRAC_PI_2;

fn from_rest() -> f64 {
    PHASE_FROM_REST_RAD
}

/// A motion along the insertion axis (`docs/reference/model.md`, *Motions*).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Motion {
    /// Constant velocity.
    Constant {
        /// Tip position at time zero in m.
        start_m: f64,
        /// Speed in m/s.
        velocity_mps: f64,
        /// Duration in s.
        duration_s: f64,
    },
    /// `z = start + A (sin(2 pi f t + phase) - sin phase)`; with the default phase the tip travels `2 A` between its turning points.
    Sinusoidal {
        /// Tip position at time zero in m.
        start_m: f64,
        /// Amplitude `A` in m.
        amplitude_m: f64,
        /// Frequency `f` in Hz.
        frequency_hz: f64,
        /// Phase in radians; default -90 degrees, from rest.
        #[serde(default = "from_rest")]
        phase_rad: f64,
        /// Duration in s.
        duration_s: f64,
    },
    /// Segments one after another.
    Program {
        /// Tip position at time zero in m.
        start_m: f64,
        /// The segments in order.
        segments: Vec<Segment>,
    },
    /// The motion comes with the data.
    Recorded,
}

/// A segment of a program.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Segment {
    /// Constant velocity; negative retracts.
    Move {
        /// Speed in m/s.
        velocity_mps: f64,
        /// Duration in s.
        duration_s: f64,
    },
    /// Standstill.
    Hold {
        /// Duration in s.
        duration_s: f64,
    },
    /// Mean velocity plus sinusoid, `v = velocity + amplitude sin(2 pi f t)` from the start of the segment.
    Ripple {
        /// Mean speed in m/s.
        velocity_mps: f64,
        /// Amplitude of the speed in m/s.
        amplitude_mps: f64,
        /// Frequency in Hz.
        frequency_hz: f64,
        /// Duration in s.
        duration_s: f64,
    },
}

impl Segment {
    /// Duration in s.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        match *self {
            Segment::Move { duration_s, .. }
            | Segment::Hold { duration_s }
            | Segment::Ripple { duration_s, .. } => duration_s,
        }
    }

    /// Displacement, velocity and acceleration `t` seconds after the segment's start.
    pub(crate) fn at(&self, t: f64) -> MotionPoint {
        match *self {
            Segment::Move { velocity_mps, .. } => {
                MotionPoint { position_m: velocity_mps * t, velocity_mps, acceleration_mps2: 0.0 }
            }
            Segment::Hold { .. } => MotionPoint::default(),
            Segment::Ripple { velocity_mps, amplitude_mps, frequency_hz, .. } => {
                let omega = core::f64::consts::TAU * frequency_hz;
                let angle = omega * t;
                MotionPoint {
                    position_m: velocity_mps * t + amplitude_mps / omega * (1.0 - libm::cos(angle)),
                    velocity_mps: velocity_mps + amplitude_mps * libm::sin(angle),
                    acceleration_mps2: amplitude_mps * omega * libm::cos(angle),
                }
            }
        }
    }

    /// Largest displacement from the start of the segment in m, at least zero.
    pub(crate) fn furthest_m(&self) -> f64 {
        let end = self.duration_s();
        let deepest = self.at(end).position_m.max(0.0);
        let Segment::Ripple { velocity_mps, amplitude_mps, frequency_hz, .. } = *self else {
            return deepest;
        };
        if amplitude_mps.abs() <= velocity_mps.abs() {
            return deepest; // never turns
        }
        // Turns from advance to retraction where sin = -v/a; the deepest of these turns is in the
        // first or in the last period.
        let turn = libm::asin(-velocity_mps / amplitude_mps);
        let turn = if amplitude_mps > 0.0 { core::f64::consts::PI - turn } else { turn };
        let period = 1.0 / frequency_hz;
        let first = (turn / core::f64::consts::TAU).rem_euclid(1.0) * period;
        let last = first + libm::floor((end - first) / period) * period;
        [first, last]
            .into_iter()
            .filter(|t| (0.0..=end).contains(t))
            .fold(deepest, |z, t| z.max(self.at(t).position_m))
    }
}

/// Position, velocity and acceleration of the tip.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MotionPoint {
    /// Position in m.
    pub position_m: f64,
    /// Velocity in m/s.
    pub velocity_mps: f64,
    /// Acceleration in m/s².
    pub acceleration_mps2: f64,
}
