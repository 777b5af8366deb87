//! Prediction band of a new recording.

use crate::diagnosis_json::{Diagnosis, Estimate, RandomEffectSd};
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::sync::Arc;
use stylet_identify::block_averages::BlockAverages;
use stylet_identify::likelihood::{FitData, replay};
use stylet_identify::model::{Assumptions, Model};
use stylet_stats::order_statistics::quantile_of_sorted;
use stylet_tissue::{AnyEffect, Effect};

/// Nominal coverage of the band.
pub const BAND_LEVEL: f64 = 0.9;
/// Draws of a band.
const DRAWS: usize = 80;
/// Equally likely noise values per draw.
const NOISE_VALUES: usize = 9;
/// Seed: the same model and recordings give the same draws.
const SEED: u64 = 0x5379_6c65;

/// Uncertainty of a prediction.
#[derive(Clone, Debug)]
pub struct Uncertainty {
    /// Standard deviation of the noise of single samples in N.
    pub floor_n: f64,
    /// The same of block means.
    pub block_n: f64,
    /// Random effects between recordings.
    differences: RandomEffectSd,
    /// Relative standard deviations per layer: stiffness, friction, puncture force.
    base: Vec<[f64; 3]>,
    /// Standard deviations in m: thickness per layer, then the surface.
    thickness_m: Vec<f64>,
    surface_m: f64,
    /// Standard deviations of effect parameters, by effect and path.
    effects: Vec<(String, String, f64)>,
    /// Whether it comes from a diagnosis.
    from_diagnosis: bool,
}

fn interval_sd(low: f64, high: f64) -> f64 {
    ((high - low) / (2.0 * stylet_stats::Z95)).max(0.0)
}

impl Uncertainty {
    /// Uncertainty from a diagnosis; without one only the noise of the recordings is known.
    pub fn new(diagnosis: Option<&Diagnosis>, blocks: &[BlockAverages]) -> Self {
        let count = blocks.len().max(1) as f64;
        let within = blocks.iter().map(|b| b.within_block_sd_n().powi(2)).sum::<f64>() / count;
        let samples = blocks.iter().map(|b| b.samples_per_block as f64).sum::<f64>() / count;
        let mut known = Self {
            floor_n: 0.0,
            block_n: crate::base_law_fit::roughness(blocks),
            differences: RandomEffectSd::default(),
            base: Vec::new(),
            thickness_m: Vec::new(),
            surface_m: 0.0,
            effects: Vec::new(),
            from_diagnosis: diagnosis.is_some(),
        };
        let Some(d) = diagnosis else {
            known.floor_n = (known.block_n.powi(2) + within).sqrt();
            return known;
        };
        known.floor_n = d.noise.sd_n;
        // Lower limit: independent noise averaged over a block.
        let square = known.floor_n.powi(2);
        known.block_n = (square - within).max(square / samples.max(1.0)).sqrt();
        known.differences = d.random_effect_sd;
        let layers = d.base_parameters.iter().map(|b| b.layer).max().unwrap_or(0);
        known.base = vec![[0.0; 3]; layers];
        known.thickness_m = vec![0.0; layers];
        for b in &d.base_parameters {
            let sd = interval_sd(b.low, b.high);
            let relative = sd / b.value.abs().max(1e-300);
            match (b.layer, b.name.as_str()) {
                (0, _) => known.surface_m = sd,
                (l, "stiffness_n_per_m") => known.base[l - 1][0] = relative,
                (l, "friction_ns_per_m2") => known.base[l - 1][1] = relative,
                (l, "puncture_n") => known.base[l - 1][2] = relative,
                (l, _) => known.thickness_m[l - 1] = sd,
            }
        }
        for c in &d.causes {
            for (path, Estimate { low, high, .. }) in &c.parameters {
                known.effects.push((c.effect.clone(), path.clone(), interval_sd(*low, *high)));
            }
        }
        known
    }

    /// Names of the components.
    pub fn components(&self) -> Vec<String> {
        let mut out = vec!["sensor noise".to_owned()];
        if !self.from_diagnosis {
            return out;
        }
        out.push("parameter intervals".to_owned());
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
        out
    }

    /// A draw of the next recording's model. Parameters are drawn independently, because `diagnosis.json`
    /// has no correlations.
    fn draw(&self, model: &Model, r: usize, rng: &mut ChaCha8Rng) -> Model {
        let mut normal = || -> f64 { StandardNormal.sample(rng) };
        let mut out = model.clone();
        let tissue = &mut out.tissue;
        tissue.surface_m += self.surface_m * normal();
        for (l, layer) in tissue.layers.iter_mut().enumerate() {
            let [k, b, f] = self.base.get(l).copied().unwrap_or_default();
            layer.stiffness_n_per_m *= (1.0 + k * normal()).max(0.0);
            layer.friction_ns_per_m2 *= (1.0 + b * normal()).max(0.0);
            let factor = (1.0 + f * normal()) * (1.0 + self.differences.puncture * normal());
            layer.puncture_n = layer.puncture_n.map(|f| f * factor.max(0.01));
            let moved = self.thickness_m.get(l).copied().unwrap_or(0.0) * normal()
                + self.differences.rupture_depth_m * normal();
            layer.thickness_m = (layer.thickness_m + moved).max(0.05 * layer.thickness_m);
        }
        out.per_recording[r].surface_m += self.differences.surface_m * normal();
        out.per_recording[r].ln_friction += self.differences.friction * normal();
        if !self.effects.is_empty() {
            let given = model.assumed.known_effects.iter().map(|e| {
                let info = e.info();
                let mut values = e.parameters();
                for (value, p) in values.iter_mut().zip(info.parameters) {
                    let known =
                        self.effects.iter().find(|(effect, path, _)| effect == info.id && path == p.path);
                    if let Some((_, _, sd)) = known.filter(|_| !p.integer) {
                        *value = (*value + sd * normal()).clamp(p.low, p.high);
                    }
                }
                AnyEffect::from_parameters(info.id, &values).unwrap_or_else(|| e.clone())
            });
            out.assumed = Arc::new(Assumptions {
                known_effects: given.collect(),
                ..Assumptions::clone(&model.assumed)
            });
        }
        out
    }
}

/// Prediction band of every recording.
pub struct Band<'a> {
    /// Uncertainty.
    pub known: &'a Uncertainty,
    /// Model.
    pub model: &'a Model,
    /// Recordings.
    pub data: &'a FitData,
}

impl Band<'_> {
    /// Lower and upper edge (N) per block of recording `r`.
    pub fn edges(&self, r: usize) -> (Vec<f64>, Vec<f64>) {
        let mut rng = ChaCha8Rng::seed_from_u64(SEED);
        let draws: Vec<Vec<f64>> = (0..DRAWS)
            .filter_map(|_| free_run_force(&self.known.draw(self.model, r, &mut rng), self.data, r))
            .collect();
        let blocks = self.data.recordings[r].len();
        let (mut low, mut high) = (Vec::with_capacity(blocks), Vec::with_capacity(blocks));
        let mut values = Vec::with_capacity(DRAWS * NOISE_VALUES);
        let noise = noise_values(self.known.block_n);
        for k in 0..blocks {
            values.clear();
            for draw in &draws {
                values.extend(noise.iter().map(|x| draw[k] + x));
            }
            values.sort_unstable_by(f64::total_cmp);
            low.push(quantile_of_sorted(&values, 0.5 * (1.0 - BAND_LEVEL)));
            high.push(quantile_of_sorted(&values, 0.5 * (1.0 + BAND_LEVEL)));
        }
        (low, high)
    }
}

/// Free-run force (N) of a model for recording `r`.
fn free_run_force(model: &Model, data: &FitData, r: usize) -> Option<Vec<f64>> {
    let trail = stylet_identify::likelihood::ReplayCache::new(model, data, r)?;
    let mut at = model.clone();
    at.rupture_times_s[r] = trail.free_rupture_times();
    Some(replay(&at, data, r)?.force_n)
}

/// Equally likely noise values with standard deviation `sd_n`.
fn noise_values(sd_n: f64) -> [f64; NOISE_VALUES] {
    let at: [f64; NOISE_VALUES] =
        std::array::from_fn(|k| stylet_stats::normal::quantile((k as f64 + 0.5) / NOISE_VALUES as f64));
    let scale = (at.iter().map(|x| x * x).sum::<f64>() / NOISE_VALUES as f64).sqrt();
    at.map(|x| x / scale * sd_n)
}

#[cfg(test)]
mod tests;
