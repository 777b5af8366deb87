//! An enhancer in a known state, for the tests of its parts.

use super::force_predictor::{ForcePredictor, MotionStep};
use super::gaussian::Gaussian;
use super::layer_estimator::LayerEstimator;
use super::noise_estimator::NoiseEstimator;
use super::retraction_tracker::ShaftSample;
use super::state::KalmanEnhancer;
use crate::config::EnhanceConfig;
use crate::sample::Sample;

/// In the first layer, 10 mm deep at 2 mm/s and 200 Hz; noise of 20 mN, bias 0.07 N; the last sample was at 9.9 mm. The predictor
/// expects 1.5 N with an innovation standard deviation of 40 mN. The layer estimator expects the same,
/// `0.6 + 25 u + 60 x + 9000 x u + 0.07`, with all parameters exact but the bias, whose standard deviation is 14 mN.
pub(super) fn inside() -> KalmanEnhancer {
    let mut stylet = KalmanEnhancer::new(&EnhanceConfig::default(), 0.0);
    stylet.noise = NoiseEstimator::known(0.0, 4e-4, 0.07, 400.0);
    stylet.predictor = ForcePredictor::new(1.5);
    stylet.predictor.state = Gaussian::new([1.5, 0.0, 0.0, 0.0, 0.0], [3.0, 0.0, 0.0, 0.0, 0.0]);
    stylet.estimator = LayerEstimator::at_contact(0.0, 0.0, 0.0, 100.0, 0.002, &stylet.noise);
    stylet.estimator.state = Gaussian::new(
        [0.6, 60.0, 9000.0, 25.0, 0.0, 0.07, 0.0, 0.0],
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0],
    );
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

/// An advancing sample without smoothing.
pub(super) fn advancing(position_m: f64, force_n: f64) -> ShaftSample {
    ShaftSample {
        gain: 1.0,
        position_m,
        force_n,
        advancing: true,
        retracting: false,
        peak_force_n: 4.0,
        released: false,
        noise_variance_n2: 1e-4,
        track_retraction: true,
    }
}

pub(super) fn retracting(position_m: f64, force_n: f64) -> ShaftSample {
    ShaftSample { advancing: false, retracting: true, ..advancing(position_m, force_n) }
}
