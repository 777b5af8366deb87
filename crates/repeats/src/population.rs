//! The runs' own numbers as a population: mean, spread, and deterministic draws from it.

use crate::fit::Fit;
use crate::run::Run;
use crate::shape::{Ingredient, Own, REFERENCE_MPS};
use crate::stats::{PRIMES, halton, mean_sd, normal_quantile};
use serde::Serialize;

/// Smallest relative scatter of a puncture force that a few runs can claim.
const LEAST_SCATTER: f64 = 0.02;

/// What varies from run to run in one layer.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LayerScatter {
    /// Mean logarithm of the puncture force (N) at 1 mm/s where the force shows it; none: no run shows it.
    pub puncture_log: Option<f64>,
    /// Standard deviation of that logarithm.
    pub puncture_sd: f64,
    /// Runs whose force drops at the rupture, of all.
    pub drops: (usize, usize),
    /// Mean position (m) at which the layer lets go, if any run shows it.
    pub release_m: Option<f64>,
    /// Its standard deviation (m).
    pub release_sd_m: f64,
}

/// The population of runs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Population {
    /// Standard deviation of the surface's shift (m).
    pub shift_sd_m: f64,
    /// Standard deviation of the logarithm of friction.
    pub friction_sd: f64,
    /// Dependence of the puncture force on speed.
    pub alpha: f64,
    /// Per layer.
    pub layers: Vec<LayerScatter>,
    /// Root mean square of the fitted runs' residual (N): in air and loading, after the first rupture,
    /// hold, way back.
    pub residual_n: [f64; 4],
    /// Mean shift (m) and mean logarithm of friction.
    mean: [f64; 2],
}

/// The part of an insertion that a sample belongs to, as [`Population::residual_n`] counts.
#[must_use]
pub fn part(run: &Run, i: usize) -> usize {
    let first = run.ruptures.iter().flatten().min().copied().unwrap_or(usize::MAX);
    match i {
        i if i >= run.phases.back => 3,
        i if i > run.phases.deepest => 2,
        i if i >= first => 1,
        _ => 0,
    }
}

impl Population {
    /// The population that a fit's runs show.
    #[must_use]
    pub fn of(fit: &Fit, runs: &[&Run]) -> Self {
        let shape = &fit.shape;
        let shifts: Vec<f64> = fit.own.iter().map(|o| o.shift_m).collect();
        let frictions: Vec<f64> = fit.own.iter().map(|o| o.friction_log).collect();
        let ((shift, shift_sd_m), (friction, friction_sd)) = (mean_sd(&shifts), mean_sd(&frictions));
        let forces = |layer: usize| -> Vec<(f64, f64)> {
            runs.iter()
                .zip(&fit.at_rupture)
                .filter(|(run, _)| run.ruptures[layer].is_some() && shape.imposes(layer))
                .map(|(run, at)| (libm::log(run.speed_mps.max(1e-4) / REFERENCE_MPS), at[layer].max(1e-3)))
                .collect()
        };
        let alpha = if shape.has(Ingredient::RatePuncture) {
            rate(&(0..shape.layers()).map(forces).collect::<Vec<_>>())
        } else {
            0.0
        };
        let layers = (0..shape.layers())
            .map(|i| {
                let logs: Vec<f64> =
                    forces(i).iter().map(|(v, f)| libm::log(f / (1.0 + alpha * v).max(0.1))).collect();
                let (mean, sd) = mean_sd(&logs);
                let releases: Vec<f64> = runs.iter().filter_map(|run| run.releases_m[i]).collect();
                let (release, release_sd_m) = mean_sd(&releases);
                LayerScatter {
                    puncture_log: (!logs.is_empty()).then_some(mean),
                    puncture_sd: if logs.len() > 1 { sd.max(LEAST_SCATTER) } else { 0.1 },
                    drops: (logs.len(), runs.len()),
                    release_m: (!releases.is_empty()).then_some(release),
                    release_sd_m,
                }
            })
            .collect();
        Self {
            shift_sd_m,
            friction_sd,
            alpha,
            layers,
            residual_n: residuals(fit, runs),
            mean: [shift, friction],
        }
    }

    /// A population put together from layers that were measured alone.
    #[must_use]
    pub fn composed(
        layers: Vec<LayerScatter>,
        shift_sd_m: f64,
        friction_sd: f64,
        residual_n: [f64; 4],
    ) -> Self {
        Self { shift_sd_m, friction_sd, alpha: 0.0, layers, residual_n, mean: [0.0; 2] }
    }

    /// `count` insertions drawn from the population: points of the Halton sequence through the
    /// quantiles of normal distributions, the same every time.
    #[must_use]
    pub fn draws(&self, count: usize) -> Vec<Own> {
        (1..=count)
            .map(|k| {
                let mut dimension = 0;
                let mut share = || {
                    let base = PRIMES[dimension % PRIMES.len()];
                    dimension += 1;
                    halton(k, base)
                };
                let shift_m = self.mean[0] + self.shift_sd_m * normal_quantile(share());
                let friction_log = self.mean[1] + self.friction_sd * normal_quantile(share());
                let mut own = Own { shift_m, friction_log, ..Own::default() };
                for layer in &self.layers {
                    let (which, force, release) =
                        (share(), normal_quantile(share()), normal_quantile(share()));
                    let shows = layer.drops.0 as f64 > which * layer.drops.1 as f64;
                    own.drops.push(shows);
                    own.puncture_n.push(
                        layer
                            .puncture_log
                            .filter(|_| shows)
                            .map(|mean| libm::exp(mean + layer.puncture_sd * force)),
                    );
                    own.releases_m.push(layer.release_m.map(|z| z + layer.release_sd_m * release));
                }
                own
            })
            .collect()
    }

    /// The mean insertion.
    #[must_use]
    pub fn mean(&self) -> Own {
        Own {
            shift_m: self.mean[0],
            friction_log: self.mean[1],
            puncture_n: self
                .layers
                .iter()
                .map(|l| l.puncture_log.filter(|_| 2 * l.drops.0 >= l.drops.1).map(libm::exp))
                .collect(),
            drops: self.layers.iter().map(|l| 2 * l.drops.0 >= l.drops.1).collect(),
            releases_m: self.layers.iter().map(|l| l.release_m).collect(),
        }
    }
}

/// `alpha` of `F = F_0 (1 + alpha ln(v/v0))` over all layers, each with its own `F_0`.
fn rate(layers: &[Vec<(f64, f64)>]) -> f64 {
    let mut points: Vec<(f64, f64)> = Vec::new();
    for forces in layers {
        let mean = forces.iter().map(|f| f.1).sum::<f64>() / forces.len().max(1) as f64;
        let mean_v = forces.iter().map(|f| f.0).sum::<f64>() / forces.len().max(1) as f64;
        points.extend(forces.iter().map(|(v, f)| (v - mean_v, f / mean - 1.0)));
    }
    let all: f64 = layers.iter().flatten().map(|f| f.0).sum::<f64>() / points.len().max(1) as f64;
    let (xx, xy): (f64, f64) = points.iter().fold((0.0, 0.0), |(xx, xy), (x, y)| (xx + x * x, xy + x * y));
    if xx < 1e-3 {
        return 0.0;
    }
    // Slope about the mean speed, turned into one about 1 mm/s.
    let slope = xy / xx;
    (slope / (1.0 - slope * all).max(0.2)).clamp(-0.5, 1.0)
}

/// Root mean square of the residual by part, all runs alike.
fn residuals(fit: &Fit, runs: &[&Run]) -> [f64; 4] {
    let mut sums = [(0.0, 0usize); 4];
    let (mut force, mut events) = (Vec::new(), Vec::new());
    for (run, own) in runs.iter().zip(&fit.own) {
        let mut data = run.columns();
        if !fit.shape.imposes(1) {
            data.ruptures.iter_mut().skip(1).for_each(|r| *r = None);
        }
        if !crate::forward::imposed(&fit.shape, &fit.x, own, &data, &mut force, &mut events) {
            continue;
        }
        for (i, (f, m)) in data.f.iter().zip(&force).enumerate() {
            let (sum, n) = &mut sums[part(run, i)];
            *sum += (f - m) * (f - m);
            *n += 1;
        }
    }
    sums.map(|(sum, n)| libm::sqrt(sum / n.max(1) as f64))
}
