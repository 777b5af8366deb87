//! The plan of a motion: where the tip is at any time. Uses `libm`, so that it has the same bits on
//! every platform.

use crate::motion::{Motion, MotionPoint, Segment};
use core::f64::consts::{FRAC_PI_2, TAU};

/// A motion made ready to be asked for any instant.
#[derive(Clone, Debug, PartialEq)]
pub struct MotionPlan {
    start_m: f64,
    duration_s: f64,
    course: Course,
}

/// What is worked out once.
#[derive(Clone, Debug, PartialEq)]
enum Course {
    Constant { velocity_mps: f64 },
    Sinusoidal { amplitude_m: f64, omega_per_s: f64, phase_rad: f64, sin_phase: f64 },
    Program(Vec<Piece>),
}

/// A segment with its start.
#[derive(Clone, Debug, PartialEq)]
struct Piece {
    from_s: f64,
    from_m: f64,
    segment: Segment,
}

impl MotionPlan {
    pub(crate) fn new(motion: &Motion) -> Option<Self> {
        Some(match motion {
            Motion::Constant { start_m, velocity_mps, duration_s } => Self {
                start_m: *start_m,
                duration_s: *duration_s,
                course: Course::Constant { velocity_mps: *velocity_mps },
            },
            Motion::Sinusoidal { start_m, amplitude_m, frequency_hz, phase_rad, duration_s } => Self {
                start_m: *start_m,
                duration_s: *duration_s,
                course: Course::Sinusoidal {
                    amplitude_m: *amplitude_m,
                    omega_per_s: TAU * frequency_hz,
                    phase_rad: *phase_rad,
                    sin_phase: libm::sin(*phase_rad),
                },
            },
            Motion::Program { start_m, segments } => {
                let (mut from_s, mut from_m) = (0.0, *start_m);
                let mut pieces = Vec::with_capacity(segments.len());
                for segment in segments {
                    pieces.push(Piece { from_s, from_m, segment: *segment });
                    from_s += segment.duration_s();
                    from_m += segment.at(segment.duration_s()).position_m;
                }
                Self { start_m: *start_m, duration_s: from_s, course: Course::Program(pieces) }
            }
            Motion::Recorded => return None,
        })
    }

    /// Duration in s.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// The tip at `time_s`. Before the start and after the end the motion is continued.
    #[must_use]
    #[inline]
    pub fn at(&self, time_s: f64) -> MotionPoint {
        match &self.course {
            Course::Constant { velocity_mps } => MotionPoint {
                position_m: self.start_m + velocity_mps * time_s,
                velocity_mps: *velocity_mps,
                acceleration_mps2: 0.0,
            },
            Course::Sinusoidal { amplitude_m, omega_per_s, phase_rad, sin_phase } => {
                let (sin, cos) = libm::sincos(omega_per_s * time_s + phase_rad);
                MotionPoint {
                    position_m: self.start_m + amplitude_m * (sin - sin_phase),
                    velocity_mps: amplitude_m * omega_per_s * cos,
                    acceleration_mps2: -amplitude_m * omega_per_s * omega_per_s * sin,
                }
            }
            Course::Program(pieces) => {
                let next = pieces.partition_point(|p| p.from_s <= time_s);
                match pieces.get(next.saturating_sub(1)) {
                    Some(Piece { from_s, from_m, segment }) => {
                        let point = segment.at(time_s - from_s);
                        MotionPoint { position_m: from_m + point.position_m, ..point }
                    }
                    None => MotionPoint { position_m: self.start_m, ..MotionPoint::default() },
                }
            }
        }
    }

    /// Deepest position of the tip in m among the samples taken at `sample_hz`.
    #[must_use]
    pub fn furthest_m(&self, sample_hz: f64) -> f64 {
        let samples = (self.duration_s * sample_hz).round() as usize;
        (0..samples.max(1))
            .map(|k| self.at(k as f64 / sample_hz).position_m)
            .fold(f64::NEG_INFINITY, f64::max)
    }

    /// Deepest position of the tip in m, at whatever instant: in closed form.
    #[must_use]
    pub fn deepest_m(&self) -> f64 {
        let ends = self.at(0.0).position_m.max(self.at(self.duration_s).position_m);
        match &self.course {
            Course::Constant { .. } => ends,
            Course::Sinusoidal { amplitude_m, omega_per_s, phase_rad, sin_phase } => {
                // A positive amplitude is deepest at the crest, a negative one in the trough.
                let crest = if *amplitude_m < 0.0 { -FRAC_PI_2 } else { FRAC_PI_2 };
                let to_crest = (crest - phase_rad).rem_euclid(TAU);
                if to_crest <= omega_per_s * self.duration_s {
                    self.start_m + amplitude_m.abs() - amplitude_m * sin_phase
                } else {
                    ends
                }
            }
            Course::Program(pieces) => {
                pieces.iter().fold(ends, |z, piece| z.max(piece.from_m + piece.segment.furthest_m()))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::PHASE_FROM_REST_RAD;
    use proptest::prelude::*;

    fn plan(motion: &Motion) -> MotionPlan {
        motion.plan().expect("it is not recorded")
    }

    #[test]
    fn the_papers_sinusoid_starts_from_rest_and_reaches_its_amplitude_in_a_quarter_period() {
        let plan = plan(&Motion::Sinusoidal {
            start_m: -0.005,
            amplitude_m: 0.12,
            frequency_hz: 0.0167,
            phase_rad: PHASE_FROM_REST_RAD,
            duration_s: 15.0,
        });
        assert_eq!(plan.at(0.0).position_m, -0.005);
        assert!(plan.at(0.0).velocity_mps.abs() < 1e-15);
        let quarter = plan.at(0.25 / 0.0167);
        assert!((quarter.position_m - 0.115).abs() < 1e-12);
        assert!((quarter.velocity_mps - 0.12 * TAU * 0.0167).abs() < 1e-12);
    }

    #[test]
    fn a_recorded_motion_has_no_plan() {
        assert_eq!(Motion::Recorded.plan(), None);
    }

    fn segment() -> impl Strategy<Value = Segment> {
        let (v, t) = (-0.02..0.02, 0.1..5.0);
        prop_oneof![
            (v.clone(), t.clone())
                .prop_map(|(velocity_mps, duration_s)| Segment::Move { velocity_mps, duration_s }),
            t.clone().prop_map(|duration_s| Segment::Hold { duration_s }),
            (v.clone(), v, 0.1..5.0, t).prop_map(
                |(velocity_mps, amplitude_mps, frequency_hz, duration_s)| {
                    Segment::Ripple { velocity_mps, amplitude_mps, frequency_hz, duration_s }
                }
            ),
        ]
    }

    fn motion() -> impl Strategy<Value = Motion> {
        let sinusoid = (-0.1..0.1, -0.2..0.2, 0.01..2.0, -7.0..7.0, 0.1..20.0).prop_map(
            |(start_m, amplitude_m, frequency_hz, phase_rad, duration_s)| Motion::Sinusoidal {
                start_m,
                amplitude_m,
                frequency_hz,
                phase_rad,
                duration_s,
            },
        );
        let program = (-0.1..0.1, prop::collection::vec(segment(), 1..6))
            .prop_map(|(start_m, segments)| Motion::Program { start_m, segments });
        prop_oneof![sinusoid, program]
    }

    proptest! {
        #[test]
        fn velocity_is_the_slope_of_position_and_acceleration_that_of_velocity(m in motion(), at in 0.0..1.0) {
            let plan = plan(&m);
            let (t, h) = (at * plan.duration_s(), 1e-6);
            let (before, here, after) = (plan.at(t - h), plan.at(t), plan.at(t + h));
            // Not where a program changes its speed.
            prop_assume!(here.velocity_mps - before.velocity_mps < 1e-4 && (after.velocity_mps - here.velocity_mps).abs() < 1e-4);
            let slope = (after.position_m - before.position_m) / (2.0 * h);
            prop_assert!((slope - here.velocity_mps).abs() < 2e-4, "{} {}", slope, here.velocity_mps);
        }

        #[test]
        fn the_furthest_position_is_reached_and_never_passed(m in motion()) {
            let plan = plan(&m);
            let n = 20_000;
            let seen = (0..=n)
                .map(|k| plan.at(plan.duration_s() * f64::from(k) / f64::from(n)).position_m)
                .fold(f64::NEG_INFINITY, f64::max);
            let furthest = plan.deepest_m();
            prop_assert!(seen <= furthest + 1e-12, "{} passes {}", seen, furthest);
            prop_assert!(furthest - seen < 1e-4, "{} does not reach {}", seen, furthest);
        }

        #[test]
        fn a_program_has_no_jumps_in_position(m in motion()) {
            let plan = plan(&m);
            let n = 20_000;
            let dt = plan.duration_s() / f64::from(n);
            for k in 0..n {
                let step = plan.at(f64::from(k + 1) * dt).position_m - plan.at(f64::from(k) * dt).position_m;
                prop_assert!(step.abs() <= 2.6 * dt + 1e-12);
            }
        }
    }
}
