//! Labels the identifiability of each parameter, and computes the covariance of the estimates.
//!
//! A parameter is moved to both ends of its interval while the others follow to first order (profile likelihood, Venzon and Moolgavkar
//! 1988), and the objective is evaluated there. If the data alone, without the prior of this parameter, lose enough of the decrease at an
//! interval end, they bound the parameter on that side.

use crate::confidence_intervals::{Covariance, interval_end_nats};
use crate::diagnosis_json::{BaseParameter, Cause, LabelledParameter, ParameterLabel};
use stylet_identify::fit::apply_step;
use stylet_identify::likelihood::{FitData, residuals};
use stylet_identify::model::{Model, ParameterRole};
use stylet_stats::Z95;

/// Share of the decrease at an interval end that the data must lose to bound the parameter; the prior provides the rest.
const MIN_DATA_SHARE: f64 = 0.5;
/// Largest half width of a 95 % interval, relative to the value, of a determined parameter.
const MAX_RELATIVE_HALF_WIDTH: f64 = 0.1;
/// Correlation from which the estimates of two parameters trade with each other.
const MIN_CORRELATION: f64 = 0.9;

/// A parameter with its role in the fit.
struct Entry {
    labelled: LabelledParameter,
    role: ParameterRole,
    /// Derivative with respect to the fitted parameters.
    gradient: Vec<f64>,
    /// Standard deviation, from the width of its interval.
    sd: f64,
    /// Reference of the relative half width.
    size: f64,
}

/// Labels of the parameters of the base law and of the causes, and their covariance in the same order and in their units.
pub(crate) fn label_parameters(
    covariance: &Covariance,
    data: &FitData,
    base: &[BaseParameter],
    causes: &[Cause],
) -> (Vec<LabelledParameter>, Vec<Vec<f64>>) {
    let mut entries = base_entries(covariance, base);
    entries.extend(effect_entries(covariance, causes));
    let solved: Vec<Vec<f64>> = entries.iter().map(|e| covariance.factor.solve(&e.gradient)).collect();
    let product = |a: &Entry, b: &[f64]| -> f64 { a.gradient.iter().zip(b).map(|(a, b)| a * b).sum() };
    let correlation = |i: usize, j: usize| {
        let r = product(&entries[i], &solved[j])
            / (product(&entries[i], &solved[i]) * product(&entries[j], &solved[j])).sqrt();
        if r.is_finite() { r.clamp(-1.0, 1.0) } else { f64::from(u8::from(i == j)) }
    };
    let n = entries.len();
    let correlations: Vec<Vec<f64>> = (0..n).map(|i| (0..n).map(|j| correlation(i, j)).collect()).collect();
    let matrix = (0..n)
        .map(|i| (0..n).map(|j| correlations[i][j] * entries[i].sd * entries[j].sd).collect())
        .collect();
    let names: Vec<String> = entries.iter().map(|e| e.labelled.to_string()).collect();
    let labelled = entries.into_iter().enumerate().map(|(i, e)| {
        let partner = (0..n)
            .filter(|j| *j != i)
            .max_by(|a, b| correlations[i][*a].abs().total_cmp(&correlations[i][*b].abs()));
        let partner = partner.filter(|j| correlations[i][*j].abs() >= MIN_CORRELATION);
        let is_wide = Z95 * e.sd > MAX_RELATIVE_HALF_WIDTH * e.size;
        let mut out = e.labelled;
        out.trades_with = partner.map(|j| names[j].clone());
        out.correlation = partner.map_or(0.0, |j| correlations[i][j]);
        if out.label == ParameterLabel::Determined && is_wide {
            out.label = if partner.is_some() {
                ParameterLabel::TradesWith
            } else {
                profile_label(covariance, data, e.role)
            };
        }
        out
    });
    (labelled.collect(), matrix)
}

/// Role of a base-law parameter in the fit, and the factor from the scale of the fit to its unit.
pub(crate) fn base_role(model: &Model, layer: usize, name: &str) -> Option<(ParameterRole, f64)> {
    let layer = layer.wrapping_sub(1);
    let assumed = model.assumed.tissue.layers.get(layer);
    Some(match name {
        "stiffness_n_per_m" => (ParameterRole::Stiffness(layer), assumed?.stiffness_n_per_m),
        "friction_ns_per_m2" => (ParameterRole::Friction(layer), assumed?.friction_ns_per_m2),
        "puncture_n" => (ParameterRole::Puncture(layer), assumed?.puncture_n?),
        "thickness_m" => (ParameterRole::Thickness(layer), 1.0),
        _ => (ParameterRole::Surface, 1.0),
    })
}

fn base_entries(covariance: &Covariance, base: &[BaseParameter]) -> Vec<Entry> {
    let tissue = &covariance.fit.model.tissue;
    let entry = |b: &BaseParameter| {
        let (role, scale) = base_role(&covariance.fit.model, b.layer, &b.name)?;
        let gradient = covariance.shared_gradient(role, scale)?;
        let label = match (b.at_least, b.at_bound) {
            (true, _) => ParameterLabel::OneSided,
            (false, true) => ParameterLabel::AtBound,
            (false, false) => ParameterLabel::Determined,
        };
        let size = if b.layer > 0 { b.value.abs() } else { tissue.layers.first()?.thickness_m };
        Some(Entry {
            labelled: LabelledParameter::new(b.layer, None, &b.name, label),
            role,
            gradient,
            sd: (b.high - b.low) / (2.0 * Z95),
            size,
        })
    };
    base.iter().filter_map(entry).collect()
}

fn effect_entries(covariance: &Covariance, causes: &[Cause]) -> Vec<Entry> {
    let mut out = Vec::new();
    for (effect, term) in covariance.fit.model.effects.iter().enumerate() {
        let Some(cause) = causes.iter().find(|c| c.effect == term.info.id) else { continue };
        for (parameter, info) in term.info.parameters.iter().enumerate().filter(|(_, p)| !p.integer) {
            let Some(estimate) = cause.parameters.get(info.path) else { continue };
            let is_limit = !term.values[parameter].is_finite();
            let label = match (is_limit, cause.at_bound.iter().any(|path| path == info.path)) {
                (true, _) => ParameterLabel::OneSided,
                (false, true) => ParameterLabel::AtBound,
                (false, false) => ParameterLabel::Determined,
            };
            out.push(Entry {
                labelled: LabelledParameter::new(0, Some(term.info.id), info.path, label),
                role: ParameterRole::Effect { effect, parameter },
                gradient: covariance.gradient(effect, parameter),
                sd: if is_limit { 0.0 } else { (estimate.high - estimate.low) / (2.0 * Z95) },
                size: (estimate.value - info.inactive).abs(),
            });
        }
    }
    out
}

/// Label of a parameter by the sides on which the data bound it: both, one or none.
fn profile_label(covariance: &Covariance, data: &FitData, role: ParameterRole) -> ParameterLabel {
    let Some(i) = covariance.index_of(role) else { return ParameterLabel::Determined };
    let Some((_, half)) = covariance.shared_parameter(role) else { return ParameterLabel::Determined };
    let Some(unit) = covariance.shared_gradient(role, 1.0) else { return ParameterLabel::Determined };
    let column = covariance.factor.solve(&unit);
    let follow: Vec<f64> = column.iter().map(|c| c / column[i].max(f64::MIN_POSITIVE)).collect();
    let (fit, parameter) = (covariance.fit, &covariance.linearization.shared[i]);
    let is_closed = |side: f64| {
        let step: Vec<f64> = follow.iter().map(|f| f * side * half).collect();
        let moved = apply_step(&fit.model, data, &covariance.linearization, &step, 1.0);
        let by_prior =
            parameter.prior_nats(moved.get(role, 0)) - parameter.prior_nats(fit.model.get(role, 0));
        residuals(&moved, data)
            .is_none_or(|r| r.nats - fit.nats() - by_prior > MIN_DATA_SHARE * interval_end_nats())
    };
    match (is_closed(-1.0), is_closed(1.0)) {
        (true, true) => ParameterLabel::Determined,
        (false, false) => ParameterLabel::NotIdentifiable,
        _ => ParameterLabel::OneSided,
    }
}
