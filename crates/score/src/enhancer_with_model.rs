//! The online core with or without an identified model of the shaft friction.

use stylet_core::config::EnhanceConfig;
use stylet_core::{Enhancer, Output, Sample, Units};

/// Most raw samples of a layer that the core stores for its replay.
pub const MAX_STORED_SAMPLES: usize = 1 << 18;

/// The core for a recording of this length.
#[must_use]
pub fn enhancer_for(samples: usize, config: &EnhanceConfig, surface_m: f64) -> Enhancer<Vec<Sample>> {
    let storage = vec![Sample::default(); samples.min(MAX_STORED_SAMPLES)];
    Enhancer::new(config.clone(), surface_m, storage)
}

/// The output of an ignored sample without the values of the previous one.
fn without_values(out: Output) -> Output {
    Output {
        enhanced_n: f64::NAN,
        reconstructed_n: f64::NAN,
        error_n: f64::NAN,
        theta: [f64::NAN; 2],
        cusum_n2: f64::NAN,
        derivative_n_per_s: f64::NAN,
        cumulative_friction_ns_per_m: f64::NAN,
        band_n: None,
        sd: [f64::NAN; 3],
        ..out
    }
}

/// As [`enhancer_for`] in units that fit the recording.
#[must_use]
pub fn enhancer_in_units(
    samples: usize,
    config: &EnhanceConfig,
    surface_m: f64,
    units: Units,
) -> Enhancer<Vec<Sample>> {
    let storage = vec![Sample::default(); samples.min(MAX_STORED_SAMPLES)];
    Enhancer::with_units(config.clone(), surface_m, units, storage)
}

/// Travel and mean absolute change of the force since the first sample, for the choice of [`Units`].
#[derive(Clone, Copy, Debug, Default)]
pub struct RecordingScale {
    first_n: f64,
    change_n: f64,
    span_m: [f64; 2],
    count: f64,
}

impl RecordingScale {
    /// Adds a sample; values that are not finite are ignored.
    pub fn push(&mut self, position_m: f64, force_n: f64) {
        if !(position_m.is_finite() && force_n.is_finite()) {
            return;
        }
        if self.count == 0.0 {
            (self.first_n, self.span_m) = (force_n, [position_m; 2]);
        }
        self.count += 1.0;
        self.change_n += ((force_n - self.first_n).abs() - self.change_n) / self.count;
        self.span_m = [self.span_m[0].min(position_m), self.span_m[1].max(position_m)];
    }

    /// Internal units for this scale.
    #[must_use]
    pub fn units(&self) -> Units {
        Units::for_extent(self.span_m[1] - self.span_m[0], self.change_n)
    }
}

/// An online core, and optionally a model that gives the shaft friction.
///
/// The model maps a sample and the number of ruptures that the core has declared so far to the friction in N. Ruptures come from
/// the core, not from the model: their positions differ by millimetres between insertions, friction changes there, and the core
/// detects them within samples.
///
/// In retraction nothing pushes on the tip, so the enhanced force should be zero. As long as the model leaves a larger mean square
/// there than the core's own friction, the core's own friction is used.
pub struct EnhancerWithModel<M> {
    core: Enhancer<Vec<Sample>>,
    model: Option<M>,
    retraction: RetractionErrors,
}

/// Enhanced force in retraction with the core's own friction and with the model's.
#[derive(Clone, Copy, Debug, Default)]
struct RetractionErrors {
    deepest_m: Option<f64>,
    core_n2: f64,
    model_n2: f64,
    /// First time in s at which the model was worse.
    model_rejected_s: Option<f64>,
}

/// Distance in m from the deepest position after which a retracting tip carries no force: the tissue in front of it is unloaded.
const UNLOADING_M: f64 = 1e-3;

impl RetractionErrors {
    fn push(&mut self, sample: &Sample, core_n: f64, model_n: f64) {
        let deepest_m = self.deepest_m.map_or(sample.position_m, |m| m.max(sample.position_m));
        self.deepest_m = Some(deepest_m);
        if sample.velocity_mps < 0.0 && sample.position_m < deepest_m - UNLOADING_M {
            self.core_n2 += core_n * core_n;
            self.model_n2 += model_n * model_n;
        }
        if !self.is_model_better() {
            self.model_rejected_s.get_or_insert(sample.time_s);
        }
    }

    fn is_model_better(&self) -> bool {
        self.model_n2 <= self.core_n2
    }
}

impl<M: FnMut(&Sample, usize) -> f64> EnhancerWithModel<M> {
    /// Algorithms that take no model ignore it.
    #[must_use]
    pub fn new(core: Enhancer<Vec<Sample>>, model: Option<M>) -> Self {
        Self { core, model, retraction: RetractionErrors::default() }
    }

    /// Processes one sample. With a model, enhanced force and band are those of [`Enhancer::apply_model_friction`]. The values of
    /// a sample that the core has ignored are not current, and NaN.
    pub fn step(&mut self, sample: Sample) -> Output {
        let mut out = self.core.step(sample);
        if !out.used {
            return without_values(out);
        }
        if let Some(model) = &mut self.model {
            let friction_n = model(&sample, out.ruptures);
            if out.restarted {
                self.retraction = RetractionErrors::default();
            }
            if let Some((enhanced_n, band_n)) = self.core.apply_model_friction(friction_n) {
                self.retraction.push(&sample, out.enhanced_n, enhanced_n);
                if self.retraction.is_model_better() {
                    (out.enhanced_n, out.band_n) = (enhanced_n, Some(band_n));
                }
            }
        }
        out
    }

    /// Time in s from which the core's own friction was used, because the model's was worse in retraction.
    #[must_use]
    pub fn model_rejected_s(&self) -> Option<f64> {
        self.retraction.model_rejected_s
    }
}

#[cfg(test)]
mod tests {
    use super::{EnhancerWithModel, enhancer_for};
    use stylet_core::Sample;
    use stylet_core::config::{Algorithm, EnhanceConfig};

    /// Air, then a layer that ruptures at 2 N and leaves half of that as friction, with enough noise to be estimated.
    fn sample(k: usize) -> Sample {
        let time_s = 0.005 * k as f64;
        let position_m = -0.01 + 0.005 * time_s;
        let depth_m = position_m.max(0.0);
        let force_n = if depth_m < 0.02 { 100.0 * depth_m } else { 1.0 + 50.0 * (depth_m - 0.02) };
        let noise_n = 0.01 * (12.9898 * k as f64).sin();
        Sample { time_s, position_m, velocity_mps: 0.005, force_n: force_n + noise_n }
    }

    #[test]
    fn a_model_receives_the_ruptures_of_the_core_and_is_ignored_by_algorithms_that_take_none() {
        for algorithm in [Algorithm::Stylet, Algorithm::Paper] {
            let config = EnhanceConfig { algorithm, ..EnhanceConfig::default() };
            let core = || enhancer_for(2000, &config, 0.0);
            let mut received = Vec::new();
            let mut without = EnhancerWithModel::new(core(), None::<fn(&Sample, usize) -> f64>);
            let model = |_: &Sample, ruptures: usize| {
                received.push(ruptures);
                0.25 * ruptures as f64
            };
            let mut with = EnhancerWithModel::new(core(), Some(model));
            let (mut declared, mut different) = (Vec::new(), 0);
            for sample in (0..2000).map(sample) {
                let (a, b) = (without.step(sample), with.step(sample));
                assert_eq!(a.detection, b.detection);
                declared.push(a.ruptures);
                if algorithm == Algorithm::Stylet && a.ruptures > 0 {
                    let friction_n = sample.force_n - b.enhanced_n;
                    assert!((friction_n - 0.25 * a.ruptures as f64).abs() < 1e-9, "{sample:?}");
                    let [low, high] = b.band_n.unwrap_or([f64::NAN; 2]);
                    assert!(low < b.enhanced_n && b.enhanced_n < high, "{sample:?}");
                }
                different += usize::from(a.enhanced_n != b.enhanced_n);
            }
            drop(with);
            assert_eq!(received, declared);
            assert_eq!(*received.last().unwrap_or(&0), 1, "{algorithm:?} detects the drop");
            assert_eq!(different > 0, algorithm == Algorithm::Stylet);
        }
    }

    #[test]
    fn a_model_that_is_worse_in_retraction_is_left_for_the_friction_of_the_core() {
        // In, and out again: friction of 1 N against the motion, and nothing at the tip on the way back.
        let motion = |k: usize| match sample(k) {
            s if k < 2000 => s,
            s => {
                let back = 0.005 * (k - 2000) as f64;
                let noise_n = 0.01 * (12.9898 * k as f64).sin();
                Sample { position_m: 0.04 - 0.005 * back, velocity_mps: -0.005, force_n: noise_n - 1.0, ..s }
            }
        };
        let mean_square = |friction_n: f64| {
            let core = enhancer_for(3500, &EnhanceConfig::default(), 0.0);
            let model = |s: &Sample, ruptures: usize| friction_n * ruptures as f64 * s.velocity_mps.signum();
            let mut with = EnhancerWithModel::new(core, Some(model));
            let outputs: Vec<f64> = (0..3500).map(|k| with.step(motion(k)).enhanced_n).collect();
            let back = &outputs[2300..];
            (back.iter().map(|n| n * n).sum::<f64>() / back.len() as f64, with.model_rejected_s())
        };
        let (right, rejected_s) = mean_square(1.0);
        assert!(right < 0.01 && rejected_s.is_none(), "{right} {rejected_s:?}");
        let (wrong, rejected_s) = mean_square(5.0);
        assert!(rejected_s.is_some_and(|t| t > 10.0), "{rejected_s:?}");
        assert!(wrong < 0.1, "{wrong}");
    }
}
