//! Identifiability: effects whose signature is absorbed by the fitted parameters, and motions that would reveal them.

use crate::diagnosis_json::Cause;
use crate::motion_period::common_motion_period_s;
use rayon::prelude::*;
use stylet_identify::fit::Fit;
use stylet_identify::likelihood::FitData;
use stylet_identify::model::EffectTerm;
use stylet_identify::score_test::ScoreTest;
use stylet_tissue::{ChainStage, EffectInfo, FitScale, Proposal};

/// An effect of typical size that would gain less than this many nats is not identifiable.
pub(crate) const MIN_DETECTABLE_NATS: f64 = 10.0;

/// Effects that are not identifiable from these recordings, in the order of the library.
#[must_use]
pub fn not_identifiable(best: &Fit, data: &FitData) -> Vec<String> {
    let score_test = ScoreTest::new(best, data);
    let entries: Vec<&'static EffectInfo> = best
        .model
        .assumed
        .candidates()
        .filter(|i| best.model.effects.iter().all(|e| e.info.id != i.id))
        .collect();
    let identifiable: Vec<bool> = entries.par_iter().map(|info| is_identifiable(info, &score_test)).collect();
    entries.iter().zip(identifiable).filter(|(_, s)| !s).map(|(i, _)| i.id.to_owned()).collect()
}

fn is_identifiable(info: &'static EffectInfo, score_test: &ScoreTest) -> bool {
    match typical_size(info, score_test) {
        Some((_, nats)) => nats >= MIN_DETECTABLE_NATS,
        // Free thicknesses absorb a shifted layer boundary.
        None if matches!(info.proposal, Proposal::LayerFaces(_)) => !score_test.fit.model.free.thickness,
        None => !has_clock(info) || common_motion_period_s(score_test.data).is_none(),
    }
}

/// Parameters of an effect at its typical size, and the nats that it would gain; the largest over its shapes. `None` for an effect
/// without a column to test.
pub(crate) fn typical_size(info: &'static EffectInfo, score_test: &ScoreTest) -> Option<(Vec<f64>, f64)> {
    let start = || info.parameters.iter().map(|p| p.start).collect::<Vec<f64>>();
    let typical = |group: &[&[f64]]| -> Vec<f64> {
        info.parameters
            .iter()
            .enumerate()
            .map(|(k, p)| if p.strength && p.fit_scale() == FitScale::Linear { p.start } else { group[0][k] })
            .collect()
    };
    let shapes = match info.proposal {
        Proposal::LinearColumns(groups) => groups.iter().map(|g| typical(g)).collect(),
        Proposal::TissueMotion | Proposal::SpectralTone | Proposal::MembraneRupture => vec![start()],
        Proposal::LayerFaces(_) | Proposal::SplitTerm(_) | Proposal::RawSamples | Proposal::PerLayer => {
            return None;
        }
    };
    // At a multiple of the commanded motion a clock shows nothing of its own.
    let is_hidden = has_clock(info) && common_motion_period_s(score_test.data).is_some();
    let gain = |values: Vec<f64>| {
        let column = score_test.effect_column(&EffectTerm::new(info, &values))?;
        let nats = score_test.gain(&[column]).detectable_nats;
        Some((values, if is_hidden { 0.0 } else { nats }))
    };
    let best = shapes.into_iter().filter_map(gain).max_by(|a, b| a.1.total_cmp(&b.1));
    Some(best.unwrap_or_else(|| (start(), 0.0)))
}

fn has_clock(info: &EffectInfo) -> bool {
    info.parameters.iter().any(|p| p.clock)
}

/// Advice on motions that would separate equivalent effects or reveal hidden ones.
#[must_use]
pub fn advice(causes: &[Cause], not_identifiable: &[String], motion_period_s: Option<f64>) -> Vec<String> {
    let mut advice = Vec::new();
    for cause in causes.iter().filter(|c| !c.equivalent.is_empty()) {
        advice.push(format!(
            "{} and {} explain these recordings equally well. A motion with a rippled speed, a hold inside every layer and a \
             retraction separates most of them.",
            cause.effect,
            cause.equivalent.join(", ")
        ));
    }
    if let Some(period_s) = motion_period_s {
        advice.push(format!(
            "The motion of every recording is periodic ({period_s:.3} s): a cause with a clock of its own is not identifiable at its multiples. A \
             hold of several periods inside the tissue, or a recording with another period, separates them."
        ));
    }
    let hidden = |place: ChainStage| {
        not_identifiable.iter().any(|i| stylet_tissue::known_effect_info(i).is_some_and(|e| e.stage == place))
    };
    if hidden(ChainStage::Friction) {
        advice.push(
            "Friction effects are not identifiable at one constant speed: vary the speed within each layer, and retract."
                .to_owned(),
        );
    }
    if hidden(ChainStage::Sensor) {
        advice.push(
            "A wrong gain of the force sensor has the same effect as other stiffness, friction and puncture forces: check it with a known weight."
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
    fn advice_follows_from_equivalent_and_hidden_effects() {
        let cause = |effect: &str, equivalent: &[&str]| Cause {
            effect: effect.to_owned(),
            equivalent: equivalent.iter().map(|e| (*e).to_owned()).collect(),
            confidence: 1.0,
            parameters: BTreeMap::new(),
            gain_nats: 0.0,
            share: 0.0,
            ..Cause::default()
        };
        assert!(
            advice(
                &[cause("force_bias", &[])],
                &["hidden_membrane".to_owned(), "no such effect".to_owned()],
                None
            )
            .is_empty()
        );
        let one = advice(
            &[cause("force_bias", &[]), cause("time_delay", &["low_pass_lag", "tool_inertia"])],
            &[],
            None,
        );
        assert!(
            one.len() == 1 && one[0].starts_with("time_delay and low_pass_lag, tool_inertia explain"),
            "{one:?}"
        );
        let friction = advice(&[], &["coulomb_friction".to_owned()], None);
        assert!(friction.len() == 1 && friction[0].starts_with("Friction effects"), "{friction:?}");
        let sensor = advice(&[], &["hidden_membrane".to_owned(), "force_gain".to_owned()], None);
        let clock = advice(&[], &["respiration".to_owned()], Some(8.0));
        assert!(clock.len() == 1 && clock[0].contains("(8.000 s)"), "{clock:?}");
        assert!(sensor.len() == 1 && sensor[0].starts_with("A wrong gain"), "{sensor:?}");
    }
}
