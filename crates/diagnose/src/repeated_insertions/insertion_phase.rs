//! Phases of an insertion as a function of time.

use super::segmented_recording::SegmentedRecording;

/// Phase of an insertion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InsertionPhase {
    /// In air and up to the first rupture.
    Loading,
    /// Advance after the first rupture.
    Cutting,
    /// At rest at the deepest point.
    Hold,
    /// Retraction.
    Retraction,
}

/// Phase at a time; the first rupture is at `first_s` (s).
#[must_use]
pub fn phase_at(run: &SegmentedRecording, time_s: f64, first_s: f64) -> InsertionPhase {
    let at = |i: usize| run.recording.time_s.get(i).copied().unwrap_or(f64::INFINITY);
    if time_s >= at(run.phases.retraction) {
        InsertionPhase::Retraction
    } else if time_s > at(run.phases.deepest) {
        InsertionPhase::Hold
    } else if time_s >= first_s {
        InsertionPhase::Cutting
    } else {
        InsertionPhase::Loading
    }
}

#[cfg(test)]
mod tests {
    use super::{InsertionPhase, phase_at};
    use crate::repeated_insertions::random_effects_population::tests::run;
    use stylet_identify::model::NO_RUPTURE;

    #[test]
    fn phases_are_in_order() {
        let run = run();
        let t = &run.recording.time_s;
        let (deepest, back) = (t[run.phases.deepest], t[run.phases.retraction]);
        for (at, first, wanted) in [
            (2.0, 3.0, InsertionPhase::Loading),
            (3.0, 3.0, InsertionPhase::Cutting),
            (deepest, 3.0, InsertionPhase::Cutting),
            (deepest, NO_RUPTURE, InsertionPhase::Loading),
            (deepest + 1e-6, 3.0, InsertionPhase::Hold),
            (back - 1e-6, 3.0, InsertionPhase::Hold),
            (back, 3.0, InsertionPhase::Retraction),
            (99.0, NO_RUPTURE, InsertionPhase::Retraction),
        ] {
            assert_eq!(phase_at(&run, at, first), wanted, "{at}");
        }
    }
}
