//! Position, velocity and acceleration of a motion at any time, bit for bit the same on every platform.

use crate::motion::{Motion, MotionPoint, Segment};
use core::f64::consts::{FRAC_PI_2, TAU};

/// A motion that can be evaluated at any time.
#[derive(Clone, Debug, PartialEq)]
pub struct MotionPlan {
    start_m: f64,
    duration_s: f64,
    trajectory: Trajectory,
}

/// Precomputed form of a motion.
#[derive(Clone, Debug, PartialEq)]
enum Trajectory {
    Constant { velocity_mps: f64 },
    Sinusoidal { amplitude_m: f64, omega_per_s: f64, phase_rad: f64, sin_phase: f64 },
    Program(Vec<PlacedSegment>),
}

/// A segment with its start time and position.
#[derive(Clone, Debug, PartialEq)]
struct PlacedSegment {
    from_s: f64,
    from_m: f64,
    segment: Segment,
}

impl Motion {
    /// The plan of the motion; `None` for [`Motion::Recorded`].
    #[must_use]
    pub fn plan(&self) -> Option<MotionPlan> {
        MotionPlan::new(self)
    }
}

impl MotionPlan {
    fn new(motion: &Motion) -> Option<Self> {
        Some(match motion {
            Motion::Constant { start_m, velocity_mps, duration_s } => Self {
                start_m: *start_m,
                duration_s: *duration_s,
                trajectory: Trajectory::Constant { velocity_mps: *velocity_mps },
            },
            Motion::Sinusoidal { start_m, amplitude_m, frequency_hz, phase_rad, duration_s } => Self {
                start_m: *start_m,
                duration_s: *duration_s,
                trajectory: Trajectory::Sinusoidal {
                    amplitude_m: *amplitude_m,
                    omega_per_s: TAU * frequency_hz,
                    phase_rad: *phase_rad,
                    sin_phase: libm::sin(*phase_rad),
                },
            },
            Motion::Program { start_m, segments } => {
                let (mut from_s, mut from_m) = (0.0, *start_m);
                let mut placed_segments = Vec::with_capacity(segments.len());
                for segment in segments {
                    placed_segments.push(PlacedSegment { from_s, from_m, segment: *segment });
                    from_s += segment.duration_s();
                    from_m += segment.at(segment.duration_s()).position_m;
                }
                Self {
                    start_m: *start_m,
                    duration_s: from_s,
                    trajectory: Trajectory::Program(placed_segments),
                }
            }
            Motion::Recorded => return None,
        })
    }

    /// Duration in s.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// The tip at `time_s`; before the start and after the end the motion is continued.
    #[must_use]
    #[inline]
    pub fn at(&self, time_s: f64) -> MotionPoint {
        match &self.trajectory {
            Trajectory::Constant { velocity_mps } => MotionPoint {
                position_m: self.start_m + velocity_mps * time_s,
                velocity_mps: *velocity_mps,
                acceleration_mps2: 0.0,
            },
            Trajectory::Sinusoidal { amplitude_m, omega_per_s, phase_rad, sin_phase } => {
                let (sin, cos) = libm::sincos(omega_per_s * time_s + phase_rad);
                MotionPoint {
                    position_m: self.start_m + amplitude_m * (sin - sin_phase),
                    velocity_mps: amplitude_m * omega_per_s * cos,
                    acceleration_mps2: -amplitude_m * omega_per_s * omega_per_s * sin,
                }
            }
            Trajectory::Program(placed_segments) => {
                let next = placed_segments.partition_point(|p| p.from_s <= time_s);
                match placed_segments.get(next.saturating_sub(1)) {
                    Some(PlacedSegment { from_s, from_m, segment }) => {
                        let point = segment.at(time_s - from_s);
                        MotionPoint { position_m: from_m + point.position_m, ..point }
                    }
                    None => MotionPoint { position_m: self.start_m, ..MotionPoint::default() },
                }
            }
        }
    }

    /// Deepest position of the tip in m, in closed form.
    #[must_use]
    pub fn deepest_m(&self) -> f64 {
        let ends = self.at(0.0).position_m.max(self.at(self.duration_s).position_m);
        match &self.trajectory {
            Trajectory::Constant { .. } => ends,
            Trajectory::Sinusoidal { amplitude_m, omega_per_s, phase_rad, sin_phase } => {
                // A positive amplitude is deepest at the crest, a negative one in the trough.
                let crest = if *amplitude_m < 0.0 { -FRAC_PI_2 } else { FRAC_PI_2 };
                let to_crest = (crest - phase_rad).rem_euclid(TAU);
                if to_crest <= omega_per_s * self.duration_s {
                    self.start_m + amplitude_m.abs() - amplitude_m * sin_phase
                } else {
                    ends
                }
            }
            Trajectory::Program(placed_segments) => placed_segments
                .iter()
                .fold(ends, |z, placed| z.max(placed.from_m + placed.segment.furthest_m())),
        }
    }
}
