//! Motion programs within limits: points of the unit cube mapped to programs of 2 to 6 parts that start and end
//! at rest.
//!
//! A part is a move, a hold, a ripple or a retraction. Every change of velocity follows a quarter sine, so that
//! the acceleration stays within its limit; in a program it is a [`Segment::Ripple`] of a quarter period.

use crate::limits::Limits;
use core::f64::consts::{FRAC_PI_2, TAU};
use stylet_scenario::{Motion, Segment};

/// Largest number of parts of a program.
pub const MAX_PARTS: usize = 6;
/// Coordinates per part: kind, speed, length, ripple amplitude, frequency.
const COORDINATES_PER_PART: usize = 5;
/// Dimension of the unit cube: number of parts, depth, and the parts.
pub const DIMENSIONS: usize = 2 + MAX_PARTS * COORDINATES_PER_PART;

/// Share of a limit that is used, so that rounding stays below it.
const LIMIT_SHARE: f64 = 0.999;
/// Shortest change of velocity in s; it also lasts at least one sampling interval.
const MIN_RAMP_S: f64 = 0.02;
/// Lowest mean speed as a share of the limit.
const MIN_SPEED_SHARE: f64 = 0.12;
/// Ripple frequencies in Hz: slower ones are shorter than one period, faster ones exceed a robot's bandwidth.
const RIPPLE_HZ: (f64, f64) = (0.2, 2.0);
/// Durations of holds in s: relaxation takes some seconds.
const HOLD_S: (f64, f64) = (1.0, 8.0);

/// Initial position and sampling of an insertion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StartConditions {
    /// Position of the tip at time zero in m.
    pub start_m: f64,
    /// Position of the surface in m.
    pub surface_m: f64,
    /// Largest position in m, slightly beyond the tissue, independent of the limits.
    pub max_depth_m: f64,
    /// Sampling rate in Hz.
    pub sample_hz: f64,
}

/// Builds a program and tracks the velocity at the end of its last segment.
struct ProgramBuilder<'a> {
    limits: &'a Limits,
    sample_hz: f64,
    segments: Vec<Segment>,
    speed_mps: f64,
}

impl ProgramBuilder<'_> {
    /// Duration in s of a change of velocity (m/s).
    fn ramp_s(&self, change_mps: f64) -> f64 {
        let least = MIN_RAMP_S.max(1.0 / self.sample_hz);
        (change_mps.abs() * FRAC_PI_2 / (LIMIT_SHARE * self.limits.acceleration_mps2)).max(least)
    }

    /// Changes to another velocity.
    fn change_speed(&mut self, speed_mps: f64) {
        let change = speed_mps - self.speed_mps;
        if change == 0.0 {
            return;
        }
        let duration_s = self.ramp_s(change);
        self.segments.push(Segment::Ripple {
            velocity_mps: self.speed_mps,
            amplitude_mps: change,
            frequency_hz: 0.25 / duration_s,
            duration_s,
        });
        self.speed_mps = speed_mps;
    }

    /// Travels a distance (m, in the direction of the velocity).
    fn travel(&mut self, speed_mps: f64, distance_m: f64) {
        self.change_speed(speed_mps);
        self.segments
            .push(Segment::Move { velocity_mps: speed_mps, duration_s: distance_m / speed_mps.abs() });
    }

    fn hold(&mut self, duration_s: f64) {
        self.change_speed(0.0);
        self.segments.push(Segment::Hold { duration_s });
    }

    /// Travels a distance at a rippled velocity over whole periods, so that it ends at the mean velocity.
    fn ripple(&mut self, speed_mps: f64, amplitude_mps: f64, frequency_hz: f64, distance_m: f64) {
        self.change_speed(speed_mps);
        let periods = (distance_m / speed_mps * frequency_hz).round().max(1.0);
        let duration_s = distance_m / speed_mps;
        self.segments.push(Segment::Ripple {
            velocity_mps: speed_mps,
            amplitude_mps,
            frequency_hz: periods / duration_s,
            duration_s,
        });
    }
}

fn between(u: f64, (low, high): (f64, f64)) -> f64 {
    low + (high - low) * u
}

fn log_between(u: f64, (low, high): (f64, f64)) -> f64 {
    low * libm::pow(high / low, u)
}

/// The motion of a point of the unit cube; `None` when it violates the limits.
#[must_use]
pub fn motion_from_point(point: &[f64], limits: &Limits, begin: &StartConditions) -> Option<Motion> {
    let at = |k: usize| point.get(k).copied().unwrap_or(0.5).clamp(0.0, 1.0);
    let parts = 2 + ((at(0) * (MAX_PARTS - 1) as f64) as usize).min(MAX_PARTS - 2);
    let deepest = LIMIT_SHARE * (limits.depth_m.min(begin.max_depth_m) - begin.start_m);
    let aim_m = deepest * between(at(1), (0.75, 1.0));
    // A program that takes too long is made faster within the speed limit.
    (0..4).find_map(|turn| {
        let least = MIN_SPEED_SHARE + (0.75 - MIN_SPEED_SHARE) * f64::from(turn) / 3.0;
        let motion = build_program(parts, aim_m, least, &at, limits, begin);
        within_limits(&motion, limits).then_some(motion)
    })
}

fn build_program(
    parts: usize,
    aim_m: f64,
    slowest: f64,
    at: &impl Fn(usize) -> f64,
    limits: &Limits,
    begin: &StartConditions,
) -> Motion {
    let most_mps = LIMIT_SHARE * limits.speed_mps;
    let mut b = ProgramBuilder { limits, sample_hz: begin.sample_hz, segments: Vec::new(), speed_mps: 0.0 };
    let coordinate = |part: usize, which: usize| at(2 + part * COORDINATES_PER_PART + which);
    // For most points the last part is a retraction, which separates friction from effects independent of the
    // direction.
    let back_last = coordinate(parts - 1, 0) < 0.85;
    let forward = |part: usize| {
        let last = part + 1 == parts;
        !(last && back_last) && (part == 0 || coordinate(part, 0) >= 0.25)
    };
    let shares: f64 = (0..parts).filter(|p| forward(*p)).map(|p| 0.2 + coordinate(p, 2)).sum();
    // Retractions in between are travelled again: the same depth is passed twice.
    let retracted: f64 = (0..parts)
        .filter(|p| !forward(*p) && *p + 1 < parts && coordinate(*p, 0) < 0.1)
        .map(|p| 0.05 + 0.1 * coordinate(p, 2))
        .sum();
    for part in 0..parts {
        let speed = most_mps * log_between(coordinate(part, 1), (slowest, 0.95));
        let share = 0.2 + coordinate(part, 2);
        if part + 1 == parts && back_last {
            b.change_speed(0.0);
            b.travel(-speed, aim_m * between(coordinate(part, 2), (0.15, 0.8)));
        } else if forward(part) {
            let distance_m = aim_m * (1.0 + retracted) * share / shares;
            let hz = log_between(coordinate(part, 4), RIPPLE_HZ);
            // Speed and acceleration limit the amplitude; whole periods change the frequency by up to half a
            // period.
            let periods = distance_m / speed * hz;
            let most = (most_mps - speed)
                .min(LIMIT_SHARE * limits.acceleration_mps2 / (TAU * hz * (1.0 + 0.5 / periods.max(0.5))));
            let desired = speed * between(coordinate(part, 3), (0.2, 1.6));
            let amplitude = desired.min(most);
            if coordinate(part, 0) > 0.45 && amplitude > 0.05 * speed && periods > 0.8 {
                b.ripple(speed, amplitude, hz, distance_m);
            } else {
                b.travel(speed, distance_m);
            }
        } else if coordinate(part, 0) < 0.1 {
            b.travel(-speed, aim_m * (0.05 + 0.1 * coordinate(part, 2)));
        } else {
            b.hold(log_between(coordinate(part, 2), HOLD_S));
        }
    }
    b.change_speed(0.0);
    Motion::Program { start_m: begin.start_m, segments: b.segments }
}

/// Largest speed (m/s) and acceleration (m/s²) of a program in closed form; velocity steps count as infinite
/// acceleration.
fn extremes(segments: &[Segment]) -> (f64, f64) {
    let (mut speed, mut acceleration) = (0.0_f64, 0.0_f64);
    let mut last = 0.0;
    for s in segments {
        let (from, to) = match *s {
            Segment::Move { velocity_mps, .. } => {
                speed = speed.max(velocity_mps.abs());
                (velocity_mps, velocity_mps)
            }
            Segment::Hold { .. } => (0.0, 0.0),
            Segment::Ripple { velocity_mps, amplitude_mps, frequency_hz, duration_s } => {
                let end = velocity_mps + amplitude_mps * libm::sin(TAU * frequency_hz * duration_s);
                let ends = velocity_mps.abs().max(end.abs());
                let quarter = frequency_hz * duration_s <= 0.25 + 1e-9;
                let crest = velocity_mps.abs() + amplitude_mps.abs();
                speed = speed.max(if quarter { ends } else { crest });
                acceleration = acceleration.max(amplitude_mps.abs() * TAU * frequency_hz);
                (velocity_mps, end)
            }
        };
        if (from - last).abs() > 1e-9 {
            acceleration = f64::INFINITY;
        }
        last = to;
    }
    if last.abs() > 1e-9 {
        acceleration = f64::INFINITY;
    }
    (speed, acceleration)
}

/// Whether a motion satisfies the limits of depth, speed, acceleration and duration, from rest to rest.
#[must_use]
pub fn within_limits(motion: &Motion, limits: &Limits) -> bool {
    let Motion::Program { segments, .. } = motion else { return false };
    let Some(plan) = motion.plan() else { return false };
    let (speed, acceleration) = extremes(segments);
    plan.duration_s() <= limits.duration_s
        && plan.deepest_m() <= limits.depth_m
        && speed <= limits.speed_mps
        && acceleration <= limits.acceleration_mps2
}

/// Why no motion can satisfy the limits, and what would help; `None` when one may.
#[must_use]
pub fn infeasibility(limits: &Limits, begin: &StartConditions) -> Option<(String, String)> {
    let into_m = limits.depth_m - begin.surface_m;
    if into_m < MIN_DEPTH_M {
        return Some((
            format!(
                "depth_m is {} m and the surface lies at {:.4} m, so the needle would not reach {:.0} mm into the tissue",
                limits.depth_m,
                begin.surface_m,
                MIN_DEPTH_M * 1e3
            ),
            format!("depth_m must be at least {:.4} m", begin.surface_m + MIN_DEPTH_M),
        ));
    }
    let distance_m = begin.surface_m + MIN_DEPTH_M - begin.start_m;
    let fastest_s = distance_m / limits.speed_mps + FRAC_PI_2 * limits.speed_mps / limits.acceleration_mps2;
    // Without reaching the speed, half of the distance is travelled at constant acceleration.
    let by_acceleration_s = 2.0 * (distance_m / limits.acceleration_mps2).sqrt();
    let least_s = fastest_s.min(by_acceleration_s.max(distance_m / limits.speed_mps));
    if limits.duration_s < least_s {
        return Some((
            format!(
                "duration_s is {} s, and {:.1} mm from the start to {:.0} mm into the tissue take {least_s:.2} s at {} m/s and {} m/s²",
                limits.duration_s,
                distance_m * 1e3,
                MIN_DEPTH_M * 1e3,
                limits.speed_mps,
                limits.acceleration_mps2
            ),
            "give it more time, or allow a higher speed or acceleration".to_owned(),
        ));
    }
    None
}

/// Smallest useful depth of an insertion into the tissue in m.
pub const MIN_DEPTH_M: f64 = 0.002;

/// Point `k` of an additive low-discrepancy sequence (Roberts 2018: powers of the root of `x^(d+1) = x + 1`).
#[must_use]
pub fn low_discrepancy_point(k: usize) -> Vec<f64> {
    let d = DIMENSIONS as i32;
    let mut g = 1.0 + 0.7 / f64::from(d);
    for _ in 0..60 {
        g = libm::pow(1.0 + g, 1.0 / f64::from(d + 1));
    }
    (1..=d).map(|i| (0.5 + (k as f64 + 1.0) * libm::pow(g, f64::from(-i))).fract()).collect()
}
