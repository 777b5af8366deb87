//! Chooses between start values from the scenario and start values from the data, for scenarios whose parameters are a rough guess.

use crate::base_law_fit::{PreparedRecordings, fit_base_law, leaves_noise, refit_with_random_effects};
use crate::baseline_search::EffectSearch;
use crate::effect_selection::OneEffectFit;
use crate::found_tissue::{FoundTissue, MIN_THICKNESS_M};
use crate::layer_starts::layer_starts;
use crate::random_effect_selection::select_random_effects;
use crate::selection_state::Search;
use std::cell::LazyCell;
use std::sync::Arc;
use stylet_identify::fit::Fit;
use stylet_identify::likelihood::FitData;
use stylet_identify::model::{Assumptions, MAX_TOLERANCES_WIDE};
use stylet_record::Recording;
use stylet_tissue::Layer;

/// Lower bound of a parameter found in the data, as a share of the assumed one, so that none is zero.
const MIN_SHARE_OF_ASSUMED: f64 = 1e-3;
/// Share of a tolerance within which a parameter is at its bound.
const AT_BOUND: f64 = 1e-6;
/// Largest number of assignments of force drops that are tried with an effect.
const MAX_STARTS: usize = 8;
/// Ratio of RMS residuals from which one fit is better, even if it leaves structure.
const BETTER_FACTOR: f64 = 2.0;

/// Searches for effects from the assumed parameters (A), from parameters found in the data (D), or from both. `None` when the model cannot
/// be replayed.
///
/// D is the best of several starts: the layers that the online algorithm finds, and those of every assignment of force drops to layers
/// ([`layer_starts`]).
///
/// 1. Only A is searched if its base law leaves only noise, with thicknesses too within tolerance, or if no layers are found in the data.
/// 2. A is searched for a single effect first if a short fit of A with one effect has an RMS residual smaller than the base law from D by
///    [`BETTER_FACTOR`]. Without such a fit too, unless the base law from D leaves only noise, has a residual smaller than that from A by
///    this factor, or a smaller one at all while the fit from A is out of tolerance. If the search from A leaves only noise within
///    tolerance, it is completed and returned.
/// 3. D is the start that fits best with one effect ([`best_start`]). If the search from there leaves only noise out of tolerance, it is
///    completed and returned.
///    If both searches are within tolerance and have the same effects, D is dropped: it would repeat A.
/// 4. If the search from A ended out of tolerance and leaves only noise under weak priors, it is completed with these and returned.
/// 5. Otherwise A is completed, and D unless A then leaves only noise within tolerance and was searched first or has no more effects than D
///    needs. The one that leaves only noise is returned; of two, the one with fewer effects (if equal: A, unless it
///    is out of tolerance); of none, A, unless the RMS residual of D is smaller by [`BETTER_FACTOR`].
pub(crate) fn search_from_any_start(
    prepared: PreparedRecordings,
    recordings: &[Recording],
    progress: &mut dyn FnMut(&str),
) -> Option<(Search, PreparedRecordings)> {
    let assumed = BaseLaw::fit(prepared)?;
    let is_out = |fit: &Fit| is_out_of_tolerance(&assumed.prepared.assumed, fit);
    let model = &assumed.fit.model;
    let is_as_assumed =
        !is_out(&assumed.fit) && !(0..model.layers()).any(|layer| model.thickness_out_of_tolerance(layer));
    let mut starts = if is_as_assumed && assumed.leaves_noise() {
        Vec::new()
    } else {
        starts_in_data(&assumed.prepared, recordings)
    };
    // The two starts that were found in different ways.
    let first: Vec<BaseLaw> = starts.drain(..starts.len().min(2)).filter_map(BaseLaw::fit).collect();
    let Some(simplest) = first.iter().min_by(|a, b| a.rms_n().total_cmp(&b.rms_n())) else {
        return Some(assumed.first_effect(progress).complete(progress));
    };
    let ratio = assumed.rms_n() / simplest.rms_n();
    let explains = |found: &Search| found.leaves_noise(&found.best);
    let count = |found: &Search| found.best.model.effects.len();
    let with_effect = LazyCell::new(|| assumed.one_effect_fit());
    let data_first =
        (simplest.leaves_noise() || ratio > BETTER_FACTOR || (ratio > 1.0 && is_out(&assumed.fit)))
            && BETTER_FACTOR * with_effect.rms_n > simplest.rms_n();
    let is_final = |found: &EffectSearch| explains(&found.search) && !is_out(&found.search.best);
    let mut from_assumed = None;
    if !data_first {
        let found = assumed.first_effect(progress);
        if is_final(&found) {
            return Some(found.complete(progress));
        }
        from_assumed = Some(found);
    }
    let measured = if simplest.leaves_noise() {
        Some(simplest.clone())
    } else {
        best_start(
            &assumed,
            with_effect.rms_n,
            first.into_iter().chain(starts.into_iter().filter_map(BaseLaw::fit)),
        )
    };
    let from_data = measured.as_ref().map(|m| m.first_effect(progress));
    let from_data = match from_data {
        Some(found) if explains(&found.search) && is_out(&found.search.best) => {
            return Some(found.complete(progress));
        }
        found => found,
    };
    let from_assumed = from_assumed.unwrap_or_else(|| assumed.first_effect(progress));
    if data_first && is_final(&from_assumed) {
        return Some(from_assumed.complete(progress));
    }
    // Two searches at the same effects, with all parameters within tolerance, would give the same result.
    let effects =
        |found: &EffectSearch| found.search.best.model.effects.iter().map(|e| e.info.id).collect::<Vec<_>>();
    let is_same = |a: &EffectSearch, b: &EffectSearch| {
        !is_out(&a.search.best) && !is_out(&b.search.best) && effects(a) == effects(b)
    };
    let from_data = from_data.filter(|d| !is_same(d, &from_assumed));
    if is_out(&from_assumed.search.best) {
        let relaxed = from_assumed.clone().with_weak_priors();
        if explains(&relaxed.search) {
            return Some(relaxed.complete(progress));
        }
    }
    let assumed = from_assumed.complete(progress);
    let Some(from_data) = from_data else { return Some(assumed) };
    // The search from the data needs at least one effect more than it has now.
    let is_simplest = !data_first || count(&assumed.0) <= count(&from_data.search) + 1;
    if is_simplest && explains(&assumed.0) && !is_out(&assumed.0.best) {
        return Some(assumed);
    }
    progress("searching from other numbers");
    let data = from_data.complete(progress);
    let rms_n = |found: &Search| found.best.rms_n(&found.data);
    let is_data_better = match (explains(&assumed.0), explains(&data.0)) {
        (true, true) if is_out(&assumed.0.best) => count(&data.0) <= count(&assumed.0),
        (true, true) => count(&data.0) < count(&assumed.0),
        (false, false) => rms_n(&assumed.0) > BETTER_FACTOR * rms_n(&data.0),
        (_, data_explains) => data_explains,
    };
    Some(if is_data_better { data } else { assumed })
}

/// A fit of the base law with its data.
#[derive(Clone)]
struct BaseLaw {
    prepared: PreparedRecordings,
    fit: Fit,
    data: FitData,
}

impl BaseLaw {
    fn fit(prepared: PreparedRecordings) -> Option<Self> {
        let (fit, data) = fit_base_law(&prepared)?;
        Some(Self { prepared, fit, data })
    }

    fn leaves_noise(&self) -> bool {
        leaves_noise(&self.fit, &self.data)
    }

    fn rms_n(&self) -> f64 {
        self.fit.rms_n(&self.data)
    }

    fn first_effect(&self, progress: &mut dyn FnMut(&str)) -> EffectSearch {
        first_effect(&self.prepared, self.fit.clone(), self.data.clone(), progress)
    }

    fn one_effect_fit(&self) -> OneEffectFit {
        Search::start(self.fit.clone(), self.data.clone()).one_effect_fit(&self.prepared)
    }
}

/// Selects random effects and searches for one effect from a fit of the base law.
pub(crate) fn first_effect(
    prepared: &PreparedRecordings,
    base: Fit,
    data: FitData,
    progress: &mut dyn FnMut(&str),
) -> EffectSearch {
    let (base, data) = select_random_effects(base, data);
    let (base, data) = refit_with_random_effects(prepared, base, data);
    EffectSearch::first_effect(prepared, base, data, progress)
}

/// Starts in the data: first the layers that the online algorithm finds, then those from assignments of force drops.
fn starts_in_data(prepared: &PreparedRecordings, recordings: &[Recording]) -> Vec<PreparedRecordings> {
    let assumed = &prepared.assumed;
    let found = FoundTissue::new(recordings, None);
    let surface_m = found.as_ref().map_or(assumed.tissue.surface_m, |f| f.surface_m);
    let start = |layers: Vec<Layer>, rupture_times_s: Option<Vec<Vec<f64>>>| PreparedRecordings {
        assumed: Arc::new(with_layers(assumed, surface_m, layers)),
        rupture_times_s,
        ..prepared.clone()
    };
    let found = found.map(|found| start(found.layers_for(&assumed.tissue.layers), None));
    let assigned = layer_starts(prepared, surface_m).into_iter().take(MAX_STARTS);
    found.into_iter().chain(assigned.map(|s| start(s.layers, Some(s.rupture_times_s)))).collect()
}

/// The start that fits best with one effect; the first one that leaves only noise ends the search. `None` if its base law is within tolerance
/// of the assumed parameters, or if those leave an RMS residual (`assumed_rms_n`) that is smaller by [`BETTER_FACTOR`].
fn best_start(
    assumed: &BaseLaw,
    assumed_rms_n: f64,
    starts: impl Iterator<Item = BaseLaw>,
) -> Option<BaseLaw> {
    let mut best: Option<(OneEffectFit, BaseLaw)> = None;
    for tried in starts {
        let fit = tried.one_effect_fit();
        let leaves_noise = fit.leaves_noise;
        if best.as_ref().is_none_or(|b| fit.criterion_nats < b.0.criterion_nats) {
            best = Some((fit, tried));
        }
        if leaves_noise {
            break;
        }
    }
    let (fit, measured) = best?;
    let is_elsewhere = is_out_of_tolerance(&assumed.prepared.assumed, &measured.fit);
    (is_elsewhere && fit.rms_n < BETTER_FACTOR * assumed_rms_n).then_some(measured)
}

/// Whether a fitted surface, stiffness, friction or puncture force is outside the tolerance of the assumed one, or a thickness outside the
/// bounds of a fit from the assumed one.
fn is_out_of_tolerance(assumed: &Assumptions, fit: &Fit) -> bool {
    let moved_m = (assumed.tissue.surface_m - fit.model.tissue.surface_m).abs();
    let layers = assumed.tissue.layers.iter().zip(&fit.model.tissue.layers).enumerate();
    moved_m > 2.0 * assumed.surface_tolerance_m
        || layers.into_iter().any(|(k, (a, b))| {
            let off = |a: f64, b: f64, tolerance: f64| (b / a - 1.0).abs() > (1.0 - AT_BOUND) * tolerance;
            off(a.stiffness_n_per_m, b.stiffness_n_per_m, assumed.tolerance[k])
                || off(a.friction_ns_per_m2, b.friction_ns_per_m2, assumed.tolerance[k])
                || off(a.thickness_m, b.thickness_m, MAX_TOLERANCES_WIDE * assumed.thickness_tolerance[k])
                || a.puncture_n.zip(b.puncture_n).is_some_and(|(a, b)| off(a, b, assumed.tolerance[k]))
        })
}

/// The assumed tissue with layers from the data, under weak priors; layers that the needle did not reach are unchanged.
fn with_layers(assumed: &Assumptions, surface_m: f64, layers: Vec<Layer>) -> Assumptions {
    let mut out = assumed.with_weak_priors();
    out.tissue.surface_m = surface_m;
    for (layer, found) in out.tissue.layers.iter_mut().zip(layers) {
        let replace = |x: &mut f64, value: f64| *x = value.max(MIN_SHARE_OF_ASSUMED * *x);
        replace(&mut layer.stiffness_n_per_m, found.stiffness_n_per_m);
        replace(&mut layer.friction_ns_per_m2, found.friction_ns_per_m2);
        layer.thickness_m = found.thickness_m.max(MIN_THICKNESS_M);
        if let Some((assumed_n, found_n)) = layer.puncture_n.as_mut().zip(found.puncture_n) {
            replace(assumed_n, found_n);
        }
    }
    out
}
