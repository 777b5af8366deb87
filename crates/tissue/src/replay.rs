//! The kinematic replay: recorded or ideal motion fed to the law, no rigid bodies.

use crate::force::{Rupture, TissueForce};
use crate::law::Law;
use crate::state::LawState;

/// Feeds `(time_s, z_m, v_mps)` samples to a law and calls `sink` with each force.
///
/// The force at a sample is the same, bit for bit, as that of a rigid-body run which reaches the
/// same `t, z, v` at the same samples.
pub fn replay(
    law: &Law,
    motion: impl IntoIterator<Item = (f64, f64, f64)>,
    mut on_rupture: impl FnMut(Rupture),
    mut sink: impl FnMut(TissueForce),
) -> LawState {
    let mut state = LawState::default();
    for (time_s, z_m, v_mps) in motion {
        let force = law.step(&mut state, time_s, z_m, v_mps, &mut on_rupture);
        sink(force);
    }
    state
}
