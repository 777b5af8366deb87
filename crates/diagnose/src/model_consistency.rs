//! Tests whether two diagnoses (of another session, day or needle) found the same model.

use crate::diagnosis_json::{Diagnosis, LabelledParameter, ParameterLabel};
use serde::{Deserialize, Serialize};
use stylet_stats::linear_algebra::{SymmetricMatrix, dot};
use stylet_stats::normal;
use stylet_stats::special_functions::chi_square_sf;

/// Significance level of each of two tests, of all common parameters jointly and of the most different one (Bonferroni). Together they
/// reject at most one in twenty pairs of equal models.
pub const DIFFERENCE_P_VALUE: f64 = 0.025;

/// One parameter in two models.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ParameterDifference {
    /// Name of the parameter.
    pub parameter: String,
    /// Value in both models.
    pub values: [f64; 2],
    /// Standard deviation of the difference.
    pub sd: f64,
    /// Two-sided p-value of the difference under equal values (normal).
    pub p_value: f64,
    /// Whether the difference is significant after correction for the number of parameters (Bonferroni).
    pub differs: bool,
}

/// Comparison of two models.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Consistency {
    /// Parameters that both models have and both sets of recordings determine, in the order of the first.
    pub parameters: Vec<ParameterDifference>,
    /// Causes of only the first and of only the second model.
    pub causes: [Vec<String>; 2],
    /// Joint p-value of all differences under equal models (chi-square, with both covariances).
    pub p_value: f64,
    /// Whether both are the same model: equal causes and no significant difference.
    pub is_consistent: bool,
}

/// Compares two diagnoses by their parameters and covariances. Diagnoses of repeats lack both.
#[must_use]
pub fn compare_models(a: &Diagnosis, b: &Diagnosis) -> Consistency {
    let common: Vec<(usize, usize)> = a
        .parameters
        .iter()
        .enumerate()
        .filter_map(|(i, p)| {
            let is_same = |q: &LabelledParameter| q.to_string() == p.to_string();
            let j = b.parameters.iter().position(is_same)?;
            let is_bounded = |p: &LabelledParameter| {
                matches!(p.label, ParameterLabel::Determined | ParameterLabel::TradesWith)
            };
            (is_bounded(p) && is_bounded(&b.parameters[j])).then_some((i, j))
        })
        .filter(|(i, j)| value(a, &a.parameters[*i]).is_some() && value(b, &b.parameters[*j]).is_some())
        .collect();
    let mut covariance = SymmetricMatrix::zeros(common.len());
    for (row, (i, j)) in common.iter().enumerate() {
        for (column, (k, l)) in common[..=row].iter().enumerate() {
            covariance.add(row, column, a.covariance[*i][*k] + b.covariance[*j][*l]);
        }
    }
    let parameters: Vec<ParameterDifference> = common
        .iter()
        .enumerate()
        .filter_map(|(row, (i, j))| {
            let values = [value(a, &a.parameters[*i])?, value(b, &b.parameters[*j])?];
            let sd = covariance.at(row, row).sqrt();
            let p_value = 2.0 * normal::sf((values[1] - values[0]).abs() / sd);
            let differs = p_value * (common.len() as f64) < DIFFERENCE_P_VALUE;
            Some(ParameterDifference {
                parameter: a.parameters[*i].to_string(),
                values,
                sd,
                p_value,
                differs,
            })
        })
        .collect();
    let difference: Vec<f64> = parameters.iter().map(|p| p.values[1] - p.values[0]).collect();
    let whitened = covariance.cholesky().forward_substitute(&difference);
    let p_value =
        if common.is_empty() { 1.0 } else { chi_square_sf(dot(&whitened, &whitened), common.len() as f64) };
    let only = |a: &Diagnosis, b: &Diagnosis| -> Vec<String> {
        let is_in_b = |effect: &str| b.causes.iter().any(|c| c.effect == effect);
        a.causes.iter().map(|c| c.effect.clone()).filter(|effect| !is_in_b(effect)).collect()
    };
    let causes = [only(a, b), only(b, a)];
    let is_consistent = causes.iter().all(Vec::is_empty)
        && p_value >= DIFFERENCE_P_VALUE
        && parameters.iter().all(|p| !p.differs);
    Consistency { parameters, causes, p_value, is_consistent }
}

/// Value of a parameter in a diagnosis.
fn value(d: &Diagnosis, p: &LabelledParameter) -> Option<f64> {
    match &p.effect {
        None => d.base_parameters.iter().find(|b| b.layer == p.layer && b.name == p.name).map(|b| b.value),
        Some(effect) => {
            d.causes.iter().find(|c| c.effect == *effect)?.parameters.get(&p.name).map(|e| e.value)
        }
    }
}
