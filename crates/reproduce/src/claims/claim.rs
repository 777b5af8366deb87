//! An evaluated claim: the effect of each condition, and the verdict with its reason.

use crate::claim_protocol::Protocol;
use crate::claim_verdict::{Trial, Verdict};
use crate::effect_size::{Criterion, CriterionResult, Effect};
use serde::Serialize;

/// An effect under a named condition.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Condition {
    /// Name of the condition.
    pub name: String,
    /// Criterion that the effect is compared with.
    pub bar: Criterion,
    /// The effect.
    #[serde(flatten)]
    pub effect: Effect,
    /// Whether the effect supports or contradicts the claim.
    pub says: CriterionResult,
}

/// The primary condition's result.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Primary {
    /// Criterion that the effect is compared with.
    pub bar: Criterion,
    /// The effect over all experiments of the condition.
    #[serde(flatten)]
    pub effect: Effect,
    /// Whether the effect supports or contradicts the claim.
    pub says: CriterionResult,
    /// The experiments one by one; they do not decide.
    pub parts: Vec<Condition>,
}

/// A claim with its verdict: a row of `claims.json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Claim {
    /// Identifier as in the protocols, such as `b1`.
    pub id: String,
    /// The claim.
    pub claim: String,
    /// Where the paper or its supplement makes it.
    pub source: String,
    /// The verdict.
    pub verdict: Verdict,
    /// Reason of the verdict, computed from the conditions.
    pub reason: String,
    /// The primary condition; none when untestable.
    pub primary: Option<Primary>,
    /// Sensitivity conditions; they do not decide.
    pub sensitivities: Vec<Condition>,
    /// Effects with assumed values halved and doubled.
    pub trials: Vec<Trial>,
    /// The protocol.
    #[serde(skip)]
    pub protocol: Protocol,
}

impl Claim {
    /// Changes of assumed values that change the verdict.
    pub fn verdict_changing_trials(&self) -> impl Iterator<Item = &Trial> {
        self.trials.iter().filter(|t| t.decides)
    }
}
