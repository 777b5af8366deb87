//! Results of one run: its score and further quantities that the claims use, accumulated sample by sample.

use crate::algorithm_variant::{Sensor, Variant};
use crate::simulated_insertion::Insertion;
use crate::tuned_thresholds::Tuning;
use stylet_core::{EnhanceConfig, Enhancer, Sample};
use stylet_score::{
    EnhancedSample, LayerSample, OfflineEstimate, Score, Scorer, TrueSample, fit_layer_offline,
};

/// One run of the algorithm on one recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// The score (docs/reference/files.md, `score.json`).
    pub score: Score,
    /// Estimated over true cumulative friction at the end; `None` where the true one is zero.
    pub cumulative_ratio: Option<f64>,
    /// RMS of the enhanced over RMS of the measured force after the tip has left the last layer and the
    /// algorithm has compensated it (from the exit on when it never does).
    pub after_exit: Option<f64>,
    /// RMS of enhanced force minus true elastic force over RMS of the latter, from contact to the last
    /// rupture.
    pub elastic_error: Option<f64>,
    /// RMS of the reconstruction error over RMS of the measured force, from contact to the end.
    pub reconstruction: Option<f64>,
    /// Layers that were estimated and compensated.
    pub estimated: usize,
    /// Elastic share of the force drop of every true rupture that was found, by layer.
    pub shares: Vec<Option<f64>>,
}

fn ratio(over: f64, under: f64) -> Option<f64> {
    (under > 0.0).then(|| (over / under).sqrt())
}

impl Outcome {
    /// Runs a core over the samples of an insertion.
    #[must_use]
    pub fn of(insertion: &Insertion, samples: &[Sample], config: &EnhanceConfig) -> Self {
        let truth = &insertion.simulation.truth;
        let mut scorer = Scorer::new(insertion.layers.clone(), config.model);
        for rupture in &truth.ruptures {
            scorer.add_rupture(*rupture);
        }
        let contact_s = truth.surface_contact_s.unwrap_or(f64::INFINITY);
        let last_rupture_s = truth.ruptures.last().map_or(f64::INFINITY, |r| r.time_s);
        let exit_s =
            if truth.ruptures.len() == insertion.layers.len() { last_rupture_s } else { f64::INFINITY };
        let mut core =
            Enhancer::new(config.clone(), insertion.surface_m(), vec![Sample::default(); samples.len()]);
        let (mut enhanced2, mut after2) = (0.0, 0.0);
        let (mut missed2, mut elastic2) = (0.0, 0.0);
        let (mut error2, mut force2) = (0.0, 0.0);
        let mut estimates = Vec::new();
        let mut found = 0.0f64;
        let mut i = 0;
        core.run(samples, |out| {
            let Sample { time_s, position_m, force_n, .. } = samples[i];
            if out.detection.is_some() || out.estimate.is_some() {
                scorer.add_event(out);
            }
            let (tip_n, total_n) = (truth.tip_force_n[i], truth.tissue_force_n[i]);
            let sample_truth = TrueSample { position_m, force_n, tip_n, total_n };
            scorer.add_sample(&sample_truth, &EnhancedSample::from(out));
            if let Some(estimate) = out.estimate {
                found = (found + estimate.added_friction_ns_per_m).max(0.0);
                estimates.push(estimate);
                if time_s > exit_s {
                    // From now on the layer that was left is compensated.
                    (enhanced2, after2) = (0.0, 0.0);
                }
            }
            if time_s >= contact_s && force_n.is_finite() {
                error2 += out.error_n * out.error_n;
                force2 += force_n * force_n;
                if time_s > exit_s && out.estimate.is_none() {
                    enhanced2 += out.enhanced_n * out.enhanced_n;
                    after2 += force_n * force_n;
                }
                if time_s < last_rupture_s {
                    let elastic = truth.elastic_n[i];
                    missed2 += (out.enhanced_n - elastic) * (out.enhanced_n - elastic);
                    elastic2 += elastic * elastic;
                }
            }
            i += 1;
        });
        let score = scorer.finish();
        let shares = score
            .ruptures
            .iter()
            .map(|r| {
                let found = r.detection?;
                estimates.iter().find(|e| e.layer == found).map(|e| e.elastic_share)
            })
            .collect();
        let cumulative = truth.cumulative_friction_ns_per_m.last().copied().unwrap_or(0.0);
        Self {
            cumulative_ratio: (cumulative > 0.0).then(|| found / cumulative),
            after_exit: ratio(enhanced2, after2),
            elastic_error: ratio(missed2, elastic2),
            reconstruction: ratio(error2, force2),
            estimated: estimates.len(),
            shares,
            score,
        }
    }

    /// Whether exactly the true ruptures were found.
    #[must_use]
    pub fn found_all(&self) -> bool {
        self.score.missed == 0 && self.score.false_alarms == 0
    }

    /// Friction of a layer in N s/m² estimated by the online algorithm.
    #[must_use]
    pub fn online_friction(&self, layer: usize) -> Option<f64> {
        self.score.layers.get(layer).and_then(|l| l.friction_ns_per_m2.estimated)
    }
}

impl Insertion {
    /// Runs the algorithm and accumulates the quantities that the claims use.
    #[must_use]
    pub fn run(&self, samples: &[Sample], sensor: Sensor, variant: Variant, tuning: &Tuning) -> Outcome {
        Outcome::of(self, samples, &variant.config(&self.scenario, sensor, tuning))
    }
}

/// Offline estimates from one recording. They use nothing of the online algorithm, except where stated the elastic share of the force
/// drop.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Offline {
    /// Friction in N s/m² of the first layer under the supplement's assumption that all force is friction:
    /// least squares of `f` on `dz v`.
    pub friction_only: Option<f64>,
    /// K and b of every ruptured layer, without the drop: where the data do not separate them, elastic and viscous column have equal
    /// weight (the supplement's `W` of eq. 17, `1/v²`).
    pub without_drop: Vec<Option<OfflineEstimate>>,
    /// The same, split by the share of the drop that the online algorithm measured.
    pub with_drop: Vec<Option<OfflineEstimate>>,
}

impl Offline {
    /// From the samples of an insertion; `shares` are the elastic shares of the force drops.
    #[must_use]
    pub fn of(insertion: &Insertion, samples: &[Sample], shares: &[Option<f64>]) -> Self {
        let ruptures = &insertion.simulation.truth.ruptures;
        let mut out = Self::default();
        let (mut without, mut with) = (0.0, 0.0);
        for (index, rupture) in ruptures.iter().enumerate() {
            let Some(layer) = rupture.layer.checked_sub(1).and_then(|l| insertion.layers.get(l)) else {
                continue;
            };
            let inside = || {
                let from = samples.partition_point(|s| s.position_m <= layer.front_m);
                samples[from.min(samples.len())..]
                    .iter()
                    .take_while(|s| s.time_s < rupture.time_s)
                    .filter(|s| s.force_n.is_finite() && s.velocity_mps > 0.0)
                    .map(|s| (s.position_m - layer.front_m, s.velocity_mps, s.force_n))
            };
            let (n, speeds) = inside().fold((0.0, 0.0), |(n, sum), (_, v, _)| (n + 1.0, sum + v));
            if index == 0 {
                let (over, under) = inside().fold((0.0, 0.0), |(over, under), (z, v, f)| {
                    let phi = z * v;
                    (over + phi * f, under + phi * phi)
                });
                out.friction_only = (under > 0.0).then(|| over / under);
            }
            let ratio = n / speeds;
            let fit = |cumulative: f64, share: f64| {
                let layer = inside().map(|(depth_m, velocity_mps, f)| LayerSample {
                    depth_m,
                    velocity_mps,
                    force_n: f - cumulative * velocity_mps,
                });
                fit_layer_offline(layer, ((1.0 - share) / share).sqrt() * ratio)
            };
            let depth_m = rupture.position_m - layer.front_m;
            let plain = fit(without, 0.5);
            without += plain.map_or(0.0, |e| e.friction_ns_per_m2.max(0.0) * depth_m);
            out.without_drop.push(plain);
            let split = shares.get(index).copied().flatten().and_then(|share| fit(with, share));
            with += split.map_or(0.0, |e| e.friction_ns_per_m2.max(0.0) * depth_m);
            out.with_drop.push(split);
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::paper_experiments::Case;

    #[test]
    fn the_offline_estimate_without_the_drop_takes_nothing_from_the_online_algorithm() {
        for case in [Case::LatexConstant, Case::LatexSinusoidal] {
            let insertion = Insertion::of(&case.scenario().expect("valid"), 1).expect("a simulation");
            let samples = insertion.samples(&insertion.reading(1, 10));
            let of = |shares: &[Option<f64>]| Offline::of(&insertion, &samples, shares);
            let (none, some, other) = (of(&[]), of(&[Some(0.3); 3]), of(&[Some(0.6); 3]));
            assert_eq!(none.without_drop.len(), 3, "{case:?}");
            assert!(none.without_drop.iter().all(Option::is_some), "{case:?}");
            assert_eq!(none.without_drop, some.without_drop, "{case:?}");
            assert_eq!(none.without_drop, other.without_drop, "{case:?}");
            assert_eq!(none.friction_only, other.friction_only, "{case:?}");
            assert!(none.with_drop.iter().all(Option::is_none), "{case:?}");
        }
        // Where the data do not separate K from b, the drop decides, so that the two estimates differ.
        let insertion =
            Insertion::of(&Case::LatexConstant.scenario().expect("valid"), 1).expect("a simulation");
        let samples = insertion.samples(&insertion.reading(1, 10));
        let of = |share: f64| Offline::of(&insertion, &samples, &[Some(share); 3]).with_drop;
        assert_ne!(of(0.3), of(0.6));
    }
}
