//! Motions of the needle's base (docs/reference/model.md, section 3): pieces whose borders are known, so that the simulation can stop at
//! each of them.

use core::f64::consts::{PI, TAU};

/// Position, velocity and acceleration of the base at one time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MotionState {
    /// Time in s.
    pub t: f64,
    /// Position in m.
    pub z: f64,
    /// Velocity in m/s.
    pub v: f64,
    /// Acceleration in m/s².
    pub a: f64,
}

/// One piece of a path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MotionPiece {
    /// Mean speed (m/s) with a ripple of amplitude (m/s) and frequency (Hz) on it, for a duration (s). A hold has
    /// neither speed nor ripple, a retraction a negative speed.
    Move {
        /// Mean speed in m/s.
        speed_mps: f64,
        /// Amplitude of the ripple in m/s.
        ripple_mps: f64,
        /// Frequency of the ripple in Hz.
        ripple_hz: f64,
        /// Duration in s.
        duration_s: f64,
    },
    /// `A (1 - cos(2 pi f t))`: starts from rest and returns.
    Swing {
        /// Amplitude `A` in m.
        amplitude_m: f64,
        /// Frequency `f` in Hz.
        frequency_hz: f64,
        /// Duration in s.
        duration_s: f64,
    },
    /// From one speed (m/s) to another along half a cosine, with a ripple on it as in `Move`. Without a jump of the speed
    /// where the ripple has whole periods.
    Blend {
        /// Speed at the beginning in m/s.
        from_mps: f64,
        /// Speed at the end in m/s.
        to_mps: f64,
        /// Amplitude of the ripple in m/s.
        ripple_mps: f64,
        /// Frequency of the ripple in Hz.
        ripple_hz: f64,
        /// Duration in s.
        duration_s: f64,
    },
}

impl MotionPiece {
    /// A steady speed.
    #[must_use]
    pub fn constant(speed_mps: f64, duration_s: f64) -> Self {
        MotionPiece::Move { speed_mps, ripple_mps: 0.0, ripple_hz: 0.0, duration_s }
    }

    fn duration_s(&self) -> f64 {
        match *self {
            MotionPiece::Move { duration_s, .. }
            | MotionPiece::Swing { duration_s, .. }
            | MotionPiece::Blend { duration_s, .. } => duration_s,
        }
    }

    fn at(&self, t: f64) -> MotionState {
        match *self {
            MotionPiece::Move { speed_mps, ripple_mps, ripple_hz, .. } => {
                if ripple_mps == 0.0 {
                    return MotionState { t, z: speed_mps * t, v: speed_mps, a: 0.0 };
                }
                let w = TAU * ripple_hz;
                let (sin, cos) = libm::sincos(w * t);
                MotionState {
                    t,
                    z: speed_mps * t + ripple_mps / w * (1.0 - cos),
                    v: speed_mps + ripple_mps * sin,
                    a: ripple_mps * w * cos,
                }
            }
            MotionPiece::Swing { amplitude_m, frequency_hz, .. } => {
                let w = TAU * frequency_hz;
                let (sin, cos) = libm::sincos(w * t);
                MotionState {
                    t,
                    z: amplitude_m * (1.0 - cos),
                    v: amplitude_m * w * sin,
                    a: amplitude_m * w * w * cos,
                }
            }
            MotionPiece::Blend { from_mps, to_mps, ripple_mps, ripple_hz, duration_s } => {
                let ripple = MotionPiece::Move { speed_mps: 0.0, ripple_mps, ripple_hz, duration_s }.at(t);
                let half = 0.5 * (to_mps - from_mps);
                let w = PI / duration_s;
                let (sin, cos) = libm::sincos(w * t);
                MotionState {
                    t,
                    z: from_mps * t + half * (t - sin / w) + ripple.z,
                    v: from_mps + half * (1.0 - cos) + ripple.v,
                    a: half * w * sin + ripple.a,
                }
            }
        }
    }
}

/// A path: pieces one after another.
#[derive(Clone, Debug, PartialEq)]
pub struct MotionPath {
    pieces: Vec<MotionPiece>,
    /// Time (s) and position (m) at the start of each piece, and at the end.
    starts: Vec<(f64, f64)>,
}

impl MotionPath {
    /// The path from `start_m` through the pieces.
    #[must_use]
    pub fn new(start_m: f64, pieces: Vec<MotionPiece>) -> Self {
        let mut starts = vec![(0.0, start_m)];
        let (mut t, mut z) = (0.0, start_m);
        for piece in &pieces {
            z += piece.at(piece.duration_s()).z;
            t += piece.duration_s();
            starts.push((t, z));
        }
        Self { pieces, starts }
    }

    /// Duration in s.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.starts.last().map_or(0.0, |s| s.0)
    }

    /// Position of the base in m at the end.
    #[must_use]
    pub fn end_m(&self) -> f64 {
        self.starts.last().map_or(0.0, |s| s.1)
    }

    /// Position of the base in m at `t`.
    #[must_use]
    pub fn position_m(&self, t: f64) -> f64 {
        let piece = self.starts.partition_point(|s| s.0 <= t).saturating_sub(1);
        self.at(piece, t).z
    }

    /// Number of pieces.
    #[must_use]
    pub fn len(&self) -> usize {
        self.pieces.len()
    }

    /// Whether there is no piece.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.pieces.is_empty()
    }

    /// End of piece `index` in s.
    #[must_use]
    pub fn piece_end_s(&self, index: usize) -> f64 {
        self.starts.get(index + 1).map_or(f64::INFINITY, |s| s.0)
    }

    /// The base at `t` in piece `index`.
    #[must_use]
    pub fn at(&self, index: usize, t: f64) -> MotionState {
        let (Some(piece), Some(&(t0, z0))) = (self.pieces.get(index), self.starts.get(index)) else {
            return MotionState { t, z: self.starts.last().map_or(0.0, |s| s.1), ..MotionState::default() };
        };
        let p = piece.at(t - t0);
        MotionState { t, z: z0 + p.z, ..p }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_is_continuous_in_position_and_its_speed_is_its_slope() {
        let path = MotionPath::new(
            -0.005,
            vec![
                MotionPiece::constant(0.003, 4.0),
                MotionPiece::Move { speed_mps: 0.002, ripple_mps: 0.001, ripple_hz: 0.7, duration_s: 3.3 },
                MotionPiece::constant(0.0, 1.0),
                MotionPiece::Swing { amplitude_m: 0.01, frequency_hz: 0.05, duration_s: 12.0 },
                MotionPiece::Blend {
                    from_mps: 0.02,
                    to_mps: -0.004,
                    ripple_mps: 0.003,
                    ripple_hz: 9.0,
                    duration_s: 1.7,
                },
                MotionPiece::constant(-0.004, 2.0),
            ],
        );
        let middle = path.piece_end_s(1) - 0.4;
        assert_eq!(path.position_m(middle), path.at(1, middle).z);
        for piece in 0..path.len() {
            let end = path.piece_end_s(piece);
            let gap = path.at(piece, end).z - path.at(piece + 1, end).z;
            assert!(gap.abs() < 1e-15, "piece {piece}: {gap}");
            let t = end - 0.3;
            let h = 1e-5;
            let slope = (path.at(piece, t + h).z - path.at(piece, t - h).z) / (2.0 * h);
            assert!((slope - path.at(piece, t).v).abs() < 1e-9);
        }
    }
}
