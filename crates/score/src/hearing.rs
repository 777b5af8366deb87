//! The core on a recording, by itself or with a law that was fitted elsewhere.

use stylet_core::config::EnhanceConfig;
use stylet_core::{Enhancer, Output, Sample};

/// Most samples that the core keeps for its re-run; a recording with fewer is kept whole.
pub const STORAGE_SAMPLES: usize = 1 << 18;

/// The core for a recording of so many samples.
#[must_use]
pub fn core_for(samples: usize, config: &EnhanceConfig, surface_m: f64) -> Enhancer<Vec<Sample>> {
    let storage = vec![Sample::default(); samples.min(STORAGE_SAMPLES)];
    Enhancer::new(config.clone(), surface_m, storage)
}

/// A core, and a law fitted elsewhere that says what the shaft takes of the force.
///
/// The law is told a sample and how many layers the core has found punctured up to it, and answers with the friction in N. That the core
/// says so and not the law: where a layer gives way differs between insertions by millimetres, the friction behind it begins there, and
/// the core sees it within samples.
pub struct Hearing<L> {
    core: Enhancer<Vec<Sample>>,
    law: Option<L>,
}

impl<L: FnMut(&Sample, usize) -> f64> Hearing<L> {
    /// The core with a law, or by itself; algorithms that take no law say what they do without.
    #[must_use]
    pub fn with(core: Enhancer<Vec<Sample>>, law: Option<L>) -> Self {
        Self { core, law }
    }

    /// Takes one sample. With a law enhanced force and band are those of [`Enhancer::with_law`].
    pub fn step(&mut self, sample: Sample) -> Output {
        let mut out = self.core.step(sample);
        if let Some(law) = &mut self.law {
            let friction_n = law(&sample, out.ruptures);
            if let Some((enhanced_n, band_n)) = self.core.with_law(friction_n) {
                (out.enhanced_n, out.band_n) = (enhanced_n, Some(band_n));
            }
        }
        out
    }
}
