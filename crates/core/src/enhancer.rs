//! The core that callers hold: one of the algorithms behind one interface.

use crate::config::{Algorithm, EnhanceConfig};
use crate::paper_enhancer::PaperEnhancer;
use crate::sample::{Output, Sample};
use crate::stylet::Stylet;

/// The online core.
///
/// Configuration is taken once; [`Enhancer::step`] is then called once per sample. It does not allocate and
/// does a bounded amount of work, whichever [`Algorithm`] runs:
///
/// - `Paper`, `Literal`: one update, at most
///   [`DropConfig::replay_per_tick`](crate::config::DropConfig::replay_per_tick) replayed samples, and
///   on the tick that declares a rupture one look back over at most 256 samples. The storage `B` holds the raw samples of
///   the layer being traversed, for the re-run after its rupture: a `Vec<Sample>` or an array. When a layer has more
///   samples than the storage, the re-run begins at the oldest that is left.
/// - `Stylet`: two small Gaussian updates; nothing is replayed and the storage stays untouched: an empty array will do.
#[derive(Clone, Debug)]
pub struct Enhancer<B> {
    paper: PaperEnhancer<B>,
    stylet: Option<Stylet>,
    surface_m: f64,
}

impl<B: AsRef<[Sample]> + AsMut<[Sample]>> Enhancer<B> {
    /// A core with `storage` for the raw samples of a layer. `surface_m` is used when the contact
    /// is [`Contact::Known`](crate::config::Contact::Known).
    pub fn new(config: EnhanceConfig, surface_m: f64, storage: B) -> Self {
        let stylet =
            (config.active_algorithm() == Algorithm::Stylet).then(|| Stylet::new(&config, surface_m));
        Self { paper: PaperEnhancer::new(config, surface_m, storage), stylet, surface_m }
    }

    /// The configuration in force.
    #[must_use]
    pub fn config(&self) -> &EnhanceConfig {
        self.paper.config()
    }

    /// Takes one sample. A sample that is not finite or not later than the one before is passed
    /// over ([`Output::used`] is false).
    #[inline]
    pub fn step(&mut self, sample: Sample) -> Output {
        match &mut self.stylet {
            Some(stylet) => {
                stylet.step(self.paper.config(), self.surface_m, sample);
                *stylet.complete_output(&sample)
            }
            None => self.paper.step(sample),
        }
    }

    /// As [`Enhancer::step`] for callers who look at a few fields of millions of samples: nothing is
    /// copied, and of the output only enhanced force, innovation, state, ruptures, contact, detection,
    /// estimate and `used` are kept up to date.
    #[inline]
    pub fn step_brief(&mut self, sample: Sample) -> &Output {
        match &mut self.stylet {
            Some(stylet) => stylet.step(self.paper.config(), self.surface_m, sample),
            None => self.paper.step_brief(sample),
        }
    }

    /// As [`Enhancer::step_brief`] for many samples at hand; `hear` is told the output for each, and the
    /// last is returned. The same bits as one call after the other.
    #[inline]
    pub fn run(&mut self, samples: &[Sample], mut hear: impl FnMut(&Output)) -> &Output {
        match &mut self.stylet {
            Some(stylet) => {
                for sample in samples {
                    hear(stylet.step(self.paper.config(), self.surface_m, *sample));
                }
                stylet.output()
            }
            None => self.paper.run(samples, hear),
        }
    }

    /// Enhanced force of the last sample in N and its 95 % band, the core's own friction replaced by what a law fitted elsewhere says: the
    /// extended law of a diagnosis, say, in which a layer counts as punctured from the sample on at which the core has declared a rupture. To be asked
    /// once after every [`Enhancer::step`]. On the way back `Stylet` corrects such a law by what the force shows, as it does
    /// its own ([`StyletConfig::track_retraction`](crate::config::StyletConfig::track_retraction)). `None` from the others.
    pub fn apply_model_friction(&mut self, friction_n: f64) -> Option<(f64, [f64; 2])> {
        let config = self.paper.config();
        self.stylet.as_mut().and_then(|stylet| stylet.apply_model_friction(config, friction_n))
    }

    /// Whether everything that is remembered is a number and every covariance positive definite. `Stylet` sees to it itself and
    /// starts afresh where rounding or senseless data have spoilt a belief; this is for tests and monitors.
    #[must_use]
    pub fn is_numerically_valid(&self) -> bool {
        self.stylet.as_ref().is_none_or(Stylet::is_numerically_valid)
    }

    /// What is remembered, for a look at what went wrong.
    #[doc(hidden)]
    #[must_use]
    pub fn debug_state(&self) -> alloc::string::String {
        alloc::format!("{:?}", self.stylet)
    }

    /// Multiplications and additions that `Stylet` did for the last sample, counted where they are done; zero for the others.
    #[must_use]
    pub fn operation_count(&self) -> u32 {
        self.stylet.as_ref().map_or(0, Stylet::operation_count)
    }
}
