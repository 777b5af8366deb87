//! (j) Weighting the covariance by W equals scaling the regressor: eqs (8)-(12), (14)-(17).
//!
//! Over the first layer of the latex stack, sinusoidal, as every seed's sensor records it: RLS from
//! `Lambda P Lambda` on `phi`, beside RLS from `P` on `Lambda phi`. The innovations must be the same and the
//! parameters `Lambda` times the other's. With weights that are powers of two floating-point arithmetic
//! scales without rounding, so that the identity must hold bit for bit; with the paper's weights it holds
//! up to rounding.

use super::{Claim, numbers};
use crate::case::Case;
use crate::spread::Spread;
use crate::study::{Insertion, ReproduceError};
use crate::verdict::{Condition, Verdict};
use stylet_core::Rls;
use stylet_testbed::InsertionSample;
use stylet_testbed::Measuring;
use stylet_tissue::TissueForce;

/// Up to rounding: relative to the largest force and parameter.
const ROUNDING: f64 = 1e-6;
/// The prior variance of both parameters, `sigma_0²`.
const PRIOR: f64 = 1e6;

/// Largest relative difference of innovations and parameters over the samples `(phi, y)`.
fn difference(samples: &[([f64; 2], f64)], weight: [f64; 2]) -> f64 {
    let mut weighted = Rls::new([PRIOR * weight[0] * weight[0], PRIOR * weight[1] * weight[1]]);
    let mut scaled = Rls::new([PRIOR, PRIOR]);
    let mut worst = 0.0f64;
    let mut force = 0.0f64;
    let mut theta = [0.0f64; 2];
    for (phi, y) in samples {
        let a = weighted.update(*phi, *y, 1.0);
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
    worst
}

pub(super) fn claim(seeds: u64) -> Result<Claim, ReproduceError> {
    let scenario = Case::LatexSinusoidal.scenario()?;
    let once = Insertion::of(&scenario, 1)?;
    let Some(layer) = once.layers.first() else { return Err(ReproduceError::NotRun("claim j".to_owned())) };
    let sensor = scenario.sensor.force_torque().cloned().unwrap_or_default();
    let inside = |seed: u64| -> Vec<([f64; 2], f64)> {
        let mut measuring = Measuring::new(&scenario.effects, &sensor, seed, scenario.sample_hz);
        let columns = once.simulation.recording.samples().zip(&once.simulation.truth.tissue_force_n);
        columns
            .map(|(s, &total_n)| {
                let depth_m = s.position_m - layer.front_m;
                let force = TissueForce { total_n, ..TissueForce::default() };
                let sample = InsertionSample {
                    time_s: s.time_s,
                    position_m: s.position_m,
                    velocity_mps: s.velocity_mps,
                    acceleration_mps2: 0.0,
                    force,
                };
                ([depth_m, depth_m * s.velocity_mps], measuring.measure(&sample), depth_m)
            })
            .filter(|(_, _, depth_m)| *depth_m > 0.0 && *depth_m < layer.thickness_m)
            .map(|(phi, y, _)| (phi, y))
            .collect()
    };
    // Mean speed of the sinusoid over the layer, for the weights of eqs (14)-(17).
    let samples: Vec<_> = (1..=seeds).map(inside).collect();
    let first = samples.first().map_or(&[][..], |s| s);
    let mean_mps = first.iter().map(|(phi, _)| phi[1] / phi[0]).sum::<f64>() / first.len().max(1) as f64;
    let d = layer.thickness_m;
    let weights = [
        ("powers of two", [4.0, 512.0]),
        ("W_d, eq. 15: 1/d", [1.0, 1.0 / d]),
        ("W_h, eq. 16: d/v", [1.0, d / mean_mps]),
        ("W, eq. 17: 1/v", [1.0, 1.0 / mean_mps]),
    ];
    let mut conditions = Vec::new();
    let mut list = Vec::new();
    for (index, (name, weight)) in weights.into_iter().enumerate() {
        let found: Vec<f64> = samples.iter().map(|s| difference(s, weight)).collect();
        let bound = if index == 0 { 0.0 } else { ROUNDING };
        conditions.push(Condition::new(name, found.iter().map(|x| *x <= bound)));
        list.push((format!("largest relative difference, {name}"), Spread::of(found.into_iter().map(Some))));
    }
    // Eq. (17) says that W_h W_d is diag(1, 1/v²).
    let product = (d / mean_mps) * (1.0 / d) * mean_mps - 1.0;
    conditions.push(Condition::new("W_h W_d = W, eq. 17", (0..seeds).map(|_| product.abs() < 1e-12)));
    Ok(Claim {
        id: 'j',
        claim: "Weighting the covariance by W equals scaling the regressor.",
        figure: "S eqs 8-12, 14-17",
        rule: "In a seed, innovations and parameters of the two recursions agree: bit for bit with weights that are powers of two, up to \
               1e-6 (rounding) with the paper's."
            .to_owned(),
        verdict: Verdict::of(&conditions, "rounding"),
        seeds,
        conditions,
        numbers: numbers(list),
        headline: &["largest relative difference, powers of two", "largest relative difference, W, eq. 17: 1/v"],
        remark: "An algebraic identity; it holds for one start of the recursion, and so for every reset of the covariance.".to_owned(),
    })
}
