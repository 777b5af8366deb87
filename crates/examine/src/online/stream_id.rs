//! Identifier of a stream: all its properties are functions of these words and numbers.

use crate::cases::case_id::{Severity, World, mix};
use crate::named_enum::named_enum;
use serde::{Deserialize, Serialize};

named_enum! {
    /// Difficulty of the streams of a row.
    Row {
        Constant = "constant": "constant speed; white noise of 10, 25, 50 mN",
        Sinusoid = "sinusoid": "one period of a slow sinusoid; white noise of 10, 25, 50 mN",
        Coloured = "coloured_noise": "AR(1) noise of 0.5, 0.8, 0.95",
        WeakDrops = "weak_drops": "drops of 0.4 to 0.6, 0.2 to 0.4, 0.1 to 0.2 N",
        SoftBoundary = "soft_boundary": "the force is released over 0.5, 1, 2 mm",
        ThinLayer = "thin_layer": "one layer of 3, 2, 1 mm",
        Hold = "hold": "1, 2, 4 pauses",
        Ripple = "ripple": "a ripple of 20, 50, 90 % of the speed at 0.3 to 2 Hz",
        Gaps = "gaps": "3, 10, 30 % of the samples missing, up to 20 in a row",
        Rate50Hz = "rate_50_hz": "50 Hz; white noise of 10, 25, 50 mN",
        Rate1kHz = "rate_1_khz": "1 kHz; white noise of 10, 25, 50 mN",
        Rate5kHz = "rate_5_khz": "5 kHz; white noise of 10, 25, 50 mN",
        Offset = "offset": "a sensor that was not zeroed: 0.5, 2, 10 N",
        Drift = "drift": "a zero that drifts by 5, 15, 30 mN/s",
        Tare = "tare": "a step of the zero of 0.2, 0.5, 2 N, up or down",
        Delay = "delay": "the force late by 5, 15, 30 ms",
        Lag = "lag": "a low-pass filter of 5, 15, 40 ms",
        TwelveBits = "twelve_bits": "a 12-bit converter over +-20, 50, 100 N",
        HandHeld = "hand_held": "a hand: 1 to 40 mm/s, pauses, small retractions, tremor of 8 to 12 Hz and 0.02, 0.05, 0.1 mm, bumps from the side",
        StickSlip = "stick_slip": "a drive that sticks and jumps by 0.2, 0.5, 1 mm",
        Breathing = "breathing": "tissue that breathes by 0.5, 1, 2 mm",
        Reinsertion = "reinsertion": "1, 2, 3 times back and in again on the old track",
        Membranes = "membranes": "thin membranes with drops of 0.3, 0.15, 0.05 N between the layers",
        Tearing = "tearing": "layers that tear in three steps, over 0.6, 1.6, 3 mm",
        DelayedPuncture = "delayed_puncture": "punctures during a pause, 5, 10, 15 % below the puncture force",
    }
}

named_enum! {
    /// Streams for the development or for the test of a detector.
    Split {
        Make = "make": "for choosing settings; the truth is exported, too",
        Judge = "judge": "for judging; the truth stays in the key",
    }
}

/// Identifier of a stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub struct StreamId {
    /// Tissue law.
    pub world: World,
    /// Row of the table.
    pub row: Row,
    /// Severity of the row's difficulty.
    pub severity: Severity,
    /// Set of streams to which this one belongs.
    pub split: Split,
    /// Seed of the generator.
    pub seed: u64,
    /// Number of the stream in its row.
    pub index: u64,
}

impl StreamId {
    /// Seed of this stream.
    #[must_use]
    pub fn stream_seed(&self) -> u64 {
        let mut h = self.seed ^ 0x0a_11_5e_ed_0b_a5_e5_01;
        for part in [self.world as u64, self.row as u64, self.split as u64, self.index] {
            h = mix(h ^ part.wrapping_mul(0x9e37_79b9_7f4a_7c15));
        }
        h
    }
}

/// The streams of a benchmark: `cases` per row, severities in turn.
#[must_use]
pub fn stream_ids(world: World, rows: &[Row], split: Split, cases: u64, seed: u64) -> Vec<StreamId> {
    rows.iter()
        .flat_map(|&row| {
            (0..cases).map(move |index| {
                let severity = Severity::ALL[(index % 3) as usize];
                StreamId { world, row, severity, split, seed, index }
            })
        })
        .collect()
}
