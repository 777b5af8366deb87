//! Recordings as streams. Their true punctures are unknown; clear falls of the force stand for them.

use super::simulate_stream::{Stream, TruePuncture};
use serde::{Deserialize, Serialize};

/// Row of the recordings in the table.
pub const MEASURED_ROW: &str = "measured";
/// Description of this row.
pub const MEASURED_DESCRIPTION: &str =
    "recordings of real insertions; reference are falls of the measured force";

/// Reference of a recording, as in the key.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MeasuredReference {
    /// Name of the recording.
    pub recording: String,
    /// Nominal rate in Hz.
    pub rate_hz: f64,
    /// Falls that a detector should find.
    pub punctures: Vec<TruePuncture>,
    /// Smaller ones: an event there is neither a hit nor a false alarm.
    pub minor: Vec<TruePuncture>,
}

/// A recording with its reference.
#[derive(Clone, Debug, PartialEq)]
pub struct MeasuredStream {
    /// Samples: time in s, position in m, force in N.
    pub samples: Vec<[f64; 3]>,
    /// Reference.
    pub reference: MeasuredReference,
}

/// The recordings of the row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeasuredRow {
    /// How the reference was derived.
    pub derivation: String,
    /// Recordings.
    pub streams: Vec<MeasuredStream>,
}

impl MeasuredStream {
    /// The stream for scoring.
    #[must_use]
    pub fn into_stream(self) -> Stream {
        let column = |k: usize| self.samples.iter().map(|sample| sample[k]).collect();
        Stream {
            row: MEASURED_ROW,
            rate_hz: self.reference.rate_hz,
            path: None,
            time_s: column(0),
            position_m: column(1),
            force_n: column(2),
            tip_n: Vec::new(),
            punctures: self.reference.punctures,
            minor: self.reference.minor,
        }
    }
}
