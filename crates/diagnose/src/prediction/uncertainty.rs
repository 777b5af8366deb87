//! Uncertainty of the model parameters, and draws of the next recording.

use super::group_deviation::Factor;
use super::training_curves::TrainingSummary;
use crate::diagnosis_json::{Diagnosis, Estimate, LabelledParameter, ParameterLabel, RandomEffectSd};
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::sync::Arc;
use stylet_identify::block_averages::BlockAverages;
use stylet_identify::likelihood::{FitData, replay};
use stylet_identify::model::{Assumptions, Model};
use stylet_stats::linear_algebra::{CholeskyFactor, SymmetricMatrix};
use stylet_tissue::{AnyEffect, Effect};

/// Number of draws for a band: its 5 % quantile is then an average over several of them.
pub const DRAWS: usize = 80;
/// Seed of the draws, constant so that equal inputs give equal bands.
pub const SEED: u64 = 0x5379_6c65;

/// Uncertainty of a prediction.
#[derive(Clone, Debug)]
pub struct Uncertainty {
    /// Standard deviation of the noise of single samples in N.
    pub floor_n: f64,
    /// The same of block means.
    pub block_n: f64,
    /// Random effects between recordings.
    differences: RandomEffectSd,
    /// Parameters of base law and causes.
    parameters: Vec<LabelledParameter>,
    /// Cholesky factor of the covariance of the parameters.
    factor: CholeskyFactor,
    /// Whether a diagnosis gave the uncertainty.
    from_diagnosis: bool,
}

/// Parameters of a diagnosis with their covariance; without a covariance, their intervals are taken as independent.
fn parameters_of(d: &Diagnosis) -> (Vec<LabelledParameter>, SymmetricMatrix) {
    let is_square = d.covariance.len() == d.parameters.len()
        && d.covariance.iter().all(|row| row.len() == d.parameters.len());
    if is_square && !d.parameters.is_empty() {
        let mut matrix = SymmetricMatrix::zeros(d.parameters.len());
        for (i, row) in d.covariance.iter().enumerate() {
            row[..=i].iter().enumerate().for_each(|(j, x)| matrix.add(i, j, *x));
        }
        return (d.parameters.clone(), matrix);
    }
    let of_base = d.base_parameters.iter().map(|b| (b.layer, None, b.name.as_str(), b.high - b.low));
    let of_causes = d.causes.iter().flat_map(|c| {
        let of_cause = |(path, e): (_, &Estimate)| (0, Some(c.effect.as_str()), path, e.high - e.low);
        c.parameters.iter().map(move |(path, e)| of_cause((path.as_str(), e)))
    });
    let all: Vec<_> = of_base.chain(of_causes).collect();
    let mut matrix = SymmetricMatrix::zeros(all.len());
    for (i, (.., width)) in all.iter().enumerate() {
        matrix.add(i, i, (width / (2.0 * stylet_stats::Z95)).max(0.0).powi(2));
    }
    let parameter =
        |(layer, effect, name, _)| LabelledParameter::new(layer, effect, name, ParameterLabel::Determined);
    (all.into_iter().map(parameter).collect(), matrix)
}

impl Uncertainty {
    /// Uncertainty from a diagnosis; without one, only the noise of the recordings.
    pub fn new(diagnosis: Option<&Diagnosis>, blocks: &[BlockAverages]) -> Self {
        let count = blocks.len().max(1) as f64;
        let within = blocks.iter().map(|b| b.within_block_sd_n().powi(2)).sum::<f64>() / count;
        let samples = blocks.iter().map(|b| b.samples_per_block as f64).sum::<f64>() / count;
        let mut known = Self {
            floor_n: 0.0,
            block_n: crate::base_law_fit::roughness(blocks),
            differences: RandomEffectSd::default(),
            parameters: Vec::new(),
            factor: SymmetricMatrix::zeros(0).cholesky(),
            from_diagnosis: diagnosis.is_some(),
        };
        let Some(d) = diagnosis else {
            known.floor_n = (known.block_n.powi(2) + within).sqrt();
            return known;
        };
        known.floor_n = d.noise.sd_n;
        // At least white noise averaged over a block.
        let square = known.floor_n.powi(2);
        known.block_n = (square - within).max(square / samples.max(1.0)).sqrt();
        known.differences = d.random_effect_sd;
        let (parameters, covariance) = parameters_of(d);
        (known.parameters, known.factor) = (parameters, covariance.cholesky());
        known
    }

    /// Names of the components of the uncertainty.
    pub fn components(&self, training: Option<&TrainingSummary>, varying: &[Factor]) -> Vec<String> {
        let mut out = vec!["sensor noise".to_owned()];
        if self.from_diagnosis {
            out.push("parameter intervals".to_owned());
        }
        let d = &self.differences;
        for (size, what) in [
            (d.puncture, "scatter of puncture forces"),
            (d.rupture_depth_m, "scatter of rupture depths"),
            (d.surface_m, "scatter of the surface"),
            (d.friction, "scatter of friction"),
        ] {
            if size > 0.0 {
                out.push(what.to_owned());
            }
        }
        if training.is_some() {
            out.push("misfit of the law".to_owned());
        }
        out.extend(varying.iter().map(|f| format!("another {}", f.name())));
        out
    }

    /// Drawn forces (N) of recording `r` in the training group.
    pub fn draws(&self, model: &Model, data: &FitData, r: usize) -> Vec<Vec<f64>> {
        let mut rng = ChaCha8Rng::seed_from_u64(SEED);
        (0..DRAWS).filter_map(|_| free_run_force(&self.draw(model, r, &mut rng), data, r)).collect()
    }

    /// Draws the model of the next recording.
    pub fn draw(&self, model: &Model, r: usize, rng: &mut ChaCha8Rng) -> Model {
        let mut normal = || -> f64 { StandardNormal.sample(rng) };
        let mut out = model.clone();
        let independent: Vec<f64> = self.parameters.iter().map(|_| normal()).collect();
        let deviations = self.factor.multiply(&independent);
        let mut effects = model.assumed.known_effects.clone();
        for (p, deviation) in self.parameters.iter().zip(&deviations) {
            if let Some(id) = &p.effect {
                effects.iter_mut().filter(|e| e.id() == id).for_each(|e| deviate(e, &p.name, *deviation));
            } else if p.layer == 0 {
                out.tissue.surface_m += deviation;
            } else if let Some(layer) = out.tissue.layers.get_mut(p.layer - 1) {
                let positive = |x: f64, least: f64| (x + deviation).max(least * x);
                match p.name.as_str() {
                    "stiffness_n_per_m" => layer.stiffness_n_per_m = positive(layer.stiffness_n_per_m, 0.0),
                    "friction_ns_per_m2" => {
                        layer.friction_ns_per_m2 = positive(layer.friction_ns_per_m2, 0.0)
                    }
                    "puncture_n" => layer.puncture_n = layer.puncture_n.map(|x| positive(x, 0.01)),
                    _ => layer.thickness_m = positive(layer.thickness_m, 0.05),
                }
            }
        }
        for layer in &mut out.tissue.layers {
            let factor = 1.0 + self.differences.puncture * normal();
            layer.puncture_n = layer.puncture_n.map(|f| f * factor.max(0.01));
            let moved_m = self.differences.rupture_depth_m * normal();
            layer.thickness_m = (layer.thickness_m + moved_m).max(0.05 * layer.thickness_m);
        }
        out.per_recording[r].surface_m += self.differences.surface_m * normal();
        out.per_recording[r].ln_friction += self.differences.friction * normal();
        out.assumed = Arc::new(Assumptions { known_effects: effects, ..Assumptions::clone(&model.assumed) });
        out
    }
}

/// Changes a parameter of an effect, within its range.
fn deviate(effect: &mut AnyEffect, path: &str, deviation: f64) {
    let info = effect.info();
    let mut values = effect.parameters();
    for (value, p) in values.iter_mut().zip(info.parameters).filter(|(_, p)| p.path == path && !p.integer) {
        *value = (*value + deviation).clamp(p.low, p.high);
    }
    if let Some(changed) = info.with_parameters(&values) {
        *effect = changed;
    }
}

/// Free-run force (N) of a model for recording `r`.
pub fn free_run_force(model: &Model, data: &FitData, r: usize) -> Option<Vec<f64>> {
    let cache = stylet_identify::likelihood::ReplayCache::new(model, data, r)?;
    let mut at = model.clone();
    at.rupture_times_s[r] = cache.free_rupture_times();
    Some(replay(&at, data, r)?.force_n)
}
