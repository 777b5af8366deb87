//! [`Enhancer`], the common interface of the online algorithms: one [`Sample`] in, one [`Output`] out.

use crate::config::{Algorithm, EnhanceConfig, Model};
use crate::kalman::KalmanEnhancer;
use crate::paper::PaperEnhancer;
use crate::paper::sample_ring::SampleRing;
use crate::sample::{Output, Sample, UnusedReason};
use crate::sample_clock::{SampleClock, Verdict};
use crate::units::Units;

/// Samples per block in [`Enhancer::run`] whose values and time stamps are checked before the algorithm runs.
const BLOCK_SAMPLES: usize = 64;

/// The online core: [`Enhancer::step`] is called once per sample.
///
/// It does not allocate, and the work per sample is bounded for every [`Algorithm`]:
///
/// - `Paper`, `Literal`: one RLS update, at most [`DropConfig::replay_per_tick`](crate::config::DropConfig::replay_per_tick)
///   replayed samples, and at each rupture a search over at most 256 earlier samples. The storage `B` (a `Vec<Sample>` or an
///   array) is a ring buffer of the active layer's raw samples for its replay; the oldest are overwritten.
/// - `Stylet`: two small Kalman updates, no replay. The storage is dropped and may be an empty array.
#[derive(Clone, Debug)]
pub struct Enhancer<B> {
    core: Core<B>,
    clock: SampleClock,
    surface_m: f64,
    units: Units,
    /// Last output converted to m and N; used only if `units` are not SI.
    converted: Output,
}

/// The algorithm that runs.
#[derive(Clone, Debug)]
#[expect(clippy::large_enum_variant, reason = "one per enhancer, and the core does not allocate")]
enum Core<B> {
    Paper { paper: PaperEnhancer, ring: SampleRing<B> },
    Stylet { kalman: KalmanEnhancer, config: EnhanceConfig },
}

impl<B: AsRef<[Sample]> + AsMut<[Sample]>> Enhancer<B> {
    /// Creates an enhancer with `storage` for the raw samples of a layer. `surface_m` is the position of the tissue surface, used
    /// with [`Contact::Known`](crate::config::Contact::Known).
    pub fn new(config: EnhanceConfig, surface_m: f64, storage: B) -> Self {
        Self::with_units(config, surface_m, Units::default(), storage)
    }

    /// As [`Enhancer::new`] for needles or forces of another scale: lengths and forces in `config` and in the internal constants
    /// are in `units`; samples, surface and outputs are in m and N.
    pub fn with_units(config: EnhanceConfig, surface_m: f64, units: Units, storage: B) -> Self {
        let surface_m = surface_m / units.length_m;
        let core = if config.active_algorithm() == Algorithm::Stylet {
            let config = config.with_limited_speeds();
            Core::Stylet { kalman: KalmanEnhancer::new(&config, surface_m), config }
        } else {
            Core::Paper { paper: PaperEnhancer::new(config, surface_m), ring: SampleRing::new(storage) }
        };
        Self { core, clock: SampleClock::default(), surface_m, units, converted: Output::default() }
    }

    /// The active configuration.
    #[must_use]
    pub fn config(&self) -> &EnhanceConfig {
        match &self.core {
            Core::Paper { paper, .. } => paper.config(),
            Core::Stylet { config, .. } => config,
        }
    }

    fn kalman(&self) -> Option<&KalmanEnhancer> {
        match &self.core {
            Core::Paper { .. } => None,
            Core::Stylet { kalman, .. } => Some(kalman),
        }
    }

    /// Processes one sample. A sample that is not finite, out of range, or not later than the previous one is ignored
    /// ([`Output::used`] is false; see [`Output::unused_reason`]).
    ///
    /// A time stamp that jumps back by 1 s or more, or ahead by more than 1 s, is ignored until five consecutive samples confirm
    /// it. A confirmed jump ahead of up to ten minutes is a pause and is processed as a long interval; any other is a new clock
    /// and re-initialises the algorithm ([`Output::restarted`]).
    #[inline]
    pub fn step(&mut self, sample: Sample) -> Output {
        if !self.units.are_si() {
            return self.step_converted(&sample);
        }
        self.step_in_units(sample);
        self.complete(&sample)
    }

    #[inline]
    fn complete(&mut self, sample: &Sample) -> Output {
        match &mut self.core {
            Core::Paper { paper, .. } => *paper.complete_output(sample),
            Core::Stylet { kalman, .. } => *kalman.complete_output(sample),
        }
    }

    #[cold]
    fn step_converted(&mut self, sample: &Sample) -> Output {
        let scaled = self.units.sample(sample);
        self.step_in_units(scaled);
        let out = self.complete(&scaled);
        self.units.output(&out, self.config().model == Model::MultiLayer)
    }

    /// As [`Enhancer::step`] without a copy of the output, of which only enhanced force, innovation, state, ruptures, contact,
    /// detection, estimate, `used`, `unused_reason` and `restarted` are updated.
    #[inline]
    pub fn step_brief(&mut self, sample: Sample) -> &Output {
        if !self.units.are_si() {
            self.converted = self.step_converted(&sample);
            return &self.converted;
        }
        self.step_in_units(sample)
    }

    #[inline]
    fn step_in_units(&mut self, sample: Sample) -> &Output {
        let before_s = self.clock.last_s();
        match self.check(&sample) {
            Verdict::Ignore(why) => self.ignore(why),
            Verdict::Restart => self.restart(sample),
            Verdict::Use => {
                let out = match &mut self.core {
                    Core::Paper { paper, ring } => paper.step_brief(ring, sample),
                    Core::Stylet { kalman, config } => kalman.step(config, self.surface_m, sample),
                };
                if !out.used {
                    // The algorithm refuses samples that are almost simultaneous; the clock must not count them.
                    self.clock.revert_to(before_s);
                }
                out
            }
        }
    }

    /// As [`Enhancer::step_brief`] for many samples, with bitwise the same results. Calls `each` with the output of every
    /// sample and returns the last one.
    #[inline]
    pub fn run(&mut self, samples: &[Sample], mut each: impl FnMut(&Output)) -> &Output {
        if !self.units.are_si() {
            for sample in samples {
                self.converted = self.step_converted(sample);
                each(&self.converted);
            }
            return &self.converted;
        }
        for block in samples.chunks(BLOCK_SAMPLES) {
            let mut clock = self.clock;
            match &mut self.core {
                Core::Paper { paper, ring }
                    if block.iter().all(|s| s.is_usable() && clock.check(s.time_s) == Verdict::Use) =>
                {
                    self.clock = clock;
                    paper.run(ring, block, &mut each);
                }
                _ => {
                    for sample in block {
                        each(self.step_brief(*sample));
                    }
                }
            }
        }
        self.output()
    }

    #[inline(always)]
    fn check(&mut self, sample: &Sample) -> Verdict {
        let usable = match &self.core {
            Core::Paper { .. } => sample.is_usable(),
            Core::Stylet { .. } => KalmanEnhancer::is_usable(sample),
        };
        if usable {
            self.clock.check(sample.time_s)
        } else {
            Verdict::Ignore(UnusedReason::of_values(sample))
        }
    }

    #[cold]
    fn ignore(&mut self, why: UnusedReason) -> &Output {
        match &mut self.core {
            Core::Paper { paper, .. } => paper.ignore(why),
            Core::Stylet { kalman, .. } => kalman.ignore(why),
        }
    }

    #[cold]
    fn restart(&mut self, sample: Sample) -> &Output {
        match &mut self.core {
            Core::Paper { paper, ring } => {
                paper.restart(self.surface_m);
                ring.clear();
                paper.step_brief(ring, sample);
                paper.mark_restarted()
            }
            Core::Stylet { kalman, config } => {
                *kalman = KalmanEnhancer::new(config, self.surface_m);
                kalman.step(config, self.surface_m, sample);
                kalman.mark_restarted()
            }
        }
    }

    fn output(&self) -> &Output {
        match &self.core {
            Core::Paper { paper, .. } => paper.output(),
            Core::Stylet { kalman, .. } => kalman.output(),
        }
    }

    /// Enhanced force of the last sample in N and its 95 % band, with the shaft friction `friction_n` of an identified model in
    /// place of the core's own estimate. Call it once after every [`Enhancer::step`]; the model should count a layer as punctured
    /// from the sample at which the core declared its rupture. During retraction `Stylet` corrects the model by the measured
    /// force ([`StyletConfig::track_retraction`](crate::config::StyletConfig::track_retraction)). `None` with the other
    /// algorithms.
    pub fn apply_model_friction(&mut self, friction_n: f64) -> Option<(f64, [f64; 2])> {
        let unit_n = self.units.force_n;
        let Core::Stylet { kalman, config } = &mut self.core else { return None };
        let (enhanced_n, band) = kalman.apply_model_friction(config, friction_n / unit_n)?;
        Some((unit_n * enhanced_n, band.map(|n| unit_n * n)))
    }

    /// True if the state is finite and every covariance positive definite; for tests and monitoring. `Stylet` re-initialises
    /// filters that become invalid.
    #[must_use]
    pub fn is_numerically_valid(&self) -> bool {
        self.kalman().is_none_or(KalmanEnhancer::is_numerically_valid)
    }

    /// Internal state as text.
    #[doc(hidden)]
    #[must_use]
    pub fn debug_state(&self) -> alloc::string::String {
        alloc::format!("{:?}", self.kalman())
    }

    /// Multiplications and additions that `Stylet` did for the last sample; zero with the other algorithms.
    #[must_use]
    pub fn operation_count(&self) -> u32 {
        self.kalman().map_or(0, KalmanEnhancer::operation_count)
    }
}
