//! Definition of a claim: measure, criterion, sensitivity conditions and assumed values, and its evaluation on a study.

use super::claim::{Claim, Condition, Primary};
use super::verdict_reason;
use crate::algorithm_variant::Setup;
use crate::all_runs::Study;
use crate::assumed_value_changes::AssumedValue;
use crate::claim_protocol::Protocol;
use crate::claim_verdict::{Trial, Verdict, verdict};
use crate::effect_size::{Criterion, Measured};
use crate::study_conditions::View;

/// Measures a claim under a condition.
pub type Measure = fn(&View<'_>) -> Measured;

/// A condition that shows how far a claim generalises; it never decides.
#[derive(Clone, Copy, Debug)]
pub struct Sensitivity {
    /// Name, as in the protocol.
    pub name: &'static str,
    /// Criterion that its effect is compared with.
    pub bar: Criterion,
    /// The measure under this condition.
    pub measure: Measure,
}

/// Definition of a claim.
#[derive(Clone, Debug)]
pub struct Definition {
    /// The protocol's text.
    pub protocol: &'static str,
    /// Measure and criterion of the primary condition; `None` for a claim that no simulation can test.
    pub primary: Option<(Measure, Criterion)>,
    /// Sensitivity conditions.
    pub sensitivities: Vec<Sensitivity>,
    /// Assumed values that enter the primary condition.
    pub assumed_values: Vec<AssumedValue>,
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

/// Name of the condition with known surface and layer depths.
pub(super) const KNOWN_DEPTH: &str = "depth known";
/// Name of the condition with the published defaults.
pub(super) const PUBLISHED_TUNING: &str = "published default tuning (s1 0.15 N, beta 0.075 N/s)";

/// The assumed values of the single gels.
pub(super) const GELS: [AssumedValue; 5] = [
    AssumedValue::Noise,
    AssumedValue::GelStiffness,
    AssumedValue::GelFriction,
    AssumedValue::GelContrast,
    AssumedValue::TravelInAir,
];

impl Definition {
    /// A claim with its primary condition.
    pub(super) fn new(
        protocol: &'static str,
        measure: Measure,
        bar: Criterion,
        assumed_values: &[AssumedValue],
    ) -> Self {
        Self {
            protocol,
            primary: Some((measure, bar)),
            sensitivities: Vec::new(),
            assumed_values: assumed_values.to_vec(),
            on_arm: false,
        }
    }

    /// A claim that no simulation can test.
    pub(super) const fn untestable(protocol: &'static str) -> Self {
        Self { protocol, primary: None, sensitivities: Vec::new(), assumed_values: Vec::new(), on_arm: false }
    }

    /// Adds a sensitivity condition with the criterion of the claim.
    pub(super) fn with_sensitivity(mut self, name: &'static str, measure: Measure) -> Self {
        let bar = self.primary.map_or(Criterion::Above(0.0), |(_, bar)| bar);
        self.sensitivities.push(Sensitivity { name, bar, measure });
        self
    }

    /// Evaluates the claim on a study.
    #[must_use]
    pub fn evaluate(&self, study: &Study) -> Claim {
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
        let says = bar.evaluate(&effect);
        let trials: Vec<Trial> = self
            .assumed_values
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
                Condition { name: s.name.to_owned(), bar: s.bar, says: s.bar.evaluate(&effect), effect }
            })
            .collect();
        let parts = parts
            .into_iter()
            .map(|(name, effect)| Condition { name, bar, says: bar.evaluate(&effect), effect })
            .collect();
        let primary = Primary { bar, effect, says, parts };
        let verdict = verdict(says, &trials);
        let reason = verdict_reason::reason(&primary, &trials, &sensitivities);
        Claim { sensitivities, trials, ..head(Some(primary), verdict, reason) }
    }
}

/// The view with known surface and layer depths.
pub(super) fn with_known_depth<'a>(view: &View<'a>) -> View<'a> {
    view.setup(Setup::KnownDepth)
}

/// The view with the published defaults.
pub(super) fn with_published_tuning<'a>(view: &View<'a>) -> View<'a> {
    view.setup(Setup::Published)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::all_runs::NOISE_MN;
    use crate::effect_size::{ExperimentValues, Scale};

    /// Per seed one value, the same in every view.
    fn constant(view: &View<'_>, value: f64) -> Measured {
        let values = vec![Some(value); view.seeds as usize];
        Measured { scale: Scale::Mean, parts: vec![ExperimentValues::new("made up", values)] }
    }

    #[test]
    fn sensitivity_conditions_decide_nothing_whatever_they_say() {
        let study = Study::planning(1, 10);
        let (holds, fails): (Measure, Measure) = (|v| constant(v, 0.0), |v| constant(v, 2.0));
        // Contradicted alone when the noise is doubled: the number decides.
        let hangs: Measure = |v| constant(v, if v.noise_mn > NOISE_MN { 2.0 } else { 0.0 });
        for (primary, assumed_values, expected) in [
            (holds, &[AssumedValue::Noise][..], Verdict::Supported),
            (fails, &[AssumedValue::Noise], Verdict::Contradicted),
            (hangs, &[AssumedValue::Noise], Verdict::Assumed),
            (hangs, &[], Verdict::Supported),
        ] {
            let plain = Definition::new(protocol!("e"), primary, Criterion::Below(1.0), assumed_values);
            let alone = plain.evaluate(&study);
            assert_eq!(alone.verdict, expected);
            for more in [
                plain.clone().with_sensitivity("holds", holds),
                plain.clone().with_sensitivity("fails", fails),
            ] {
                let judged = more.evaluate(&study);
                assert_eq!((judged.verdict, &judged.primary), (expected, &alone.primary));
                assert_eq!(judged.sensitivities.len(), 1);
            }
        }
    }
}
