use crate::rupture_likelihood::RuptureEvent;
use stylet_tissue::{ForceLawState, MeasurementState};

/// State of a replay before piece `piece`, without the strain of its layers.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ReplayState {
    pub(super) piece: usize,
    pub(super) ruptured_layers: usize,
    pub(super) block: u32,
    /// Integral of the force since the start of the block, in N s.
    pub(super) force_integral: f64,
    /// Puncture force in N of the active layer in the previous span.
    pub(super) threshold_n: f64,
    /// Until this time (s) a compliant needle or a lagging sensor is in transient after a jump.
    pub(super) transient_until_s: f64,
    pub(super) law: ForceLawState,
    pub(super) chain: Option<MeasurementState>,
    /// Whether the tip has reached each break position of the model.
    pub(super) broken: Vec<bool>,
}

/// A stored state, from which a replay can continue.
#[derive(Clone, Debug)]
pub(super) struct Checkpoint {
    pub(super) state: ReplayState,
    pub(super) ruptures: Vec<RuptureEvent>,
}
