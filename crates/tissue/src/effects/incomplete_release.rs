use crate::effect::{Effect, Memory, Moment, Place};
use crate::slab::Slab;

/// A rupture that does not release everything: a share `rho` of `f_K` at rupture stays as a
/// constant tip force until the next rupture or reversal.
///
/// Source: Okamura, Simone, O'Leary 2004 (liver: drop 0.66 N of 2.30 N). Signature: the force
/// does not fall to the friction line after a puncture.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct IncompleteRelease {
    /// Share that stays, `rho`, 0 to 1. Neutral: 0.
    pub fraction: f64,
}

impl Effect for IncompleteRelease {
    fn id(&self) -> &'static str {
        "incomplete_release"
    }
    fn place(&self) -> Place {
        Place::Release
    }
    fn is_neutral(&self) -> bool {
        self.fraction == 0.0
    }
    fn on_rupture(&self, released_n: f64, _z_m: f64, memory: &mut Memory) {
        memory[0] = self.fraction * released_n;
    }
    fn tip_force(&self, moment: &Moment, _slabs: &[Slab], memory: &mut Memory) -> f64 {
        if moment.v_mps < -crate::effect::SGN_DEAD_BAND_MPS {
            memory[0] = 0.0;
        }
        memory[0]
    }
}
