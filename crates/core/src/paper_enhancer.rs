//! The online algorithm, one call per sample (SPEC section 5; Ferro et al. 2021, supplement
//! Fig. 1 and eqs. 1-17).

use crate::config::{Algorithm, Contact, CusumConfig, Depths, DropEstimator, EnhanceConfig};
use crate::contact_detection::{ContactDetector, ContactStatus};
use crate::force_drop::{ForceDrop, locate_drop};
use crate::friction_compensation::FrictionCompensation;
use crate::layer_replay::{LayerReplay, ResetClock, regressor, relative_noise, reweighted_prior};
use crate::preprocessing::{Preprocessor, SampleFlags};
use crate::rls::Rls;
use crate::sample::{Cause, Detection, LayerEstimate, Output, Sample, State};
use crate::sample_ring::SampleRing;

/// Samples that are looked at ahead of the estimator.
const BLOCK: usize = 64;

/// The CUSUM's constants, worked out once.
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
struct Traverse {
    start_m: f64,
    first: u64,
    /// No rupture is declared within the blind travel from here.
    blind_from_m: f64,
    /// Number of the sample that crossed the known far face.
    crossed: Option<u64>,
    /// Travel and time while the needle moved: their ratio is the mean speed.
    travel_m: f64,
    moving_s: f64,
}

/// A layer that has ruptured and waits for its estimate.
#[derive(Clone, Copy, Debug)]
struct Pending {
    layer: usize,
    traverse: Traverse,
    end: u64,
    thickness_m: f64,
    online: [f64; 2],
    drop: ForceDrop,
    rerun: Option<LayerReplay>,
    drop_n: f64,
    share: f64,
}

/// The published algorithm.
#[derive(Clone, Debug)]
pub(crate) struct PaperEnhancer<B> {
    config: EnhanceConfig,
    history: SampleRing<B>,
    front: Preprocessor,
    contact: ContactDetector,
    compensation: FrictionCompensation,
    rls: Rls,
    clock: ResetClock,
    in_contact: bool,
    traverse: Traverse,
    pending: Option<Pending>,
    cusum: Cusum,
    cusum_n2: f64,
    /// Numbers of the samples at which detection was last off, and at which the CUSUM was last zero.
    off_until: u64,
    zero_until: u64,
    waited_m: f64,
    waited_s: f64,
    settled_for_s: f64,
    out: Output,
}

impl<B: AsRef<[Sample]> + AsMut<[Sample]>> PaperEnhancer<B> {
    /// A core with `storage` for the raw samples of a layer. `surface_m` is used when the contact
    /// is [`Contact::Known`].
    pub fn new(mut config: EnhanceConfig, surface_m: f64, storage: B) -> Self {
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
            history: SampleRing::new(storage),
            front: Preprocessor::new(&config),
            contact: ContactDetector::new(&config.contact_search),
            compensation: FrictionCompensation::default(),
            rls: Rls::new(prior),
            clock: ResetClock::default(),
            in_contact: false,
            traverse: Traverse { start_m: surface_m, ..Traverse::default() },
            pending: None,
            cusum: Cusum::new(&config.cusum),
            cusum_n2: 0.0,
            off_until: 0,
            zero_until: 0,
            waited_m: 0.0,
            waited_s: 0.0,
            settled_for_s: 0.0,
            out: Output::default(),
            config,
        }
    }

    /// The configuration in force.
    #[must_use]
    pub fn config(&self) -> &EnhanceConfig {
        &self.config
    }

    fn prior(&self) -> [f64; 2] {
        [self.config.prior_stiffness, self.config.prior_friction]
    }

    /// Takes one sample. A sample that is not finite or not later than the one before is passed
    /// over ([`Output::used`] is false).
    #[inline]
    pub fn step(&mut self, sample: Sample) -> Output {
        self.step_brief(sample);
        let out = &mut self.out;
        if out.used {
            out.reconstructed_n = if self.in_contact { sample.force_n - out.error_n } else { 0.0 };
        }
        out.theta = if self.rls.is_finite() { self.rls.theta } else { [0.0; 2] };
        out.cusum_n2 = self.cusum_n2;
        out.derivative_n_per_s = self.front.derivative_n_per_s();
        out.cumulative_friction_ns_per_m = self.compensation.cumulative_ns_per_m();
        self.out
    }

    /// As `step` for callers who look at a few fields of millions of samples: nothing is
    /// copied, and of the output only enhanced force, innovation, state, ruptures, contact, detection,
    /// estimate and `used` are kept up to date.
    #[inline]
    pub fn step_brief(&mut self, sample: Sample) -> &Output {
        let mut seen = SampleFlags::default();
        self.front.process(&self.config, sample, &mut seen);
        self.take(sample, seen);
        &self.out
    }

    /// As `step_brief` for many samples at hand; `hear` is told the output for each, and the
    /// last is returned.
    ///
    /// The samples are looked at ahead of the estimator, a block at a time, which is faster than one after
    /// the other and gives the same bits.
    #[inline]
    pub fn run(&mut self, samples: &[Sample], mut hear: impl FnMut(&Output)) -> &Output {
        let mut seen = [SampleFlags::default(); BLOCK];
        for block in samples.chunks(BLOCK) {
            for (seen, sample) in seen.iter_mut().zip(block) {
                self.front.process(&self.config, *sample, seen);
            }
            for (seen, sample) in seen.iter().zip(block) {
                self.take(*sample, *seen);
                hear(&self.out);
            }
        }
        &self.out
    }

    /// What the estimator makes of a sample.
    #[inline(always)]
    fn take(&mut self, sample: Sample, seen: SampleFlags) {
        self.out.detection = None;
        self.out.estimate = None;
        self.out.used = seen.used();
        if !seen.used() {
            return;
        }
        let number = self.history.next_index();
        self.history.push(sample);
        self.touch(seen.dt_s, sample, number);
        let before = self.rls.theta;
        let v = sample.velocity_mps;
        // What is left of the force without the friction of the layers traversed so far.
        let left_n = sample.force_n - self.compensation.friction_at_ns_per_m(sample.position_m) * v;
        self.out.error_n = self.identify(seen.dt_s, sample, left_n);
        self.advance(sample, seen, before);
        self.out.enhanced_n = left_n;
        if self.out.estimate.is_some() {
            let friction = self.compensation.friction_at_ns_per_m(sample.position_m);
            self.out.enhanced_n = sample.force_n - friction * v;
        }
    }

    /// First contact.
    #[inline(always)]
    fn touch(&mut self, dt_s: f64, sample: Sample, number: u64) {
        if self.out.contact_m.is_some() {
            return;
        }
        let (start_m, first, settled) = match self.config.contact {
            Contact::Known if sample.position_m >= self.traverse.start_m => {
                (self.traverse.start_m, number, true)
            }
            Contact::Known => return,
            Contact::Detected => {
                match self.contact.update(&self.config.contact_search, dt_s, sample, number) {
                    ContactStatus::InAir => return,
                    ContactStatus::Provisional { surface_m, first } => (surface_m, first, false),
                    ContactStatus::Settled { surface_m, first } => (surface_m, first, true),
                }
            }
        };
        if !self.in_contact {
            // A needle that is known to start inside the tissue is blind from where it starts.
            let blind_from_m = match self.config.contact {
                Contact::Known => sample.position_m,
                Contact::Detected => start_m,
            };
            self.begin_layer(start_m, blind_from_m, first);
        } else if settled {
            // The start moves by a fraction of a millimetre: the estimate is kept, its covariance is not.
            self.traverse.start_m = start_m;
            self.traverse.blind_from_m = start_m;
            let prior = self.prior();
            self.rls.reset_covariance(prior);
        }
        self.in_contact = true;
        if settled {
            self.out.contact_m = Some(start_m);
        }
    }

    fn begin_layer(&mut self, start_m: f64, blind_from_m: f64, first: u64) {
        self.traverse = Traverse { start_m, blind_from_m, first, ..Traverse::default() };
        self.rls = Rls::new(self.prior());
        self.clock = ResetClock::default();
        self.cusum_n2 = 0.0;
    }

    /// One RLS update; returns the innovation.
    #[inline(always)]
    fn identify(&mut self, dt_s: f64, sample: Sample, left_n: f64) -> f64 {
        let depth_m = sample.position_m - self.traverse.start_m;
        if !self.in_contact || depth_m <= 0.0 {
            return 0.0;
        }
        let v = sample.velocity_mps;
        if v.abs() >= self.config.drop.standstill_mps {
            self.traverse.travel_m += v.abs() * dt_s;
            self.traverse.moving_s += dt_s;
        }
        let prior = self.prior();
        self.clock.reset_if_due(&self.config.reset, dt_s, prior, &mut self.rls);
        let phi = regressor(self.config.model, depth_m, v);
        let noise = relative_noise(dt_s);
        let mut error_n = self.rls.update_with_noise(phi, left_n, self.config.forgetting, noise);
        if !error_n.is_finite() {
            // The estimate has overflowed, as a forgetting factor below one makes it in the end.
            self.rls = Rls::new(prior);
            error_n = self.rls.update_with_noise(phi, left_n, self.config.forgetting, noise);
        }
        if self.traverse.crossed.is_none() && self.known_thickness_m().is_some_and(|d| depth_m >= d) {
            self.traverse.crossed = Some(self.history.next_index().saturating_sub(1));
        }
        error_n
    }

    /// The state machine.
    #[inline(always)]
    fn advance(&mut self, sample: Sample, seen: SampleFlags, before: [f64; 2]) {
        let dt_s = seen.dt_s;
        match self.out.state {
            State::NoRupture | State::ExpectedRupture | State::FreeTip => {
                self.watch(sample, seen, before);
            }
            State::DetectedRupture => {
                self.out.state = State::ForceDropMeasuring;
                self.waited_m = 0.0;
                self.waited_s = 0.0;
                self.measure(dt_s, sample);
            }
            State::ForceDropMeasuring => self.measure(dt_s, sample),
            State::ForceCompensation => self.compensate(dt_s, sample),
        }
    }

    /// Looks for a rupture.
    #[inline(always)]
    fn watch(&mut self, sample: Sample, seen: SampleFlags, before: [f64; 2]) {
        if !self.in_contact {
            return;
        }
        let armed = self.out.contact_m.is_some()
            && sample.position_m - self.traverse.blind_from_m >= self.config.guard.blind_travel_m
            && seen.detection_enabled();
        let mut cause = None;
        if armed {
            let was = self.cusum_n2;
            let e = self.out.error_n;
            let sum = was + e * e - self.cusum.drift_n2;
            self.cusum_n2 = if sum > 0.0 { sum } else { 0.0 };
            if sum > self.cusum.threshold_n2 && was <= self.cusum.threshold_n2 {
                cause = Some(Cause::Cusum);
            }
            if was == 0.0 {
                self.zero_until = self.history.next_index().saturating_sub(1);
            }
        } else {
            self.cusum_n2 = 0.0;
            self.zero_until = self.history.next_index();
            self.off_until = self.zero_until;
        }
        if cause.is_none() && armed && seen.trailing_edge() && self.out.state == State::ExpectedRupture {
            cause = Some(Cause::DerivativeTrailingEdge);
        }
        if cause.is_none() && self.traverse.crossed.is_some() {
            cause = Some(Cause::KnownFace);
        }
        if let Some(cause) = cause {
            self.declare(sample, seen.dt_s, before, cause);
        } else {
            self.out.state = if seen.derivative_on() { State::ExpectedRupture } else { State::NoRupture };
        }
    }

    #[inline]
    fn known_thickness_m(&self) -> Option<f64> {
        match &self.config.depths {
            Depths::Unknown => None,
            Depths::Known(thicknesses) => thicknesses.get(self.out.ruptures).copied(),
        }
    }

    /// A rupture: the traversed layer is set aside, a new one begins.
    #[cold]
    fn declare(&mut self, sample: Sample, dt_s: f64, before: [f64; 2], cause: Cause) {
        let newest = self.history.next_index().saturating_sub(1);
        let literal = self.config.algorithm == Algorithm::Literal;
        let after = match cause {
            _ if literal => newest,
            Cause::KnownFace => self.traverse.crossed.unwrap_or(newest),
            // The alarm came of what was added since the sum was last zero.
            Cause::Cusum => self.located_from(self.zero_until.saturating_sub(4)),
            // The filters of the derivative are late by about a second at most.
            Cause::DerivativeTrailingEdge => {
                let second = 1.0 / dt_s.max(1e-9);
                self.located_from(self.off_until.max(newest.saturating_sub(second as u64)))
            }
        };
        let located = self.history.get(after).copied().unwrap_or(sample);
        let start_m = self.traverse.start_m;
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
        self.pending = Some(Pending {
            layer: self.out.ruptures,
            traverse: self.traverse,
            end: after,
            thickness_m,
            online: before,
            drop: ForceDrop::begin(&self.history, self.traverse.first, after),
            rerun: None,
            drop_n: 0.0,
            share: 0.0,
        });
        let known = matches!(self.config.depths, Depths::Known(_));
        let next_start_m = if known { start_m + thickness_m } else { located.position_m };
        self.begin_layer(next_start_m, next_start_m, after);
        self.out.state = State::DetectedRupture;
    }

    fn located_from(&self, number: u64) -> u64 {
        locate_drop(&self.history, number.max(self.traverse.first))
    }

    /// Counts the travel and time that a waiting state needs; standstill does not count.
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

    /// ForceDropMeasuring.
    #[inline]
    fn measure(&mut self, dt_s: f64, sample: Sample) {
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
                let (drop_n, share) = pending.drop.drop_and_elastic_share(&self.config.drop, cumulative);
                pending.drop_n = drop_n;
                pending.share = share;
                pending.rerun = self.config.drop.replay.then(|| {
                    let t = &pending.traverse;
                    let mean = t.travel_m / t.moving_s;
                    let friction = if self.config.drop.reweight {
                        reweighted_prior(&self.config, share, mean, pending.thickness_m)
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

    /// ForceCompensation: a share of the re-run per tick, then the layer's friction is added.
    #[inline]
    fn compensate(&mut self, dt_s: f64, sample: Sample) {
        self.wait(dt_s, sample);
        if let Some(mut pending) = self.pending.take() {
            let theta = match &mut pending.rerun {
                Some(rerun) => {
                    rerun.process_batch(&self.config, &self.history, &self.compensation, pending.online)
                }
                None => Some(pending.online),
            };
            match theta {
                Some(theta) => self.settle(sample, &pending, theta),
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
    fn settle(&mut self, sample: Sample, pending: &Pending, theta: [f64; 2]) {
        let stiffness = theta[0].max(0.0);
        let friction = theta[1].max(0.0);
        let added = match self.config.model {
            crate::config::Model::MultiLayer => friction * pending.thickness_m,
            crate::config::Model::KelvinVoigt => friction,
        };
        let estimate = LayerEstimate {
            layer: pending.layer,
            start_m: pending.traverse.start_m,
            thickness_m: pending.thickness_m,
            stiffness_n_per_m: stiffness,
            friction,
            drop_n: pending.drop_n,
            elastic_share: pending.share,
            added_friction_ns_per_m: if self.config.drop.compensate { added } else { 0.0 },
            time_s: sample.time_s,
            ..LayerEstimate::default()
        };
        self.compensation.add_layer(estimate);
        // The estimate of the layer being traversed was made with the old friction: let it move.
        let prior = self.prior();
        self.rls.reset_covariance(prior);
        self.out.estimate = Some(estimate);
    }
}
