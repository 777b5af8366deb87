use crate::effect::{Effect, Memory, Moment, Place, sgn};

/// Dry friction along the shaft: `f_B += c sgn(v) sum l_i`.
///
/// Source: Okamura, Simone, O'Leary 2004 (Karnopp model, per unit length). Signature: a plateau
/// that does not depend on speed, with a step at reversal; invisible at one constant velocity.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct CoulombFriction {
    /// Friction per metre of needle inside, `c` in N/m, zero or positive. Neutral: 0.
    pub c_n_per_m: f64,
}

impl Effect for CoulombFriction {
    fn id(&self) -> &'static str {
        "coulomb_friction"
    }
    fn place(&self) -> Place {
        Place::Friction
    }
    fn is_neutral(&self) -> bool {
        self.c_n_per_m == 0.0
    }
    fn shaft_force(&self, moment: &Moment, inside_m: f64, _memory: &mut Memory) -> f64 {
        self.c_n_per_m * sgn(moment.v_mps) * inside_m
    }
}
