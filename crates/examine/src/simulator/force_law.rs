//! What a law has to answer: the force at the needle's base between two instants, with its jumps.

use super::motion_path::MotionState;

/// The force at an instant. Two knots of one instant are a jump.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForceKnot {
    /// Time in s.
    pub t: f64,
    /// Force of the tissue at the needle's base in N.
    pub force_n: f64,
}

/// A tissue through which a needle goes.
pub trait ForceLaw {
    /// Puts the base at its first point and returns the force there.
    fn start(&mut self, at: &MotionState) -> f64;

    /// Goes on to `to` on a stretch in which the base moves smoothly; adds the knots after the stretch's beginning.
    fn advance(&mut self, to: &MotionState, knots: &mut Vec<ForceKnot>);

    /// The base's speed changes at once, at the instant reached.
    fn jump(&mut self, to: &MotionState, knots: &mut Vec<ForceKnot>);

    /// Instants (s) at which layers gave way so far, in the order of the layers.
    fn ruptures(&self) -> &[f64];

    /// Elastic force in N that each of these ruptures released, at once or over some travel.
    fn released_n(&self) -> &[f64];

    /// Force on the tip in N: the force at the base without the friction along the shaft.
    fn tip_n(&self) -> f64;
}
