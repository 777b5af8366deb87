//! Expected answers: rules per cause, fixed before any run.
//!
//! The rules, with their reasons:
//!
//! 1. **What a user cannot know exactly is no cause** (docs/reference/algorithms.md): a wrong thickness, surface, K, b or F within the
//!    stated tolerance, noise of any colour, growing, with tails, and scatter between recordings require the verdict `none`. Irregular
//!    or missing samples are remarks on the data.
//! 2. **A cause may be named or not** where a sensor's ordinary imperfection is a form of an effect: a force late by up to two samples
//!    *is* a `time_delay`, mains hum *is* a `periodic_interference`, a 12-bit converter *is* a `quantisation`.
//! 3. **`force_gain` is not identifiable** once K, b, F are re-fitted (all forces scale): naming it is not justified, and
//!    `none` is right. Its size is drawn within the tolerance.
//! 4. **`position_scale` is the base law with other parameter values**: recorded depths and speeds times `1 + eps` are thicknesses times
//!    `1 + eps`, K over `1 + eps`, b over its square. Within the tolerances both the name and `none` are right.
//! 5. **`boundary_shift` is two thicknesses**: within the tolerance of both layers the name and `none` are right, beyond the
//!    tolerance of either only the name.
//!    Where the thicknesses are only guessed, both are right.
//! 6. **A puncture that depends on speed is not identifiable from one recording**, in which every layer is punctured once: name or
//!    `none`.
//! 7. **Lags and delays below one sampling interval** cannot be distinguished: either name is accepted.
//! 8. **Stribeck and presliding friction that dry friction imitates to less than 0.3 noise standard deviations** cannot be distinguished
//!    from dry friction: `coulomb_friction` is right as well.
//! 9. **Effects of the rich law are not in the library**: each lists the library effects that describe it (a foundation spring may be
//!    `deep_indentation`), and `unknown` is right as well.
//! 10. **Negligible effects never count**, nor do those listed as not identifiable.
//! 11. **A class** (`equivalent`) counts as its best member would if it holds a right one among at most four.
//! 12. **Without a scenario** the number of layers has to be right as well.

use crate::cases::case_definition::CaseSetup;
use crate::cases::case_id::{CaseId, Hide};
use crate::cases::draw_effect::THICKNESS_TOLERANCE;
use crate::cases::effect_strength::{RefitTerms, unexplained_rms_n};
use crate::cases::rich_world_effects;
use crate::scoring::diagnosis_answer::{Answer, Verdict};
use crate::simulator::effect::Effect;
use serde::{Deserialize, Serialize};

/// Largest class of effects that counts as an answer.
pub const MAX_CLASS_SIZE: usize = 4;
/// Largest residual of dry friction fitted to Stribeck or presliding friction, in noise standard deviations, at which both count as
/// equal (rule 8).
const DRY_FRICTION_LIMIT_SD: f64 = 0.3;

/// An expected cause.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ExpectedCause {
    /// The hidden effect.
    pub effect: String,
    /// Equivalent names.
    pub also: Vec<String>,
    /// Whether leaving it out is correct as well.
    pub may_be_silent: bool,
    /// Whether naming it is wrong because it is not identifiable.
    pub unseen: bool,
}

impl ExpectedCause {
    fn fits(&self, class: &[&str]) -> bool {
        !self.unseen
            && class.len() <= MAX_CLASS_SIZE
            && class.iter().any(|c| *c == self.effect || self.also.iter().any(|a| a == c))
    }
}

/// The expected answer.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Expected {
    /// Causes.
    pub wanted: Vec<ExpectedCause>,
    /// Further names that are accepted.
    pub optional: Vec<String>,
    /// Names that describe the effects of the rich law.
    pub allowed: Vec<String>,
    /// Whether one of these, or `unknown`, is required.
    pub asks_for_allowed: bool,
    /// Whether a force outside the library is present.
    pub outside: bool,
    /// Whether `unknown` is correct as well.
    pub unknown_is_right: bool,
    /// Number of layers that have to be found; `None` when a scenario gives it.
    pub layers: Option<usize>,
}

/// Score of an answer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct AnswerScore {
    /// Correct and unique.
    pub correct: bool,
    /// A cause is named that is not present.
    pub wrong_name: bool,
    /// Every expected cause is found; others may be named as well.
    pub all_found: bool,
}

/// The expected answer for a case.
#[must_use]
pub fn expected_answer(id: &CaseId, setup: &CaseSetup) -> Expected {
    let mut out = Expected {
        outside: setup.shape.is_some(),
        unknown_is_right: setup.shape.is_some(),
        ..Expected::default()
    };
    for effect in &setup.effects {
        out.wanted.push(expected_cause(effect, setup));
    }
    if let Some(custom) = &setup.custom {
        let effect = custom.id().to_owned();
        out.wanted.push(ExpectedCause { effect, also: Vec::new(), may_be_silent: false, unseen: false });
    }
    let a = &setup.amounts;
    // Rule 12.
    out.layers = (!a.has_scenario).then_some(setup.truth.layers.len());
    // Rule 2.
    if a.late_samples > 0.0 {
        out.optional.push("time_delay".to_owned());
    }
    if a.hum > 0.0 {
        out.optional.push("periodic_interference".to_owned());
    }
    if a.bits_range_n.is_some() {
        out.optional.push("quantisation".to_owned());
    }
    // Rule 9.
    for name in rich_world_effects::names(&setup.rich) {
        out.allowed.extend(rich_world_effects::accepted_names(name).iter().map(|s| (*s).to_owned()));
        out.unknown_is_right = true;
        out.asks_for_allowed |= !may_go_undetected(name, setup);
    }
    debug_assert!(id.hide != Hide::Clean || out.wanted.is_empty());
    out
}

fn expected_cause(effect: &Effect, setup: &CaseSetup) -> ExpectedCause {
    let mut it = ExpectedCause {
        effect: effect.id().to_owned(),
        also: Vec::new(),
        may_be_silent: false,
        unseen: false,
    };
    let interval_s = 1.0 / setup.amounts.rate_hz;
    let is_guess = setup.amounts.is_tissue_guessed();
    let passes_for_dry = || {
        unexplained_rms_n(setup, core::slice::from_ref(effect), None, RefitTerms::DryFriction)
            < DRY_FRICTION_LIMIT_SD * setup.noise.sd_n
    };
    match *effect {
        Effect::ForceGain { .. } => {
            it.unseen = true;
            it.may_be_silent = true;
        }
        Effect::PositionScale { eps } => {
            it.may_be_silent = is_guess || eps.abs() + setup.amounts.thickness <= THICKNESS_TOLERANCE;
        }
        Effect::BoundaryShift { layer, shift_m } => {
            let thick = |i: usize| setup.assumed.layers.get(i).map_or(0.0, |l| l.thickness_m);
            let least = thick(layer - 1).min(thick(layer));
            it.may_be_silent =
                is_guess || shift_m.abs() <= (THICKNESS_TOLERANCE + setup.amounts.thickness) * least;
        }
        Effect::RateDependentPuncture { .. } => it.may_be_silent = setup.paths.len() == 1,
        Effect::LowPassLag { time_constant_s } if time_constant_s < interval_s => {
            it.also.push("time_delay".to_owned());
        }
        Effect::TimeDelay { delay_s } if delay_s < interval_s => it.also.push("low_pass_lag".to_owned()),
        Effect::StribeckFriction { .. } | Effect::PreslidingFriction { .. } if passes_for_dry() => {
            it.also.push("coulomb_friction".to_owned());
        }
        _ => {}
    }
    it
}

/// Whether an effect of the rich law may be left out: a foundation that yields by less than the thickness tolerance, or under layers
/// that all rupture by force (equivalent to a softer layer); damage that affects the punctures of at most one recording; any effect
/// with a residual below half a standard deviation of the noise.
fn may_go_undetected(effect: &str, setup: &CaseSetup) -> bool {
    match effect {
        "foundation" => {
            let softness = setup.rich.foundation.map_or(0.0, |f| f.softness);
            softness / (1.0 + softness) <= THICKNESS_TOLERANCE + setup.amounts.thickness
                || setup.truth.layers.iter().all(|l| l.puncture_n.is_some())
        }
        "damage" => setup.paths.len() == 1 || setup.rich.damage.is_none_or(|d| d.exponent > 10.0),
        _ => setup.strength_sd < 0.5,
    }
}

/// Scores an answer.
#[must_use]
pub fn score_answer(expected: &Expected, answer: &Answer) -> AnswerScore {
    let classes: Vec<Vec<&str>> = answer
        .causes
        .iter()
        .map(|c| {
            let mut class = vec![c.effect.as_str()];
            class.extend(c.equivalent.iter().map(String::as_str).filter(|e| *e != c.effect));
            class
        })
        .collect();
    // Each cause matches one wanted effect; exact names first, so that a class does not take the place of another.
    let mut taken = vec![false; classes.len()];
    let mut all_found = true;
    let mut missing = false;
    let mut order: Vec<&ExpectedCause> = expected.wanted.iter().collect();
    order.sort_by_key(|w| !answer.causes.iter().any(|c| c.effect == w.effect));
    for w in order {
        let exact =
            (0..classes.len()).find(|&k| !taken[k] && classes[k][0] == w.effect && w.fits(&classes[k]));
        let found = exact.or_else(|| (0..classes.len()).find(|&k| !taken[k] && w.fits(&classes[k])));
        match found {
            Some(k) => taken[k] = true,
            None => {
                all_found &= w.may_be_silent;
                missing |= !w.may_be_silent;
            }
        }
    }
    let described = |c: &str| expected.optional.iter().chain(&expected.allowed).any(|o| o == c);
    let stray = (0..classes.len()).any(|k| {
        !taken[k] && (classes[k].len() > MAX_CLASS_SIZE || !classes[k].iter().any(|c| described(c)))
    });
    let says_allowed = classes.iter().flatten().any(|c| expected.allowed.iter().any(|a| a == c));
    let unknown = answer.verdict == Verdict::Unknown;
    let right = if expected.outside && expected.wanted.is_empty() {
        unknown && !stray
    } else if expected.outside {
        // Known effect together with an unmodelled force: found, under any verdict.
        !missing
    } else if unknown {
        expected.unknown_is_right && !missing && !stray
    } else {
        !missing && !stray && (says_allowed || !expected.asks_for_allowed)
    };
    let has_layers = expected.layers.is_none_or(|count| count == answer.layer_count());
    AnswerScore { correct: right && has_layers, wrong_name: stray, all_found }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scoring::diagnosis_answer::Cause;

    fn says(verdict: Verdict, causes: &[(&str, &[&str])]) -> Answer {
        let causes = causes
            .iter()
            .map(|(e, also)| Cause {
                effect: (*e).to_owned(),
                equivalent: also.iter().map(|a| (*a).to_owned()).collect(),
                ..Cause::default()
            })
            .collect();
        Answer { verdict, causes, ..Answer::none() }
    }

    fn wants(effects: &[&str]) -> Expected {
        let wanted = effects
            .iter()
            .map(|e| ExpectedCause {
                effect: (*e).to_owned(),
                also: Vec::new(),
                may_be_silent: false,
                unseen: false,
            })
            .collect();
        Expected { wanted, ..Expected::default() }
    }

    #[test]
    fn clean_data_are_to_be_called_clean() {
        assert!(score_answer(&wants(&[]), &says(Verdict::None, &[])).correct);
        let false_attribution = score_answer(&wants(&[]), &says(Verdict::Named, &[("force_bias", &[])]));
        assert!(!false_attribution.correct && false_attribution.wrong_name);
        assert!(!score_answer(&wants(&[]), &says(Verdict::Unknown, &[])).correct);
    }

    #[test]
    fn a_cause_is_right_alone_or_in_a_small_class() {
        let one = wants(&["coulomb_friction"]);
        assert!(score_answer(&one, &says(Verdict::Named, &[("coulomb_friction", &[])])).correct);
        let class: &[&str] = &["coulomb_friction"];
        assert!(score_answer(&one, &says(Verdict::Ambiguous, &[("stribeck_friction", class)])).correct);
        let wide: &[&str] = &["a", "b", "c", "coulomb_friction"];
        assert!(!score_answer(&one, &says(Verdict::Ambiguous, &[("stribeck_friction", wide)])).correct);
        let extra_cause =
            score_answer(&one, &says(Verdict::Named, &[("coulomb_friction", &[]), ("force_drift", &[])]));
        assert!(!extra_cause.correct && extra_cause.all_found && extra_cause.wrong_name);
    }

    #[test]
    fn two_effects_ask_for_two_causes() {
        let two = wants(&["coulomb_friction", "force_bias"]);
        assert!(
            score_answer(&two, &says(Verdict::Named, &[("force_bias", &[]), ("coulomb_friction", &[])]))
                .correct
        );
        let class: &[&str] = &["force_bias"];
        assert!(!score_answer(&two, &says(Verdict::Ambiguous, &[("coulomb_friction", class)])).correct);
    }

    #[test]
    fn effects_outside_the_library_are_unknown_and_unidentifiable_ones_are_not_named() {
        let outside = Expected { outside: true, unknown_is_right: true, ..Expected::default() };
        assert!(score_answer(&outside, &says(Verdict::Unknown, &[])).correct);
        assert!(!score_answer(&outside, &says(Verdict::None, &[])).correct);
        assert!(score_answer(&outside, &says(Verdict::Named, &[("force_bias", &[])])).wrong_name);
        let mut gain = wants(&["force_gain"]);
        gain.wanted[0].unseen = true;
        gain.wanted[0].may_be_silent = true;
        assert!(score_answer(&gain, &says(Verdict::None, &[])).correct);
        assert!(!score_answer(&gain, &says(Verdict::Named, &[("force_gain", &[])])).correct);
    }

    #[test]
    fn traces_do_not_count() {
        let mut answer = says(Verdict::None, &[]);
        answer.negligible.push(crate::scoring::diagnosis_answer::NegligibleEffect::default());
        assert!(score_answer(&wants(&[]), &answer).correct);
    }
}
