//! Starting values from the data alone, for scenarios whose numbers are a rough guess, and for none.

use crate::base_law_fit::{MISFIT_FACTOR, PreparedRecordings, fit_base_law};
use crate::error::DiagnoseError;
use crate::found_tissue::FoundTissue;
use crate::input_checks::{CleanRecordings, NamedRecording, check_length, clean_recordings};
use std::sync::Arc;
use stylet_identify::fit::Fit;
use stylet_identify::likelihood::{FitData, residuals};
use stylet_identify::model::Assumptions;
use stylet_identify::noise::NoiseSource;
use stylet_record::Recording;
use stylet_scenario::{Motion, Scenario};

/// Relative tolerance of stiffness, friction and puncture force about a value from the data.
const TOLERANCE: f64 = 1.0;
/// Smallest value of a parameter, as a share of the assumed one: none of them is zero.
const MIN_SHARE_OF_ASSUMED: f64 = 1e-3;
/// Gain in nats from which the start from the data is better than the scenario's.
const MIN_GAIN_NATS: f64 = 20.0;

/// Fits the base law from the assumed numbers and, where that leaves more than noise, from numbers found in the data; the better
/// fit with the assumptions it started from. `None` when the model cannot be replayed.
pub(crate) fn fit_base_law_from_any_start(
    prepared: PreparedRecordings,
    recordings: &[Recording],
) -> Option<(PreparedRecordings, Fit, FitData)> {
    let (base, data) = fit_base_law(&prepared)?;
    let calm = data.with_estimated_noise(&base.residuals.residual_n, NoiseSource::Detrended);
    if base.rms_n(&data) < MISFIT_FACTOR * calm.noise.sd_n() {
        return Some((prepared, base, data));
    }
    let from_data = || {
        let found = FoundTissue::new(recordings, None)?;
        let assumed = Arc::new(assumptions_from(&found, &prepared.assumed));
        let measured = PreparedRecordings { assumed, ..prepared.clone() };
        let (fit, data) = fit_base_law(&measured)?;
        let gain_nats = residuals(&base.model, &data)?.nats - fit.nats();
        let better = gain_nats > MIN_GAIN_NATS && is_out_of_tolerance(&prepared.assumed, &fit);
        better.then_some((measured, fit, data))
    };
    Some(from_data().unwrap_or((prepared, base, data)))
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

/// Whether a fitted surface, stiffness, friction, puncture force or thickness is outside the tolerance of the assumed one.
fn is_out_of_tolerance(assumed: &Assumptions, fit: &Fit) -> bool {
    let moved_m = (assumed.tissue.surface_m - fit.model.tissue.surface_m).abs();
    let layers = assumed.tissue.layers.iter().zip(&fit.model.tissue.layers).enumerate();
    moved_m > 2.0 * assumed.surface_tolerance_m
        || layers.into_iter().any(|(k, (a, b))| {
            let off = |a: f64, b: f64, tolerance: f64| (b / a - 1.0).abs() > tolerance;
            off(a.stiffness_n_per_m, b.stiffness_n_per_m, assumed.tolerance[k])
                || off(a.friction_ns_per_m2, b.friction_ns_per_m2, assumed.tolerance[k])
                || off(a.thickness_m, b.thickness_m, 2.0 * assumed.thickness_tolerance[k])
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
