//! The rule from the primary condition to the verdict, the same for all claims (`claims/README.md`).

use crate::assumed_value_changes::Change;
use crate::effect_size::{Criterion, CriterionResult, Effect};
use serde::Serialize;

/// Verdict on a claim.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The primary condition supports it, independently of the assumed values.
    Supported,
    /// The primary condition contradicts it, independently of the assumed values.
    Contradicted,
    /// The verdict depends on an assumed value.
    Assumed,
    /// The interval contains the limit of the criterion, or too few seeds give a value.
    Undecided,
    /// Not testable by simulation.
    Untestable,
}

impl Verdict {
    /// Name of the verdict.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Verdict::Supported => "supported",
            Verdict::Contradicted => "contradicted",
            Verdict::Assumed => "assumed",
            Verdict::Undecided => "undecided",
            Verdict::Untestable => "untestable",
        }
    }
}

/// A halved or doubled assumed value, and the primary effect with it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Trial {
    /// The change.
    pub change: Change,
    /// The effect with the change.
    pub effect: Effect,
    /// Whether it lies on the other side of the limit, or exists only with or only without the change.
    pub decides: bool,
}

impl Trial {
    /// Compares with the primary effect.
    #[must_use]
    pub fn new(change: Change, effect: Effect, primary: &Effect, bar: Criterion) -> Self {
        let decides = bar.side(&effect) != bar.side(primary);
        Self { change, effect, decides }
    }
}

/// The verdict of the primary condition, unless it depends on an assumed value. Sensitivity conditions are not used.
#[must_use]
pub fn verdict(primary: CriterionResult, trials: &[Trial]) -> Verdict {
    if trials.iter().any(|t| t.decides) {
        return Verdict::Assumed;
    }
    match primary {
        CriterionResult::Supports => Verdict::Supported,
        CriterionResult::Contradicts => Verdict::Contradicted,
        CriterionResult::Undecided => Verdict::Undecided,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assumed_value_changes::AssumedValue;
    use crate::seed_interval::Interval;

    fn effect(value: f64) -> Effect {
        Effect { interval: Some(Interval { value, low: value - 0.1, high: value + 0.1 }), seeds: 50, of: 50 }
    }

    #[test]
    fn the_primary_condition_decides_unless_a_chosen_number_does() {
        let bar = Criterion::Below(1.0);
        let [halved, doubled] = AssumedValue::Noise.changes();
        let trial = |change, value| Trial::new(change, effect(value), &effect(0.5), bar);
        let (same, other) = (trial(halved, 0.7), trial(doubled, 1.2));
        assert!(!same.decides && other.decides);
        assert_eq!(verdict(CriterionResult::Supports, std::slice::from_ref(&same)), Verdict::Supported);
        assert_eq!(verdict(CriterionResult::Contradicts, &[]), Verdict::Contradicted);
        assert_eq!(verdict(CriterionResult::Undecided, &[]), Verdict::Undecided);
        assert_eq!(verdict(CriterionResult::Supports, &[same, other]), Verdict::Assumed);
        let none = Effect { interval: None, seeds: 0, of: 20 };
        assert!(Trial::new(halved, none, &effect(0.5), bar).decides, "an effect that exists no longer");
    }
}
