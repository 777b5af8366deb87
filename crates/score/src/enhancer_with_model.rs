//! The core on a recording, by itself or with a law that was fitted elsewhere.

use stylet_core::config::EnhanceConfig;
use stylet_core::{Enhancer, Output, Sample};

/// Most samples that the core keeps for its re-run; a recording with fewer is kept whole.
pub const MAX_STORED_SAMPLES: usize = 1 << 18;

/// The core for a recording of so many samples.
#[must_use]
pub fn enhancer_for(samples: usize, config: &EnhanceConfig, surface_m: f64) -> Enhancer<Vec<Sample>> {
    let storage = vec![Sample::default(); samples.min(MAX_STORED_SAMPLES)];
    Enhancer::new(config.clone(), surface_m, storage)
}

/// A core, and a law fitted elsewhere that says what the shaft takes of the force.
///
/// The law is told a sample and how many layers the core has found punctured up to it, and answers with the friction in N. That the core
/// says so and not the law: where a layer gives way differs between insertions by millimetres, the friction behind it begins there, and
/// the core sees it within samples.
pub struct EnhancerWithModel<L> {
    core: Enhancer<Vec<Sample>>,
    law: Option<L>,
}

impl<L: FnMut(&Sample, usize) -> f64> EnhancerWithModel<L> {
    /// The core with a law, or by itself; algorithms that take no law say what they do without.
    #[must_use]
    pub fn new(core: Enhancer<Vec<Sample>>, law: Option<L>) -> Self {
        Self { core, law }
    }

    /// Takes one sample. With a law enhanced force and band are those of [`Enhancer::with_law`].
    pub fn step(&mut self, sample: Sample) -> Output {
        let mut out = self.core.step(sample);
        if let Some(law) = &mut self.law {
            let friction_n = law(&sample, out.ruptures);
            if let Some((enhanced_n, band_n)) = self.core.apply_model_friction(friction_n) {
                (out.enhanced_n, out.band_n) = (enhanced_n, Some(band_n));
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::{EnhancerWithModel, enhancer_for};
    use stylet_core::Sample;
    use stylet_core::config::{Algorithm, EnhanceConfig};

    /// Air, and a layer that gives way at 2 N, where half of that stays as friction.
    fn sample(k: usize) -> Sample {
        let time_s = 0.005 * k as f64;
        let position_m = -0.01 + 0.005 * time_s;
        let inside = position_m.max(0.0);
        let force_n = if inside < 0.02 { 100.0 * inside } else { 1.0 + 50.0 * (inside - 0.02) };
        // Noise enough to be learned.
        Sample {
            time_s,
            position_m,
            velocity_mps: 0.005,
            force_n: force_n + 0.01 * (12.9898 * k as f64).sin(),
        }
    }

    #[test]
    fn a_law_is_told_what_the_core_found_punctured_and_algorithms_that_take_none_go_by_themselves() {
        for algorithm in [Algorithm::Stylet, Algorithm::Paper] {
            let config = EnhanceConfig { algorithm, ..EnhanceConfig::default() };
            let mut seen = Vec::new();
            let mut alone =
                EnhancerWithModel::new(enhancer_for(2000, &config, 0.0), None::<fn(&Sample, usize) -> f64>);
            let law = |_: &Sample, ruptured: usize| {
                seen.push(ruptured);
                0.25 * ruptured as f64
            };
            let mut told = EnhancerWithModel::new(enhancer_for(2000, &config, 0.0), Some(law));
            let (mut found, mut differ) = (Vec::new(), 0);
            for k in 0..2000 {
                let (a, t) = (alone.step(sample(k)), told.step(sample(k)));
                assert_eq!(a.detection, t.detection);
                found.push(a.ruptures);
                if algorithm == Algorithm::Stylet && a.ruptures > 0 {
                    assert!(
                        (sample(k).force_n - t.enhanced_n - 0.25 * a.ruptures as f64).abs() < 1e-9,
                        "{k}"
                    );
                    let [low, high] = t.band_n.unwrap_or([f64::NAN; 2]);
                    assert!(low < t.enhanced_n && t.enhanced_n < high, "{k}");
                }
                differ += usize::from(a.enhanced_n != t.enhanced_n);
            }
            drop(told);
            assert_eq!(seen, found);
            assert_eq!(*seen.last().unwrap_or(&0), 1, "{algorithm:?} finds the drop");
            assert_eq!(differ > 0, algorithm == Algorithm::Stylet);
        }
    }
}
