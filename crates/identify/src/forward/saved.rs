use super::walk::Walk;
use crate::events::Event;
use stylet_tissue::{LawState, MeasurementState};

/// All that a replay remembers before a piece.
#[derive(Clone, Debug)]
pub(super) struct Saved {
    pub(super) piece: usize,
    pub(super) state: LawState,
    pub(super) chain: Option<MeasurementState>,
    pub(super) done: usize,
    pub(super) threshold_n: f64,
    pub(super) restless_s: f64,
    pub(super) broken: Vec<bool>,
    pub(super) block: u32,
    pub(super) sum: f64,
    pub(super) events: Vec<Event>,
}

/// Where a replay stands before a piece.
pub(super) struct Here<'a, 'b> {
    pub(super) piece: usize,
    pub(super) walk: &'a Walk<'b>,
    pub(super) broken: &'a [bool],
    pub(super) block: u32,
    pub(super) sum: f64,
}

impl Here<'_, '_> {
    pub(super) fn saved(&self) -> Saved {
        Saved {
            piece: self.piece,
            state: self.walk.state,
            chain: self.walk.chain.clone(),
            done: self.walk.done,
            threshold_n: self.walk.threshold_n,
            restless_s: self.walk.restless_s,
            broken: self.broken.to_vec(),
            block: self.block,
            sum: self.sum,
            events: self.walk.events.clone(),
        }
    }

    /// Whether everything from here on is the same.
    pub(super) fn leads_on_like(&self, other: &Saved) -> bool {
        let walk = self.walk;
        self.piece == other.piece
            && walk.done == other.done
            && self.block == other.block
            && self.sum == other.sum
            && walk.threshold_n == other.threshold_n
            && walk.restless_s == other.restless_s
            && walk.state == other.state
            && walk.chain == other.chain
            && self.broken == other.broken
            && walk.events.get(walk.done..) == other.events.get(other.done..)
    }
}
