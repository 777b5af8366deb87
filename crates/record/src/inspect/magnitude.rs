//! Units that magnitudes suggest: proposals, which are never applied silently.

use crate::units::{Dimension, STANDARD_GRAVITY};
use serde::{Deserialize, Serialize};

/// A unit that would make a magnitude plausible.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct UnitProposal {
    /// Name of the unit.
    pub unit: String,
    /// SI units per unit.
    pub scale: f64,
    /// The magnitude in SI units, if the unit is right.
    pub value: f64,
}

/// Typical travel of an insertion (m).
const TYPICAL_TRAVEL_M: f64 = 0.1;
/// Travels (m) of microneedles to robots.
const TRAVELS_M: (f64, f64) = (2e-4, 1.0);
/// Typical largest force of an insertion (N).
const TYPICAL_FORCE_N: f64 = 4.0;
/// Largest forces (N) of microneedles to biopsies of bone.
const FORCES_N: (f64, f64) = (0.02, 500.0);
/// Typical sampling interval (s).
const TYPICAL_INTERVAL_S: f64 = 0.005;
/// Sampling intervals (s) of loggers.
const INTERVALS_S: (f64, f64) = (1e-5, 0.5);

/// First times (s since 1970) of recordings: 1998 to 2128.
pub(super) const EPOCH_S: (f64, f64) = (9e8, 5e9);

/// Units with SI units per unit and their rarity: factors by which the magnitude must fit better than in a usual unit, as
/// logarithms.
type Units = &'static [(&'static str, f64, f64)];

const LENGTHS: Units = &[
    ("m", 1.0, 0.0),
    ("mm", 1e-3, 0.0),
    ("inch", 0.0254, 1.0),
    ("µm", 1e-6, 0.5),
    ("cm", 1e-2, 1.5),
    ("nm", 1e-9, 2.0),
];
const FORCES: Units = &[
    ("N", 1.0, 0.0),
    ("mN", 1e-3, 0.0),
    ("gram-force", 1e-3 * STANDARD_GRAVITY, 1.0),
    ("kN", 1e3, 0.5),
    ("µN", 1e-6, 1.0),
];
const TIMES: Units =
    &[("s", 1.0, 0.0), ("ms", 1e-3, 0.0), ("µs", 1e-6, 0.0), ("ns", 1e-9, 0.0), ("days", 86_400.0, 0.0)];

/// Units that would make a magnitude plausible, the most typical one first: of a length the travel, of a force the largest
/// one, of a time the sampling interval.
#[must_use]
pub fn propose_units(dimension: Dimension, magnitude: f64) -> Vec<UnitProposal> {
    let (units, (low, high), typical) = match dimension {
        Dimension::Length => (LENGTHS, TRAVELS_M, TYPICAL_TRAVEL_M),
        Dimension::Force => (FORCES, FORCES_N, TYPICAL_FORCE_N),
        Dimension::Time => (TIMES, INTERVALS_S, TYPICAL_INTERVAL_S),
        Dimension::Velocity | Dimension::Other => return Vec::new(),
    };
    let mut found: Vec<(f64, UnitProposal)> = units
        .iter()
        .map(|(unit, scale, rarity)| {
            let value = scale * magnitude;
            (
                rarity + libm::log(value / typical).abs(),
                UnitProposal { unit: (*unit).to_owned(), scale: *scale, value },
            )
        })
        .filter(|(_, proposal)| (low..=high).contains(&proposal.value))
        .collect();
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    found.into_iter().map(|(_, proposal)| proposal).collect()
}

/// Whether a magnitude is implausible in SI units.
#[must_use]
pub fn is_implausible(dimension: Dimension, magnitude: f64) -> bool {
    match dimension {
        Dimension::Length => magnitude > TRAVELS_M.1,
        Dimension::Force => magnitude > FORCES_N.1 / 5.0,
        Dimension::Time => magnitude > INTERVALS_S.1,
        Dimension::Velocity | Dimension::Other => false,
    }
}

/// Whether a sampling interval is so short in seconds that it may be in days.
#[must_use]
pub(super) fn may_be_days(dimension: Dimension, magnitude: f64) -> bool {
    dimension == Dimension::Time && magnitude > 0.0 && magnitude < INTERVALS_S.0
}

/// The proposals as words: `gram-force (scale 0.00980665, 4.9 N) or mN (scale 0.001, 0.5 N)`.
#[must_use]
pub fn in_words(proposals: &[UnitProposal], si: &str) -> String {
    let words: Vec<String> = proposals
        .iter()
        .map(|p| {
            format!(
                "{} (scale {}, then {} {si})",
                p.unit,
                p.scale,
                stylet_stats::number_format::significant(p.value, 3)
            )
        })
        .collect();
    words.join(" or ")
}

/// The unit, below a second, of a time that began in 1970, by its size, and seconds per unit.
#[must_use]
pub fn epoch_unit(first: f64) -> Option<(&'static str, f64)> {
    let units = [("milliseconds", 1e-3), ("microseconds", 1e-6), ("nanoseconds", 1e-9)];
    units.into_iter().find(|(_, scale)| (EPOCH_S.0..EPOCH_S.1).contains(&(first * scale)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn first(dimension: Dimension, magnitude: f64) -> String {
        propose_units(dimension, magnitude).first().map(|p| p.unit.clone()).unwrap_or_default()
    }

    #[test]
    fn magnitudes_propose_the_usual_units() {
        assert_eq!(first(Dimension::Force, 510.0), "gram-force");
        assert_eq!(first(Dimension::Force, 5000.0), "mN");
        assert_eq!(first(Dimension::Force, 3.0), "N");
        assert_eq!(first(Dimension::Length, 3.4), "inch");
        assert_eq!(first(Dimension::Length, 60.0), "mm");
        assert_eq!(first(Dimension::Length, 24.0), "mm");
        assert_eq!(first(Dimension::Length, 8.6), "cm");
        assert_eq!(first(Dimension::Length, 0.06), "m");
        assert_eq!(first(Dimension::Length, 86_000.0), "µm");
        assert_eq!(first(Dimension::Time, 5e6), "ns");
        assert_eq!(first(Dimension::Time, 5.0), "ms");
        assert_eq!(first(Dimension::Time, 1.157e-7), "days");
        assert_eq!(epoch_unit(1.7e18), Some(("nanoseconds", 1e-9)));
        assert_eq!(epoch_unit(1.7e12), Some(("milliseconds", 1e-3)));
        assert_eq!(epoch_unit(1.7e9), None);
    }
}
