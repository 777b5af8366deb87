//! Streaming computation of a score, so that a sweep needs no copy of the run.

use crate::rupture_matching::match_ruptures;
use crate::score::{Coverage, EnhancementScore, EstimateError, LayerScore, Score};
use stylet_core::config::Model;
use stylet_core::{Detection, LayerEstimate, Output};
use stylet_record::{LayerTruth, TrueRupture};

/// Ground truth of one sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrueSample {
    /// True tip position in m.
    pub position_m: f64,
    /// Measured force in N.
    pub force_n: f64,
    /// True tip force in N: the tissue force less the friction of the passed layers.
    pub tip_n: f64,
    /// True force of the tissue on the needle in N.
    pub total_n: f64,
}

/// Output of the core for one sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EnhancedSample {
    /// Enhanced force in N.
    pub enhanced_n: f64,
    /// Innovation in N.
    pub error_n: f64,
    /// 95 % band on the tip force in N.
    pub band_n: Option<[f64; 2]>,
}

impl From<&Output> for EnhancedSample {
    #[inline]
    fn from(output: &Output) -> Self {
        Self { enhanced_n: output.enhanced_n, error_n: output.error_n, band_n: output.band_n }
    }
}

/// Sums that the scores are computed from.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    samples: f64,
    tip2: f64,
    miss2: f64,
    friction2: f64,
    in_band: f64,
    banded: f64,
    error2: f64,
    inside_tip2: f64,
    inside_miss2: f64,
    exit_enhanced2: f64,
    exit_force2: f64,
}

/// Collects the samples of one run.
#[derive(Clone, Debug)]
pub struct Scorer {
    layers: Vec<LayerTruth>,
    model: Model,
    ruptures: Vec<TrueRupture>,
    detections: Vec<Detection>,
    estimates: Vec<LayerEstimate>,
    contact_m: Option<f64>,
    deepest_m: f64,
    /// Front of the first and far face of the last layer in m; the front is infinite without layers.
    front_m: f64,
    far_m: f64,
    sums: Sums,
    /// The sums at the deepest point, kept when the needle reverses.
    at_deepest: Option<Sums>,
}

impl Scorer {
    /// For a stack of layers and the model of the core.
    #[must_use]
    pub fn new(layers: Vec<LayerTruth>, model: Model) -> Self {
        Self {
            front_m: layers.first().map_or(f64::INFINITY, |l| l.front_m),
            far_m: layers.last().map_or(f64::INFINITY, |l| l.front_m + l.thickness_m),
            layers,
            model,
            ruptures: Vec::new(),
            detections: Vec::new(),
            estimates: Vec::new(),
            contact_m: None,
            deepest_m: f64::NEG_INFINITY,
            sums: Sums::default(),
            at_deepest: None,
        }
    }

    /// Adds a true rupture.
    pub fn add_rupture(&mut self, rupture: TrueRupture) {
        self.ruptures.push(rupture);
    }

    /// Adds the detection, the layer estimate and a withdrawal of a sample; samples without any may be omitted.
    pub fn add_event(&mut self, output: &Output) {
        if let Some(layer) = output.zero_step.and_then(|step| step.withdrawn) {
            self.detections.retain(|d| d.layer != layer);
            self.estimates.retain(|e| e.layer != layer);
        }
        self.detections.extend(output.detection);
        if let Some(estimate) = output.estimate {
            // A later estimate of a layer replaces the earlier one.
            self.estimates.retain(|e| e.layer != estimate.layer);
            self.estimates.push(estimate);
        }
    }

    /// Sets the position in m of the detected contact.
    pub fn set_contact(&mut self, contact_m: Option<f64>) {
        self.contact_m = contact_m;
    }

    /// Adds a sample and its output.
    #[inline]
    pub fn add_sample(&mut self, truth: &TrueSample, output: &EnhancedSample) {
        let z = truth.position_m;
        if z < self.front_m {
            return;
        }
        // Insertion ends at the deepest point; retraction is not scored.
        if z >= self.deepest_m {
            self.deepest_m = z;
            self.at_deepest = None;
        } else if self.at_deepest.is_none() {
            self.at_deepest = Some(self.sums);
        }
        let miss = output.enhanced_n - truth.tip_n;
        let sums = &mut self.sums;
        sums.samples += 1.0;
        sums.tip2 += truth.tip_n * truth.tip_n;
        sums.miss2 += miss * miss;
        // Without the sensor error: true less estimated friction.
        let friction = miss - (truth.force_n - truth.total_n);
        sums.friction2 += friction * friction;
        if let Some([low, high]) = output.band_n {
            sums.banded += 1.0;
            if truth.tip_n >= low && truth.tip_n <= high {
                sums.in_band += 1.0;
            }
        }
        sums.error2 += output.error_n * output.error_n;
        if z < self.far_m {
            sums.inside_tip2 += truth.tip_n * truth.tip_n;
            sums.inside_miss2 += miss * miss;
        } else {
            sums.exit_enhanced2 += output.enhanced_n * output.enhanced_n;
            sums.exit_force2 += truth.force_n * truth.force_n;
        }
    }

    /// Detections so far.
    #[must_use]
    pub fn detections(&self) -> &[Detection] {
        &self.detections
    }

    /// Computes the score.
    #[must_use]
    pub fn finish(self) -> Score {
        let (ruptures, is_false) = match_ruptures(&self.ruptures, &self.detections);
        let false_s: Vec<f64> =
            self.detections.iter().zip(&is_false).filter(|(_, f)| **f).map(|(d, _)| d.time_s).collect();
        let layers: Vec<LayerScore> =
            ruptures.iter().filter_map(|r| self.layer(r.layer, r.true_m, r.detection)).collect();
        let cumulative =
            layers.last().map_or(EstimateError::new(0.0, None), |l| l.cumulative_friction_ns_per_m);
        let sums = self.at_deepest.unwrap_or(self.sums);
        let ratio = |over: f64, under: f64| (under > 0.0).then(|| (over / under).sqrt());
        let missed = ruptures.iter().filter(|r| r.detected_s.is_none()).count();
        Score {
            missed,
            false_alarms: false_s.len(),
            hits_are_chance: false_s.len() > ruptures.len(),
            false_s,
            layers,
            cumulative_friction_ns_per_m: cumulative,
            contact_m: EstimateError {
                truth: self.layers.first().map_or(0.0, |l| l.front_m),
                estimated: self.contact_m,
                relative_error: None,
            },
            enhancement: EnhancementScore {
                rms_relative: ratio(sums.miss2, sums.tip2),
                friction_rms_relative: ratio(sums.friction2, sums.tip2),
                in_tissue_relative: ratio(sums.inside_miss2, sums.inside_tip2),
                after_exit_relative: ratio(sums.exit_enhanced2, sums.exit_force2),
            },
            reconstruction_rms_n: ratio(sums.error2, sums.samples),
            coverage: self.coverage(&ruptures, &sums),
            ruptures,
        }
    }

    /// Coverage of the intervals.
    fn coverage(&self, ruptures: &[crate::rupture_matching::RuptureScore], sums: &Sums) -> Coverage {
        let mut coverage = Coverage { band: [sums.in_band, sums.banded], ..Coverage::default() };
        for rupture in ruptures {
            let Some(truth) = rupture.layer.checked_sub(1).and_then(|i| self.layers.get(i)) else { continue };
            let Some(e) = rupture.detection.and_then(|d| self.estimates.iter().find(|e| e.layer == d)) else {
                continue;
            };
            if e.stiffness_sd <= 0.0 {
                continue;
            }
            let along = self.layers.iter().take(rupture.layer);
            let cumulative: f64 =
                along.map(|l| l.friction_ns_per_m2 * l.length_inside_m(rupture.true_m)).sum();
            for (count, off, sd) in [
                (&mut coverage.stiffness, e.stiffness_n_per_m - truth.stiffness_n_per_m, e.stiffness_sd),
                (&mut coverage.friction, e.friction - truth.friction_ns_per_m2, e.friction_sd),
                (&mut coverage.cumulative, e.cumulative_ns_per_m - cumulative, e.cumulative_sd),
            ] {
                count[1] += 1.0;
                if off.abs() <= stylet_stats::Z95 * sd {
                    count[0] += 1.0;
                }
            }
        }
        coverage
    }

    fn layer(&self, number: usize, rupture_m: f64, detection: Option<usize>) -> Option<LayerScore> {
        let truth = self.layers.get(number.checked_sub(1)?)?;
        let estimate = detection.and_then(|d| self.estimates.iter().find(|e| e.layer == d));
        let friction = estimate.map(|e| match self.model {
            Model::MultiLayer => e.friction,
            Model::KelvinVoigt => e.friction / e.thickness_m,
        });
        let true_cumulative: f64 = self
            .layers
            .iter()
            .take(number)
            .map(|l| l.friction_ns_per_m2 * l.length_inside_m(rupture_m))
            .sum();
        let cumulative = estimate.map(|upto| {
            self.estimates.iter().filter(|e| e.layer <= upto.layer).map(|e| e.added_friction_ns_per_m).sum()
        });
        Some(LayerScore {
            layer: number,
            stiffness_n_per_m: EstimateError::new(
                truth.stiffness_n_per_m,
                estimate.map(|e| e.stiffness_n_per_m),
            ),
            friction_ns_per_m2: EstimateError::new(truth.friction_ns_per_m2, friction),
            thickness_m: EstimateError::new(truth.thickness_m, estimate.map(|e| e.thickness_m)),
            cumulative_friction_ns_per_m: EstimateError::new(true_cumulative, cumulative),
            offline_stiffness_n_per_m: None,
            offline_friction_ns_per_m2: None,
            offline_separable: None,
        })
    }
}
