//! Outcome of one case.

use super::diagnosis_answer::{Answer, Estimate, Verdict};
use super::expected_answer::{AnswerScore, Expected, expected_answer, score_answer};
use crate::cases::case_id::{CaseId, GENERATOR_VERSION, first_generator_version};
use crate::cases::case_recordings::Case;
use crate::cases::rich_world_effects;
use crate::simulator::effect::Effect;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// One estimated parameter and its true value.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ScoredParameter {
    /// Such as `coulomb_friction.c_n_per_m`, or `base.stiffness_n_per_m`.
    pub name: String,
    /// The truth.
    pub truth: f64,
    /// The answer.
    pub value: f64,
    /// Lower end of its 95 % interval.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub low: Option<f64>,
    /// Upper end.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub high: Option<f64>,
    /// Whether the 95 % interval contains the truth; `None` without an interval.
    #[serde(rename = "held")]
    pub interval_covers: Option<bool>,
    /// Label of the parameter in the answer.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub label: Option<String>,
}

/// Outcome of one case.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CaseOutcome {
    /// The case.
    pub id: CaseId,
    /// Version of the case generator ([`GENERATOR_VERSION`]).
    #[serde(default = "first_generator_version")]
    pub generator_version: u32,
    /// What was hidden, by name.
    pub hidden: Vec<String>,
    /// Their parameter values.
    pub values: Vec<(String, f64)>,
    /// Strength of the hidden causes in noise standard deviations.
    pub strength_sd: f64,
    /// The expected answer.
    pub expected: Expected,
    /// Verdict of the answer.
    pub verdict: Verdict,
    /// Grade of the model, A to D, if the answer has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub grade: Option<String>,
    /// Causes named, each with its class.
    pub named: Vec<Vec<String>>,
    /// Confidence of each cause, and whether it is correct.
    pub confidence: Vec<(f64, bool)>,
    /// Score of the answer.
    #[serde(rename = "worth")]
    pub score: AnswerScore,
    /// Estimated parameters with their true values.
    #[serde(rename = "numbers")]
    pub parameters: Vec<ScoredParameter>,
    /// Samples.
    pub samples: usize,
    /// Wall time of the answer in s.
    pub seconds: f64,
    /// Reason for a missing answer.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failed: Option<String>,
}

impl CaseOutcome {
    /// Scores the answer of an engine. Without an answer the case counts as wrong.
    #[must_use]
    pub fn new(case: &Case, answer: Result<Answer, String>, seconds: f64) -> Self {
        let expected = expected_answer(&case.id, &case.setup);
        let (answer, failed) = match answer {
            Ok(answer) => (answer, None),
            Err(why) => (Answer { verdict: Verdict::Unknown, ..Answer::none() }, Some(why)),
        };
        let mut score = score_answer(&expected, &answer);
        if failed.is_some() {
            score.correct = false;
        }
        let mut hidden: Vec<String> = case.setup.effects.iter().map(|e| e.id().to_owned()).collect();
        hidden.extend(case.setup.custom.as_ref().map(|c| c.id().to_owned()));
        hidden.extend(rich_world_effects::names(&case.setup.rich).iter().map(|n| (*n).to_owned()));
        hidden.extend(case.setup.shape.as_ref().map(|s| s.name().to_owned()));
        let mut values = Vec::new();
        for e in &case.setup.effects {
            values.extend(e.parameters().into_iter().map(|(p, x)| (format!("{}.{p}", e.id()), x)));
        }
        if let Some(custom) = &case.setup.custom {
            values.extend(custom.parameters().into_iter().map(|(p, x)| (format!("{}.{p}", custom.id()), x)));
        }
        let present = |name: &str| {
            expected.wanted.iter().any(|w| w.effect == name || w.also.iter().any(|a| a == name))
                || expected.optional.iter().any(|o| o == name)
        };
        Self {
            id: case.id,
            generator_version: GENERATOR_VERSION,
            hidden,
            values,
            strength_sd: case.setup.strength_sd,
            verdict: answer.verdict,
            grade: answer.grade.as_ref().map(|g| g.letter.clone()),
            named: answer
                .causes
                .iter()
                .map(|c| {
                    std::iter::once(&c.effect)
                        .chain(c.equivalent.iter().filter(|e| **e != c.effect))
                        .cloned()
                        .collect()
                })
                .collect(),
            confidence: answer
                .causes
                .iter()
                .filter_map(|c| Some((c.confidence?, present(&c.effect))))
                .collect(),
            parameters: scored_parameters(case, &answer),
            score,
            expected,
            samples: case.samples(),
            seconds,
            failed,
        }
    }
}

/// Parameters of two terms, the faster one first, because their order is arbitrary.
fn in_order(estimates: &BTreeMap<String, Estimate>) -> BTreeMap<String, Estimate> {
    let time = |term: &str| estimates.get(&format!("{term}.time_constant_s")).map(|e| e.value);
    let (first, second) = ("terms.0", "terms.1");
    if !matches!((time(first), time(second)), (Some(a), Some(b)) if a > b) {
        return estimates.clone();
    }
    let swapped = |path: &String| match path.strip_prefix(first) {
        Some(rest) => format!("{second}{rest}"),
        None => path.strip_prefix(second).map_or_else(|| path.clone(), |rest| format!("{first}{rest}")),
    };
    estimates.iter().map(|(path, e)| (swapped(path), *e)).collect()
}

fn scored_parameters(case: &Case, answer: &Answer) -> Vec<ScoredParameter> {
    let mut out = Vec::new();
    if !rich_world_effects::names(&case.setup.rich).is_empty() {
        // A law of another form has no true values of the base law's parameters.
        return out;
    }
    for effect in &case.setup.effects {
        let Some(cause) = answer.causes.iter().find(|c| c.effect == effect.id()) else { continue };
        let estimates = in_order(&cause.parameters);
        for (path, truth) in effect.parameters() {
            let Some(e) = estimates.get(&path) else { continue };
            if path == "layer" {
                continue;
            }
            // The delays of sensor and effect add up.
            let late = matches!(effect, Effect::TimeDelay { .. });
            let truth = truth + if late { case.setup.amounts.delay_s() } else { 0.0 };
            let turn = if path.ends_with("_rad") {
                let whole = core::f64::consts::TAU;
                libm::round((truth - e.value) / whole) * whole
            } else {
                0.0
            };
            let mut scored = scored_parameter(
                format!("{}.{path}", effect.id()),
                truth,
                e.value + turn,
                e.low.map(|x| x + turn),
                e.high.map(|x| x + turn),
            );
            scored.label = answer.label(0, Some(effect.id()), &path);
            out.push(scored);
        }
    }
    if let Some(custom) = &case.setup.custom
        && let Some(cause) = answer.causes.iter().find(|c| c.effect == custom.id())
    {
        for (path, truth) in custom.parameters() {
            let Some(e) = cause.parameters.get(&path) else { continue };
            let mut scored =
                scored_parameter(format!("{}.{path}", custom.id()), truth, e.value, e.low, e.high);
            scored.label = answer.label(0, Some(custom.id()), &path);
            out.push(scored);
        }
    }
    let truth = &case.setup.truth;
    // A gain or a position scale is equivalent to other base parameters, so their true values are not defined.
    let relabelled = |e: &Effect| matches!(e, Effect::ForceGain { .. } | Effect::PositionScale { .. });
    if case.setup.effects.iter().any(relabelled) {
        return out;
    }
    let moved = case.setup.effects.iter().any(|e| matches!(e, Effect::BoundaryShift { .. }));
    for p in &answer.base_parameters {
        let layer = p.layer.checked_sub(1).and_then(|i| truth.layers.get(i));
        let value = match (p.name.as_str(), layer) {
            ("surface_m", _) => Some(truth.surface_m),
            ("stiffness_n_per_m", Some(l)) => Some(l.stiffness_n_per_m),
            ("friction_ns_per_m2", Some(l)) => Some(l.friction_ns_per_m2),
            ("puncture_n", Some(l)) => l.puncture_n,
            ("thickness_m", Some(l)) if !moved => Some(l.thickness_m),
            _ => None,
        };
        if let Some(value) = value {
            let mut scored = scored_parameter(format!("base.{}", p.name), value, p.value, p.low, p.high);
            scored.label = answer.label(p.layer, None, &p.name);
            out.push(scored);
        }
    }
    out
}

fn scored_parameter(
    name: String,
    truth: f64,
    value: f64,
    low: Option<f64>,
    high: Option<f64>,
) -> ScoredParameter {
    let interval_covers = low.zip(high).map(|(low, high)| low <= truth && truth <= high);
    ScoredParameter { name, truth, value, low, high, interval_covers, label: None }
}

#[cfg(test)]
mod tests {
    use super::{Estimate, in_order};
    use std::collections::BTreeMap;

    #[test]
    fn of_two_terms_the_faster_one_is_the_first() {
        let estimates = |numbers: &[(&str, f64)]| -> BTreeMap<String, Estimate> {
            let of = |(path, value): &(&str, f64)| {
                ((*path).to_owned(), Estimate { value: *value, ..Estimate::default() })
            };
            numbers.iter().map(of).collect()
        };
        let slow_first = estimates(&[
            ("terms.0.fraction", 0.5),
            ("terms.0.time_constant_s", 6.0),
            ("terms.1.fraction", 0.2),
            ("terms.1.time_constant_s", 0.3),
        ]);
        let fast_first = estimates(&[
            ("terms.0.fraction", 0.2),
            ("terms.0.time_constant_s", 0.3),
            ("terms.1.fraction", 0.5),
            ("terms.1.time_constant_s", 6.0),
        ]);
        assert_eq!(in_order(&slow_first), fast_first);
        assert_eq!(in_order(&fast_first), fast_first);
        let one = estimates(&[("terms.0.fraction", 0.2), ("terms.0.time_constant_s", 3.0)]);
        assert_eq!(in_order(&one), one);
    }
}
