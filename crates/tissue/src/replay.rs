//! The kinematic replay: recorded or ideal motion fed to the law, no rigid bodies.

use crate::force::{Rupture, TissueForce};
use crate::force_law::ForceLaw;
use crate::force_law_state::ForceLawState;

/// Feeds `(time_s, z_m, v_mps)` samples to a law and calls `sink` with each force.
///
/// The force at a sample is the same, bit for bit, as that of a rigid-body run which reaches the
/// same `t, z, v` at the same samples.
pub fn replay(
    law: &ForceLaw,
    motion: impl IntoIterator<Item = (f64, f64, f64)>,
    mut on_rupture: impl FnMut(Rupture),
    mut sink: impl FnMut(TissueForce),
) -> ForceLawState {
    let mut state = ForceLawState::default();
    for (time_s, z_m, v_mps) in motion {
        let force = law.step(&mut state, time_s, z_m, v_mps, &mut on_rupture);
        sink(force);
    }
    state
}
