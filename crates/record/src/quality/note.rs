//! Quality notes and their kinds. The thresholds are in the modules of the checks.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// Kind of a [`QualityNote`], most consequential first. Serialises in snake case. *Blocking*: no diagnosis from such a
/// recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum QualityKind {
    /// The force is constant in all samples: a dead sensor. Blocking. Numbers: `value`.
    Dead,
    /// While the needle advances the force decreases, by 8 times its noise and 3 times its increase, and is negative.
    /// Blocking. Numbers: `wrong_n`, `right_n`.
    Reversed,
    /// Over the motion the force does work on the needle, more than 0.3 of the sum of its absolute values: the position has the
    /// other sign. Blocking. Numbers: `work_j`, `absolute_j`.
    ReversedPosition,
    /// The position advances by less than 5 % of its travel: a retraction alone, or a position of the other sign. Blocking.
    /// Numbers: `advance_m`, `travel_m`.
    OnlyRetraction,
    /// Means over 0.1 s and more are uncorrelated like noise: no contact with tissue. Blocking. Numbers: `low_n`, `high_n`.
    InAir,
    /// Fewer than 50 samples. Blocking. Numbers: `samples`, `least`.
    TooShort,
    /// The position never changes by a micrometre (blocking; numbers: `value`, `travel_m`), or the force is constant over
    /// more than 20 samples while the needle moves (numbers: `runs`, `longest`, `at_s`, `value`).
    Stuck,
    /// Among repeats: force over depth more than 5 robust standard deviations (RMS over 24 depths) from the others.
    /// Numbers: `distance`, `typical_n`, `others_n`.
    OutlierRecording,
    /// Rows were dropped because their time stamps ran backward or repeated, or because the last one is cut short. Numbers:
    /// `dropped`, `kept`; `lines`.
    RepairedRows,
    /// Equal time stamps were spread evenly. Numbers: `samples`, `bursts`.
    Retimed,
    /// Columns of other topics, rows or files were interpolated on the time stamps of the force. Numbers: `samples`.
    Interpolated,
    /// Units that names, a row of units or types gave were applied, or components projected on an axis.
    Converted,
    /// A quantity looks as if it had another unit: position range above 2 m, speed above 1 m/s (99th percentile), force above
    /// 500 N (not blocking), median interval of 1 s and more, or a measured velocity that is not the slope of the position.
    /// Blocking, except for a velocity within 20 times the slope. Numbers: `value`, `limit`.
    UnitMixUp,
    /// Intervals above five median intervals. Numbers: `count`, `largest_s`, `at_s` (start of the largest),
    /// `median_interval_s`.
    Gaps,
    /// The force is constant at its extreme: at least two runs of 5 or more equal samples that hold most of the samples at
    /// this value, or one run of 20 or more while the needle moves by more than 1 % of its range. A force of exactly zero
    /// does not count. Numbers: `value`, `runs`, `samples`, `longest`, `at_s`.
    Saturation,
    /// Isolated samples (one or two) of force or position more than 8 robust standard deviations from the median of the 11
    /// around them and from the samples on both sides; not within 5 samples of the ends. Numbers: `count`, `largest`
    /// (distance from the median, SI unit), `at_s`, `robust_sd`.
    Spikes,
    /// The intervals without gaps scatter by more than 5 % (standard deviation over median). Numbers: `sd_s`, `shortest_s`,
    /// `longest_s`, `median_interval_s`.
    Jitter,
    /// Force or position takes few values on a grid: less than 20 % of the samples are distinct, and the steps between the
    /// values are multiples of the smallest one. Numbers: `smallest_step` (SI unit), `distinct`, `distinct_ratio`.
    Quantisation,
    /// The recording was downsampled before use ([`mod@crate::downsample`]). Numbers: `from`, `to`, `together`.
    Downsampled,
    /// The zero of the force sensor steps during the recording, or differs from that of the first recording; found by the
    /// diagnosis. Numbers: `count`, `largest_n`, `at_s` (time of the largest), `offset_n` (zero at the start).
    ZeroStep,
}

/// A note on the quality of a recording.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct QualityNote {
    /// Kind of the note.
    pub kind: QualityKind,
    /// Message with the numbers and the remedy.
    pub message: String,
    /// Numbers by name; the unit is in the name or in [`QualityKind`].
    pub numbers: BTreeMap<String, f64>,
    /// Lines of the file (1-based); only for [`QualityKind::RepairedRows`].
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub lines: Vec<u64>,
    /// Whether a diagnosis from this recording is rejected.
    #[serde(default, skip_serializing_if = "is_false")]
    pub blocking: bool,
}

fn is_false(b: &bool) -> bool {
    !b
}

impl QualityNote {
    /// A blocking note.
    pub(crate) fn blocking<const N: usize>(
        kind: QualityKind,
        message: String,
        numbers: [(&str, f64); N],
    ) -> Self {
        Self { blocking: true, ..Self::new(kind, message, numbers) }
    }

    /// A note with its numbers by name, without lines, that does not block a diagnosis.
    #[must_use]
    pub fn new<'a>(
        kind: QualityKind,
        message: String,
        numbers: impl IntoIterator<Item = (&'a str, f64)>,
    ) -> Self {
        let numbers = numbers.into_iter().map(|(name, value)| (name.to_owned(), value)).collect();
        Self { kind, message, numbers, lines: Vec::new(), blocking: false }
    }
}

/// The note on dropped rows; `lines` in the order of the file.
pub(crate) fn repaired_rows(lines: Vec<u64>, kept: usize) -> QualityNote {
    const MAX_LISTED: usize = 12;
    let mut named = lines.iter().take(MAX_LISTED).map(u64::to_string).collect::<Vec<_>>().join(", ");
    if lines.len() > MAX_LISTED {
        named.push_str(&format!(" and {} more", lines.len() - MAX_LISTED));
    }
    let message = format!(
        "{} row(s) dropped because their time stamps run backward or repeat, {kept} kept: line(s) {named}",
        lines.len()
    );
    let numbers = [("dropped", lines.len() as f64), ("kept", kept as f64)];
    QualityNote { lines, ..QualityNote::new(QualityKind::RepairedRows, message, numbers) }
}
