//! Starting values from the data, for scenarios whose numbers are a rough guess.

use crate::base_law_fit::{PreparedRecordings, fit_base_law, refit_with_random_effects};
use crate::baseline_search::{leaves_noise, search_with_baseline};
use crate::found_tissue::FoundTissue;
use crate::random_effect_selection::select_random_effects;
use crate::selection_state::Search;
use std::sync::Arc;
use stylet_identify::fit::Fit;
use stylet_identify::likelihood::FitData;
use stylet_identify::model::{Assumptions, MAX_TOLERANCES_WIDE};
use stylet_record::Recording;

/// Relative tolerance of stiffness, friction and puncture force about a value from the data.
pub(crate) const TOLERANCE: f64 = 1.0;
/// Smallest value of a parameter, as a share of the assumed one: none of them is zero.
const MIN_SHARE_OF_ASSUMED: f64 = 1e-3;
/// A fit that leaves a residual smaller by this factor is better, even if it does not explain the force.
const BETTER_FACTOR: f64 = 2.0;

/// The search for effects from the assumed numbers, or from those in the data.
///
/// Numbers in the data are the start where the assumed ones leave more than noise and differ by more than their tolerance. That search
/// stands if it explains the force and its numbers are still outside the tolerance. Else the search from the assumed numbers decides.
/// `None` when the model cannot be replayed.
pub(crate) fn search_from_any_start(
    prepared: PreparedRecordings,
    recordings: &[Recording],
    progress: &mut impl FnMut(&str),
) -> Option<(Search, PreparedRecordings)> {
    let (base, data) = fit_base_law(&prepared)?;
    let measured = if leaves_noise(&base, &data) { None } else { fit_from_data(&prepared, recordings) };
    let Some((measured, fit, data_of_fit)) = measured else {
        return Some(search(&prepared, base, data, progress));
    };
    let explains = |found: &Search| found.leaves_noise(&found.best);
    let from_data = search(&measured, fit, data_of_fit, progress);
    let data_explains = explains(&from_data.0);
    if data_explains && is_out_of_tolerance(&prepared.assumed, &from_data.0.best) {
        return Some(from_data);
    }
    progress("starting again from the assumed numbers");
    let from_assumed = search(&prepared, base, data, progress);
    let rms_n = |found: &Search| found.best.rms_n(&found.data);
    let is_better = explains(&from_assumed.0)
        || (!data_explains && rms_n(&from_data.0) < BETTER_FACTOR * rms_n(&from_assumed.0));
    Some(if is_better { from_assumed } else { from_data })
}

/// The search from a fit of the base law, with the recordings it was fitted to.
fn search(
    prepared: &PreparedRecordings,
    base: Fit,
    data: FitData,
    progress: &mut impl FnMut(&str),
) -> (Search, PreparedRecordings) {
    let (base, data) = select_random_effects(base, data);
    let (base, data) = refit_with_random_effects(prepared, base, data);
    search_with_baseline(prepared, base, data, progress)
}

/// The base law fitted from the layers in the data; `None` where that gives the assumed numbers.
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

/// Whether a fitted surface, stiffness, friction or puncture force is outside the tolerance of the assumed one, or a thickness outside
/// the bounds of a fit from the assumed one.
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

/// The assumed tissue with the numbers that were found, under weak priors. Layers that the needle did not reach keep the assumed
/// numbers.
fn assumptions_from(found: &FoundTissue, assumed: &Assumptions) -> Assumptions {
    let mut out = assumed.clone();
    out.tissue.surface_m = found.surface_m;
    for (k, layer) in out.tissue.layers.iter_mut().enumerate() {
        out.tolerance[k] = TOLERANCE;
        out.thickness_tolerance[k] = Assumptions::GUESSED_TOLERANCE;
        let Some(l) = found.layers.get(k) else { continue };
        let replace = |x: &mut f64, value: f64| *x = value.max(MIN_SHARE_OF_ASSUMED * *x);
        replace(&mut layer.stiffness_n_per_m, l.stiffness_n_per_m);
        replace(&mut layer.friction_ns_per_m2, l.friction_ns_per_m2);
        // A layer that did not rupture ends where nobody looked.
        layer.thickness_m =
            if l.rupture_n.is_some() { l.thickness_m } else { layer.thickness_m.max(l.thickness_m) };
        if let Some((assumed_n, found_n)) = layer.puncture_n.as_mut().zip(l.rupture_n) {
            replace(assumed_n, found_n);
        }
    }
    out
}
