//! Parameter estimates with jackknife confidence intervals over recordings.

use super::cross_validation::HeldOutPrediction;
use super::multistart_fit::SetFit;
use crate::confidence_intervals::unreached_puncture;
use crate::diagnosis_json::{BaseParameter, Estimate};
use std::collections::BTreeMap;
use stylet_identify::fit::Fit;
use stylet_identify::model::{Model, ParameterRole};
use stylet_stats::{sd, student_t};
use stylet_tissue::Tissue;

/// Distance to its bound within which a parameter is at the bound, as a share of its range (of at most one).
const BOUND_TOLERANCE: f64 = 1e-3;

/// Estimate of a parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct ParameterEstimate {
    /// Effect id, `layer.N` for a base parameter, `layer.0` for the stack.
    pub owner: String,
    /// Parameter path.
    pub path: String,
    /// Value.
    pub value: f64,
    /// Lower end of the 95 % interval.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Whether the value is at its bound.
    pub at_bound: bool,
}

impl ParameterEstimate {
    /// Value and interval.
    pub fn estimate(&self) -> Estimate {
        Estimate { value: self.value, low: self.low, high: self.high }
    }
}

/// Whether a parameter is at its bound.
pub(super) fn is_at_bound(model: &Model, role: ParameterRole) -> bool {
    let parameter = model.shared_parameters().into_iter().find(|n| n.role == role);
    parameter.is_some_and(|n| n.is_at_bound(model.get(role, 0), BOUND_TOLERANCE))
}

/// Owner and path of every parameter, its value, and whether it is at its bound.
fn parameter_values(model: &Model) -> Vec<(String, String, f64, bool)> {
    let reached = |role: ParameterRole| is_at_bound(model, role);
    let mut out = Vec::new();
    let mut push =
        |owner: String, path: &str, value: f64, bound: bool| out.push((owner, path.to_owned(), value, bound));
    push("layer.0".to_owned(), "surface_m", model.tissue.surface_m, reached(ParameterRole::Surface));
    for (l, layer) in model.tissue.layers.iter().enumerate() {
        let owner = format!("layer.{}", l + 1);
        let is_front_at_bound = l > 0 && reached(ParameterRole::Thickness(l - 1));
        push(owner.clone(), "front_m", model.tissue.front_m(l), is_front_at_bound);
        let (stiffness, friction) = (layer.stiffness_n_per_m, layer.friction_ns_per_m2);
        push(owner.clone(), "stiffness_n_per_m", stiffness, reached(ParameterRole::Stiffness(l)));
        push(owner.clone(), "friction_ns_per_m2", friction, reached(ParameterRole::Friction(l)));
        if let Some(force) = layer.puncture_n {
            push(owner, "puncture_n", force, reached(ParameterRole::Puncture(l)));
        }
    }
    let many = |id: &str| model.effects.iter().filter(|c| c.info.id == id).count() > 1;
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for (effect, term) in model.effects.iter().enumerate() {
        let id = term.info.id;
        let k = counts.entry(id).or_insert(0);
        for (parameter, p) in term.info.parameters.iter().enumerate() {
            let path = if many(id) { format!("{k}.{}", p.path) } else { p.path.to_owned() };
            let like = model.tied.iter().find(|b| b.effect == effect && b.parameter == parameter);
            let role =
                ParameterRole::Effect { effect: like.and_then(|b| b.tied_to).unwrap_or(effect), parameter };
            push(id.to_owned(), &path, term.values[parameter], !p.integer && reached(role));
        }
        *k += 1;
    }
    out
}

/// Estimates with 95 % jackknife intervals over recordings (Quenouille, Tukey). They include model error that differs between recordings.
pub fn jackknife_estimates(fitted: &SetFit, out: &[HeldOutPrediction]) -> Vec<ParameterEstimate> {
    let others: Vec<_> =
        out.iter().filter_map(|o| o.population.as_ref()).map(|p| parameter_values(&p.model)).collect();
    let n = others.len() as f64;
    parameter_values(&fitted.fit.model)
        .into_iter()
        .enumerate()
        .map(|(i, (owner, path, value, at_bound))| {
            let all: Vec<f64> = others.iter().filter_map(|o| o.get(i)).map(|o| o.2).collect();
            // The jackknife variance is (n - 1)/n times the sum of squares; `sd` divides by n - 1.
            let error = sd(&all) * (n - 1.0) / n.sqrt();
            let reach = student_t::quantile(0.975, (n - 1.0).max(1.0)) * error;
            let reach = if reach.is_finite() { reach } else { value.abs() };
            ParameterEstimate { owner, path, value, low: value - reach, high: value + reach, at_bound }
        })
        .collect()
}

/// Base parameters among the estimates, with their assumed values. A puncture force that no recording reached is a lower limit, as in the
/// diagnosis of a single recording.
pub fn base_parameters(
    estimates: &[ParameterEstimate],
    fit: &Fit,
    assumed_tissue: &Tissue,
) -> Vec<BaseParameter> {
    let shared = fit.model.shared_parameters();
    let unreached = |layer: usize| {
        let n = shared.iter().find(|n| n.role == ParameterRole::Puncture(layer))?;
        unreached_puncture(fit, n)
    };
    estimates
        .iter()
        .filter_map(|t| {
            let layer: usize = t.owner.strip_prefix("layer.")?.parse().ok()?;
            let of = |f: &dyn Fn(&stylet_tissue::Layer) -> f64| {
                layer.checked_sub(1).and_then(|l| assumed_tissue.layers.get(l)).map_or(0.0, f)
            };
            let assumed = match t.path.as_str() {
                "surface_m" => assumed_tissue.surface_m,
                "front_m" => assumed_tissue.front_m(layer.saturating_sub(1)),
                "stiffness_n_per_m" => of(&|l| l.stiffness_n_per_m),
                "friction_ns_per_m2" => of(&|l| l.friction_ns_per_m2),
                _ => of(&|l| l.puncture_n.unwrap_or(0.0)),
            };
            let unreached = layer.checked_sub(1).filter(|_| t.path == "puncture_n").and_then(unreached);
            let (mut value, mut low, mut high) = (t.value, t.low, t.high);
            if let Some(u) = &unreached {
                // The jackknife interval is about the prior mean, which all refits share.
                value = value.max(u.reached_n);
                low = u.reached_n;
                high = high.max(u.prior_upper_end * assumed).max(value);
            }
            Some(BaseParameter {
                layer,
                name: t.path.clone(),
                assumed,
                value,
                low,
                high,
                changed: !(low <= assumed && assumed <= high),
                at_bound: t.at_bound,
                at_least: unreached.is_some(),
                out_of_tolerance: false,
            })
        })
        .collect()
}

#[cfg(test)]
mod tests;
