//! Chooses between start values from the scenario and start values from the data, for scenarios whose parameters are a rough guess.

use crate::base_law_fit::{PreparedRecordings, fit_base_law, leaves_noise, refit_with_random_effects};
use crate::baseline_search::EffectSearch;
use crate::found_tissue::FoundTissue;
use crate::random_effect_selection::select_random_effects;
use crate::selection_state::Search;
use std::sync::Arc;
use stylet_identify::fit::Fit;
use stylet_identify::likelihood::FitData;
use stylet_identify::model::{Assumptions, MAX_TOLERANCES_WIDE};
use stylet_record::Recording;

/// Lower bound of a parameter found in the data, as a share of the assumed one, so that none is zero.
const MIN_SHARE_OF_ASSUMED: f64 = 1e-3;
/// Ratio of RMS residuals from which one fit is better, even if it leaves structure.
const BETTER_FACTOR: f64 = 2.0;

/// Searches for effects from the assumed parameters (A), from parameters found in the data (D), or from both. `None` when the model cannot
/// be replayed.
///
/// 1. Only A is searched if its base law leaves only noise, if no layers are found in the data, if the base law from D is within
///    tolerance of A, or if its RMS residual is larger by [`BETTER_FACTOR`].
/// 2. Both are searched for a single effect. D is first if its base law leaves only noise, if its RMS residual is smaller by
///    [`BETTER_FACTOR`], or if it is smaller at all and the fit from A is out of tolerance. The first one that leaves only noise and ends
///    on its side of the tolerance (A within, D out of it) is completed and returned.
/// 3. Otherwise A is completed; if A is first, leaves only noise and is within tolerance, it is returned.
/// 4. Otherwise D is completed too. The one that leaves only noise is returned; of two, the one with fewer effects (if equal: A, unless it
///    is out of tolerance); of none, A, unless the RMS residual of D is smaller by [`BETTER_FACTOR`].
pub(crate) fn search_from_any_start(
    prepared: PreparedRecordings,
    recordings: &[Recording],
    progress: &mut impl FnMut(&str),
) -> Option<(Search, PreparedRecordings)> {
    let (base, data) = fit_base_law(&prepared)?;
    let measured = if leaves_noise(&base, &data) { None } else { fit_from_data(&prepared, recordings) };
    let ratio = |fit: &Fit, data_of_fit: &FitData| base.rms_n(&data) / fit.rms_n(data_of_fit);
    let measured = measured.filter(|(_, fit, data_of_fit)| ratio(fit, data_of_fit) * BETTER_FACTOR > 1.0);
    let Some((measured, fit, data_of_fit)) = measured else {
        return Some(first_effect(&prepared, base, data, progress).complete(progress));
    };
    let ratio = ratio(&fit, &data_of_fit);
    let explains = |found: &Search| found.leaves_noise(&found.best);
    let count = |found: &Search| found.best.model.effects.len();
    let is_out = |fit: &Fit| is_out_of_tolerance(&prepared.assumed, fit);
    let data_first =
        leaves_noise(&fit, &data_of_fit) || ratio > BETTER_FACTOR || (ratio > 1.0 && is_out(&base));
    let is_final = |found: &EffectSearch, data_start: bool| {
        explains(&found.search) && is_out(&found.search.best) == data_start
    };
    let from = |data_start: bool, progress: &mut _| {
        let (prepared, base, data) =
            if data_start { (&measured, &fit, &data_of_fit) } else { (&prepared, &base, &data) };
        first_effect(prepared, base.clone(), data.clone(), progress)
    };
    let first = from(data_first, progress);
    if is_final(&first, data_first) {
        return Some(first.complete(progress));
    }
    let second = from(!data_first, progress);
    if is_final(&second, !data_first) {
        return Some(second.complete(progress));
    }
    let (assumed, measured) = if data_first { (second, first) } else { (first, second) };
    let assumed = assumed.complete(progress);
    if !data_first && explains(&assumed.0) && !is_out(&assumed.0.best) {
        return Some(assumed);
    }
    progress("searching from other numbers");
    let data = measured.complete(progress);
    let rms_n = |found: &Search| found.best.rms_n(&found.data);
    let is_data_better = match (explains(&assumed.0), explains(&data.0)) {
        (true, true) if is_out(&assumed.0.best) => count(&data.0) <= count(&assumed.0),
        (true, true) => count(&data.0) < count(&assumed.0),
        (false, false) => rms_n(&assumed.0) > BETTER_FACTOR * rms_n(&data.0),
        (_, data_explains) => data_explains,
    };
    Some(if is_data_better { data } else { assumed })
}

/// Selects random effects and searches for one effect from a fit of the base law.
pub(crate) fn first_effect(
    prepared: &PreparedRecordings,
    base: Fit,
    data: FitData,
    progress: &mut impl FnMut(&str),
) -> EffectSearch {
    let (base, data) = select_random_effects(base, data);
    let (base, data) = refit_with_random_effects(prepared, base, data);
    EffectSearch::first_effect(prepared, base, data, progress)
}

/// The base law fitted from the layers found in the data; `None` if there are none, or if it is within tolerance of the assumed parameters.
fn fit_from_data(
    prepared: &PreparedRecordings,
    recordings: &[Recording],
) -> Option<(PreparedRecordings, Fit, FitData)> {
    let found = FoundTissue::new(recordings, None)?;
    let assumed = Arc::new(assumptions_from(&found, &prepared.assumed));
    let measured = PreparedRecordings { assumed, ..prepared.clone() };
    let (fit, data) = fit_base_law(&measured)?;
    is_out_of_tolerance(&prepared.assumed, &fit).then_some((measured, fit, data))
}

/// Whether a fitted surface, stiffness, friction or puncture force is outside the tolerance of the assumed one, or a thickness outside the
/// bounds of a fit from the assumed one.
fn is_out_of_tolerance(assumed: &Assumptions, fit: &Fit) -> bool {
    let moved_m = (assumed.tissue.surface_m - fit.model.tissue.surface_m).abs();
    let layers = assumed.tissue.layers.iter().zip(&fit.model.tissue.layers).enumerate();
    moved_m > 2.0 * assumed.surface_tolerance_m
        || layers.into_iter().any(|(k, (a, b))| {
            let off = |a: f64, b: f64, tolerance: f64| (b / a - 1.0).abs() > tolerance;
            off(a.stiffness_n_per_m, b.stiffness_n_per_m, assumed.tolerance[k])
                || off(a.friction_ns_per_m2, b.friction_ns_per_m2, assumed.tolerance[k])
                || off(a.thickness_m, b.thickness_m, MAX_TOLERANCES_WIDE * assumed.thickness_tolerance[k])
                || a.puncture_n.zip(b.puncture_n).is_some_and(|(a, b)| off(a, b, assumed.tolerance[k]))
        })
}

/// The assumed tissue with the parameters found in the data, under weak priors; layers that the needle did not reach are unchanged.
fn assumptions_from(found: &FoundTissue, assumed: &Assumptions) -> Assumptions {
    let mut out = assumed.with_weak_priors();
    out.tissue.surface_m = found.surface_m;
    for (k, layer) in out.tissue.layers.iter_mut().enumerate() {
        let Some(l) = found.layers.get(k) else { continue };
        let replace = |x: &mut f64, value: f64| *x = value.max(MIN_SHARE_OF_ASSUMED * *x);
        replace(&mut layer.stiffness_n_per_m, l.stiffness_n_per_m);
        replace(&mut layer.friction_ns_per_m2, l.friction_ns_per_m2);
        // The thickness found for a layer that did not rupture is only a lower bound.
        layer.thickness_m =
            if l.rupture_n.is_some() { l.thickness_m } else { layer.thickness_m.max(l.thickness_m) };
        if let Some((assumed_n, found_n)) = layer.puncture_n.as_mut().zip(l.rupture_n) {
            replace(assumed_n, found_n);
        }
    }
    out
}
