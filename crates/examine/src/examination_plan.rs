//! Selection of the cases of an examination.

use crate::cases::case_id::{CaseId, Hide, Severity, Size, World, Wrong};
use crate::cases::hide_effects::intended_effect;

/// An examination: rows of misspecifications, each at some severities, with a number of cases per cell.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Tissue law of the simulator.
    pub world: World,
    /// Misspecifications, row by row.
    pub wrong: Vec<Wrong>,
    /// Severities of the misspecification.
    pub severities: Vec<Severity>,
    /// Hidden causes; the cases of a cell cycle through these, so that with `[One, One, Clean]` two thirds hide something.
    pub hide: Vec<Hide>,
    /// Strength of the hidden causes.
    pub size: Size,
    /// Cases per cell.
    pub cases: u64,
    /// Seed.
    pub seed: u64,
    /// Only cases that hide one of these effects or shapes; empty: all.
    pub only: Vec<&'static str>,
}

impl Default for Plan {
    fn default() -> Self {
        Self {
            world: World::Plain,
            wrong: vec![Wrong::Nothing],
            severities: vec![Severity::Large],
            hide: vec![Hide::One, Hide::One, Hide::Clean],
            size: Size::Strong,
            cases: 60,
            seed: 1,
            only: Vec::new(),
        }
    }
}

impl Plan {
    /// The cases, row by row. Without a misspecification there is one severity.
    #[must_use]
    pub fn cases(&self) -> Vec<CaseId> {
        let mut out = Vec::new();
        for &wrong in &self.wrong {
            let severities: &[Severity] =
                if wrong == Wrong::Nothing { &[Severity::Large] } else { &self.severities };
            for &severity in severities {
                let mut counts = vec![0; Hide::ALL.len()];
                for k in 0..self.cases {
                    let Some(&hide) = self.hide.get(k as usize % self.hide.len().max(1)) else { continue };
                    let index = counts[hide as usize];
                    counts[hide as usize] += 1;
                    let id = CaseId {
                        world: self.world,
                        wrong,
                        severity,
                        hide,
                        size: self.size,
                        seed: self.seed,
                        index,
                    };
                    if self.asks_for(&id) {
                        out.push(id);
                    }
                }
            }
        }
        out
    }

    fn asks_for(&self, id: &CaseId) -> bool {
        self.only.is_empty() || intended_effect(id).is_some_and(|what| self.only.contains(&what))
    }
}

#[cfg(test)]
mod tests {
    use super::Plan;
    use crate::cases::case_id::{Hide, Wrong};
    use crate::cases::hide_effects::intended_effect;

    #[test]
    fn cases_of_one_effect_are_those_of_all_that_hide_it() {
        let all = Plan { wrong: vec![Wrong::Nothing, Wrong::Thickness], seed: 5, ..Plan::default() };
        let some = Plan { only: vec!["time_delay"], ..all.clone() };
        let wanted: Vec<_> =
            all.cases().into_iter().filter(|id| intended_effect(id) == Some("time_delay")).collect();
        assert!(wanted.len() >= 2 && wanted.iter().all(|id| id.hide == Hide::One), "{wanted:?}");
        assert_eq!(some.cases(), wanted);
    }
}
