//! Motions of the needle: what a scenario writes, and the plan that says where the tip is at any time.

use serde::{Deserialize, Serialize};

/// Default phase of a sinusoid in radians: -90 degrees, from rest.
pub const FROM_REST_RAD: f64 = -core::f64::consts::FRAC_PI_2;

fn from_rest() -> f64 {
    FROM_REST_RAD
}

/// A motion along the insertion axis (SPEC sections 3 and 8).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Motion {
    /// One speed throughout.
    Constant {
        /// Tip position at time zero in m.
        start_m: f64,
        /// Speed in m/s.
        velocity_mps: f64,
        /// Duration in s.
        duration_s: f64,
    },
    /// `z = start + A (sin(2 pi f t + phase) - sin phase)`.
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

/// A piece of a program.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Segment {
    /// One speed; a negative one retracts.
    Move {
        /// Speed in m/s.
        velocity_mps: f64,
        /// Duration in s.
        duration_s: f64,
    },
    /// Standing still.
    Hold {
        /// Duration in s.
        duration_s: f64,
    },
    /// A mean speed with a sinusoid on it: `v = velocity + amplitude sin(2 pi f t)` from the
    /// segment's start.
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
    fn at(&self, t: f64) -> MotionPoint {
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
}

/// Where the tip is and how it moves at one instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MotionPoint {
    /// Position in m.
    pub position_m: f64,
    /// Velocity in m/s.
    pub velocity_mps: f64,
    /// Acceleration in m/s².
    pub acceleration_mps2: f64,
}

/// A motion made ready to be asked for any instant.
#[derive(Clone, Debug, PartialEq)]
pub struct MotionPlan {
    motion: Motion,
    /// For a program: (start time, start position) of each segment, and of the end.
    starts: Vec<(f64, f64)>,
    duration_s: f64,
}

impl Motion {
    /// The plan of the motion; `None` for [`Motion::Recorded`], which has none of its own.
    #[must_use]
    pub fn plan(&self) -> Option<MotionPlan> {
        let mut starts = Vec::new();
        let duration_s = match self {
            Motion::Constant { duration_s, .. } | Motion::Sinusoidal { duration_s, .. } => *duration_s,
            Motion::Program { start_m, segments } => {
                let (mut t, mut z) = (0.0, *start_m);
                for segment in segments {
                    starts.push((t, z));
                    t += segment.duration_s();
                    z += segment.at(segment.duration_s()).position_m;
                }
                starts.push((t, z));
                t
            }
            Motion::Recorded => return None,
        };
        Some(MotionPlan { motion: self.clone(), starts, duration_s })
    }
}

impl MotionPlan {
    /// Duration in s.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// The tip at `time_s`. Before the start and after the end the motion is continued.
    #[must_use]
    #[inline]
    pub fn at(&self, time_s: f64) -> MotionPoint {
        match &self.motion {
            Motion::Constant { start_m, velocity_mps, .. } => MotionPoint {
                position_m: start_m + velocity_mps * time_s,
                velocity_mps: *velocity_mps,
                acceleration_mps2: 0.0,
            },
            Motion::Sinusoidal { start_m, amplitude_m, frequency_hz, phase_rad, .. } => {
                let omega = core::f64::consts::TAU * frequency_hz;
                let angle = omega * time_s + phase_rad;
                let sin = libm::sin(angle);
                MotionPoint {
                    position_m: start_m + amplitude_m * (sin - libm::sin(*phase_rad)),
                    velocity_mps: amplitude_m * omega * libm::cos(angle),
                    acceleration_mps2: -amplitude_m * omega * omega * sin,
                }
            }
            Motion::Program { start_m, segments } => {
                let index = self.starts.partition_point(|(t, _)| *t <= time_s).saturating_sub(1);
                let (Some(segment), Some((t, z))) = (
                    segments.get(index).or(segments.last()),
                    self.starts.get(index.min(segments.len().saturating_sub(1))),
                ) else {
                    return MotionPoint { position_m: *start_m, ..MotionPoint::default() };
                };
                let point = segment.at(time_s - t);
                MotionPoint { position_m: z + point.position_m, ..point }
            }
            Motion::Recorded => MotionPoint::default(),
        }
    }

    /// Deepest position of the tip in m, looked for at `sample_hz`.
    #[must_use]
    pub fn furthest_m(&self, sample_hz: f64) -> f64 {
        let samples = (self.duration_s * sample_hz).round() as usize;
        (0..samples.max(1))
            .map(|k| self.at(k as f64 / sample_hz).position_m)
            .fold(f64::NEG_INFINITY, f64::max)
    }
}
