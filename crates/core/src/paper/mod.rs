//! The published algorithm, one call per sample: Ferro et al. 2021, supplement Fig. 1 and eqs. 1-17; see "Paper's core" in
//! `docs/reference/algorithms.md`.

mod contact_detection;
mod force_drop;
mod friction_compensation;
mod layer_replay;
mod line_fit;
mod low_pass;
mod motion_guard;
mod preprocessing;
pub(crate) mod rls;
pub(crate) mod sample_ring;
pub(crate) mod state_machine;

use crate::config::{Algorithm, Contact, CusumConfig, Depths, DropEstimator, EnhanceConfig, Model};
use crate::sample::{Cause, Detection, LayerEstimate, Output, Sample, State, UnusedReason};
use contact_detection::{ContactDetector, ContactStatus};
use force_drop::{ForceDrop, locate_drop};
use friction_compensation::FrictionCompensation;
use layer_replay::{LayerReplay, ResetClock, regressor, relative_noise, reweighted_prior};
use preprocessing::{Preprocessor, SampleFlags};
use rls::Rls;
use sample_ring::{SampleRing, Storage};

/// Samples that are preprocessed ahead of the estimator.
const BLOCK_SAMPLES: usize = 64;

/// Constants of the CUSUM.
#[derive(Clone, Copy, Debug)]
struct Cusum {
    drift_n2: f64,
    /// Infinite when the CUSUM is off.
    threshold_n2: f64,
}

impl Cusum {
    fn new(config: &CusumConfig) -> Self {
        let threshold_n2 = if config.enabled { config.threshold_n2() } else { f64::INFINITY };
        Self { drift_n2: config.drift_n2(), threshold_n2 }
    }
}

/// The layer being traversed.
#[derive(Clone, Copy, Debug, Default)]
struct LayerTraversal {
    start_m: f64,
    first: u64,
    /// No rupture is declared within the blind travel from here.
    blind_from_m: f64,
    /// Index of the sample that crossed the known far face.
    crossed: Option<u64>,
    /// Travel and time while the needle moves; their ratio is the mean speed.
    travel_m: f64,
    moving_s: f64,
}

/// A ruptured layer that waits for its estimate.
#[derive(Clone, Copy, Debug)]
struct PendingLayer {
    layer: usize,
    traversal: LayerTraversal,
    end: u64,
    thickness_m: f64,
    online: [f64; 2],
    drop: ForceDrop,
    replay: Option<LayerReplay>,
    drop_n: f64,
    elastic_share: f64,
}

/// The raw samples of a layer are kept in a ring beside it, which every call is given.
#[derive(Clone, Debug)]
pub(crate) struct PaperEnhancer {
    config: EnhanceConfig,
    preprocessor: Preprocessor,
    contact: ContactDetector,
    compensation: FrictionCompensation,
    rls: Rls,
    clock: ResetClock,
    in_contact: bool,
    traversal: LayerTraversal,
    pending: Option<PendingLayer>,
    cusum: Cusum,
    cusum_n2: f64,
    /// Indices of the samples at which detection was last disabled and the CUSUM last zero.
    disabled_until: u64,
    zero_until: u64,
    waited_m: f64,
    waited_s: f64,
    settled_for_s: f64,
    out: Output,
}

impl PaperEnhancer {
    pub(crate) fn new(mut config: EnhanceConfig, surface_m: f64) -> Self {
        if config.algorithm == Algorithm::Literal {
            config.guard.blind_travel_m = 0.0;
            config.guard.rest_s = 0.0;
            config.guard.slowing_per_s = f64::INFINITY;
            config.contact_search.extrapolate_over_m = 0.0;
            config.drop.settle_s = 0.0;
            config.drop.estimator = DropEstimator::Extremes;
        }
        let prior = [config.prior_stiffness, config.prior_friction];
        Self {
            preprocessor: Preprocessor::new(&config),
            contact: ContactDetector::new(&config.contact_search),
            compensation: FrictionCompensation::default(),
            rls: Rls::new(prior),
            clock: ResetClock::default(),
            in_contact: false,
            traversal: LayerTraversal { start_m: surface_m, ..LayerTraversal::default() },
            pending: None,
            cusum: Cusum::new(&config.cusum),
            cusum_n2: 0.0,
            disabled_until: 0,
            zero_until: 0,
            waited_m: 0.0,
            waited_s: 0.0,
            settled_for_s: 0.0,
            out: Output::default(),
            config,
        }
    }

    pub(crate) fn config(&self) -> &EnhanceConfig {
        &self.config
    }

    fn prior(&self) -> [f64; 2] {
        [self.config.prior_stiffness, self.config.prior_friction]
    }

    /// Re-initialises everything but the configuration.
    #[cold]
    pub(crate) fn restart(&mut self, surface_m: f64) {
        *self = Self::new(core::mem::take(&mut self.config), surface_m);
    }

    pub(crate) fn output(&self) -> &Output {
        &self.out
    }

    /// Marks the last sample as the first after a restart.
    pub(crate) fn mark_restarted(&mut self) -> &Output {
        self.out.restarted = true;
        &self.out
    }

    /// The output for an ignored sample.
    #[cold]
    pub(crate) fn ignore(&mut self, why: UnusedReason) -> &Output {
        self.out.ignore(why);
        &self.out
    }

    /// Fills in the fields that only [`Enhancer::step`](crate::Enhancer::step) returns.
    #[inline]
    pub(crate) fn complete_output(&mut self, sample: &Sample) -> &Output {
        let out = &mut self.out;
        if out.used {
            out.reconstructed_n = if self.in_contact { sample.force_n - out.error_n } else { 0.0 };
        }
        out.theta = if self.rls.is_finite() { self.rls.theta } else { [0.0; 2] };
        out.cusum_n2 = self.cusum_n2;
        out.derivative_n_per_s = self.preprocessor.derivative_n_per_s();
        out.cumulative_friction_ns_per_m = self.compensation.cumulative_ns_per_m();
        &self.out
    }

    /// As `step`, but updates only the fields that [`Enhancer::step_brief`](crate::Enhancer::step_brief) lists.
    #[inline]
    pub(crate) fn step_brief(&mut self, ring: &mut SampleRing<impl Storage>, sample: Sample) -> &Output {
        let mut flags = SampleFlags::default();
        self.preprocessor.process(&self.config, sample, &mut flags);
        self.process_ready_sample(ring, sample, flags);
        &self.out
    }

    /// As `step_brief` for many samples, with the same results. Preprocessing runs ahead of the estimator, a block at a time,
    /// which is faster.
    #[inline]
    pub(crate) fn run(
        &mut self,
        ring: &mut SampleRing<impl Storage>,
        samples: &[Sample],
        mut each: impl FnMut(&Output),
    ) -> &Output {
        let mut flags = [SampleFlags::default(); BLOCK_SAMPLES];
        for block in samples.chunks(BLOCK_SAMPLES) {
            for (flags, sample) in flags.iter_mut().zip(block) {
                self.preprocessor.process(&self.config, *sample, flags);
            }
            for (flags, sample) in flags.iter().zip(block) {
                self.process_ready_sample(ring, *sample, *flags);
                each(&self.out);
            }
        }
        &self.out
    }

    #[inline(always)]
    fn process_ready_sample(
        &mut self,
        ring: &mut SampleRing<impl Storage>,
        sample: Sample,
        flags: SampleFlags,
    ) {
        self.out.detection = None;
        self.out.estimate = None;
        self.out.restarted = false;
        self.out.used = flags.used();
        if !flags.used() {
            let why =
                if sample.is_usable() { UnusedReason::NotLater } else { UnusedReason::of_values(&sample) };
            self.out.unused_reason = Some(why);
            return;
        }
        self.out.unused_reason = None;
        let index = ring.next_index();
        ring.push(sample);
        self.update_contact(flags.dt_s, sample, index);
        let before = self.rls.theta;
        let v = sample.velocity_mps;
        let compensated_n = sample.force_n - self.compensation.friction_at_ns_per_m(sample.position_m) * v;
        self.out.error_n = self.identify(index, flags.dt_s, sample, compensated_n);
        self.advance_state(ring, sample, flags, before);
        self.out.enhanced_n = compensated_n;
        if self.out.estimate.is_some() {
            let friction = self.compensation.friction_at_ns_per_m(sample.position_m);
            self.out.enhanced_n = sample.force_n - friction * v;
        }
    }

    #[inline(always)]
    fn update_contact(&mut self, dt_s: f64, sample: Sample, index: u64) {
        if self.out.contact_m.is_some() {
            return;
        }
        let (start_m, first, settled) = match self.config.contact {
            Contact::Known if sample.position_m >= self.traversal.start_m => {
                (self.traversal.start_m, index, true)
            }
            Contact::Known => return,
            Contact::None => (sample.position_m, index, true),
            Contact::Detected => {
                match self.contact.update(&self.config.contact_search, dt_s, sample, index) {
                    ContactStatus::InAir => return,
                    ContactStatus::Provisional { surface_m, first } => (surface_m, first, false),
                    ContactStatus::Settled { surface_m, first } => (surface_m, first, true),
                }
            }
        };
        if !self.in_contact {
            // A needle known to start inside the tissue is blind from its start position.
            let blind_from_m = match self.config.contact {
                Contact::Known | Contact::None => sample.position_m,
                Contact::Detected => start_m,
            };
            self.begin_layer(start_m, blind_from_m, first);
        } else if settled {
            // The start moves by a fraction of a millimetre: the parameters are kept, the covariance is reset.
            self.traversal.start_m = start_m;
            self.traversal.blind_from_m = start_m;
            let prior = self.prior();
            self.rls.reset_covariance(prior);
        }
        self.in_contact = true;
        if settled {
            self.out.contact_m = Some(start_m);
        }
    }

    fn begin_layer(&mut self, start_m: f64, blind_from_m: f64, first: u64) {
        self.traversal = LayerTraversal { start_m, blind_from_m, first, ..LayerTraversal::default() };
        self.rls = Rls::new(self.prior());
        self.clock = ResetClock::default();
        self.cusum_n2 = 0.0;
    }

    /// RLS update; returns the innovation.
    #[inline(always)]
    fn identify(&mut self, index: u64, dt_s: f64, sample: Sample, compensated_n: f64) -> f64 {
        let depth_m = sample.position_m - self.traversal.start_m;
        if !self.in_contact || depth_m <= 0.0 {
            return 0.0;
        }
        let v = sample.velocity_mps;
        if v.abs() >= self.config.drop.standstill_mps {
            self.traversal.travel_m += v.abs() * dt_s;
            self.traversal.moving_s += dt_s;
        }
        let prior = self.prior();
        self.clock.reset_if_due(&self.config.reset, dt_s, prior, &mut self.rls);
        let phi = regressor(self.config.model, depth_m, v);
        let noise = relative_noise(dt_s);
        let mut error_n = self.rls.update_with_noise(phi, compensated_n, self.config.forgetting, noise);
        if !error_n.is_finite() {
            // The estimate has overflowed, as it eventually does with a forgetting factor below one.
            self.rls = Rls::new(prior);
            error_n = self.rls.update_with_noise(phi, compensated_n, self.config.forgetting, noise);
        }
        if self.traversal.crossed.is_none() && self.known_thickness_m().is_some_and(|d| depth_m >= d) {
            self.traversal.crossed = Some(index);
        }
        error_n
    }

    #[inline(always)]
    fn advance_state(
        &mut self,
        ring: &SampleRing<impl Storage>,
        sample: Sample,
        flags: SampleFlags,
        before: [f64; 2],
    ) {
        let dt_s = flags.dt_s;
        match self.out.state {
            State::NoRupture | State::ExpectedRupture | State::FreeTip => {
                self.detect_rupture(ring, sample, flags, before);
            }
            State::DetectedRupture => {
                self.out.state = State::ForceDropMeasuring;
                self.waited_m = 0.0;
                self.waited_s = 0.0;
                self.measure_drop(dt_s, sample);
            }
            State::ForceDropMeasuring => self.measure_drop(dt_s, sample),
            State::ForceCompensation => self.compensate(ring, dt_s, sample),
        }
    }

    #[inline(always)]
    fn detect_rupture(
        &mut self,
        ring: &SampleRing<impl Storage>,
        sample: Sample,
        flags: SampleFlags,
        before: [f64; 2],
    ) {
        if !self.in_contact {
            return;
        }
        let enabled = self.out.contact_m.is_some()
            && sample.position_m - self.traversal.blind_from_m >= self.config.guard.blind_travel_m
            && flags.detection_enabled();
        let mut cause = None;
        if enabled {
            let was = self.cusum_n2;
            let e = self.out.error_n;
            let sum = was + e * e - self.cusum.drift_n2;
            self.cusum_n2 = if sum > 0.0 { sum } else { 0.0 };
            if sum > self.cusum.threshold_n2 && was <= self.cusum.threshold_n2 {
                cause = Some(Cause::Cusum);
            }
            if was == 0.0 {
                self.zero_until = ring.next_index().saturating_sub(1);
            }
        } else {
            self.cusum_n2 = 0.0;
            self.zero_until = ring.next_index();
            self.disabled_until = self.zero_until;
        }
        let expected = self.out.state == State::ExpectedRupture;
        if cause.is_none() && enabled && flags.trailing_edge() && expected {
            cause = Some(Cause::DerivativeTrailingEdge);
        }
        if cause.is_none() && self.traversal.crossed.is_some() {
            cause = Some(Cause::KnownFace);
        }
        if let Some(cause) = cause {
            self.declare_rupture(ring, sample, flags.dt_s, before, cause);
        } else {
            self.out.state = if flags.derivative_on() { State::ExpectedRupture } else { State::NoRupture };
        }
    }

    #[inline]
    fn known_thickness_m(&self) -> Option<f64> {
        match &self.config.depths {
            Depths::Unknown => None,
            Depths::Known(thicknesses) => thicknesses.get(self.out.ruptures).copied(),
        }
    }

    /// Sets the traversed layer aside and begins a new one.
    #[cold]
    fn declare_rupture(
        &mut self,
        ring: &SampleRing<impl Storage>,
        sample: Sample,
        dt_s: f64,
        before: [f64; 2],
        cause: Cause,
    ) {
        let newest = ring.next_index().saturating_sub(1);
        let literal = self.config.algorithm == Algorithm::Literal;
        let after = match cause {
            _ if literal => newest,
            Cause::KnownFace => self.traversal.crossed.unwrap_or(newest),
            // The alarm accumulated since the sum was last zero.
            Cause::Cusum => self.locate_from(ring, self.zero_until.saturating_sub(4)),
            // The filters of the derivative delay by at most about a second.
            Cause::DerivativeTrailingEdge => {
                let second = 1.0 / dt_s.max(1e-9);
                self.locate_from(ring, self.disabled_until.max(newest.saturating_sub(second as u64)))
            }
        };
        let located = ring.get(after).copied().unwrap_or(sample);
        let start_m = self.traversal.start_m;
        let thickness_m = self.known_thickness_m().unwrap_or((located.position_m - start_m).max(0.0));
        self.out.ruptures += 1;
        self.out.detection = Some(Detection {
            layer: self.out.ruptures,
            time_s: sample.time_s,
            position_m: sample.position_m,
            located_s: located.time_s,
            located_m: located.position_m,
            cause,
            drop_n: 0.0,
            drop_sd_n: 0.0,
            confidence: 0.0,
        });
        self.pending = Some(PendingLayer {
            layer: self.out.ruptures,
            traversal: self.traversal,
            end: after,
            thickness_m,
            online: before,
            drop: ForceDrop::begin(ring, self.traversal.first, after),
            replay: None,
            drop_n: 0.0,
            elastic_share: 0.0,
        });
        let known = matches!(self.config.depths, Depths::Known(_));
        let next_start_m = if known { start_m + thickness_m } else { located.position_m };
        self.begin_layer(next_start_m, next_start_m, after);
        self.out.state = State::DetectedRupture;
    }

    fn locate_from(&self, ring: &SampleRing<impl Storage>, index: u64) -> u64 {
        locate_drop(ring, index.max(self.traversal.first))
    }

    /// Adds travel and time to a waiting state; standstill does not count.
    #[inline]
    fn wait(&mut self, dt_s: f64, sample: Sample) {
        if sample.velocity_mps.abs() >= self.config.drop.standstill_mps {
            self.waited_m += sample.velocity_mps.abs() * dt_s;
            self.waited_s += dt_s;
        }
    }

    fn is_reversing(&self, sample: Sample) -> bool {
        sample.velocity_mps < -self.config.drop.standstill_mps
    }

    /// State ForceDropMeasuring.
    #[inline]
    fn measure_drop(&mut self, dt_s: f64, sample: Sample) {
        self.wait(dt_s, sample);
        let reversing = self.is_reversing(sample);
        let over = reversing
            || self.waited_m >= self.config.drop.travel_m
            || self.waited_s >= self.config.drop.max_duration_s;
        let cumulative = self.compensation.cumulative_ns_per_m();
        if let Some(pending) = &mut self.pending {
            if !reversing {
                pending.drop.add(&sample);
            }
            if over {
                (pending.drop_n, pending.elastic_share) =
                    pending.drop.drop_and_elastic_share(&self.config.drop, cumulative);
                pending.replay = self.config.drop.replay.then(|| {
                    let t = &pending.traversal;
                    let mean_mps = t.travel_m / t.moving_s;
                    let friction = if self.config.drop.reweight {
                        reweighted_prior(&self.config, pending.elastic_share, mean_mps, pending.thickness_m)
                    } else {
                        self.config.prior_friction
                    };
                    let prior = [self.config.prior_stiffness, friction];
                    LayerReplay::new(prior, t.start_m, t.first, pending.end)
                });
            }
        }
        if over {
            self.out.state = State::ForceCompensation;
            self.waited_m = 0.0;
            self.waited_s = 0.0;
        }
    }

    /// State ForceCompensation: replays the layer in batches, then adds its friction.
    #[inline]
    fn compensate(&mut self, ring: &SampleRing<impl Storage>, dt_s: f64, sample: Sample) {
        self.wait(dt_s, sample);
        if let Some(mut pending) = self.pending.take() {
            let theta = match &mut pending.replay {
                Some(replay) => replay.process_batch(&self.config, ring, &self.compensation, pending.online),
                None => Some(pending.online),
            };
            match theta {
                Some(theta) => self.finish_layer(sample, &pending, theta),
                None => self.pending = Some(pending),
            }
            self.settled_for_s = 0.0;
        } else {
            self.settled_for_s += dt_s;
        }
        let over = self.is_reversing(sample)
            || self.waited_m >= self.config.drop.compensation_travel_m
            || self.waited_s >= self.config.drop.max_duration_s / 2.0;
        if over && self.pending.is_none() && self.settled_for_s >= self.config.drop.settle_s {
            self.cusum_n2 = 0.0;
            self.out.state = State::NoRupture;
        }
    }

    #[cold]
    fn finish_layer(&mut self, sample: Sample, pending: &PendingLayer, theta: [f64; 2]) {
        let stiffness = theta[0].max(0.0);
        let friction = theta[1].max(0.0);
        let added = match self.config.model {
            Model::MultiLayer => friction * pending.thickness_m,
            Model::KelvinVoigt => friction,
        };
        let estimate = LayerEstimate {
            layer: pending.layer,
            start_m: pending.traversal.start_m,
            thickness_m: pending.thickness_m,
            stiffness_n_per_m: stiffness,
            friction,
            drop_n: pending.drop_n,
            elastic_share: pending.elastic_share,
            added_friction_ns_per_m: if self.config.drop.compensate { added } else { 0.0 },
            time_s: sample.time_s,
            ..LayerEstimate::default()
        };
        self.compensation.add_layer(estimate);
        // The active layer was estimated with the previous friction: its parameters must be free to move.
        let prior = self.prior();
        self.rls.reset_covariance(prior);
        self.out.estimate = Some(estimate);
    }
}
