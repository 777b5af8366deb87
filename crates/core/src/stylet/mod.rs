//! `algorithm: Stylet`: one pass, no buffer, a bounded handful of operations per sample. The derivation stands in
//! `docs/enhancer.md`.

mod alarm;
mod contact;
mod fall;
mod feel;
mod gaussian;
mod going;
mod layers;
mod local;
mod motion;
mod noise;
mod shaft;
mod slack;
mod speak;
mod track;

use crate::config::EnhanceConfig;
use crate::sample::{Output, Sample};
use alarm::Alarm;
use fall::Fall;
use feel::UNPROVEN;
use going::Going;
use layers::{Behind, Layers};
use local::{Local, Step};
use noise::Noise;
use shaft::Shaft;
use slack::Slack;

/// Stiffest tissue that a needle is pushed into, in N/m: how wide a slope is before it is known.
const STIFFEST: f64 = 2000.0;
/// Multiplications and additions of what every sample costs beside the beliefs, and of a rupture (a linear map of six unknowns).
const WORK_FRAME: u32 = 60;
const WORK_RUPTURE: u32 = 2 * 216 + 2 * 126 + 2 * 84;
/// No needle is faster, in m/s, nor farther from the origin, in m: what says so is a fault of the logging.
const FASTEST_MPS: f64 = 2.0;
const FARTHEST_M: f64 = 10.0;
/// Samples as close as this share of the usual interval, but not 0.1 ms, are of one instant; so are those of the same microsecond.
const SAME_INSTANT: f64 = 0.02;
const SAME_INSTANT_S: f64 = 1e-4;
const LEAST_STEP_S: f64 = 1e-6;
/// What an ordinary drop lasts at most, in s.
const LONGEST_DROP_S: f64 = 0.1;

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
    slack: Slack,
    first_m: f64,
    /// What drives friction, in m/s, its dry state from -1 to 1, and what a steady advance at the usual speed makes of it.
    drive: f64,
    xi: f64,
    steady: f64,
    was_quiet: bool,
    /// The last step's length, and the shares of the low-passes that go with it.
    shares: [f64; 4],
    going: Going,
    in_tissue: bool,
    started: bool,
    last: Sample,
    deepest_m: f64,
    speed_mps: f64,
    low_passed_n: f64,
    above: u32,
    spikes: u8,
    /// The last sample was far off, and it is not known yet whether that was the speed.
    doubted: bool,
    /// Samples since the last rupture, and the count at which the ruptured layer is reported next.
    since: u32,
    report_at: u32,
    /// The estimator just after the last rupture, while its drop may go on.
    fallen: Option<Layers>,
    since_s: f64,
    falling: bool,
    /// The estimator as it was before the last rupture, and where that was noticed in m; where a drop that lasts began, with the variance of that
    /// in m².
    intact: Layers,
    fell_m: f64,
    lasting: Option<(f64, f64)>,
    /// Time since it was last seen to fall, in s.
    fell_s: f64,
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
            slack: Slack::new(config.stylet.false_alarms_per_hour, 0.005, &layers),
            first_m: surface_m,
            drive: 0.0,
            xi: 0.0,
            steady: 0.0,
            was_quiet: true,
            shares: [0.0; 4],
            going: Going::default(),
            in_tissue: false,
            started: false,
            last: Sample::default(),
            deepest_m: f64::NEG_INFINITY,
            speed_mps: 0.0,
            low_passed_n: 0.0,
            above: 0,
            spikes: 0,
            doubted: false,
            since: 0,
            report_at: u32::MAX,
            fallen: None,
            since_s: 0.0,
            falling: false,
            intact: layers,
            fell_m: surface_m,
            lasting: None,
            fell_s: f64::INFINITY,
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
        let numbers = [
            self.noise.variance,
            self.noise.rho,
            self.peak_n,
            self.misfit,
            self.texture,
            self.out.enhanced_n,
        ];
        numbers.iter().sum::<f64>().is_finite()
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
        // Two samples at one instant say nothing of how fast the needle goes; a clock's digits do not make two of it.
        let instant_s = (SAME_INSTANT * self.noise.step_s).clamp(LEAST_STEP_S, SAME_INSTANT_S);
        let later = sample.time_s - self.last.time_s > instant_s;
        self.out.used = sample.is_usable() && robot && (!self.started || later);
        if !self.out.used {
            return &self.out;
        }
        let last = if self.started { self.last } else { sample };
        let (velocity_mps, sudden) = self.going.speed(&last, &sample, self.speed_mps, self.shares[3]);
        let (velocity_mps, sudden) = self.set_off(&last, &sample, velocity_mps, sudden);
        let sample = Sample { velocity_mps, ..sample };
        let step = self.motion(config, &last, &sample, sudden);
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
}

#[cfg(test)]
mod tests {
    use super::gaussian::Gaussian;
    use super::*;

    /// In the first layer, 10 mm deep at 2 mm/s, at 200 Hz, with a noise of 20 mN about 0.07 N: the last sample was at 9.9 mm. The
    /// predictor expects 1.5 N and knows them to 1.73 times the noise, so that an innovation's standard deviation is 40 mN. So does the law of
    /// layers, `0.6 + 25 u + 60 x + 9000 x u + 0.07`, which knows all but the zero exactly, and that to 14 mN.
    pub(super) fn inside() -> Stylet {
        let mut stylet = Stylet::new(&EnhanceConfig::default(), 0.0);
        stylet.noise = Noise::known(0.0, 4e-4, 0.07, 400.0);
        stylet.local = Local::new(1.5);
        stylet.local.state = Gaussian::new([1.5, 0.0, 0.0, 0.0, 0.0], [3.0, 0.0, 0.0, 0.0, 0.0]);
        stylet.layers = Layers::contact(0.0, 0.0, 0.0, 100.0, 0.002, &stylet.noise);
        stylet.layers.belief =
            Gaussian::new([0.6, 60.0, 9000.0, 25.0, 0.0, 0.07], [0.0, 0.0, 0.0, 0.0, 0.0, 0.5]);
        stylet.layers.settled = true;
        (stylet.before, stylet.before_m) = (stylet.layers, 0.0097);
        (stylet.in_tissue, stylet.started, stylet.last) = (true, true, sample(0.0099, 1.5));
        (stylet.first_m, stylet.deepest_m) = (0.001, 0.0099);
        (stylet.drive, stylet.steady, stylet.speed_mps) = (0.002, 0.002, 0.002);
        (stylet.peak_n, stylet.misfit, stylet.rough) = (1.2, 1.0, 0.0);
        (stylet.since, stylet.since_s) = (100, 0.5);
        stylet
    }

    /// At this place, with this force, at 2 mm/s.
    pub(super) fn sample(position_m: f64, force_n: f64) -> Sample {
        Sample { time_s: 500.0 * position_m, position_m, velocity_mps: 0.002, force_n }
    }

    /// From 9.9 to 10 mm.
    pub(super) fn step() -> Step {
        Step { dt_s: 0.005, dz_m: 1e-4, dv_mps: 0.0, rho: 0.0, sudden: false, speed_mps: 0.002 }
    }

    pub(super) fn near(found: f64, expected: f64) {
        assert!((found - expected).abs() <= 1e-10 * expected.abs(), "{found} for {expected}");
    }

    #[test]
    fn a_sample_of_the_same_instant_or_that_no_robot_makes_is_not_used() {
        let config = EnhanceConfig::default();
        let used = |stylet: &Stylet, sample: Sample| {
            let mut stylet = *stylet;
            let used = stylet.step(&config, 0.0, sample).used;
            assert_eq!(stylet.last == sample, used);
            used
        };
        // A fiftieth of the usual step, no less than a microsecond, no more than a tenth of a millisecond.
        for (step_s, instant_s) in [(0.005, 1e-4), (0.001, 2e-5), (1e-5, 1e-6), (0.1, 1e-4)] {
            let mut stylet = inside();
            stylet.noise.step_s = step_s;
            for (share, later) in [(0.99, false), (1.01, true), (-1.01, false)] {
                let time_s = stylet.last.time_s + share * instant_s;
                // At the place and speed that the mean of the two speeds leads to.
                let position_m = stylet.last.position_m + 0.002 * (share * instant_s);
                let sample = Sample { time_s, position_m, ..stylet.last };
                assert_eq!(used(&stylet, sample), later, "{share} of {instant_s} s");
            }
        }
        let fresh = Stylet::new(&config, 0.0);
        let of =
            |position_m: f64, velocity_mps: f64| Sample { position_m, velocity_mps, ..Sample::default() };
        assert!(used(&fresh, of(-0.01, 0.002)), "the first needs none before it");
        for (position_m, v, robot) in [
            (0.0, 1.99, true),
            (0.0, 2.0, false),
            (0.0, -1.99, true),
            (0.0, -2.01, false),
            (-9.9, 0.0, true),
            (-10.1, 0.0, false),
            (-10.0, 0.0, false),
            (10.1, 0.0, false),
            (9.9, 0.0, true),
        ] {
            assert_eq!(used(&fresh, of(position_m, v)), robot, "{position_m} m, {v} m/s");
        }
        assert!(!used(&fresh, Sample { force_n: f64::NAN, ..of(-0.01, 0.002) }));
        assert!(!used(&fresh, Sample { time_s: f64::INFINITY, ..of(-0.01, 0.002) }));
    }

    #[test]
    fn what_was_said_of_a_sample_is_not_said_of_the_next() {
        let config = EnhanceConfig::default();
        let mut stylet = inside();
        stylet.out.estimate = Some(crate::sample::LayerEstimate::default());
        stylet.rupture(&step(), &sample(0.0099, 0.5), 1.3);
        assert!(stylet.out.detection.is_some());
        let out = stylet.step(&config, 0.0, Sample { force_n: f64::NAN, ..stylet.last });
        assert!(out.detection.is_none() && out.estimate.is_none() && !out.used);
        assert_eq!(stylet.work(), 60, "no more than the frame");
    }

    #[test]
    fn every_sample_costs_its_frame_and_moves_as_its_positions_do() {
        let config = EnhanceConfig::default();
        let mut stylet = inside();
        // It is said to creep, but has not moved.
        let still = Sample { time_s: 4.955, velocity_mps: 9e-6, ..stylet.last };
        stylet.step(&config, 0.0, still);
        assert_eq!((stylet.last.velocity_mps, stylet.last.position_m), (0.0, 0.0099));
        assert_eq!(stylet.work(), 60 + 158 + 136);
        assert!(stylet.out.used && stylet.started);
        // And is looked at in the air.
        let mut air = Stylet::new(&config, 0.0);
        air.step(&config, 0.0, sample(-0.01, 0.3));
        assert_eq!((air.work(), air.low_passed_n, air.is_sound()), (60, 0.3, true));
    }

    #[test]
    fn what_is_no_number_or_no_variance_is_not_sound() {
        assert!(inside().is_sound());
        let spoils: [fn(&mut Stylet, f64); 8] = [
            |s, x| s.noise.variance = x,
            |s, x| s.noise.rho = x,
            |s, x| s.peak_n = x,
            |s, x| s.misfit = x,
            |s, x| s.texture = x,
            |s, x| s.out.enhanced_n = x,
            |s, x| s.local.state.x[2] = x,
            |s, x| s.layers.belief.x[2] = x,
        ];
        for (n, spoil) in spoils.iter().enumerate() {
            for x in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                let mut stylet = inside();
                spoil(&mut stylet, x);
                assert!(!stylet.is_sound(), "{n} with {x}");
            }
        }
        for variance in [0.0, -1.0] {
            let mut stylet = inside();
            stylet.noise.variance = variance;
            assert!(!stylet.is_sound());
        }
        let mut stylet = inside();
        stylet.local.state.p[1][1] = -1.0;
        assert!(!stylet.is_sound());
        let mut stylet = inside();
        stylet.layers.belief.p[1][1] = -1.0;
        assert!(!stylet.is_sound());
    }
}
