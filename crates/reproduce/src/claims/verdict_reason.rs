//! The reason of a verdict as text, composed from the conditions.

use super::claim::{Condition, Primary};
use crate::claim_verdict::Trial;
use crate::effect_size::CriterionResult;
use std::fmt::Write as _;

/// Names with their effects: `depth known 0.93 (0.91 to 0.95)`.
fn list<'a>(conditions: impl Iterator<Item = &'a Condition>) -> String {
    conditions.map(|c| format!("{} {}", c.name, c.effect.words())).collect::<Vec<_>>().join("; ")
}

/// Composes the reason from the primary condition, the changes of assumed values and the sensitivity conditions.
pub(super) fn reason(primary: &Primary, trials: &[Trial], sensitivities: &[Condition]) -> String {
    let bar = primary.bar.words();
    let says = match (primary.says, primary.effect.interval.is_some()) {
        (CriterionResult::Supports, _) => "the whole interval is on the claim's side",
        (CriterionResult::Contradicts, _) => "the whole interval is on the other side",
        (CriterionResult::Undecided, true) => "the interval contains the limit",
        (CriterionResult::Undecided, false) => "too few seeds give a value",
    };
    let mut text =
        format!("The primary condition gives {}; the criterion is {bar}: {says}.", primary.effect.words());
    let others: Vec<&Condition> = primary.parts.iter().filter(|p| p.says != primary.says).collect();
    if primary.parts.len() > 1 && !others.is_empty() {
        let _ = write!(text, " Other results of single experiments: {}.", list(others.into_iter()));
    }
    let deciding: Vec<String> = trials
        .iter()
        .filter(|t| t.decides)
        .map(|t| format!("{} {}", t.change.words(), t.effect.words()))
        .collect();
    if deciding.is_empty() {
        if !trials.is_empty() {
            let _ = write!(
                text,
                " None of the {} assumed values, halved or doubled, changes that.",
                trials.len() / 2
            );
        }
    } else {
        let _ = write!(text, " It depends on assumed values: {}.", deciding.join("; "));
    }
    for (says, verb) in [
        (CriterionResult::Supports, "It holds with"),
        (CriterionResult::Contradicts, "It does not hold with"),
        (CriterionResult::Undecided, "Undecided with"),
    ] {
        let some: Vec<&Condition> = sensitivities.iter().filter(|s| s.says == says).collect();
        if !some.is_empty() {
            let _ = write!(text, " {verb}: {}.", list(some.into_iter()));
        }
    }
    text
}
