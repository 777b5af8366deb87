//! The band in which the next recording's force is expected.

use super::{BAND_LEVEL, by_itself};
use crate::diagnosis_json::{Diagnosis, Estimate, RandomEffectSd};
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::sync::Arc;
use stylet_identify::block_averages::BlockAverages;
use stylet_identify::likelihood::FitData;
use stylet_identify::model::{Assumptions, Model};
use stylet_stats::order_statistics::quantile_of_sorted;
use stylet_tissue::{AnyEffect, Effect};

/// Insertions drawn for a band.
const DRAWS: usize = 80;
/// Equally likely values that stand for the noise of each of them.
const NOISE: usize = 9;
/// The draws are the same whenever the same model meets the same recordings.
const SEED: u64 = 0x5379_6c65;

/// What is known about noise and scatter.
#[derive(Clone, Debug)]
pub struct Uncertainty {
    /// Standard deviation of the noise of single samples in N.
    pub floor_n: f64,
    /// Of means over blocks.
    pub block_n: f64,
    /// From insertion to insertion.
    differences: RandomEffectSd,
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

impl Uncertainty {
    /// What a diagnosis tells; without one, what the recordings themselves tell of their noise.
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
        known.differences = d.random_effect_sd;
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
    pub fn components(&self) -> Vec<String> {
        let mut out = vec!["the noise".to_owned()];
        if !self.told {
            return out;
        }
        out.push("the intervals of the model's numbers".to_owned());
        let d = &self.differences;
        for (size, what) in [
            (d.puncture, "scatter of puncture forces"),
            (d.rupture_depth_m, "scatter of the places at which layers give way"),
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

/// A band for every recording.
pub struct Band<'a> {
    /// What is known.
    pub known: &'a Uncertainty,
    /// The model.
    pub model: &'a Model,
    /// The recordings.
    pub data: &'a FitData,
}

impl Band<'_> {
    /// Lower and upper edge in N for every block of recording `r`.
    pub fn edges(&self, r: usize) -> (Vec<f64>, Vec<f64>) {
        let mut rng = ChaCha8Rng::seed_from_u64(SEED);
        let draws: Vec<Vec<f64>> = (0..DRAWS)
            .filter_map(|_| by_itself(&self.known.drawn(self.model, r, &mut rng), self.data, r))
            .collect();
        let blocks = self.data.recordings[r].len();
        let (mut low, mut high) = (Vec::with_capacity(blocks), Vec::with_capacity(blocks));
        let mut values = Vec::with_capacity(DRAWS * NOISE);
        let noise = noise(self.known.block_n);
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

/// Equally likely values of noise of standard deviation `sd_n`.
fn noise(sd_n: f64) -> [f64; NOISE] {
    let at: [f64; NOISE] =
        std::array::from_fn(|k| stylet_stats::normal::quantile((k as f64 + 0.5) / NOISE as f64));
    let scale = (at.iter().map(|x| x * x).sum::<f64>() / NOISE as f64).sqrt();
    at.map(|x| x / scale * sd_n)
}

#[cfg(test)]
mod tests {
    use super::{Band, NOISE, SEED, Uncertainty, noise, sd};
    use crate::diagnosis_json::{Cause, Diagnosis, Estimate, RandomEffectSd};
    use crate::prediction::by_itself;
    use rand::SeedableRng;
    use rand::rngs::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};
    use std::collections::BTreeMap;
    use std::sync::Arc;
    use stylet_identify::block_averages::{BLOCK_S, BlockAverages};
    use stylet_identify::likelihood::FitData;
    use stylet_identify::model::{Assumptions, Model};
    use stylet_identify::noise::Noise;
    use stylet_record::Recording;
    use stylet_tissue::{CoulombFriction, Layer, Tissue};

    /// In by 30 mm in 6 s at 200 Hz, alternating noise of 0.02 N.
    fn blocks() -> BlockAverages {
        let t: Vec<f64> = (0..1200).map(|k| f64::from(k) / 200.0).collect();
        let z = t.iter().map(|t| 0.005 * t).collect();
        let f = t.iter().enumerate().map(|(k, t)| 0.5 * t + if k % 2 == 0 { 0.02 } else { -0.02 }).collect();
        BlockAverages::new(&Recording::new(t, z, f).expect("a recording"), &[], BLOCK_S)
    }

    /// A diagnosis of which only what a band needs is said.
    fn diagnosis() -> Diagnosis {
        let base = |layer: usize, name: &str, value: f64, half: f64| {
            serde_json::json!({"layer": layer, "name": name, "assumed": value, "value": value, "low": value - half, "high": value + half,
                               "changed": false, "at_bound": false})
        };
        let mut d: Diagnosis = serde_json::from_value(serde_json::json!({
            "verdict": "named", "causes": [], "invisible": [], "data_quality": [], "evidence": [], "advice": [],
            "base_parameters": [
                base(1, "stiffness_n_per_m", 120.0, 12.0), base(1, "friction_ns_per_m2", 5000.0, 900.0), base(1, "puncture_n", 1.2, 0.3),
                base(1, "thickness_m", 0.012, 0.001), base(2, "stiffness_n_per_m", 200.0, 8.0), base(2, "thickness_m", 0.05, 0.002),
                base(0, "surface_m", 0.002, 0.0006)
            ],
            "gain": {"held_out": true, "recordings": [], "rmse_before_n": 0.0, "rmse_after_n": 0.0, "floor_n": 0.03, "each_n": []},
            "leftover": {"p_value": 1.0, "depends_on": [], "nats": 0.0, "share": 0.0},
            "noise": {"sd_n": 0.03, "ar": [0.0, 0.0], "from_air": false}
        }))
        .expect("a diagnosis");
        d.random_effect_sd =
            RandomEffectSd { puncture: 0.04, rupture_depth_m: 3e-4, surface_m: 2e-4, friction: 0.05 };
        d.causes = vec![Cause {
            effect: "coulomb_friction".to_owned(),
            equivalent: Vec::new(),
            confidence: 1.0,
            parameters: BTreeMap::from([(
                "c_n_per_m".to_owned(),
                Estimate { value: 8.0, low: 7.0, high: 9.5 },
            )]),
            gain_nats: 0.0,
            share: 0.0,
        }];
        d
    }

    #[test]
    fn standard_deviations_are_a_quarter_of_an_interval_or_nothing() {
        assert!((sd(1.0, 4.0) - 3.0 / (2.0 * 1.959_963_984_540_054)).abs() < 1e-12);
        assert_eq!(sd(4.0, 1.0), 0.0);
    }

    #[test]
    fn values_that_stand_for_noise_are_equally_likely_and_have_its_size() {
        let at = noise(0.7);
        assert!((at.iter().map(|x| x * x).sum::<f64>() / 9.0 - 0.49).abs() < 1e-12);
        assert!(at[4].abs() < 1e-12 && at.windows(2).all(|w| w[0] < w[1]));
        let ratio = stylet_stats::normal::quantile(0.5 / 9.0) / stylet_stats::normal::quantile(1.5 / 9.0);
        assert!((at[0] / at[1] - ratio).abs() < 1e-12 && (at[8] + at[0]).abs() < 1e-12);
    }

    #[test]
    fn what_is_known_is_what_the_diagnosis_said() {
        let b = blocks();
        let within = b.within_block_sd_n();
        assert!(within > 0.005, "{within}");
        let k = Uncertainty::new(Some(&diagnosis()), std::slice::from_ref(&b));
        assert_eq!(k.floor_n, 0.03);
        assert!(
            (k.block_n - (0.03 * 0.03 - within * within).max(0.03 * 0.03 / 4.0).sqrt()).abs() < 1e-12,
            "{}",
            k.block_n
        );
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} for {b}");
        let z = stylet_stats::Z95;
        near(k.base[0][0], 0.1 / z);
        near(k.base[0][1], 0.18 / z);
        near(k.base[0][2], 0.25 / z);
        near(k.base[1][0], 0.04 / z);
        assert_eq!(k.base[1][1..], [0.0, 0.0]);
        near(k.thickness_m[0], 0.001 / z);
        near(k.thickness_m[1], 0.002 / z);
        near(k.surface_m, 0.0006 / z);
        assert_eq!((k.effects[0].0.as_str(), k.effects[0].1.as_str()), ("coulomb_friction", "c_n_per_m"));
        near(k.effects[0].2, 2.5 / (2.0 * z));
        assert_eq!(k.components().len(), 6);
        let mut d = diagnosis();
        d.random_effect_sd = RandomEffectSd { surface_m: 1e-4, ..RandomEffectSd::default() };
        // Noise whose samples are hardly more than what is within a block: an independent noise's mean is the least.
        d.noise.sd_n = 1.0001 * within;
        let k = Uncertainty::new(Some(&d), std::slice::from_ref(&b));
        near(k.block_n, d.noise.sd_n / 2.0);
        assert_eq!(
            k.components(),
            ["the noise", "the intervals of the model's numbers", "scatter of the surface"]
        );
        // Without a diagnosis the recordings tell their own noise.
        let k = Uncertainty::new(None, &[b.clone(), b.clone()]);
        let rough = crate::base_law_fit::roughness(&[b.clone(), b]);
        near(k.floor_n, (rough * rough + within * within).sqrt());
        near(k.block_n, rough);
        assert_eq!(k.components(), ["the noise"]);
    }

    fn model() -> Model {
        let layer = |d: f64, k: f64, f: Option<f64>| Layer {
            name: String::new(),
            thickness_m: d,
            stiffness_n_per_m: k,
            friction_ns_per_m2: 5000.0,
            puncture_n: f,
        };
        let belief = Assumptions {
            tissue: Tissue {
                surface_m: 0.002,
                layers: vec![layer(0.012, 120.0, Some(1.2)), layer(0.05, 200.0, None)],
            },
            known_effects: vec![CoulombFriction { c_n_per_m: 8.0 }.into()],
            tolerance: vec![0.3; 2],
            thickness_tolerance: vec![0.1; 2],
            surface_tolerance_m: 0.01,
        };
        Model::base(Arc::new(belief), 1)
    }

    /// Numbers are drawn one by one in the order surface, then per layer stiffness, friction, puncture force (its own and its scatter),
    /// thickness and face, then what differs between insertions, then the effects'.
    #[test]
    fn a_drawn_model_is_off_by_what_its_numbers_may_be() {
        let mut k = Uncertainty::new(Some(&diagnosis()), &[blocks()]);
        let coulomb = k.effects[0].2;
        // What is known of another effect's number, or of another number of this effect, is not this one's.
        k.effects.insert(0, ("stribeck_friction".to_owned(), "c_n_per_m".to_owned(), 50.0));
        k.effects.insert(0, ("coulomb_friction".to_owned(), "c".to_owned(), 50.0));
        let m = model();
        for seed in [1, 5, 9] {
            let out = k.drawn(&m, 0, &mut ChaCha8Rng::seed_from_u64(seed));
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let mut n = || -> f64 { StandardNormal.sample(&mut rng) };
            let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-12 * (1.0 + b.abs()), "{a} for {b}");
            near(out.tissue.surface_m, 0.002 + k.surface_m * n());
            for (l, layer) in m.tissue.layers.iter().enumerate() {
                let drawn = &out.tissue.layers[l];
                near(drawn.stiffness_n_per_m, layer.stiffness_n_per_m * (1.0 + k.base[l][0] * n()));
                near(drawn.friction_ns_per_m2, layer.friction_ns_per_m2 * (1.0 + k.base[l][1] * n()));
                let factor = (1.0 + k.base[l][2] * n()) * (1.0 + 0.04 * n());
                assert_eq!(drawn.puncture_n.is_some(), l == 0);
                near(drawn.puncture_n.unwrap_or(0.0), layer.puncture_n.unwrap_or(0.0) * factor);
                near(drawn.thickness_m, layer.thickness_m + k.thickness_m[l] * n() + 3e-4 * n());
            }
            near(out.per_recording[0].surface_m, 2e-4 * n());
            near(out.per_recording[0].ln_friction, 0.05 * n());
            near(out.assumed.known_effects[0].parameters()[0], 8.0 + coulomb * n());
        }
        // Nothing falls below nothing, a force not below a hundredth, a layer not below a twentieth.
        let mut wild = k.clone();
        (wild.base, wild.thickness_m) = (vec![[40.0; 3]; 2], vec![9.0; 2]);
        let all: Vec<Model> = (0..40).map(|s| wild.drawn(&m, 0, &mut ChaCha8Rng::seed_from_u64(s))).collect();
        let least = |of: &dyn Fn(&Model) -> f64| all.iter().map(of).fold(f64::INFINITY, f64::min);
        assert_eq!(least(&|m| m.tissue.layers[0].stiffness_n_per_m), 0.0);
        assert_eq!(least(&|m| m.tissue.layers[1].friction_ns_per_m2), 0.0);
        assert!((least(&|m| m.tissue.layers[0].puncture_n.unwrap_or(9.0)) - 0.012).abs() < 1e-12);
        assert!((least(&|m| m.tissue.layers[0].thickness_m) - 0.0006).abs() < 1e-12);
    }

    #[test]
    fn the_edges_are_the_quantiles_of_what_is_drawn_and_of_the_noise() {
        let b = blocks();
        let k = Uncertainty::new(Some(&diagnosis()), std::slice::from_ref(&b));
        let data = FitData::new(Arc::new(vec![b]), Noise::white(0.03), 0.0);
        let m = model();
        let (low, high) = Band { known: &k, model: &m, data: &data }.edges(0);
        let mut rng = ChaCha8Rng::seed_from_u64(SEED);
        let draws: Vec<Vec<f64>> =
            (0..80).filter_map(|_| by_itself(&k.drawn(&m, 0, &mut rng), &data, 0)).collect();
        assert_eq!(draws.len(), 80);
        for at in [20, 110, 260] {
            let mut all: Vec<f64> = draws.iter().flat_map(|d| noise(k.block_n).map(|x| d[at] + x)).collect();
            assert_eq!(all.len(), 80 * NOISE);
            all.sort_by(f64::total_cmp);
            assert!((low[at] - stylet_stats::quantile_of_sorted(&all, 0.05)).abs() < 1e-12);
            assert!((high[at] - stylet_stats::quantile_of_sorted(&all, 0.95)).abs() < 1e-12);
        }
    }
}
