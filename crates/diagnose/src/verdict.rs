//! Assesses a finished selection: whether the residual is noise, and whether the selected effects are causes or imitations of an unmodelled
//! one.

use crate::competing_effects::{CompetingEffect, EQUIVALENCE_NATS};
use crate::confidence_intervals::{Covariance, release_unreached_punctures};
use crate::diagnosis_json::{
    BaseParameter, Cause, LabelledParameter, NegligibleEffect, ResidualStructureReport,
};
use crate::geometry_selection::free_geometry;
use crate::held_out::JackknifeResult;
use crate::model_comparison::confidence;
use crate::negligible_effects::Negligible;
use crate::outlier_segment_test::outlier_segment_p_value;
use crate::parameter_labels::label_parameters;
use crate::residual_tests::test_residuals;
use crate::selection_state::Search;
use crate::slow_noise::{MIN_EXCESS_SLOW, excess};
use crate::tone_detection::{detect_tones, with_noise_without_tones};
use crate::varying_coefficient_test::{FEATURES, VaryingCoefficient, varying_coefficient_test};
use rand::{SeedableRng, rngs::ChaCha8Rng};
use std::cell::LazyCell;
use stylet_identify::fit::{Effort, Fit, fit};
use stylet_identify::likelihood::{FitData, residuals};
use stylet_identify::model::ParameterRole;
use stylet_identify::noise::NoiseSource;
use stylet_identify::score_test::ScoreTest;
use stylet_stats::special_functions::chi_square_sf;
use stylet_tissue::EffectInfo;

/// p-value below which the residual has structure. It is small because sums over pairs of recordings have longer tails than their skewness
/// implies.
const MAX_STRUCTURE_P_VALUE: f64 = 1e-6;
/// Unexplained share of the base law's residual variance above the noise from which the verdict is `unknown`.
const MAX_UNEXPLAINED_SHARE: f64 = 0.1;
/// Excess variance of the residual, in units of the noise variance, from which it counts as unexplained.
const MIN_EXCESS: f64 = 0.8;
/// Excess variance from which the residual of a single recording counts as unexplained: its structure is not distinguishable from slow
/// noise.
const MIN_EXCESS_SINGLE: f64 = 3.0;
/// Gain of the varying-coefficient test, as a share of the largest gain of an effect, from which an effect is an imitation.
const MIN_IMITATION_SHARE: f64 = 0.02;
/// Smallest gain (nats) of that test for an imitation: chance gives half a nat, and an inexact motion some tens.
const MIN_IMITATION_NATS: f64 = 100.0;
/// Smallest gain (nats) of the varying-coefficient test for an imitation under long-memory noise.
const MIN_IMITATION_SLOW_NATS: f64 = 10.0;
/// Largest relative jackknife error of a cause in the presence of an unmodelled effect.
const MAX_RELATIVE_SE: f64 = 0.1;
/// Smallest share of the mean square error above the noise that such a cause removes.
pub(crate) const MIN_GAIN_BESIDE_UNKNOWN: f64 = 0.1;
/// Largest gain of the varying-coefficient test of such a cause in the reweighted fit, as a share of the loss without it.
const MAX_VARYING_SHARE: f64 = 0.001;
/// Largest gain of that test in the fit with equal weights, as a share of the loss without the cause.
const MAX_VARYING_SHARE_UNWEIGHTED: f64 = 0.03;
/// Largest gain of the varying-coefficient test, as a share of the loss, for effects that can imitate any force of their kind.
const MAX_VARYING_SHARE_IMITATING: f64 = 0.0005;

/// Seed of the bootstrap, constant so that equal recordings give equal results.
pub(crate) const BOOTSTRAP_SEED: u64 = 1;

/// Assessment of a selection.
pub(crate) struct Assessment {
    pub causes: Vec<Cause>,
    /// Evidence (nats) against zero strength of each effect.
    pub nats_against_zero: Vec<(String, f64)>,
    pub base_parameters: Vec<BaseParameter>,
    /// Identifiability of each parameter, and covariance of the estimates.
    pub labels: (Vec<LabelledParameter>, Vec<Vec<f64>>),
    pub residual_structure: ResidualStructureReport,
    pub unknown: bool,
    /// Whether the residual has tones.
    pub has_tones: bool,
}

/// p-value of a tone whose power is `excess` times that of all other frequencies, in white noise (Fisher 1929).
fn tone_p_value(excess: f64, blocks: usize) -> f64 {
    let bins = 0.5 * blocks as f64;
    (bins * libm::pow(1.0 + excess, 1.0 - bins)).clamp(f64::MIN_POSITIVE, 1.0)
}

/// Assesses the residual and the effects of a finished selection. If the residual has tones, the data of the search get the noise estimated
/// without them.
pub(crate) fn assess_search(search: &mut Search, competing: &[Vec<CompetingEffect>]) -> Assessment {
    let tests = test_residuals(&search.best, &search.data);
    let tones = detect_tones(&search.best, &search.data);
    let without_tones = if tones.is_empty() {
        search.data.clone()
    } else {
        with_noise_without_tones(&search.best, &search.data, &tones)
    };
    let (before, after) = (
        excess(&without_tones, &search.base.residuals.residual_n),
        excess(&without_tones, &search.best.residuals.residual_n),
    );
    let has_tones = !tones.is_empty() && after > MIN_EXCESS;
    let share = (after.max(0.0) / before.max(1e-9)).min(1.0);
    let single = search.data.recording_count() < 2;
    let significant = if single {
        after > MIN_EXCESS_SINGLE
    } else {
        after > MIN_EXCESS && tests.coloured_noise.p_value < MAX_STRUCTURE_P_VALUE
    };
    let beyond_slow_noise = after > MIN_EXCESS_SLOW && tests.white_noise.p_value < MAX_STRUCTURE_P_VALUE;
    let segment_p = outlier_segment_p_value(&without_tones, &search.best.residuals.residual_n);
    let without = |k: usize| {
        fit(
            &search.best.model.without_effect(k),
            &search.data,
            Effort { max_iterations: 3, min_gain_nats: 1.0 },
        )
    };
    let without: Vec<Option<Fit>> = (0..search.best.model.effects.len()).map(without).collect();
    // Intervals use the noise of the whole residual, including structure and slow parts.
    let slow_data =
        search.data.with_estimated_noise(&search.best.residuals.residual_n, NoiseSource::LongMemory);
    let with_slow_noise =
        fit(&free_geometry(&search.best.model), &slow_data, Effort { max_iterations: 3, min_gain_nats: 0.1 })
            .unwrap_or_else(|| search.best.clone());
    let with_slow_noise = release_unreached_punctures(with_slow_noise, &slow_data);
    let imitation = find_imitation(&search.best, &search.data, &without, (&with_slow_noise, &slow_data));
    let unknown = imitation.is_some()
        || (share > MAX_UNEXPLAINED_SHARE
            && (significant || beyond_slow_noise || has_tones || segment_p.is_some()));
    let structure = if unknown && !significant { &tests.white_noise } else { &tests.coloured_noise };
    let covariance =
        Covariance::new(&with_slow_noise, &slow_data, &mut ChaCha8Rng::seed_from_u64(BOOTSTRAP_SEED));
    let (mut causes, mut nats_against_zero) = (Vec::new(), Vec::new());
    for (k, choice) in with_slow_noise.model.effects.iter().enumerate() {
        let competing = competing.get(k).map_or(&[][..], Vec::as_slice);
        let estimate = |p: usize| covariance.effect_parameter(k, p);
        let paths = choice.info.parameters.iter().map(|p| p.path.to_owned());
        let parameters = paths.enumerate().map(|(p, path)| (path, estimate(p))).collect();
        nats_against_zero
            .extend(covariance.nats_against_zero(k).map(|nats| (choice.info.id.to_owned(), nats)));
        let stage = search.stages.iter().rev().find(|s| s.selected.is_some_and(|t| t.0 == choice.info.id));
        let gain_nats = stage.and_then(|s| s.selected).map_or(0.0, |t| t.1);
        let needed = stage.map_or(0.0, |s| s.required_nats);
        let weights: f64 = competing.iter().map(|r| libm::exp(-r.nats_behind.max(-3.0))).sum();
        let returned =
            without[k].as_ref().map_or(0.0, |f| excess(&without_tones, &f.residuals.residual_n) - after);
        causes.push(Cause {
            effect: choice.info.id.to_owned(),
            equivalent: competing
                .iter()
                .filter(|r| r.nats_behind < EQUIVALENCE_NATS)
                .map(|r| r.name.to_owned())
                .collect(),
            confidence: confidence(gain_nats - needed, weights),
            parameters,
            gain_nats,
            share: (returned / before.max(1e-9)).clamp(0.0, 1.0),
            at_bound: covariance.effect_bounds(k),
            ..Cause::default()
        });
    }
    let base_parameters = base_parameters(&covariance);
    let labels = label_parameters(&covariance, &slow_data, &base_parameters, &causes);
    causes.sort_by(|a, b| b.gain_nats.total_cmp(&a.gain_nats));
    let mut depends_on: Vec<String> = structure.depends_on.iter().map(|d| d.0.clone()).collect();
    if has_tones {
        depends_on.insert(0, "frequency".to_owned());
    } else if unknown && depends_on.is_empty() {
        depends_on.push(imitation.map_or("time", |b| b.feature).to_owned());
    }
    let imitation_p = imitation
        .map_or(1.0, |b| (chi_square_sf(2.0 * b.nats, 1.0) * FEATURES.len() as f64).max(f64::MIN_POSITIVE));
    let tone_p = if has_tones { tone_p_value(after, search.data.compared_block_count()) } else { 1.0 };
    let residual_structure = ResidualStructureReport {
        p_value: structure
            .p_value
            .min(tone_p)
            .min(imitation_p)
            .min(segment_p.filter(|_| unknown).unwrap_or(1.0)),
        depends_on,
        nats: structure.nats,
        share,
    };
    if has_tones {
        // All objectives then use the same noise.
        for fit in [&mut search.base, &mut search.best] {
            fit.residuals = residuals(&fit.model, &without_tones).unwrap_or_else(|| fit.residuals.clone());
        }
        search.data = without_tones;
    }
    Assessment { causes, nats_against_zero, base_parameters, labels, residual_structure, unknown, has_tones }
}

/// Varying-coefficient test of all effects: result of the effect with the largest gain, if it is an imitation. `without` are the fits
/// without each effect; `slow` is the fit under long-memory noise, because sensor drift resembles a dependence on time.
fn find_imitation(
    best: &Fit,
    data: &FitData,
    without: &[Option<Fit>],
    slow: (&Fit, &FitData),
) -> Option<VaryingCoefficient> {
    if without.is_empty() {
        return None;
    }
    let score_test = ScoreTest::new(best, data);
    let slow_score_test = LazyCell::new(|| ScoreTest::new(slow.0, slow.1));
    let loss = |reduced: &Option<Fit>| reduced.as_ref().map_or(0.0, |f| f.nats() - best.nats());
    let most = without.iter().map(loss).fold(0.0, f64::max);
    let test = |(k, reduced): (usize, &Option<Fit>)| {
        let result = varying_coefficient_test(&score_test, k, loss(reduced))?;
        let is_imitation = result.nats > MIN_IMITATION_NATS.max(MIN_IMITATION_SHARE * most)
            && varying_coefficient_test(&slow_score_test, k, loss(reduced))?.nats > MIN_IMITATION_SLOW_NATS;
        is_imitation.then_some(result)
    };
    without.iter().enumerate().filter_map(test).max_by(|a, b| a.nats.total_cmp(&b.nats))
}

/// Whether an effect remains a cause in the presence of an unmodelled one, by the reweighted fit and, if it was selected there too, the fit
/// with equal weights (`unweighted`).
pub(crate) fn is_kept(
    info: &EffectInfo,
    reweighted: &JackknifeResult,
    unweighted: Option<&JackknifeResult>,
) -> bool {
    let most =
        if info.absorbs_unmodelled { MAX_VARYING_SHARE_IMITATING } else { MAX_VARYING_SHARE_UNWEIGHTED };
    reweighted.relative_se < MAX_RELATIVE_SE
        && reweighted.varying_coefficient_share < MAX_VARYING_SHARE.min(most)
        && unweighted.is_none_or(|l| l.varying_coefficient_share < most)
        && [Some(reweighted), unweighted]
            .into_iter()
            .flatten()
            .all(|b| b.held_out_gain > MIN_GAIN_BESIDE_UNKNOWN)
}

/// Moves negligible causes to the list of negligible effects.
pub(crate) fn move_negligible(assessment: &mut Assessment, small: Vec<Negligible>) -> Vec<NegligibleEffect> {
    let mut moved = Vec::new();
    for s in small {
        if let Some(k) = assessment.causes.iter().position(|c| c.effect == s.effect) {
            let cause = assessment.causes.remove(k);
            moved.push(NegligibleEffect {
                effect: cause.effect,
                parameters: cause.parameters,
                reason: s.reason,
            });
        }
    }
    moved
}

/// Estimates of the base law's parameters with their intervals.
pub(crate) fn base_parameters(covariance: &Covariance) -> Vec<BaseParameter> {
    let mut out = Vec::new();
    let assumed_tissue = &covariance.fit.model.assumed.tissue;
    let mut add = |layer: usize, name: &str, role: ParameterRole, assumed: f64, scale: f64| {
        let Some((x, half)) = covariance.shared_parameter(role) else { return };
        let unreached = covariance.unreached_puncture(role);
        let reached_n = unreached.as_ref().map_or(f64::NEG_INFINITY, |u| u.reached_n);
        let value = (x * scale).max(reached_n);
        // Only the surface can be negative.
        let least = if role == ParameterRole::Surface { f64::NEG_INFINITY } else { 0.0 };
        let low = ((x - half) * scale).max(reached_n).max(least);
        let high = unreached.as_ref().map_or(x + half, |u| u.prior_upper_end.max(x + half));
        let high = (high * scale).max(value);
        out.push(BaseParameter {
            layer,
            name: name.to_owned(),
            assumed,
            value,
            low,
            high,
            changed: assumed < low || assumed > high,
            at_bound: covariance.at_bound(role),
            at_least: unreached.is_some(),
            out_of_tolerance: false,
        });
    };
    for (l, layer) in assumed_tissue.layers.iter().enumerate() {
        let (k, b) = (layer.stiffness_n_per_m, layer.friction_ns_per_m2);
        add(l + 1, "stiffness_n_per_m", ParameterRole::Stiffness(l), k, k);
        add(l + 1, "friction_ns_per_m2", ParameterRole::Friction(l), b, b);
        if let Some(f) = layer.puncture_n {
            add(l + 1, "puncture_n", ParameterRole::Puncture(l), f, f);
        }
        add(l + 1, "thickness_m", ParameterRole::Thickness(l), layer.thickness_m, 1.0);
    }
    add(0, "surface_m", ParameterRole::Surface, assumed_tissue.surface_m, 1.0);
    out
}

#[cfg(test)]
mod tests;
