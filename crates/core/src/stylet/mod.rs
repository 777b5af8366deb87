//! `algorithm: Stylet`: one pass, no buffer, a bounded handful of operations per sample. The derivation stands in
//! `docs/enhancer.md`.

mod alarm;
mod gaussian;
mod layers;
mod local;
mod noise;
mod shaft;

use crate::config::{Contact, EnhanceConfig, FrictionLaw};
use crate::sample::{Cause, Detection, LayerEstimate, Output, Sample, State};
use alarm::Alarm;
use gaussian::{at_least, at_most};
use layers::{Behind, FP, K, KP, Layers};
use local::{Local, Step};
use noise::Noise;
use shaft::{Felt, Shaft};

/// Stiffest tissue that a needle is pushed into, in N/m: how wide a slope is before it is known.
const STIFFEST: f64 = 2000.0;
/// A force outside this many standard deviations that comes alone is a spike.
const SPIKE_SDS: f64 = 6.0;
/// A spike lasts at most this many samples.
const SPIKE_SAMPLES: u8 = 3;
/// Multiplications and additions: of what every sample costs beside the beliefs, of the local predictor (five shears, an innovation and
/// an update of five unknowns), of the layers (an innovation and an update of six), and of a rupture (a linear map of six unknowns).
const WORK_FRAME: u32 = 60;
const WORK_LOCAL: u32 = 5 * 14 + 2 * 24 + 2 * 20;
const WORK_LAYERS: u32 = 2 * 35 + 2 * 27 + 12;
const WORK_BACK: u32 = 16 * 5;
const WORK_RUPTURE: u32 = 2 * 216 + 2 * 126 + 2 * 84;
/// No needle is faster, in m/s, nor farther from the origin, in m: what says so is a fault of the logging.
const FASTEST_MPS: f64 = 2.0;
const FARTHEST_M: f64 = 10.0;
/// Below this the needle stands, in m/s (SPEC section 6).
const DEAD_MPS: f64 = 1e-5;
/// Smoothing of the speed that stands for the motion, in s.
const SPEED_S: f64 = 0.2;
/// What an ordinary drop lasts at most, in s.
const LONGEST_DROP_S: f64 = 0.1;
/// Misfit at which the law of layers does not hold; it has to be shown that it does.
const UNPROVEN: f64 = 3.0;

/// Samples that the level of a fall is averaged over at most.
const MOST_AVERAGED: f64 = 16.0;
/// Samples in a row above the threshold that are a contact.
const CONTACT_SAMPLES: u32 = 5;

/// A fall of the force that may become a rupture.
#[derive(Clone, Copy, Debug)]
struct Fall {
    from_n: f64,
    mean_n: f64,
    since_s: f64,
    count: f64,
}

/// What is remembered from sample to sample.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stylet {
    noise: Noise,
    local: Local,
    alarm: Alarm,
    layers: Layers,
    /// The estimator as it was when the alarm's sums left zero, and the position then.
    before: Layers,
    before_m: f64,
    behind: Behind,
    first_m: f64,
    /// What drives friction, in m/s, its dry state from -1 to 1, and what a steady advance at the usual speed makes of it.
    drive: f64,
    xi: f64,
    steady: f64,
    was_quiet: bool,
    /// The last step's length, and the shares of the low-passes that go with it.
    shares: [f64; 3],
    in_tissue: bool,
    started: bool,
    last: Sample,
    deepest_m: f64,
    speed_mps: f64,
    low_passed_n: f64,
    above: u32,
    spikes: u8,
    /// Samples since the last rupture, and the count at which the ruptured layer is reported next.
    since: u32,
    report_at: u32,
    /// The estimator just after the last rupture, while its drop may go on.
    fallen: Option<Layers>,
    since_s: f64,
    falling: bool,
    fall: Option<Fall>,
    /// Size of the last fall that was looked at, and its standard deviation, in N.
    drop: (f64, f64),
    last_level_n: f64,
    shaft: Shaft,
    /// The law of layers has failed: friction is taken as dry.
    dry: bool,
    releasing_s: f64,
    /// Largest force so far in N, noise smoothed away.
    peak_n: f64,
    /// Mean squared standardised error of the estimator over the last travel: one where its law holds.
    misfit: f64,
    /// How far the law of layers fails, 0 to 1; and then, how much rougher the force is than the sensor's noise (a variance ratio).
    rough: f64,
    texture: f64,
    /// Least fall that is a rupture, in N.
    least_n: f64,
    behind_variance: f64,
    /// Multiplications and additions of the last sample.
    work: u32,
    out: Output,
}

impl Stylet {
    pub(crate) fn new(config: &EnhanceConfig, surface_m: f64) -> Self {
        let noise = Noise::new(config.contact_search.smallest_noise_n);
        let layers = Layers::contact(surface_m, 0.0, 0.0, 1.0, 1.0, &noise);
        Self {
            noise,
            local: Local::new(0.0),
            alarm: Alarm::new(config.stylet.false_alarms_per_hour, 0.005),
            layers,
            before: layers,
            before_m: surface_m,
            behind: Behind::default(),
            first_m: surface_m,
            drive: 0.0,
            xi: 0.0,
            steady: 0.0,
            was_quiet: true,
            shares: [0.0; 3],
            in_tissue: false,
            started: false,
            last: Sample::default(),
            deepest_m: f64::NEG_INFINITY,
            speed_mps: 0.0,
            low_passed_n: 0.0,
            above: 0,
            spikes: 0,
            since: 0,
            report_at: u32::MAX,
            fallen: None,
            since_s: 0.0,
            falling: false,
            fall: None,
            drop: (0.0, 0.0),
            last_level_n: 0.0,
            shaft: Shaft::default(),
            dry: false,
            releasing_s: 0.0,
            peak_n: 0.0,
            misfit: UNPROVEN,
            rough: 1.0,
            texture: 1.0,
            least_n: 0.0,
            behind_variance: 0.0,
            work: 0,
            out: Output::default(),
        }
    }

    pub(crate) fn is_sound(&self) -> bool {
        let numbers = self.noise.variance
            + self.noise.rho
            + self.peak_n
            + self.misfit
            + self.texture
            + self.out.enhanced_n;
        numbers.is_finite()
            && self.noise.variance > 0.0
            && self.local.state.is_sound()
            && self.layers.belief.is_sound()
    }

    pub(crate) fn work(&self) -> u32 {
        self.work
    }

    pub(crate) fn out(&self) -> &Output {
        &self.out
    }

    #[inline]
    pub(crate) fn step(&mut self, config: &EnhanceConfig, surface_m: f64, sample: Sample) -> &Output {
        self.out.detection = None;
        self.out.estimate = None;
        self.work = WORK_FRAME;
        let robot = sample.velocity_mps.abs() < FASTEST_MPS && sample.position_m.abs() < FARTHEST_M;
        self.out.used = sample.is_usable() && robot && (!self.started || sample.time_s > self.last.time_s);
        if !self.out.used {
            return &self.out;
        }
        let last = if self.started { self.last } else { sample };
        let step = self.motion(config, &last, &sample);
        self.drive_friction(config, &step, &sample);
        if self.in_tissue {
            self.feel(config, &step, &sample);
        } else {
            self.look_for_contact(config, surface_m, &step, &sample);
        }
        self.last = sample;
        self.started = true;
        self.speak(config, &sample);
        &self.out
    }

    /// The drive of friction, by the law in force.
    #[inline(always)]
    fn drive_friction(&mut self, config: &EnhanceConfig, step: &Step, sample: &Sample) {
        let v = sample.velocity_mps;
        let (dry_mps, travel_m) = match config.stylet.law {
            FrictionLaw::Auto | FrictionLaw::Viscous => {
                self.drive = v;
                self.steady = step.speed_mps;
                return;
            }
            FrictionLaw::CoulombViscous { dry_mps } => (dry_mps, 0.0),
            FrictionLaw::Presliding { dry_mps, travel_m } => (dry_mps, travel_m),
        };
        let sign = if v > DEAD_MPS {
            1.0
        } else if v < -DEAD_MPS {
            -1.0
        } else {
            0.0
        };
        self.xi = if travel_m > 0.0 {
            // Builds up while any shaft is inside; a hold leaves it as it is.
            let travel = step.dz_m.abs();
            let inside = self.in_tissue && sign != 0.0 && travel > 0.0;
            if inside { sign + (self.xi - sign) * libm::exp(-travel / travel_m) } else { self.xi }
        } else {
            sign
        };
        self.drive = v + dry_mps * self.xi;
        self.steady = step.speed_mps + dry_mps;
    }

    /// How the needle has moved since the last sample.
    #[inline(always)]
    fn motion(&mut self, config: &EnhanceConfig, last: &Sample, sample: &Sample) -> Step {
        let dt_s = sample.time_s - last.time_s;
        if dt_s > 0.0 {
            self.noise.clock(dt_s);
            if (dt_s - self.shares[0]).abs() > 1e-9 {
                self.shares = [dt_s, dt_s / (dt_s + SPEED_S), dt_s / (dt_s + shaft::SMOOTH_S)];
            }
        }
        let speed = sample.velocity_mps.abs();
        if speed > config.drop.standstill_mps {
            if self.speed_mps == 0.0 {
                self.speed_mps = speed;
            } else {
                self.speed_mps += self.shares[1] * (speed - self.speed_mps);
            }
        }
        Step {
            dt_s,
            dz_m: sample.position_m - last.position_m,
            dv_mps: sample.velocity_mps - last.velocity_mps,
            rho: self.noise.rho_over(dt_s),
            speed_mps: at_least(config.drop.standstill_mps, self.speed_mps),
        }
    }

    /// In the air.
    fn look_for_contact(&mut self, config: &EnhanceConfig, surface_m: f64, step: &Step, sample: &Sample) {
        self.deepest_m = self.deepest_m.max(sample.position_m);
        let known = config.contact == Contact::Known;
        if known && sample.position_m >= surface_m {
            self.touch(config, step, sample, surface_m, 0.0, 0.0);
            return;
        }
        self.noise.in_air(sample.force_n);
        let search = &config.contact_search;
        if !self.started {
            self.low_passed_n = sample.force_n;
        }
        let share = step.dt_s / (step.dt_s + search.time_constant_s);
        self.low_passed_n += share * (sample.force_n - self.low_passed_n);
        if known || self.noise.in_air_count() == 0.0 {
            return;
        }
        let risen = self.low_passed_n - self.noise.bias_n();
        let spread =
            self.noise.variance * self.noise.slow() * self.noise.step_s / (2.0 * search.time_constant_s);
        let sd = libm::sqrt(
            spread.min(self.noise.marginal()) + self.noise.bias_variance().min(self.noise.marginal()),
        );
        if risen > search.noise_sds * sd
            && sample.force_n > self.noise.bias_n()
            && sample.velocity_mps > -config.drop.standstill_mps
        {
            self.above += 1;
        } else {
            self.above = 0;
        }
        if self.above >= CONTACT_SAMPLES {
            self.touch(config, step, sample, sample.position_m, risen, risen + 3.0 * sd);
        }
    }

    #[cold]
    fn touch(
        &mut self,
        config: &EnhanceConfig,
        step: &Step,
        sample: &Sample,
        start_m: f64,
        force_n: f64,
        sd_n: f64,
    ) {
        self.in_tissue = true;
        self.first_m = sample.position_m;
        self.alarm = Alarm::new(config.stylet.false_alarms_per_hour, self.noise.step_s);
        let drive = self.steady.max(1e-6);
        self.layers = Layers::contact(start_m, force_n, sd_n, STIFFEST, drive, &self.noise);
        self.before = self.layers;
        self.before_m = sample.position_m;
        self.local = Local::new(sample.force_n);
        self.local.renew(sample.force_n, STIFFEST * local::MEMORY_M, &self.noise, step.speed_mps, true);
        self.out.contact_m = Some(start_m);
    }

    /// In the tissue.
    #[inline(always)]
    fn feel(&mut self, config: &EnhanceConfig, step: &Step, sample: &Sample) {
        let force_n = sample.force_n;
        self.mend(step, sample);
        self.work += WORK_LOCAL;
        self.local.advance(step, &self.noise);
        self.last_level_n = if self.fall.is_none() { self.local.level_n() } else { self.last_level_n };
        let innovation = self.local.innovation(force_n, step, &self.noise);
        let sd = libm::sqrt(innovation.s * self.noise.variance);
        let z = innovation.e / sd;
        self.out.error_n = innovation.e;
        self.since = self.since.saturating_add(1);
        self.since_s += step.dt_s;
        let standstill = config.drop.standstill_mps;
        let forward = sample.velocity_mps > -standstill
            && sample.position_m > self.deepest_m - config.guard.old_ground_m;
        if sample.position_m > self.deepest_m {
            self.deepest_m = sample.position_m;
        }
        let share = step.dz_m.abs() / (step.dz_m.abs() + 2.0 * local::MEMORY_M);
        // A spike: upwards, or below what any rupture can leave, and not for long.
        let below = force_n - self.noise.bias_n() < -SPIKE_SDS * libm::sqrt(self.noise.marginal());
        let odd = z > SPIKE_SDS || (forward && z < -SPIKE_SDS && below);
        // A release of the shaft takes as long as a drop.
        self.releasing_s =
            if z > SPIKE_SDS && !forward { LONGEST_DROP_S } else { self.releasing_s - step.dt_s };
        if odd && forward && self.spikes < SPIKE_SAMPLES {
            self.spikes += 1;
            self.local.pass();
            self.layers.pass();
            return;
        }
        if odd {
            // It stays: the force has jumped.
            let force = (force_n - self.noise.bias_n()).abs();
            self.local.renew(force_n, force.max(sd), &self.noise, step.speed_mps, false);
        }
        self.spikes = 0;
        let rough = 1.0 + self.rough * at_least(0.0, self.texture - 1.0);
        let smoothed = if rough > 1.0 { z / libm::sqrt(rough) } else { z };
        let heard = self.alarm.take(if forward && !odd { smoothed } else { 0.0 });
        if !forward {
            self.alarm.rest();
        }
        if !heard.quiet && (self.was_quiet || heard.outweighs) {
            self.before = self.layers;
            self.before_m = self.last.position_m;
        }
        self.was_quiet = heard.quiet || !forward;
        if forward && !odd && !heard.quiet {
            self.fall(step, sample);
        }
        if heard.quiet {
            self.fall = None;
        }
        if heard.alarm && forward && !odd {
            let recent = self.out.ruptures > 0 && self.since_s <= LONGEST_DROP_S;
            if recent {
                // Still the same drop.
                self.go_on_falling(step, sample, sd);
                return;
            }
            if self.is_a_drop(config) {
                self.rupture(step, sample, heard.evidence);
                return;
            }
        }
        if !odd {
            self.noise.in_tissue(innovation.e, innovation.s);
            self.local.take(&innovation, force_n);
            self.texture += share * (at_most(36.0, z * z) - self.texture);
        }
        self.falling = self.fallen.is_some() && self.settle(step);
        if self.falling {
            if let Some(fallen) = self.fallen {
                self.layers = fallen;
            }
        } else if forward && sample.position_m >= self.layers.start_m {
            self.work += WORK_LAYERS;
            let (e, s) = self.layers.take(sample.position_m, self.drive, force_n, step.rho);
            let z2 = at_most(400.0, e * e / (s * self.noise.variance));
            if s < 2.0 || sample.velocity_mps.abs() <= standstill {
                let share = at_least(share, at_most(0.5, step.dt_s * (0.25 / local::MEMORY_S)));
                self.misfit += share * (z2 - self.misfit);
            }
            self.peak_n = at_least(self.peak_n, self.local.level_n() - self.noise.bias_n());
            // Where the law of layers does not hold, small falls are texture.
            let weight = (self.misfit - 0.5 * UNPROVEN) / (UNPROVEN - 0.5 * UNPROVEN - 1.0);
            let weight = at_most(1.0, at_least(0.0, weight));
            self.rough = weight;
            // A law that has failed is not trusted again.
            if self.misfit >= UNPROVEN && self.deepest_m - self.first_m >= config.guard.blind_travel_m {
                self.dry = true;
            }
            self.least_n = weight * config.stylet.smallest_drop * self.peak_n;
        } else {
            self.layers.pass();
        }
        if self.since >= self.report_at {
            self.report_at = self.report_at.saturating_mul(2);
            self.report(sample);
        }
    }

    /// Beliefs that senseless data have spoilt begin afresh.
    #[inline(always)]
    fn mend(&mut self, step: &Step, sample: &Sample) {
        if !(self.noise.variance.is_finite() && self.noise.variance < 1e12) {
            self.noise = Noise::new(1e-3);
        }
        if !self.local.state.is_usable() {
            self.local = Local::new(sample.force_n);
            let force = (sample.force_n - self.noise.bias_n()).abs().max(1e-3);
            self.local.renew(sample.force_n, force, &self.noise, step.speed_mps, true);
            self.work += WORK_RUPTURE;
        }
        if !self.layers.belief.is_usable() {
            self.layers = Layers::contact(sample.position_m, 0.0, 1.0, STIFFEST, step.speed_mps, &self.noise);
            self.before = self.layers;
            self.fallen = None;
            self.work += WORK_RUPTURE;
        }
    }

    /// Follows a fall from where it began.
    #[inline(always)]
    fn fall(&mut self, step: &Step, sample: &Sample) {
        let fall = self.fall.get_or_insert(Fall {
            from_n: self.last_level_n,
            mean_n: sample.force_n,
            since_s: 0.0,
            count: 0.0,
        });
        fall.since_s += step.dt_s;
        fall.count += 1.0;
        // As many samples as it takes to know the force to a quarter of the drop that counts.
        let most = if self.least_n > 0.0 {
            16.0 * self.noise.marginal() / (self.least_n * self.least_n)
        } else {
            MOST_AVERAGED
        };
        let most = most.clamp(1.0, MOST_AVERAGED);
        fall.mean_n += (sample.force_n - fall.mean_n) / fall.count.min(most);
        if fall.since_s > LONGEST_DROP_S && self.least_n > 0.0 && fall.from_n - fall.mean_n < self.least_n {
            // Too slow, or too small: not a rupture.
            self.fall = None;
            self.alarm.rest();
            self.was_quiet = true;
        }
    }

    /// Whether the fall so far is a drop: larger than what the noise may feign, and than texture.
    fn is_a_drop(&mut self, config: &EnhanceConfig) -> bool {
        let Some(fall) = self.fall else { return false };
        // As long as the law has not been seen to hold, the first travel after contact is no layer.
        if self.rough > 0.0 && self.deepest_m - self.first_m < config.guard.blind_travel_m {
            return false;
        }
        let effective = (fall.count.min(MOST_AVERAGED) / libm::sqrt(self.noise.slow())).max(1.0);
        let noise = 2.0 * libm::sqrt(self.noise.marginal() / effective);
        let size = fall.from_n - fall.mean_n;
        self.drop = (size, noise / 2.0);
        size >= self.least_n.max(noise)
    }

    fn go_on_falling(&mut self, step: &Step, sample: &Sample, sd: f64) {
        let force = (sample.force_n - self.noise.bias_n()).abs().max(sd);
        self.local.renew(sample.force_n, force, &self.noise, step.speed_mps, false);
        self.alarm.rest();
        self.was_quiet = true;
        self.fall = None;
        if let Some(fallen) = self.fallen {
            self.layers = fallen;
        }
        self.before = self.layers;
        self.before_m = sample.position_m;
        self.shaft.rupture(sample.position_m, sample.force_n - self.noise.bias_n());
    }

    #[cold]
    fn rupture(&mut self, step: &Step, sample: &Sample, evidence: f64) {
        if self.report_at < u32::MAX {
            self.report(sample);
        }
        let bias = self.noise.bias_n();
        let span = (sample.position_m - self.before_m).max(0.0);
        // One sample that says it all lies half a step behind the rupture; a sum over many began where it left zero, give or take
        // a step.
        let first = span.min(step.dz_m.max(0.0));
        let at_m = self.before_m + 0.5 * first;
        let place_m = if span > 1.5 * first { first.max(0.5 * span) } else { first / libm::sqrt(12.0) };
        let drive = self.steady.max(1e-6);
        let predicted = self.local.level_n();
        self.layers = self.before;
        self.work += WORK_RUPTURE;
        self.layers.rupture(at_m, place_m, drive, &self.noise, &mut self.behind);
        self.fallen = Some(self.layers);
        self.since_s = 0.0;
        self.layers.take(sample.position_m, self.drive, sample.force_n, 0.0);
        let force = (sample.force_n - bias).abs().max((predicted - sample.force_n).abs());
        self.local.renew(sample.force_n, force, &self.noise, step.speed_mps, false);
        self.alarm.rest();
        self.was_quiet = true;
        self.fall = None;
        self.before = self.layers;
        self.before_m = sample.position_m;
        self.since = 0;
        self.report_at = 16;
        if self.out.ruptures == 0 {
            self.out.contact_m = Some(self.layers.start_m - self.layers.previous_m);
        }
        self.out.ruptures += 1;
        self.shaft.rupture(sample.position_m, sample.force_n - bias);
        // Before the sum passed its threshold a rupture was as likely as a false alarm; what is above it counts.
        let confidence = 1.0 / (1.0 + libm::exp(-(evidence + core::f64::consts::LN_2)));
        let (drop_n, drop_sd_n) = self.drop;
        self.out.detection = Some(Detection {
            layer: self.out.ruptures,
            time_s: sample.time_s,
            position_m: sample.position_m,
            located_s: sample.time_s,
            located_m: at_m,
            cause: Cause::Cusum,
            drop_n,
            drop_sd_n,
            confidence,
        });
    }

    /// Whether the drop still goes on; once it is over, that is settled.
    fn settle(&mut self, step: &Step) -> bool {
        let (rate, variance) = self.local.rate(step.speed_mps);
        let sd = libm::sqrt(variance * self.noise.variance);
        let falling = rate < -3.0 * sd;
        if self.since_s > LONGEST_DROP_S && rate > -2.0 * sd {
            self.fallen = None;
        }
        falling
    }

    /// The layer before, as it is known now.
    fn report(&mut self, sample: &Sample) {
        let l = &self.layers;
        let d = l.previous_m;
        let [k, b] = [l.belief.x[KP], l.belief.x[FP]];
        let doubt = self.noise.doubt();
        let [vk, vb] = l.previous_variance(&self.noise).map(|v| v * doubt);
        let (cumulative, cumulative_variance) = l.behind(&self.noise);
        let drop = k * d;
        let certain = drop > 1.96 * d * libm::sqrt(vk.max(0.0));
        if !certain {
            return;
        }
        self.out.estimate = Some(LayerEstimate {
            layer: self.out.ruptures,
            start_m: l.start_m - d,
            thickness_m: d,
            stiffness_n_per_m: k,
            friction: b,
            drop_n: drop,
            elastic_share: (k / (k + b * self.steady)).clamp(0.0, 1.0),
            added_friction_ns_per_m: b * d,
            time_s: sample.time_s,
            stiffness_sd: libm::sqrt(vk.max(0.0)),
            friction_sd: libm::sqrt(vb.max(0.0)),
            drop_sd_n: d * libm::sqrt(vk.max(0.0)),
            cumulative_ns_per_m: cumulative,
            cumulative_sd: libm::sqrt((cumulative_variance * doubt).max(0.0)),
        });
    }

    #[inline(always)]
    fn speak(&mut self, config: &EnhanceConfig, sample: &Sample) {
        let standstill = config.drop.standstill_mps;
        let retracting = sample.velocity_mps < -standstill;
        let marginal = self.noise.marginal();
        let (mut behind, mut variance) = self.layers.behind(&self.noise);
        if let (Some(fallen), true) = (&self.fallen, self.falling) {
            // As long as elastic force may be left, friction is no more than what was expected of it.
            behind = behind.min(fallen.behind(&self.noise).0);
        }
        behind = at_least(0.0, behind);
        if retracting && self.in_tissue {
            self.work += WORK_BACK;
            behind = self.layers.around_shaft(&self.behind, sample.position_m);
        }
        let u = self.drive;
        let mut friction = behind * u;
        let behind_variance = variance;
        variance *= u * u;
        if self.in_tissue {
            let felt = Felt {
                share: self.shares[2],
                position_m: sample.position_m,
                force_n: sample.force_n - self.noise.bias_n(),
                advancing: sample.velocity_mps > standstill,
                retracting,
                peak_n: self.peak_n,
                jumped: self.releasing_s > 0.0,
                noise_n2: marginal,
                track: config.stylet.track_way_back,
            };
            let (dry_n, sd) = self.shaft.take(&felt);
            if self.dry && config.stylet.law == FrictionLaw::Auto {
                (friction, variance) = (dry_n, sd * sd);
            }
        }
        let out = &mut self.out;
        out.state = if out.detection.is_some() { State::DetectedRupture } else { State::NoRupture };
        self.behind_variance = behind_variance;
        let out = &mut self.out;
        out.cumulative_friction_ns_per_m = behind;
        out.enhanced_n = sample.force_n - friction;
        let half = 1.96 * libm::sqrt(marginal + at_least(0.0, variance));
        out.band_n = Some([out.enhanced_n - half, out.enhanced_n + half]);
    }

    /// Fills in what only callers of the whole output look at.
    pub(crate) fn complete(&mut self, sample: &Sample) -> &Output {
        let out = &mut self.out;
        if out.used {
            out.reconstructed_n = if self.in_tissue { sample.force_n - out.error_n } else { 0.0 };
            out.cusum_n2 = self.alarm.level();
            if self.in_tissue {
                let belief = &self.layers.belief;
                out.theta = [belief.x[K], belief.x[layers::F]];
                let sd = |i: usize| libm::sqrt((belief.p[i][i] * self.noise.variance).max(0.0));
                out.sd = [sd(K), sd(layers::F), libm::sqrt(self.behind_variance.max(0.0))];
            }
        }
        &self.out
    }
}
