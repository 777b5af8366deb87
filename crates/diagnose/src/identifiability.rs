//! Identifiability: effects whose signature the fitted parameters absorb, and motions that would make them identifiable.

use crate::check_json::EffectVisibility;
use crate::diagnosis_json::Cause;
use crate::geometry_selection::free_geometry;
use crate::motion_period::common_motion_period_s;
use std::collections::BTreeMap;
use std::sync::Arc;
use stylet_identify::fit::{Effort, Fit, fit};
use stylet_identify::likelihood::FitData;
use stylet_identify::model::EffectTerm;
use stylet_identify::score_test::{ScoreTest, scale_strengths};
use stylet_stats::parallel::*;
use stylet_tissue::{ChainStage, EffectInfo, FitScale, Proposal};

/// Approximate gain (nats) that the search requires of an effect with two parameters.
const REQUIRED_NATS: f64 = 12.0;
/// Expected gain (nats) from which an effect is identified in most cases. It exceeds the required gain because strength and held-out
/// improvement must be significant, too.
const SEEN_NATS: f64 = 100.0;
/// Largest multiple of an effect's typical size that is plausible.
const MAX_PLAUSIBLE_FACTOR: f64 = 30.0;
/// Iterations of the size for a given gain, which grows about with its square.
const SIZE_STEPS: usize = 3;

/// Detectable size of each effect that a fit does not contain; effects without a column to test are omitted.
///
/// The geometry is free and the priors on layer parameters are weak, because what follows from their tolerance alone is no evidence.
/// Effects that resemble each other are not distinguished here; the diagnosis lists them as equivalent.
pub fn visible_effects(best: &Fit, data: &FitData) -> Vec<EffectVisibility> {
    let mut model = free_geometry(&best.model);
    model.assumed = Arc::new(model.assumed.with_weak_priors());
    let fit = fit(&model, data, Effort { max_iterations: 3, min_gain_nats: 0.1 });
    let score_test = ScoreTest::new(fit.as_ref().unwrap_or(best), data);
    let missing: Vec<&'static EffectInfo> = missing_effects(best).collect();
    missing.par_iter().filter_map(|info| visibility(info, &score_test)).collect()
}

fn missing_effects(fit: &Fit) -> impl Iterator<Item = &'static EffectInfo> + '_ {
    fit.model.assumed.candidates().filter(|i| fit.model.effects.iter().all(|e| e.info.id != i.id))
}

fn visibility(info: &'static EffectInfo, score_test: &ScoreTest) -> Option<EffectVisibility> {
    let (values, nats) = typical_size(info, score_test)?;
    let scaled = |factor: f64| scale_strengths(info, &[&values], &[factor]);
    let size_at = |wanted_nats: f64| -> Option<BTreeMap<String, f64>> {
        let (mut factor, mut at) = (1.0, nats);
        for _ in 0..SIZE_STEPS {
            factor *= (wanted_nats / at.max(1e-12)).sqrt();
            if factor > MAX_PLAUSIBLE_FACTOR {
                return None;
            }
            let column = score_test.effect_column(&EffectTerm::new(info, &scaled(factor)))?;
            at = score_test.gain(&[column]).detectable_nats;
        }
        Some(info.parameters.iter().map(|p| p.path.to_owned()).zip(scaled(factor)).collect())
    };
    Some(EffectVisibility {
        effect: info.id.to_owned(),
        visible: nats >= SEEN_NATS,
        nats,
        smallest: size_at(SEEN_NATS),
        hidden_below: size_at(0.5 * REQUIRED_NATS),
    })
}

/// Effects that are not identifiable from these recordings, in the order of the library; `visible` contains those with a column to test.
pub fn not_identifiable(best: &Fit, data: &FitData, visible: &[EffectVisibility]) -> Vec<String> {
    let is_identifiable = |info: &EffectInfo| match visible.iter().find(|v| v.effect == info.id) {
        Some(v) => v.nats >= REQUIRED_NATS,
        // Free thicknesses absorb a shifted layer boundary.
        None if matches!(info.proposal, Proposal::LayerFaces(_)) => !best.model.free.thickness,
        None => !has_clock(info) || common_motion_period_s(data).is_none(),
    };
    missing_effects(best).filter(|info| !is_identifiable(info)).map(|i| i.id.to_owned()).collect()
}

/// Parameters of an effect at its typical size, and its expected gain (nats), the largest over its shapes. `None` for an effect without a
/// column to test.
fn typical_size(info: &'static EffectInfo, score_test: &ScoreTest) -> Option<(Vec<f64>, f64)> {
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
    // At a multiple of the commanded motion, a periodic effect is not identifiable.
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

/// Advice on motions that would distinguish equivalent effects or make effects identifiable.
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
