//! Starting values from the data alone, for scenarios whose numbers are a rough guess, and for none.

use crate::base_law_fit::{PreparedRecordings, fit_base_law, refit_with_random_effects};
use crate::baseline_search::{DOMINANT_FACTOR, leaves_noise, search_with_baseline};
use crate::error::DiagnoseError;
use crate::found_tissue::FoundTissue;
use crate::input_checks::{CleanRecordings, NamedRecording, check_length, clean_recordings};
use crate::random_effect_selection::select_random_effects;
use crate::selection_state::Search;
use std::sync::Arc;
use stylet_identify::fit::Fit;
use stylet_identify::likelihood::FitData;
use stylet_identify::model::{Assumptions, MAX_TOLERANCES_WIDE};
use stylet_record::Recording;
use stylet_scenario::{Motion, Scenario};

/// Relative tolerance of stiffness, friction and puncture force about a value from the data.
const TOLERANCE: f64 = 1.0;
/// Smallest value of a parameter, as a share of the assumed one: none of them is zero.
const MIN_SHARE_OF_ASSUMED: f64 = 1e-3;
/// A search that leaves a residual smaller by this factor is better, even if neither explains the force.
const BETTER_FACTOR: f64 = 2.0;

/// The search for effects from the assumed numbers. Where that leaves more than noise and numbers from the data are outside the
/// tolerance of the assumed ones, the search starts from those: at once where they need no effect or leave far less, else where
/// the first search does not explain the force and the second does, or does far better. `None` when the model cannot be replayed.
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
    let dominant = base.rms_n(&data) > DOMINANT_FACTOR * fit.rms_n(&data_of_fit);
    if dominant || leaves_noise(&fit, &data_of_fit) {
        return Some(search(&measured, fit, data_of_fit, progress));
    }
    let assumed = search(&prepared, base, data, progress);
    let explains = |found: &Search| found.leaves_noise(&found.best);
    if explains(&assumed.0) {
        return Some(assumed);
    }
    progress("starting again from the layers in the data");
    let other = search(&measured, fit, data_of_fit, progress);
    let rms_n = |found: &Search| found.best.rms_n(&found.data);
    let better = explains(&other.0) || rms_n(&assumed.0) > BETTER_FACTOR * rms_n(&other.0);
    Some(if better { other } else { assumed })
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

/// A scenario with the layers that the recordings show, `layers` of them or as many as there are, and weak priors about their
/// numbers: what [`diagnose`](crate::diagnose()) starts from without a scenario.
///
/// # Errors
/// [`DiagnoseError`] when a recording is too short, or none has a contact.
pub fn scenario_from_recordings(
    name: &str,
    recordings: &[NamedRecording],
    layers: Option<usize>,
) -> Result<Scenario, DiagnoseError> {
    check_length(recordings)?;
    let CleanRecordings { recordings: clean, .. } = clean_recordings(recordings);
    let found = FoundTissue::new(&clean, layers).ok_or(DiagnoseError::NoContact)?;
    let mut scenario = Scenario::new(name.to_owned(), found.tissue(), Motion::Recorded);
    (scenario.tolerance, scenario.thickness_tolerance) = (TOLERANCE, Assumptions::GUESSED_TOLERANCE);
    Ok(scenario)
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
