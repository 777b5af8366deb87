//! The rule by which numbers become a verdict: one place for all claims.
//!
//! A claim is a list of conditions (a phantom, a motion, a sensor, a protocol). In every noise seed the
//! claim's statement either holds under a condition or does not. A condition *holds* when the statement
//! does in at least 90 % of the seeds, it *fails* when it does in at most 10 %; between, the noise decides.
//! All conditions hold: **supported**. All fail: **not supported**. Otherwise: **depends on** what
//! separates the conditions. The thresholds inside the statements stand in each claim's file; they were set
//! before the numbers were seen and are not tuned to the verdicts.

use serde::{Serialize, Serializer};

/// Share of the seeds from which on a condition holds.
pub const HOLDS: f64 = 0.9;
/// Share of the seeds up to which a condition fails.
pub const FAILS: f64 = 0.1;

/// In how many seeds a claim's statement holds under a condition.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Condition {
    /// Under which circumstances.
    pub name: String,
    /// Seeds in which the statement holds,
    pub holds: usize,
    /// of so many.
    pub of: usize,
}

impl Condition {
    /// Counts.
    #[must_use]
    pub fn new(name: impl Into<String>, seeds: impl Iterator<Item = bool>) -> Self {
        let (mut holds, mut of) = (0, 0);
        for seed in seeds {
            of += 1;
            holds += usize::from(seed);
        }
        Self { name: name.into(), holds, of }
    }

    fn share(&self) -> f64 {
        if self.of == 0 { 0.0 } else { self.holds as f64 / self.of as f64 }
    }

    /// The statement holds in nearly every seed.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.share() >= HOLDS
    }

    /// The statement fails in nearly every seed.
    #[must_use]
    pub fn fails(&self) -> bool {
        self.share() <= FAILS
    }
}

/// What our testbed says of a claim.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Under every condition.
    Supported,
    /// Under none.
    NotSupported,
    /// Under some; on what it depends.
    DependsOn(String),
}

impl Verdict {
    /// From the conditions; `on` names what tells them apart.
    #[must_use]
    pub fn of(conditions: &[Condition], on: &str) -> Self {
        if !conditions.is_empty() && conditions.iter().all(Condition::holds) {
            Self::Supported
        } else if conditions.iter().all(Condition::fails) {
            Self::NotSupported
        } else {
            Self::DependsOn(on.to_owned())
        }
    }

    /// As it stands in `claims.json`.
    #[must_use]
    pub fn words(&self) -> String {
        match self {
            Self::Supported => "supported".to_owned(),
            Self::NotSupported => "not supported".to_owned(),
            Self::DependsOn(on) => format!("depends on {on}"),
        }
    }
}

impl Serialize for Verdict {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&self.words())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn condition(holds: usize) -> Condition {
        Condition { name: String::new(), holds, of: 50 }
    }

    #[test]
    fn the_verdict_follows_from_the_shares() {
        let verdict = |shares: &[usize]| {
            Verdict::of(&shares.iter().map(|&h| condition(h)).collect::<Vec<_>>(), "x").words()
        };
        assert_eq!(verdict(&[50, 45]), "supported");
        assert_eq!(verdict(&[0, 5]), "not supported");
        assert_eq!(verdict(&[50, 0]), "depends on x");
        assert_eq!(verdict(&[30]), "depends on x");
        assert_eq!(verdict(&[]), "not supported");
    }
}
