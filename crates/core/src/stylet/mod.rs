//! `algorithm: Stylet`: one pass, no buffer, a bounded handful of operations per sample. The derivation stands in
//! `docs/enhancer.md`.

mod contact_detection;
mod cusum;
mod force_predictor;
mod free_tip;
mod gaussian;
mod layer_estimator;
mod motion;
mod noise_estimator;
mod output;
mod retraction_tracker;
mod rupture_detection;
mod shaft_friction;
mod tissue_update;
mod velocity_estimator;

use crate::config::EnhanceConfig;
use crate::sample::{Output, Sample};
use cusum::CusumBank;
use force_predictor::{ForcePredictor, MotionStep};
use free_tip::FreeTipDetector;
use layer_estimator::{LayerEstimator, PassedLayers};
use noise_estimator::NoiseEstimator;
use rupture_detection::DropCandidate;
use shaft_friction::DryShaftFriction;
use tissue_update::FAILED_MISFIT;
use velocity_estimator::VelocityEstimator;

/// Stiffest tissue that a needle is pushed into, in N/m: how wide a slope is before it is known.
const MAX_STIFFNESS_N_PER_M: f64 = 2000.0;
/// Multiplications and additions of what every sample costs beside the beliefs, and of a rupture (a linear map of six unknowns).
const OPERATIONS_PER_SAMPLE: u32 = 60;
const OPERATIONS_PER_RUPTURE: u32 = 2 * 216 + 2 * 126 + 2 * 84;
/// No needle is faster, in m/s, nor farther from the origin, in m: what says so is a fault of the logging.
const MAX_SPEED_MPS: f64 = 2.0;
const MAX_POSITION_M: f64 = 10.0;
/// Samples as close as this share of the usual interval, but not 0.1 ms, are of one instant; so are those of the same microsecond.
const DUPLICATE_INTERVAL_SHARE: f64 = 0.02;
const MAX_DUPLICATE_INTERVAL_S: f64 = 1e-4;
const MIN_DUPLICATE_INTERVAL_S: f64 = 1e-6;
/// What an ordinary drop lasts at most, in s.
const MAX_DROP_DURATION_S: f64 = 0.1;

/// What is remembered from sample to sample.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stylet {
    noise: NoiseEstimator,
    predictor: ForcePredictor,
    cusum: CusumBank,
    estimator: LayerEstimator,
    /// The estimator as it was when the alarm's sums left zero, and the position then.
    snapshot: LayerEstimator,
    snapshot_m: f64,
    passed_layers: PassedLayers,
    free_tip: FreeTipDetector,
    contact_sample_m: f64,
    /// What drives friction, in m/s, its dry state from -1 to 1, and what a steady advance at the usual speed makes of it.
    friction_drive_mps: f64,
    presliding_state: f64,
    steady_drive_mps: f64,
    cusum_was_zero: bool,
    /// The last step's length, and the shares of the low-passes that go with it.
    low_pass_gains: [f64; 4],
    velocity_estimator: VelocityEstimator,
    in_tissue: bool,
    started: bool,
    last_sample: Sample,
    deepest_m: f64,
    speed_mps: f64,
    low_passed_n: f64,
    samples_above_threshold: u32,
    spike_samples: u8,
    /// The last sample was far off, and it is not known yet whether that was the speed.
    deferred: bool,
    /// Samples since the last rupture, and the count at which the ruptured layer is reported next.
    samples_since_rupture: u32,
    next_report_at: u32,
    /// The estimator just after the last rupture, while its drop may go on.
    post_rupture: Option<LayerEstimator>,
    time_since_rupture_s: f64,
    drop_continues: bool,
    /// The estimator as it was before the last rupture, and where that was noticed in m; where a drop that lasts began, with the variance of that
    /// in m².
    pre_rupture: LayerEstimator,
    alarm_m: f64,
    drop_onset: Option<(f64, f64)>,
    /// Time since it was last seen to fall, in s.
    time_since_falling_s: f64,
    candidate: Option<DropCandidate>,
    /// Size of the last fall that was looked at, and its standard deviation, in N.
    last_drop_n: (f64, f64),
    level_before_fall_n: f64,
    dry_friction: DryShaftFriction,
    /// The law of layers has failed: friction is taken as dry.
    base_law_failed: bool,
    release_window_s: f64,
    /// Largest force so far in N, noise smoothed away.
    peak_force_n: f64,
    /// Mean squared standardised error of the estimator over the last travel: one where its law holds.
    misfit: f64,
    /// How far the law of layers fails, 0 to 1; and then, how much rougher the force is than the sensor's noise (a variance ratio).
    misfit_weight: f64,
    roughness: f64,
    /// Least fall that is a rupture, in N.
    min_drop_n: f64,
    shaft_friction_variance: f64,
    /// Multiplications and additions of the last sample.
    operations: u32,
    output: Output,
}

impl Stylet {
    pub(crate) fn new(config: &EnhanceConfig, surface_m: f64) -> Self {
        let noise = NoiseEstimator::new(config.contact_search.min_noise_n);
        let layers = LayerEstimator::at_contact(surface_m, 0.0, 0.0, 1.0, 1.0, &noise);
        Self {
            noise,
            predictor: ForcePredictor::new(0.0),
            cusum: CusumBank::new(config.stylet.false_alarms_per_hour, 0.005),
            estimator: layers,
            snapshot: layers,
            snapshot_m: surface_m,
            passed_layers: PassedLayers::default(),
            free_tip: FreeTipDetector::new(config.stylet.false_alarms_per_hour, 0.005, &layers),
            contact_sample_m: surface_m,
            friction_drive_mps: 0.0,
            presliding_state: 0.0,
            steady_drive_mps: 0.0,
            cusum_was_zero: true,
            low_pass_gains: [0.0; 4],
            velocity_estimator: VelocityEstimator::default(),
            in_tissue: false,
            started: false,
            last_sample: Sample::default(),
            deepest_m: f64::NEG_INFINITY,
            speed_mps: 0.0,
            low_passed_n: 0.0,
            samples_above_threshold: 0,
            spike_samples: 0,
            deferred: false,
            samples_since_rupture: 0,
            next_report_at: u32::MAX,
            post_rupture: None,
            time_since_rupture_s: 0.0,
            drop_continues: false,
            pre_rupture: layers,
            alarm_m: surface_m,
            drop_onset: None,
            time_since_falling_s: f64::INFINITY,
            candidate: None,
            last_drop_n: (0.0, 0.0),
            level_before_fall_n: 0.0,
            dry_friction: DryShaftFriction::default(),
            base_law_failed: false,
            release_window_s: 0.0,
            peak_force_n: 0.0,
            misfit: FAILED_MISFIT,
            misfit_weight: 1.0,
            roughness: 1.0,
            min_drop_n: 0.0,
            shaft_friction_variance: 0.0,
            operations: 0,
            output: Output::default(),
        }
    }

    pub(crate) fn is_numerically_valid(&self) -> bool {
        let numbers = [
            self.noise.variance,
            self.noise.rho,
            self.peak_force_n,
            self.misfit,
            self.roughness,
            self.output.enhanced_n,
        ];
        numbers.iter().sum::<f64>().is_finite()
            && self.noise.variance > 0.0
            && self.predictor.belief.is_positive_definite()
            && self.estimator.belief.is_positive_definite()
    }

    pub(crate) fn operation_count(&self) -> u32 {
        self.operations
    }

    pub(crate) fn output(&self) -> &Output {
        &self.output
    }

    #[inline]
    pub(crate) fn step(&mut self, config: &EnhanceConfig, surface_m: f64, sample: Sample) -> &Output {
        self.output.detection = None;
        self.output.estimate = None;
        self.operations = OPERATIONS_PER_SAMPLE;
        let robot = sample.velocity_mps.abs() < MAX_SPEED_MPS && sample.position_m.abs() < MAX_POSITION_M;
        // Two samples at one instant say nothing of how fast the needle goes; a clock's digits do not make two of it.
        let instant_s = (DUPLICATE_INTERVAL_SHARE * self.noise.interval_s)
            .clamp(MIN_DUPLICATE_INTERVAL_S, MAX_DUPLICATE_INTERVAL_S);
        let later = sample.time_s - self.last_sample.time_s > instant_s;
        self.output.used = sample.is_usable() && robot && (!self.started || later);
        if !self.output.used {
            return &self.output;
        }
        let last = if self.started { self.last_sample } else { sample };
        let (velocity_mps, sudden) =
            self.velocity_estimator.update(&last, &sample, self.speed_mps, self.low_pass_gains[3]);
        let (velocity_mps, sudden) = self.resolve_motion_start(&last, &sample, velocity_mps, sudden);
        let sample = Sample { velocity_mps, ..sample };
        let step = self.motion_step(config, &last, &sample, sudden);
        self.update_friction_drive(config, &step, &sample);
        if self.in_tissue {
            self.update_in_tissue(config, &step, &sample);
        } else {
            self.detect_contact(config, surface_m, &step, &sample);
        }
        self.last_sample = sample;
        self.started = true;
        self.write_output(config, &sample);
        &self.output
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
        stylet.noise = NoiseEstimator::known(0.0, 4e-4, 0.07, 400.0);
        stylet.predictor = ForcePredictor::new(1.5);
        stylet.predictor.belief = Gaussian::new([1.5, 0.0, 0.0, 0.0, 0.0], [3.0, 0.0, 0.0, 0.0, 0.0]);
        stylet.estimator = LayerEstimator::at_contact(0.0, 0.0, 0.0, 100.0, 0.002, &stylet.noise);
        stylet.estimator.belief =
            Gaussian::new([0.6, 60.0, 9000.0, 25.0, 0.0, 0.07], [0.0, 0.0, 0.0, 0.0, 0.0, 0.5]);
        stylet.estimator.layer_confirmed = true;
        (stylet.snapshot, stylet.snapshot_m) = (stylet.estimator, 0.0097);
        (stylet.in_tissue, stylet.started, stylet.last_sample) = (true, true, sample(0.0099, 1.5));
        (stylet.contact_sample_m, stylet.deepest_m) = (0.001, 0.0099);
        (stylet.friction_drive_mps, stylet.steady_drive_mps, stylet.speed_mps) = (0.002, 0.002, 0.002);
        (stylet.peak_force_n, stylet.misfit, stylet.misfit_weight) = (1.2, 1.0, 0.0);
        (stylet.samples_since_rupture, stylet.time_since_rupture_s) = (100, 0.5);
        stylet
    }

    /// At this place, with this force, at 2 mm/s.
    pub(super) fn sample(position_m: f64, force_n: f64) -> Sample {
        Sample { time_s: 500.0 * position_m, position_m, velocity_mps: 0.002, force_n }
    }

    /// From 9.9 to 10 mm.
    pub(super) fn step() -> MotionStep {
        MotionStep { dt_s: 0.005, dz_m: 1e-4, dv_mps: 0.0, rho: 0.0, sudden: false, speed_mps: 0.002 }
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
            assert_eq!(stylet.last_sample == sample, used);
            used
        };
        // A fiftieth of the usual step, no less than a microsecond, no more than a tenth of a millisecond.
        for (step_s, instant_s) in [(0.005, 1e-4), (0.001, 2e-5), (1e-5, 1e-6), (0.1, 1e-4)] {
            let mut stylet = inside();
            stylet.noise.interval_s = step_s;
            for (share, later) in [(0.99, false), (1.01, true), (-1.01, false)] {
                let time_s = stylet.last_sample.time_s + share * instant_s;
                // At the place and speed that the mean of the two speeds leads to.
                let position_m = stylet.last_sample.position_m + 0.002 * (share * instant_s);
                let sample = Sample { time_s, position_m, ..stylet.last_sample };
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
        stylet.output.estimate = Some(crate::sample::LayerEstimate::default());
        stylet.declare_rupture(&step(), &sample(0.0099, 0.5), 1.3);
        assert!(stylet.output.detection.is_some());
        let out = stylet.step(&config, 0.0, Sample { force_n: f64::NAN, ..stylet.last_sample });
        assert!(out.detection.is_none() && out.estimate.is_none() && !out.used);
        assert_eq!(stylet.operation_count(), 60, "no more than the frame");
    }

    #[test]
    fn every_sample_costs_its_frame_and_moves_as_its_positions_do() {
        let config = EnhanceConfig::default();
        let mut stylet = inside();
        // It is said to creep, but has not moved.
        let still = Sample { time_s: 4.955, velocity_mps: 9e-6, ..stylet.last_sample };
        stylet.step(&config, 0.0, still);
        assert_eq!((stylet.last_sample.velocity_mps, stylet.last_sample.position_m), (0.0, 0.0099));
        assert_eq!(stylet.operation_count(), 60 + 158 + 136);
        assert!(stylet.output.used && stylet.started);
        // And is looked at in the air.
        let mut air = Stylet::new(&config, 0.0);
        air.step(&config, 0.0, sample(-0.01, 0.3));
        assert_eq!((air.operation_count(), air.low_passed_n, air.is_numerically_valid()), (60, 0.3, true));
    }

    #[test]
    fn what_is_no_number_or_no_variance_is_not_sound() {
        assert!(inside().is_numerically_valid());
        let spoils: [fn(&mut Stylet, f64); 8] = [
            |s, x| s.noise.variance = x,
            |s, x| s.noise.rho = x,
            |s, x| s.peak_force_n = x,
            |s, x| s.misfit = x,
            |s, x| s.roughness = x,
            |s, x| s.output.enhanced_n = x,
            |s, x| s.predictor.belief.x[2] = x,
            |s, x| s.estimator.belief.x[2] = x,
        ];
        for (n, spoil) in spoils.iter().enumerate() {
            for x in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                let mut stylet = inside();
                spoil(&mut stylet, x);
                assert!(!stylet.is_numerically_valid(), "{n} with {x}");
            }
        }
        for variance in [0.0, -1.0] {
            let mut stylet = inside();
            stylet.noise.variance = variance;
            assert!(!stylet.is_numerically_valid());
        }
        let mut stylet = inside();
        stylet.predictor.belief.p[1][1] = -1.0;
        assert!(!stylet.is_numerically_valid());
        let mut stylet = inside();
        stylet.estimator.belief.p[1][1] = -1.0;
        assert!(!stylet.is_numerically_valid());
    }
}
