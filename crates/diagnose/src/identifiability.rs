//! What an experiment cannot show: effects whose signature everything that is fitted imitates.

use crate::diagnosis_json::Cause;
use rayon::prelude::*;
use stylet_identify::fit::Fit;
use stylet_identify::likelihood::FitData;
use stylet_identify::model::EffectTerm;
use stylet_identify::score_test::ScoreTest;
use stylet_tissue::{ChainStage, EffectInfo, FitScale, Proposal, general_effects};

/// An effect of plausible size that would gain less than this is invisible (nats).
const LEAST_NATS: f64 = 10.0;

/// Effects that these recordings cannot show, in the order of the library.
#[must_use]
pub fn not_identifiable(best: &Fit, data: &FitData) -> Vec<String> {
    let look = ScoreTest::new(best, data);
    let entries: Vec<&'static EffectInfo> =
        general_effects().filter(|i| best.model.effects.iter().all(|e| e.info.id != i.id)).collect();
    let shown: Vec<bool> = entries.par_iter().map(|info| shows(info, &look)).collect();
    entries.iter().zip(shown).filter(|(_, s)| !s).map(|(i, _)| i.id.to_owned()).collect()
}

fn shows(info: &'static EffectInfo, look: &ScoreTest) -> bool {
    let typical = |group: &[&[f64]]| -> Vec<f64> {
        info.parameters
            .iter()
            .enumerate()
            .map(|(k, p)| if p.strength && p.fit_scale() == FitScale::Linear { p.start } else { group[0][k] })
            .collect()
    };
    match info.proposal {
        Proposal::LinearColumns(groups) => groups.iter().any(|g| {
            let own = |values: &[f64]| {
                let column = look.effect_column(&EffectTerm::new(info, values))?;
                Some(look.gain(&[column]).detectable_nats)
            };
            own(&typical(g)).is_some_and(|nats| nats >= LEAST_NATS)
        }),
        // Free faces imitate a shifted one.
        Proposal::LayerFaces(_) => !look.fit.model.free.thickness,
        Proposal::TissueMotion | Proposal::SpectralTone | Proposal::MembraneRupture => {
            let values: Vec<f64> = info.parameters.iter().map(|p| p.start).collect();
            look.effect_column(&EffectTerm::new(info, &values))
                .is_some_and(|c| look.gain(&[c]).detectable_nats >= LEAST_NATS)
        }
        Proposal::SplitTerm(_) | Proposal::RawSamples | Proposal::PerLayer => true,
    }
}

/// Which motion would tell more.
#[must_use]
pub fn advice(causes: &[Cause], invisible: &[String]) -> Vec<String> {
    let mut advice = Vec::new();
    for cause in causes.iter().filter(|c| !c.equivalent.is_empty()) {
        advice.push(format!(
            "{} and {} explain these recordings equally well. A motion with a rippled speed, a hold inside every layer and a \
             retraction tells most of them apart.",
            cause.effect,
            cause.equivalent.join(", ")
        ));
    }
    let unseen = |place: ChainStage| {
        invisible.iter().any(|i| stylet_tissue::effect_info(i).is_some_and(|e| e.stage == place))
    };
    if unseen(ChainStage::Friction) {
        advice.push(
            "Laws of friction do not show at one constant speed: vary the speed within each layer, and retract."
                .to_owned(),
        );
    }
    if unseen(ChainStage::Sensor) {
        advice.push(
            "A wrong gain of the force sensor looks like other stiffness, friction and puncture forces: check it with a known weight."
                .to_owned(),
        );
    }
    advice
}

#[cfg(test)]
mod tests {
    use super::advice;
    use crate::diagnosis_json::Cause;
    use std::collections::BTreeMap;

    #[test]
    fn advice_follows_from_what_cannot_be_told_apart_or_seen() {
        let cause = |effect: &str, equivalent: &[&str]| Cause {
            effect: effect.to_owned(),
            equivalent: equivalent.iter().map(|e| (*e).to_owned()).collect(),
            confidence: 1.0,
            parameters: BTreeMap::new(),
            gain_nats: 0.0,
            share: 0.0,
        };
        assert!(
            advice(&[cause("force_bias", &[])], &["hidden_membrane".to_owned(), "no such effect".to_owned()])
                .is_empty()
        );
        let one =
            advice(&[cause("force_bias", &[]), cause("time_delay", &["low_pass_lag", "tool_inertia"])], &[]);
        assert!(
            one.len() == 1 && one[0].starts_with("time_delay and low_pass_lag, tool_inertia explain"),
            "{one:?}"
        );
        let friction = advice(&[], &["coulomb_friction".to_owned()]);
        assert!(friction.len() == 1 && friction[0].starts_with("Laws of friction"), "{friction:?}");
        let sensor = advice(&[], &["hidden_membrane".to_owned(), "force_gain".to_owned()]);
        assert!(sensor.len() == 1 && sensor[0].starts_with("A wrong gain"), "{sensor:?}");
    }
}
