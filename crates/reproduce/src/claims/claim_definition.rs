//! Definition of a claim: measure, bar, sensitivity conditions and assumed values, and its evaluation on a study.

use super::claim::{Claim, Condition, Primary};
use super::verdict_reason;
use crate::algorithm_variant::Setup;
use crate::all_runs::Study;
use crate::assumed_value_changes::Number;
use crate::claim_protocol::Protocol;
use crate::claim_verdict::{Trial, Verdict, verdict};
use crate::effect_size::{Bar, Measured};
use crate::study_conditions::View;

/// Measures a claim under a condition.
pub type Measure = fn(&View<'_>) -> Measured;

/// A condition that shows how far a claim generalises; it never decides.
#[derive(Clone, Copy, Debug)]
pub struct Sensitivity {
    /// Name, as in the protocol.
    pub name: &'static str,
    /// The bar that its effect is compared with.
    pub bar: Bar,
    /// The measure under this condition.
    pub measure: Measure,
}

/// Definition of a claim.
#[derive(Clone, Debug)]
pub struct Definition {
    /// The protocol's text.
    pub protocol: &'static str,
    /// Measure and bar of the primary condition; `None` for a claim that no simulation can test.
    pub primary: Option<(Measure, Bar)>,
    /// Sensitivity conditions.
    pub sensitivities: Vec<Sensitivity>,
    /// Assumed values that enter the primary condition.
    pub numbers: Vec<Number>,
    /// Whether the simulated arm is used.
    pub on_arm: bool,
}

/// Text of a protocol by its file name.
macro_rules! protocol {
    ($name:literal) => {
        include_str!(concat!("../../claims/", $name, ".md"))
    };
}
pub(super) use protocol;

/// Name of the condition with everything known.
pub(super) const KNOWN: &str = "depth known";
/// Name of the condition with the published defaults.
pub(super) const PUBLISHED: &str = "published default tuning (s1 0.15 N, beta 0.075 N/s)";

/// The assumed values of the single gels.
pub(super) const GELS: [Number; 5] =
    [Number::Noise, Number::GelStiffness, Number::GelFriction, Number::GelContrast, Number::Start];

impl Definition {
    /// A claim with its primary condition.
    pub(super) fn new(protocol: &'static str, measure: Measure, bar: Bar, numbers: &[Number]) -> Self {
        Self {
            protocol,
            primary: Some((measure, bar)),
            sensitivities: Vec::new(),
            numbers: numbers.to_vec(),
            on_arm: false,
        }
    }

    /// A claim that no simulation can test.
    pub(super) const fn untestable(protocol: &'static str) -> Self {
        Self { protocol, primary: None, sensitivities: Vec::new(), numbers: Vec::new(), on_arm: false }
    }

    /// Adds a sensitivity condition with the bar of the claim.
    pub(super) fn also(mut self, name: &'static str, measure: Measure) -> Self {
        let bar = self.primary.map_or(Bar::Above(0.0), |(_, bar)| bar);
        self.sensitivities.push(Sensitivity { name, bar, measure });
        self
    }

    /// Evaluates the claim on a study.
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

/// The view with everything known.
pub(super) fn known<'a>(view: &View<'a>) -> View<'a> {
    view.setup(Setup::KnownDepth)
}

/// The view with the published defaults.
pub(super) fn published<'a>(view: &View<'a>) -> View<'a> {
    view.setup(Setup::Published)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::all_runs::NOISE_MN;
    use crate::effect_size::{Part, Scale};

    /// Per seed one value, the same in every view.
    fn constant(view: &View<'_>, value: f64) -> Measured {
        let values = vec![Some(value); view.seeds as usize];
        Measured { scale: Scale::Mean, parts: vec![Part::new("made up", values)] }
    }

    #[test]
    fn sensitivity_conditions_decide_nothing_whatever_they_say() {
        let study = Study::asking(1, 10);
        let (holds, fails): (Measure, Measure) = (|v| constant(v, 0.0), |v| constant(v, 2.0));
        // Contradicted alone when the noise is doubled: the number decides.
        let hangs: Measure = |v| constant(v, if v.noise_mn > NOISE_MN { 2.0 } else { 0.0 });
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
