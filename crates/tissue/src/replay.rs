//! Kinematic replay: the force law along a given motion, without rigid-body dynamics.

use crate::force::{Rupture, TissueForce};
use crate::force_law::ForceLaw;
use crate::force_law_state::ForceLawState;

/// Steps a force law along `(time_s, z_m, v_mps)` samples and passes each force to `sink`.
///
/// The force at a sample is bit for bit that of a rigid-body simulation with the same `t, z, v` at the same samples.
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
