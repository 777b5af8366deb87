//! The band in which the next recording's force is expected.

use super::{BAND, by_itself};
use crate::outcome::{Diagnosis, Differences, Estimate};
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::sync::Arc;
use stylet_identify::blocks::Blocks;
use stylet_identify::model::{Belief, Model};
use stylet_identify::objective::Data;
use stylet_stats::order::quantile_of_sorted;
use stylet_tissue::{AnyEffect, Effect};

/// Insertions drawn for a band.
const DRAWS: usize = 80;
/// Equally likely values that stand for the noise of each of them.
const NOISE: usize = 9;
/// The draws are the same whenever the same model meets the same recordings.
const SEED: u64 = 0x5379_6c65;

/// What is known about noise and scatter.
#[derive(Clone, Debug)]
pub struct Known {
    /// Standard deviation of the noise of single samples in N.
    pub floor_n: f64,
    /// Of means over blocks.
    pub block_n: f64,
    /// From insertion to insertion.
    differences: Differences,
    /// Relative standard deviations: stiffness, friction, puncture force of each layer.
    base: Vec<[f64; 3]>,
    /// Standard deviations in m: thickness of each layer, then the surface.
    thickness_m: Vec<f64>,
    surface_m: f64,
    /// Of effects' parameters, by effect and path.
    effects: Vec<(String, String, f64)>,
    /// Whether a diagnosis told it.
    told: bool,
}

fn sd(low: f64, high: f64) -> f64 {
    ((high - low) / (2.0 * stylet_stats::Z95)).max(0.0)
}

impl Known {
    /// What a diagnosis tells; without one, what the recordings themselves tell of their noise.
    pub fn new(diagnosis: Option<&Diagnosis>, blocks: &[Blocks]) -> Self {
        let count = blocks.len().max(1) as f64;
        let within = blocks.iter().map(|b| b.within_n().powi(2)).sum::<f64>() / count;
        let samples = blocks.iter().map(|b| b.samples as f64).sum::<f64>() / count;
        let mut known = Self {
            floor_n: 0.0,
            block_n: crate::base::roughness(blocks),
            differences: Differences::default(),
            base: Vec::new(),
            thickness_m: Vec::new(),
            surface_m: 0.0,
            effects: Vec::new(),
            told: diagnosis.is_some(),
        };
        let Some(d) = diagnosis else {
            known.floor_n = (known.block_n.powi(2) + within).sqrt();
            return known;
        };
        known.floor_n = d.noise.sd_n;
        // At least what independent noise leaves of a mean.
        let square = known.floor_n.powi(2);
        known.block_n = (square - within).max(square / samples.max(1.0)).sqrt();
        known.differences = d.differences;
        let layers = d.base_parameters.iter().map(|b| b.layer).max().unwrap_or(0);
        known.base = vec![[0.0; 3]; layers];
        known.thickness_m = vec![0.0; layers];
        for b in &d.base_parameters {
            let sd = sd(b.low, b.high);
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
                known.effects.push((c.effect.clone(), path.clone(), sd(*low, *high)));
            }
        }
        known
    }

    /// In words.
    pub fn holds(&self) -> Vec<String> {
        let mut out = vec!["the noise".to_owned()];
        if !self.told {
            return out;
        }
        out.push("the intervals of the model's numbers".to_owned());
        let d = &self.differences;
        for (size, what) in [
            (d.puncture, "scatter of puncture forces"),
            (d.face_m, "scatter of the places at which layers give way"),
            (d.surface_m, "scatter of the surface"),
            (d.friction, "scatter of friction"),
        ] {
            if size > 0.0 {
                out.push(what.to_owned());
            }
        }
        out
    }

    /// A model as the next insertion may find it. Numbers are drawn one by one: their correlations are not in
    /// `diagnosis.json`.
    fn drawn(&self, model: &Model, r: usize, rng: &mut ChaCha8Rng) -> Model {
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
                + self.differences.face_m * normal();
            layer.thickness_m = (layer.thickness_m + moved).max(0.05 * layer.thickness_m);
        }
        out.own[r].surface_m += self.differences.surface_m * normal();
        out.own[r].friction += self.differences.friction * normal();
        if !self.effects.is_empty() {
            let given = model.belief.given.iter().map(|e| {
                let info = e.info();
                let mut values = e.parameters();
                for (value, p) in values.iter_mut().zip(info.parameters) {
                    let known =
                        self.effects.iter().find(|(effect, path, _)| effect == info.id && path == p.path);
                    if let Some((_, _, sd)) = known.filter(|_| !p.whole) {
                        *value = (*value + sd * normal()).clamp(p.low, p.high);
                    }
                }
                AnyEffect::from_parameters(info.id, &values).unwrap_or_else(|| e.clone())
            });
            out.belief = Arc::new(Belief { given: given.collect(), ..Belief::clone(&model.belief) });
        }
        out
    }
}

/// A band for every recording.
pub struct Band<'a> {
    /// What is known.
    pub known: &'a Known,
    /// The model.
    pub model: &'a Model,
    /// The recordings.
    pub data: &'a Data,
}

impl Band<'_> {
    /// Lower and upper edge in N for every block of recording `r`.
    pub fn edges(&self, r: usize) -> (Vec<f64>, Vec<f64>) {
        let mut rng = ChaCha8Rng::seed_from_u64(SEED);
        let draws: Vec<Vec<f64>> = (0..DRAWS)
            .filter_map(|_| by_itself(&self.known.drawn(self.model, r, &mut rng), self.data, r))
            .collect();
        let blocks = self.data.blocks[r].len();
        let (mut low, mut high) = (Vec::with_capacity(blocks), Vec::with_capacity(blocks));
        let mut values = Vec::with_capacity(DRAWS * NOISE);
        let noise = noise(self.known.block_n);
        for k in 0..blocks {
            values.clear();
            for draw in &draws {
                values.extend(noise.iter().map(|x| draw[k] + x));
            }
            values.sort_unstable_by(f64::total_cmp);
            low.push(quantile_of_sorted(&values, 0.5 * (1.0 - BAND)));
            high.push(quantile_of_sorted(&values, 0.5 * (1.0 + BAND)));
        }
        (low, high)
    }
}

/// Equally likely values of noise of standard deviation `sd_n`.
fn noise(sd_n: f64) -> [f64; NOISE] {
    let at: [f64; NOISE] =
        std::array::from_fn(|k| stylet_stats::normal::quantile((k as f64 + 0.5) / NOISE as f64));
    let scale = (at.iter().map(|x| x * x).sum::<f64>() / NOISE as f64).sqrt();
    at.map(|x| x / scale * sd_n)
}
