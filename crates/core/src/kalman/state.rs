//! State of the algorithm between samples.

use super::baseline::AirBaseline;
use super::continued_drop::ContinuedDrop;
use super::cusum::CusumBank;
use super::force_predictor::ForcePredictor;
use super::free_tip::FreeTipDetector;
use super::layer_estimator::{LayerEstimator, PassedLayers};
use super::noise_estimator::NoiseEstimator;
use super::shaft_friction::DryShaftFriction;
use super::velocity_estimator::VelocityEstimator;
use super::zero_step_state::{Jump, ZeroStepTest};
use crate::config::EnhanceConfig;
use crate::sample::{Output, Sample};

/// Largest misfit (mean squared standardised innovation) at which the layer estimator feeds the CUSUMs. Even if its excess
/// over 1 is a constant offset, 0.45 standard deviations, they do not drift.
pub(super) const MAX_ALARM_MISFIT: f64 = 1.2;
/// Prior standard deviation of an unknown slope in N/m: that of the stiffest tissue.
pub(super) const MAX_STIFFNESS_N_PER_M: f64 = 2000.0;
/// Multiplications and additions of a rupture (linear maps of six and five unknowns).
pub(super) const OPERATIONS_PER_RUPTURE: u32 = 2 * 216 + 2 * 126 + 2 * 84;
/// Size of a drop in standard deviations that noise exceeds once in 30 000 tests: the smallest drop where the base law holds.
pub(super) const SURE_DROP_SDS: f64 = 4.0;
/// Longest duration of an ordinary drop, in s.
pub(super) const MAX_DROP_DURATION_S: f64 = 0.1;
/// Misfit from which the base law is rejected; also the initial value, so that the law is used only after it has fitted data.
pub(super) const FAILED_MISFIT: f64 = 3.0;

#[derive(Clone, Copy, Debug)]
pub(crate) struct KalmanEnhancer {
    pub(super) noise: NoiseEstimator,
    pub(super) predictor: ForcePredictor,
    pub(super) cusum: CusumBank,
    pub(super) estimator: LayerEstimator,
    /// Estimator and position when the CUSUM last left zero.
    pub(super) snapshot: LayerEstimator,
    pub(super) snapshot_m: f64,
    pub(super) passed_layers: PassedLayers,
    pub(super) free_tip: FreeTipDetector,
    pub(super) contact_sample_m: f64,
    /// Friction drive in m/s, dry-friction state from -1 to 1, and the drive at a steady advance at the usual speed.
    pub(super) friction_drive_mps: f64,
    pub(super) presliding_state: f64,
    pub(super) steady_drive_mps: f64,
    pub(super) cusum_was_zero: bool,
    /// Duration of the last step, and the low-pass gains for it: speed, smoothed force, velocity disagreement.
    pub(super) low_pass_gains: [f64; 4],
    pub(super) velocity_estimator: VelocityEstimator,
    pub(super) in_tissue: bool,
    pub(super) started: bool,
    pub(super) last_sample: Sample,
    pub(super) deepest_m: f64,
    pub(super) speed_mps: f64,
    pub(super) low_passed_n: f64,
    pub(super) samples_above_threshold: u32,
    pub(super) samples_below_threshold: u32,
    /// Number of consecutive samples off the baseline at which the hypotheses in air are evaluated next.
    pub(super) next_air_evaluation_at: u32,
    pub(super) baseline: AirBaseline,
    /// The contact was configured, not detected, and is not revised.
    pub(super) contact_given: bool,
    pub(super) spike_samples: u8,
    pub(super) jump: Jump,
    /// The last rupture explained as a step of the sensor's zero instead.
    pub(super) zero_step_test: Option<ZeroStepTest>,
    /// The decision on the last sample, far from the prediction, waits for the next: the velocity may have jumped.
    pub(super) deferred: bool,
    /// Position in m of an alarm that was not declared because the needle may have stopped there.
    pub(super) waiting_from_m: Option<f64>,
    /// The needle does not advance.
    pub(super) stop: Option<Stop>,
    /// Samples since the last rupture, and the count at which the ruptured layer is reported next.
    pub(super) samples_since_rupture: u32,
    pub(super) next_report_at: u32,
    /// Estimator just after the last rupture, while its drop may continue.
    pub(super) post_rupture: Option<LayerEstimator>,
    pub(super) time_since_rupture_s: f64,
    pub(super) drop_continues: bool,
    /// Estimator before the last rupture, and the position in m at which the alarm was raised.
    pub(super) pre_rupture: LayerEstimator,
    pub(super) alarm_m: f64,
    /// Estimated start of a long drop in m, and its variance in m².
    pub(super) drop_onset: Option<(f64, f64)>,
    pub(super) time_since_falling_s: f64,
    pub(super) candidate: Option<DropCandidate>,
    /// Size of the last drop candidate and its standard deviation, in N.
    pub(super) last_drop_n: (f64, f64),
    pub(super) level_before_fall_n: f64,
    /// The drop of the last rupture, while it may continue.
    pub(super) continued_drop: Option<ContinuedDrop>,
    pub(super) dry_friction: DryShaftFriction,
    /// The base law is rejected; friction is modelled as dry.
    pub(super) base_law_failed: bool,
    pub(super) release_window_s: f64,
    /// Largest smoothed force so far in N.
    pub(super) peak_force_n: f64,
    /// Mean squared standardised innovation of the layer estimator over the recent travel; one where the base law holds.
    pub(super) misfit: f64,
    /// Degree to which the base law fails, 0 to 1, and the recent mean squared standardised innovation of the predictor.
    pub(super) misfit_weight: f64,
    pub(super) roughness: f64,
    /// Smallest drop that counts as a rupture, in N.
    pub(super) min_drop_n: f64,
    pub(super) shaft_friction_variance: f64,
    /// Multiplications and additions of the last sample.
    pub(super) operations: u32,
    pub(super) output: Output,
}

/// A stop of the needle, or a retraction.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stop {
    /// Time since the needle last advanced, in s.
    pub(super) duration_s: f64,
    /// Lowest force in N that the loss of friction may leave.
    pub(super) lowest_n: f64,
}

/// A drop of the force that may be a rupture.
#[derive(Clone, Copy, Debug)]
pub(super) struct DropCandidate {
    pub(super) from_n: f64,
    pub(super) mean_n: f64,
    /// Mean of the prediction by the layer estimator's snapshot minus the measured force.
    pub(super) missing_n: f64,
    pub(super) duration_s: f64,
    pub(super) count: f64,
}

impl KalmanEnhancer {
    pub(crate) fn new(config: &EnhanceConfig, surface_m: f64) -> Self {
        let noise = NoiseEstimator::new(config.contact_search.min_noise_n);
        let estimator = LayerEstimator::at_contact(surface_m, 0.0, 0.0, 1.0, 1.0, &noise);
        let per_hour = config.stylet.false_alarms_per_hour;
        Self {
            noise,
            predictor: ForcePredictor::new(0.0),
            cusum: CusumBank::new(per_hour, 0.005),
            estimator,
            snapshot: estimator,
            snapshot_m: surface_m,
            passed_layers: PassedLayers::default(),
            free_tip: FreeTipDetector::new(per_hour, 0.005, &estimator),
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
            samples_below_threshold: 0,
            next_air_evaluation_at: 0,
            baseline: AirBaseline::new(noise.min_variance()),
            contact_given: false,
            spike_samples: 0,
            jump: Jump::default(),
            zero_step_test: None,
            deferred: false,
            waiting_from_m: None,
            stop: None,
            samples_since_rupture: 0,
            next_report_at: u32::MAX,
            post_rupture: None,
            time_since_rupture_s: 0.0,
            drop_continues: false,
            pre_rupture: estimator,
            alarm_m: surface_m,
            drop_onset: None,
            time_since_falling_s: f64::INFINITY,
            candidate: None,
            last_drop_n: (0.0, 0.0),
            level_before_fall_n: 0.0,
            continued_drop: None,
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
            && self.predictor.state.is_positive_definite()
            && self.estimator.state.is_positive_definite()
    }

    pub(crate) fn operation_count(&self) -> u32 {
        self.operations
    }

    pub(crate) fn output(&self) -> &Output {
        &self.output
    }

    /// Marks the last sample as the first after a restart.
    pub(crate) fn mark_restarted(&mut self) -> &Output {
        self.output.restarted = true;
        &self.output
    }
}
