//! A stack of two layers and outputs of a core.

use stylet_core::{Cause, Detection, LayerEstimate, Output};
use stylet_record::TrueRupture;
use stylet_score::LayerTruth;

/// Layers from 10 to 20 mm and from 20 to 25 mm.
pub const LAYERS: [LayerTruth; 2] = [
    LayerTruth { front_m: 0.010, thickness_m: 0.010, stiffness_n_per_m: 40.0, friction_ns_per_m2: 2000.0 },
    LayerTruth { front_m: 0.020, thickness_m: 0.005, stiffness_n_per_m: 100.0, friction_ns_per_m2: 3000.0 },
];

pub fn rupture(layer: usize, time_s: f64, position_m: f64) -> TrueRupture {
    TrueRupture { layer, time_s, position_m, by_force: false }
}

pub fn detection(layer: usize, time_s: f64) -> Detection {
    Detection {
        layer,
        time_s,
        position_m: 0.002 * time_s,
        located_s: time_s,
        located_m: 0.002 * time_s,
        cause: Cause::Cusum,
        drop_n: 0.0,
        drop_sd_n: 0.0,
        confidence: 0.0,
    }
}

/// Output with a detection.
pub fn detection_output(detection: Detection) -> Output {
    Output { detection: Some(detection), used: true, ..Output::default() }
}

/// Output with a layer estimate.
pub fn estimate_output(estimate: LayerEstimate) -> Output {
    Output { estimate: Some(estimate), used: true, ..Output::default() }
}

#[track_caller]
pub fn near(found: Option<f64>, wanted: f64) {
    assert!(
        found.is_some_and(|f| (f - wanted).abs() <= 1e-12 * wanted.abs()),
        "{found:?} instead of {wanted}"
    );
}
