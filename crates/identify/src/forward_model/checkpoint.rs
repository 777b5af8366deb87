use super::time_stepper::TimeStepper;
use crate::rupture_likelihood::RuptureEvent;
use stylet_tissue::{ForceLawState, MeasurementState};

/// Complete state of a replay before piece `piece`.
#[derive(Clone, Debug)]
pub(super) struct Checkpoint {
    pub(super) piece: usize,
    pub(super) state: ForceLawState,
    pub(super) chain: Option<MeasurementState>,
    pub(super) ruptured_layers: usize,
    pub(super) threshold_n: f64,
    pub(super) transient_until_s: f64,
    pub(super) broken: Vec<bool>,
    pub(super) block: u32,
    pub(super) force_integral: f64,
    pub(super) ruptures: Vec<RuptureEvent>,
}

/// Borrowed state of a running replay before piece `piece`.
pub(super) struct CheckpointView<'a, 'b> {
    pub(super) piece: usize,
    pub(super) stepper: &'a TimeStepper<'b>,
    pub(super) broken: &'a [bool],
    pub(super) block: u32,
    pub(super) force_integral: f64,
}

impl CheckpointView<'_, '_> {
    pub(super) fn to_checkpoint(&self) -> Checkpoint {
        Checkpoint {
            piece: self.piece,
            state: self.stepper.state,
            chain: self.stepper.chain.clone(),
            ruptured_layers: self.stepper.ruptured_layers,
            threshold_n: self.stepper.threshold_n,
            transient_until_s: self.stepper.transient_until_s,
            broken: self.broken.to_vec(),
            block: self.block,
            force_integral: self.force_integral,
            ruptures: self.stepper.ruptures.clone(),
        }
    }

    /// Whether a replay continued from here equals one continued from `other`.
    pub(super) fn same_future_as(&self, other: &Checkpoint) -> bool {
        let stepper = self.stepper;
        self.piece == other.piece
            && stepper.ruptured_layers == other.ruptured_layers
            && self.block == other.block
            && self.force_integral == other.force_integral
            && stepper.threshold_n == other.threshold_n
            && stepper.transient_until_s == other.transient_until_s
            && stepper.state == other.state
            && stepper.chain == other.chain
            && self.broken == other.broken
            && stepper.ruptures.get(stepper.ruptured_layers..) == other.ruptures.get(other.ruptured_layers..)
    }
}
