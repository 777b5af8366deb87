//! The paper's claims, each computed: one file per claim holds what is measured; the bar, the conditions and
//! the sources stand in its protocol (`claims/*.md`), which was written first.

mod a_friction_apart;
mod b_slightly_lower;
mod c_multi_layer_better;
mod d_kelvin_voigt_over;
mod e_f_detection;
mod g_only_ruptures;
mod h_no_reweighting;
mod i_reset_mechanisms;
mod j_weighting;
mod verdict_reason;

use crate::algorithm_variant::Setup;
use crate::all_runs::Study;
use crate::assumed_value_changes::Number;
use crate::claim_protocol::Protocol;
use crate::claim_verdict::{Trial, Verdict, verdict};
use crate::effect_size::{Bar, Effect, Measured, Says};
use crate::study_conditions::View;
use serde::Serialize;

/// Measures a claim under a condition.
pub type Measure = fn(&View<'_>) -> Measured;

/// A condition that says how far a claim carries, and never decides.
#[derive(Clone, Copy, Debug)]
pub struct Sensitivity {
    /// Name, as in the protocol.
    pub name: &'static str,
    /// What is asked of it.
    pub bar: Bar,
    /// The measure, with the condition in it.
    pub measure: Measure,
}

/// What is computed for a claim.
#[derive(Clone, Debug)]
pub struct Definition {
    /// The protocol's text.
    pub protocol: &'static str,
    /// The primary condition; none when no simulation can say.
    pub primary: Option<(Measure, Bar)>,
    /// Conditions that say how far it carries.
    pub sensitivities: Vec<Sensitivity>,
    /// Numbers of ours that enter the primary condition.
    pub numbers: Vec<Number>,
    /// Whether the arm takes part.
    pub on_arm: bool,
}

macro_rules! protocol {
    ($name:literal) => {
        include_str!(concat!("../../claims/", $name, ".md"))
    };
}
pub(crate) use d_kelvin_voigt_over::VISIBLY;
pub(crate) use protocol;

/// The name of the condition with everything known.
pub(crate) const KNOWN: &str = "depth known";
/// The name of the condition with the published defaults.
pub(crate) const PUBLISHED: &str = "published default tuning (s1 0.15 N, beta 0.075 N/s)";

/// The numbers of the single gels.
pub(crate) const GELS: [Number; 5] =
    [Number::Noise, Number::GelStiffness, Number::GelFriction, Number::GelContrast, Number::Start];

impl Definition {
    /// A claim with its primary condition.
    fn new(protocol: &'static str, measure: Measure, bar: Bar, numbers: &[Number]) -> Self {
        Self {
            protocol,
            primary: Some((measure, bar)),
            sensitivities: Vec::new(),
            numbers: numbers.to_vec(),
            on_arm: false,
        }
    }

    /// What no simulation can say.
    const fn untestable(protocol: &'static str) -> Self {
        Self { protocol, primary: None, sensitivities: Vec::new(), numbers: Vec::new(), on_arm: false }
    }

    /// Adds a condition with the claim's own bar.
    fn also(mut self, name: &'static str, measure: Measure) -> Self {
        let bar = self.primary.map_or(Bar::Above(0.0), |(_, bar)| bar);
        self.sensitivities.push(Sensitivity { name, bar, measure });
        self
    }

    /// Judges the claim on a study.
    #[must_use]
    pub fn judge(&self, study: &Study) -> Claim {
        let protocol = Protocol::read(self.protocol);
        let head = |primary, verdict, reason: String| Claim {
            id: protocol.id.clone(),
            claim: protocol.title.clone(),
            source: protocol.section("Source").to_owned(),
            verdict,
            reason,
            primary,
            sensitivities: Vec::new(),
            trials: Vec::new(),
            protocol: protocol.clone(),
        };
        let Some((measure, bar)) = self.primary else {
            let reason = format!("No run says: {}", protocol.section("Primary condition"));
            return head(None, Verdict::Untestable, reason);
        };
        let view = View::primary(study);
        let measured = measure(&view);
        let effect = measured.effect();
        let parts = measured.parts();
        let says = bar.judge(&effect);
        let trials: Vec<Trial> = self
            .numbers
            .iter()
            .flat_map(|n| n.changes())
            .map(|change| {
                let changed = measure(&view.changed(change, self.on_arm)).effect();
                Trial::new(change, changed, &effect, bar)
            })
            .collect();
        let sensitivities: Vec<Condition> = self
            .sensitivities
            .iter()
            .map(|s| {
                let effect = (s.measure)(&view).effect();
                Condition { name: s.name.to_owned(), bar: s.bar, says: s.bar.judge(&effect), effect }
            })
            .collect();
        let parts = parts
            .into_iter()
            .map(|(name, effect)| Condition { name, bar, says: bar.judge(&effect), effect })
            .collect();
        let primary = Primary { bar, effect, says, parts };
        let verdict = verdict(says, &trials);
        let reason = verdict_reason::reason(&primary, &trials, &sensitivities);
        Claim { sensitivities, trials, ..head(Some(primary), verdict, reason) }
    }
}

/// An effect under a named condition.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Condition {
    /// Under which circumstances.
    pub name: String,
    /// What is asked.
    pub bar: Bar,
    /// The effect.
    #[serde(flatten)]
    pub effect: Effect,
    /// What it says.
    pub says: Says,
}

/// The primary condition's result.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Primary {
    /// What is asked.
    pub bar: Bar,
    /// The effect over all experiments of the condition.
    #[serde(flatten)]
    pub effect: Effect,
    /// What it says.
    pub says: Says,
    /// The experiments one by one; they do not decide.
    pub parts: Vec<Condition>,
}

/// A claim with what the testbed says of it: a row of `claims.json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Claim {
    /// As in the protocols: `b1`.
    pub id: String,
    /// The claim.
    pub claim: String,
    /// Where the paper or its supplement makes it.
    pub source: String,
    /// The verdict.
    pub verdict: Verdict,
    /// Why, computed from the conditions.
    pub reason: String,
    /// The primary condition; none when untestable.
    pub primary: Option<Primary>,
    /// Conditions that say how far it carries.
    pub sensitivities: Vec<Condition>,
    /// Numbers of ours, halved and doubled.
    pub trials: Vec<Trial>,
    /// The protocol.
    #[serde(skip)]
    pub protocol: Protocol,
}

impl Claim {
    /// Numbers of ours on which the verdict hangs, as they were changed.
    pub fn hangs_on(&self) -> impl Iterator<Item = &Trial> {
        self.trials.iter().filter(|t| t.decides)
    }
}

/// What is computed for every claim, in the order of the protocols.
#[must_use]
pub fn definitions() -> Vec<Definition> {
    let mut all = vec![
        a_friction_apart::definition(),
        Definition::untestable(protocol!("a2")),
        b_slightly_lower::online(),
        b_slightly_lower::sinusoidal(),
        c_multi_layer_better::behind_the_gel(),
        c_multi_layer_better::on_the_liver(),
        d_kelvin_voigt_over::definition(),
    ];
    all.extend(e_f_detection::definitions());
    all.extend([
        Definition::untestable(protocol!("f2")),
        g_only_ruptures::definition(),
        h_no_reweighting::reconstructs(),
        h_no_reweighting::compensates(),
        i_reset_mechanisms::definition(),
        j_weighting::definition(),
    ]);
    all
}

/// All claims, judged.
#[must_use]
pub fn all(study: &Study) -> Vec<Claim> {
    definitions().iter().map(|d| d.judge(study)).collect()
}

/// The view with everything known.
pub(crate) fn known<'a>(view: &View<'a>) -> View<'a> {
    view.setup(Setup::KnownDepth)
}

/// The view with the published defaults.
pub(crate) fn published<'a>(view: &View<'a>) -> View<'a> {
    view.setup(Setup::Published)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn code_and_protocols_agree_on_ids_bars_conditions_and_numbers() {
        let definitions = definitions();
        let protocols: Vec<Protocol> = definitions.iter().map(|d| Protocol::read(d.protocol)).collect();
        let ids: Vec<&str> = protocols.iter().map(|p| p.id.as_str()).collect();
        assert_eq!(
            ids,
            ["a1", "a2", "b1", "b2", "c1", "c2", "d", "e", "f1", "f2", "g", "h1", "h2", "i", "j"]
        );
        for (definition, protocol) in definitions.iter().zip(&protocols) {
            let bar = definition.primary.map_or("none".to_owned(), |(_, bar)| bar.words());
            assert_eq!(bar, protocol.section("Supported when"), "{}", protocol.id);
            let names: Vec<&str> = definition.sensitivities.iter().map(|s| s.name).collect();
            assert_eq!(names, protocol.list("Sensitivity conditions"), "{}", protocol.id);
            let numbers: Vec<&str> = definition.numbers.iter().map(|n| n.name()).collect();
            assert_eq!(numbers, protocol.list("Numbers of ours, halved and doubled"), "{}", protocol.id);
            for heading in
                ["The paper says", "Source", "Primary condition", "Effect", "Assumed", "Untestable"]
            {
                assert!(!protocol.section(heading).is_empty(), "{}: {heading}", protocol.id);
            }
        }
    }

    /// Per seed one value, the same in every view.
    fn constant(view: &View<'_>, value: f64) -> Measured {
        let values = vec![Some(value); view.seeds as usize];
        Measured {
            scale: crate::effect_size::Scale::Mean,
            parts: vec![crate::effect_size::Part::new("made up", values)],
        }
    }

    #[test]
    fn sensitivity_conditions_decide_nothing_whatever_they_say() {
        let study = Study::asking(1, 10);
        let (holds, fails): (Measure, Measure) = (|v| constant(v, 0.0), |v| constant(v, 2.0));
        // Contradicted alone when the noise is doubled: the number decides.
        let hangs: Measure = |v| constant(v, if v.noise_mn > crate::all_runs::NOISE_MN { 2.0 } else { 0.0 });
        for (primary, numbers, expected) in [
            (holds, &[Number::Noise][..], Verdict::Supported),
            (fails, &[Number::Noise], Verdict::Contradicted),
            (hangs, &[Number::Noise], Verdict::Assumed),
            (hangs, &[], Verdict::Supported),
        ] {
            let plain = Definition::new(protocol!("e"), primary, Bar::Below(1.0), numbers);
            let alone = plain.judge(&study);
            assert_eq!(alone.verdict, expected);
            for more in [plain.clone().also("holds", holds), plain.clone().also("fails", fails)] {
                let judged = more.judge(&study);
                assert_eq!((judged.verdict, &judged.primary), (expected, &alone.primary));
                assert_eq!(judged.sensitivities.len(), 1);
            }
        }
    }
}
