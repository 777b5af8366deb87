//! (j) Weighting the covariance by W equals scaling the regressor: eqs (8)-(12), (14)-(17).
//!
//! Over the first layer of the latex stack, sinusoidal, as every seed's sensor records it: RLS from
//! `Lambda P0 Lambda` on `phi`, compared with RLS from `P0` on `Lambda phi`. The innovations must be the same and the
//! parameters `Lambda` times the other's. With weights that are powers of two floating-point arithmetic scales
//! without rounding, so that the identity must hold bit for bit; with the paper's weights up to rounding.

use super::claim_definition::{Definition, protocol};
use crate::all_runs::NOISE_MN;
use crate::effect_size::{Criterion, ExperimentValues, Measured, Scale};
use crate::paper_experiments::Case;
use crate::simulated_insertion::Insertion;
use crate::study_conditions::View;
use stylet_core::Rls;

/// The prior variance of both parameters, `sigma_0²`.
const PRIOR: f64 = 1e6;
/// Up to rounding: relative to the largest force and parameter.
const ROUNDING: Criterion = Criterion::Below(1e-6);
/// Samples after which a covariance is no longer diagonal.
const NON_DIAGONAL_FROM: usize = 10;

type Samples = Vec<([f64; 2], f64)>;

/// Weights, and their application.
#[derive(Clone, Copy)]
enum Weighting {
    /// `Lambda = diag(1, 1/v)`, once, at the start: eqs (12) and (17).
    MeanSpeed,
    /// `Lambda = diag(4, 512)`.
    PowersOfTwo,
    /// Eq. (11) taken as a recursion: `Lambda` acts on the covariance at every step.
    EveryStep,
    /// `W P` instead of `Lambda P Lambda` for a covariance that is no longer diagonal (eq. 9).
    FullCovariance,
}

/// Largest relative difference of two covariances' entries, relative to the larger diagonal entry.
fn relative_difference(weight: [f64; 2], samples: &Samples) -> f64 {
    let mut rls = Rls::new([PRIOR, PRIOR]);
    for (phi, y) in samples.iter().take(NON_DIAGONAL_FROM) {
        rls.update(*phi, *y, 1.0);
    }
    // Off the diagonal W P has w_i² p, Lambda P Lambda has w_1 w_2 p.
    let [a, b] = weight;
    let p = rls.covariance;
    let off = (a * a * p[1] - a * b * p[1]).abs().max((b * b * p[1] - a * b * p[1]).abs());
    off / (a * a * p[0]).abs().max((b * b * p[2]).abs())
}

fn difference(samples: &Samples, weight: [f64; 2], weighting: Weighting) -> f64 {
    let mut weighted = Rls::new([PRIOR * weight[0] * weight[0], PRIOR * weight[1] * weight[1]]);
    let mut scaled = Rls::new([PRIOR, PRIOR]);
    let (mut worst, mut force) = (0.0f64, 0.0f64);
    let mut theta = [0.0f64; 2];
    for (phi, y) in samples {
        let a = weighted.update(*phi, *y, 1.0);
        if matches!(weighting, Weighting::EveryStep) {
            let [a, b] = weight;
            let [p11, p12, p22] = weighted.covariance;
            weighted.covariance = [a * a * p11, a * b * p12, b * b * p22];
        }
        let b = scaled.update([weight[0] * phi[0], weight[1] * phi[1]], *y, 1.0);
        force = force.max(y.abs());
        worst = worst.max((a - b).abs() / force);
        for i in 0..2 {
            theta[i] = theta[i].max(weighted.theta[i].abs());
            if theta[i] > 0.0 {
                worst = worst.max((weighted.theta[i] - weight[i] * scaled.theta[i]).abs() / theta[i]);
            }
        }
    }
    // A diverged recursion counts as a relative difference of one.
    if worst.is_finite() { worst } else { 1.0 }
}

fn measured(view: &View<'_>, weighting: Weighting) -> Measured {
    let seeds = if view.study.is_planning() { 0 } else { view.seeds };
    let part = |values: Vec<Option<f64>>| Measured {
        scale: Scale::Mean,
        parts: vec![ExperimentValues::new(Case::LatexSinusoidal.name(), values)],
    };
    let insertion = Case::LatexSinusoidal.scenario().ok().and_then(|s| Insertion::of(&s, 1).ok());
    let Some((insertion, layer)) = insertion.as_ref().and_then(|i| Some((i, i.layers.first()?))) else {
        return part(Vec::new());
    };
    let values = (0..seeds).map(|index| {
        let force = insertion.reading(view.study.first_seed + index, NOISE_MN);
        let samples: Samples = insertion
            .samples(&force)
            .iter()
            .map(|s| (s.position_m - layer.front_m, s.velocity_mps, s.force_n))
            .filter(|(depth_m, _, _)| *depth_m > 0.0 && *depth_m < layer.thickness_m)
            .map(|(depth_m, v, f)| ([depth_m, depth_m * v], f))
            .collect();
        // Mean speed of the sinusoid over the layer.
        let mean_mps =
            samples.iter().map(|(phi, _)| phi[1] / phi[0]).sum::<f64>() / samples.len().max(1) as f64;
        let weight = match weighting {
            Weighting::PowersOfTwo => [4.0, 512.0],
            _ => [1.0, 1.0 / mean_mps],
        };
        Some(match weighting {
            Weighting::FullCovariance => relative_difference(weight, &samples),
            _ => difference(&samples, weight, weighting),
        })
    });
    part(values.collect())
}

pub(super) fn definition() -> Definition {
    let mut claim = Definition::new(protocol!("j"), |v| measured(v, Weighting::MeanSpeed), ROUNDING, &[])
        .with_sensitivity("weights that are powers of two, bit for bit", |v| {
            measured(v, Weighting::PowersOfTwo)
        })
        .with_sensitivity("eq. (11) iterated as printed, Lambda at every step", |v| {
            measured(v, Weighting::EveryStep)
        })
        .with_sensitivity(
            "W P instead of Lambda P Lambda after ten samples (eq. 9 for a full covariance)",
            |v| measured(v, Weighting::FullCovariance),
        );
    // Bit for bit: any nonzero difference is above this.
    if let Some(exact) = claim.sensitivities.first_mut() {
        exact.bar = Criterion::Below(f64::MIN_POSITIVE);
    }
    claim
}
