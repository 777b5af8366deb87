//! The rule by which a primary condition becomes a verdict: one place for all claims (`claims/README.md`).

use crate::assumed_value_changes::Change;
use crate::effect_size::{Bar, Effect, Says};
use serde::Serialize;

/// What the testbed says of a claim.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The primary condition supports it, and no number of ours decides.
    Supported,
    /// The primary condition contradicts it, and no number of ours decides.
    Contradicted,
    /// A number that we chose decides.
    Assumed,
    /// The interval holds the bar, or too few seeds give a value.
    Undecided,
    /// No simulation can say.
    Untestable,
}

impl Verdict {
    /// In a word.
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

/// A number of ours halved or doubled, and what becomes of the primary effect.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Trial {
    /// What was changed.
    pub change: Change,
    /// The effect then.
    pub effect: Effect,
    /// Whether it lies on the other side of the bar, or exists only with or only without the change.
    pub decides: bool,
}

impl Trial {
    /// Compares with the primary effect.
    #[must_use]
    pub fn new(change: Change, effect: Effect, primary: &Effect, bar: Bar) -> Self {
        let decides = bar.side(&effect) != bar.side(primary);
        Self { change, effect, decides }
    }
}

/// The verdict: what the primary condition says, unless a number of ours decides. Sensitivity conditions are
/// not asked.
#[must_use]
pub fn verdict(primary: Says, trials: &[Trial]) -> Verdict {
    if trials.iter().any(|t| t.decides) {
        return Verdict::Assumed;
    }
    match primary {
        Says::Supports => Verdict::Supported,
        Says::Contradicts => Verdict::Contradicted,
        Says::Undecided => Verdict::Undecided,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assumed_value_changes::Number;
    use crate::seed_interval::Interval;

    fn effect(value: f64) -> Effect {
        Effect { interval: Some(Interval { value, low: value - 0.1, high: value + 0.1 }), seeds: 50, of: 50 }
    }

    #[test]
    fn the_primary_condition_decides_unless_a_chosen_number_does() {
        let bar = Bar::Below(1.0);
        let [halved, doubled] = Number::Noise.changes();
        let trial = |change, value| Trial::new(change, effect(value), &effect(0.5), bar);
        let (same, other) = (trial(halved, 0.7), trial(doubled, 1.2));
        assert!(!same.decides && other.decides);
        assert_eq!(verdict(Says::Supports, std::slice::from_ref(&same)), Verdict::Supported);
        assert_eq!(verdict(Says::Contradicts, &[]), Verdict::Contradicted);
        assert_eq!(verdict(Says::Undecided, &[]), Verdict::Undecided);
        assert_eq!(verdict(Says::Supports, &[same, other]), Verdict::Assumed);
        let none = Effect { interval: None, seeds: 0, of: 20 };
        assert!(Trial::new(halved, none, &effect(0.5), bar).decides, "an effect that exists no longer");
    }
}
