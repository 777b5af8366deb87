//! Fits the parameters to each recording alone, and tests whether the recordings share one value with Cochran's Q (Cochran 1954, "The
//! combination of estimates from different experiments").
//!
//! Ruptures and scatter are those of the joint fit, so that modelled scatter between recordings counts as uncertainty and not as a
//! difference.

use crate::confidence_intervals::Covariance;
use crate::diagnosis_json::{Estimate, LabelledParameter, ParameterByRecording, ParameterLabel};
use crate::geometry_selection::free_geometry;
use crate::parameter_labels::base_role;
use stylet_identify::fit::{Effort, Fit, fit};
use stylet_identify::likelihood::FitData;
use stylet_identify::model::ParameterRole;
use stylet_identify::noise::NoiseSource;
use stylet_stats::Z95;
use stylet_stats::parallel::*;
use stylet_stats::special_functions::chi_square_sf;

/// Effort of the fit to one recording, which starts at the fit to all.
const EFFORT: Effort = Effort { max_iterations: 3, min_gain_nats: 0.1 };
/// Largest variance of an estimate, as a share of the prior variance: the data then give at least as much information as the prior.
const MAX_PRIOR_SHARE: f64 = 0.5;

/// The parameters that the recordings determine jointly, fitted to each recording alone; empty for a single recording.
pub(crate) fn parameters_by_recording(
    best: &Fit,
    data: &FitData,
    labels: &[LabelledParameter],
) -> Vec<ParameterByRecording> {
    let count = data.recording_count();
    if count < 2 {
        return Vec::new();
    }
    // Noise and geometry as for the intervals.
    let data = data.with_estimated_noise(&best.residuals.residual_n, NoiseSource::LongMemory);
    let joint = free_geometry(&best.model);
    let determined: Vec<&LabelledParameter> = labels
        .iter()
        .filter(|p| matches!(p.label, ParameterLabel::Determined | ParameterLabel::TradesWith))
        .collect();
    let alone = |r: usize| -> Vec<Option<(f64, f64)>> {
        let none = || vec![None; determined.len()];
        let mut model = joint.clone();
        model.rupture_times_s = vec![model.rupture_times_s[r].clone()];
        model.per_recording = vec![model.per_recording[r]];
        model.zero_steps = model.zero_steps.get(r).cloned().into_iter().collect();
        let Some(fit) = fit(&model, &data.subset(&[r]), EFFORT) else { return none() };
        let covariance = Covariance::with_known_noise(&fit, &data.subset(&[r]));
        determined.iter().map(|p| estimate(&covariance, p)).collect()
    };
    let by_recording: Vec<Vec<Option<(f64, f64)>>> = (0..count).into_par_iter().map(alone).collect();
    let compared = |(k, p): (usize, &&LabelledParameter)| {
        let values: Vec<Option<(f64, f64)>> = by_recording.iter().map(|r| r[k]).collect();
        let known: Vec<(f64, f64)> = values.iter().copied().flatten().collect();
        (known.len() > 1).then(|| ParameterByRecording {
            parameter: p.to_string(),
            estimates: values.iter().map(|v| v.map(interval)).collect(),
            p_value: cochran_p_value(&known),
        })
    };
    determined.iter().enumerate().filter_map(compared).collect()
}

/// Value and standard deviation of a parameter; `None` if the recording gives less information than the prior.
fn estimate(covariance: &Covariance, p: &LabelledParameter) -> Option<(f64, f64)> {
    let model = &covariance.fit.model;
    let (role, gradient, value) = match &p.effect {
        None => {
            let (role, scale) = base_role(model, p.layer, &p.name)?;
            (role, covariance.shared_gradient(role, scale)?, scale * model.get(role, 0))
        }
        Some(id) => {
            let effect = model.effects.iter().position(|e| e.info.id == id)?;
            let parameter = model.effects[effect].info.parameters.iter().position(|i| i.path == p.name)?;
            let role = ParameterRole::Effect { effect, parameter };
            (role, covariance.gradient(effect, parameter), model.effects[effect].values[parameter])
        }
    };
    let shared = &covariance.linearization.shared[covariance.index_of(role)?];
    let in_fit_scale = covariance.deviation(&covariance.shared_gradient(role, 1.0)?).0;
    let sd = covariance.deviation(&gradient).0;
    let is_bounded = in_fit_scale.powi(2) <= MAX_PRIOR_SHARE * shared.prior_sd.powi(2);
    (is_bounded && sd > 0.0 && value.is_finite()).then_some((value, sd))
}

fn interval((value, sd): (f64, f64)) -> Estimate {
    Estimate { value, low: value - Z95 * sd, high: value + Z95 * sd }
}

/// p-value of the differences under one common value (Cochran's Q).
fn cochran_p_value(values: &[(f64, f64)]) -> f64 {
    let weight: f64 = values.iter().map(|(_, sd)| sd.powi(-2)).sum();
    let mean = values.iter().map(|(x, sd)| x * sd.powi(-2)).sum::<f64>() / weight;
    let q: f64 = values.iter().map(|(x, sd)| ((x - mean) / sd).powi(2)).sum();
    chi_square_sf(q, values.len() as f64 - 1.0)
}

#[cfg(test)]
mod tests {
    use super::cochran_p_value;

    #[test]
    fn two_values_differ_by_their_normal_deviate() {
        // Difference 2 with a standard deviation of 1: two-sided 4.55 %.
        let sd = 0.5_f64.sqrt();
        assert!((cochran_p_value(&[(0.0, sd), (2.0, sd)]) - 0.0455).abs() < 1e-4);
        assert_eq!(cochran_p_value(&[(1.0, 0.1), (1.0, 0.2), (1.0, 0.3)]), 1.0);
    }
}
