//! Interface of a force law: the force at the needle's base between two times, with its jumps.

use super::motion_path::MotionState;

/// The force at one time. Two knots at the same time are a jump.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForceKnot {
    /// Time in s.
    pub t: f64,
    /// Force of the tissue at the needle's base in N.
    pub force_n: f64,
}

/// Force law of a tissue with its state.
pub trait ForceLaw {
    /// Puts the base at its first point and returns the force there.
    fn start(&mut self, at: &MotionState) -> f64;

    /// Advances to `to` over an interval in which the base moves smoothly; adds the knots of this interval.
    fn advance(&mut self, to: &MotionState, knots: &mut Vec<ForceKnot>);

    /// Changes the base's velocity abruptly at the present time.
    fn jump(&mut self, to: &MotionState, knots: &mut Vec<ForceKnot>);

    /// Times (s) of the ruptures so far, in the order of the layers.
    fn ruptures(&self) -> &[f64];

    /// Elastic force in N that each of these ruptures released, at once or over some travel.
    fn released_n(&self) -> &[f64];

    /// Force on the tip in N: the force at the base without the friction along the shaft.
    fn tip_n(&self) -> f64;
}
