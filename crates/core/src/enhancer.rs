//! The online core: one of the algorithms behind one interface.

use crate::config::{Algorithm, EnhanceConfig};
use crate::kalman::KalmanEnhancer;
use crate::paper::PaperEnhancer;
use crate::sample::{Output, Sample};

/// The online core: [`Enhancer::step`] is called once per sample.
///
/// It does not allocate, and the work per sample is bounded for every [`Algorithm`]:
///
/// - `Paper`, `Literal`: one RLS update, at most
///   [`DropConfig::replay_per_tick`](crate::config::DropConfig::replay_per_tick) replayed samples, and at a declared rupture
///   one look back over at most 256 samples. The storage `B` (a `Vec<Sample>` or an array) keeps the raw samples of the
///   active layer for its replay; of a layer with more samples the oldest are lost.
/// - `Stylet`: two small Kalman updates, no replay. The storage is not used and may be an empty array.
#[derive(Clone, Debug)]
pub struct Enhancer<B> {
    paper: PaperEnhancer<B>,
    kalman: Option<KalmanEnhancer>,
    surface_m: f64,
}

impl<B: AsRef<[Sample]> + AsMut<[Sample]>> Enhancer<B> {
    /// A core with `storage` for the raw samples of a layer. `surface_m` is the position of the tissue surface, used with
    /// [`Contact::Known`](crate::config::Contact::Known).
    pub fn new(config: EnhanceConfig, surface_m: f64, storage: B) -> Self {
        let kalman =
            (config.active_algorithm() == Algorithm::Stylet).then(|| KalmanEnhancer::new(&config, surface_m));
        Self { paper: PaperEnhancer::new(config, surface_m, storage), kalman, surface_m }
    }

    /// The active configuration.
    #[must_use]
    pub fn config(&self) -> &EnhanceConfig {
        self.paper.config()
    }

    /// Processes one sample. A sample that is not finite, out of range, or not later than the previous one is ignored
    /// ([`Output::used`] is false).
    #[inline]
    pub fn step(&mut self, sample: Sample) -> Output {
        match &mut self.kalman {
            Some(kalman) => {
                kalman.step(self.paper.config(), self.surface_m, sample);
                *kalman.complete_output(&sample)
            }
            None => self.paper.step(sample),
        }
    }

    /// As [`Enhancer::step`] without a copy of the output, of which only enhanced force, innovation, state, ruptures, contact,
    /// detection, estimate and `used` are updated.
    #[inline]
    pub fn step_brief(&mut self, sample: Sample) -> &Output {
        match &mut self.kalman {
            Some(kalman) => kalman.step(self.paper.config(), self.surface_m, sample),
            None => self.paper.step_brief(sample),
        }
    }

    /// As [`Enhancer::step_brief`] for many samples, with bitwise the same results. Calls `each` with the output of every
    /// sample and returns the last one.
    #[inline]
    pub fn run(&mut self, samples: &[Sample], mut each: impl FnMut(&Output)) -> &Output {
        match &mut self.kalman {
            Some(kalman) => {
                for sample in samples {
                    each(kalman.step(self.paper.config(), self.surface_m, *sample));
                }
                kalman.output()
            }
            None => self.paper.run(samples, each),
        }
    }

    /// Enhanced force of the last sample in N and its 95 % band, with the shaft friction `friction_n` of an identified model in
    /// place of the core's own estimate. To be called once after every [`Enhancer::step`]; the model should count a layer as
    /// punctured from the sample at which the core has declared its rupture. During retraction `Stylet` corrects the model by
    /// the measured force ([`StyletConfig::track_retraction`](crate::config::StyletConfig::track_retraction)). `None` with the
    /// other algorithms.
    pub fn apply_model_friction(&mut self, friction_n: f64) -> Option<(f64, [f64; 2])> {
        let config = self.paper.config();
        self.kalman.as_mut().and_then(|kalman| kalman.apply_model_friction(config, friction_n))
    }

    /// The state is finite and every covariance positive definite; for tests and monitors. `Stylet` restarts filters that
    /// rounding or invalid data have spoilt.
    #[must_use]
    pub fn is_numerically_valid(&self) -> bool {
        self.kalman.as_ref().is_none_or(KalmanEnhancer::is_numerically_valid)
    }

    /// Internal state as text.
    #[doc(hidden)]
    #[must_use]
    pub fn debug_state(&self) -> alloc::string::String {
        alloc::format!("{:?}", self.kalman)
    }

    /// Multiplications and additions that `Stylet` did for the last sample; zero with the other algorithms.
    #[must_use]
    pub fn operation_count(&self) -> u32 {
        self.kalman.as_ref().map_or(0, KalmanEnhancer::operation_count)
    }
}
