//! Score of one simulated run.

use crate::rupture_matching::RuptureScore;
use serde::{Deserialize, Serialize};

/// An estimate and its error.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct EstimateError {
    /// True value.
    #[serde(rename = "true")]
    pub truth: f64,
    /// Online estimate; `null` without one.
    pub estimated: Option<f64>,
    /// `|estimated - true| / true`; `null` without an estimate or when the true value is zero.
    pub relative_error: Option<f64>,
}

impl EstimateError {
    /// A true value of zero has no relative error.
    #[must_use]
    pub fn new(truth: f64, estimated: Option<f64>) -> Self {
        let relative_error = estimated.filter(|_| truth != 0.0).map(|e| ((e - truth) / truth).abs());
        Self { truth, estimated, relative_error }
    }
}

/// Coefficients of one layer.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LayerScore {
    /// Layer, 1-based.
    pub layer: usize,
    /// Stiffness `K_i` in N/m.
    pub stiffness_n_per_m: EstimateError,
    /// Friction `b_i` in N s/m²; a Kelvin-Voigt estimate (N s/m) is divided by the thickness.
    pub friction_ns_per_m2: EstimateError,
    /// Thickness `d_i` in m. A layer that ruptures before its far face is estimated thinner.
    pub thickness_m: EstimateError,
    /// Cumulative friction in N s/m after this layer; the true value is `sum b_j l_j` at its rupture.
    pub cumulative_friction_ns_per_m: EstimateError,
    /// Offline least squares over the whole layer, stiffness in N/m.
    pub offline_stiffness_n_per_m: Option<f64>,
    /// Offline least squares over the whole layer, friction in N s/m².
    pub offline_friction_ns_per_m2: Option<f64>,
    /// The data alone separate stiffness from friction; otherwise the force drop decided the split.
    pub offline_separable: Option<bool>,
}

/// Accuracy of the enhanced force.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct EnhancementScore {
    /// RMS of `f_enh - (f - D_true v)` over the RMS of the tip force, first contact to deepest point.
    pub rms_relative: Option<f64>,
    /// RMS of estimated less true friction over the RMS of the tip force: as `rms_relative`
    /// without the sensor noise.
    pub friction_rms_relative: Option<f64>,
    /// As `rms_relative`, up to the time at which the tip leaves the last layer.
    pub in_tissue_relative: Option<f64>,
    /// RMS of `f_enh` over RMS of `f` after the tip has left the last layer; `null` if it never does.
    pub after_exit_relative: Option<f64>,
}

/// Score of one model on one sensor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Score {
    /// Every true rupture.
    pub ruptures: Vec<RuptureScore>,
    /// True ruptures without a detection.
    pub missed: usize,
    /// Detections without a true rupture.
    #[serde(rename = "false")]
    pub false_alarms: usize,
    /// Times of the false detections in s.
    pub false_s: Vec<f64>,
    /// More than one false detection per true rupture: matches may be by chance.
    pub hits_are_chance: bool,
    /// Every ruptured layer.
    pub layers: Vec<LayerScore>,
    /// Cumulative friction `D` in N s/m at the last true rupture.
    pub cumulative_friction_ns_per_m: EstimateError,
    /// Position of the first contact in m; `relative_error` is not defined.
    pub contact_m: EstimateError,
    /// Enhanced force against the tip force.
    pub enhancement: EnhancementScore,
    /// RMS of the innovation `e` in N, from first contact to the deepest point.
    pub reconstruction_rms_n: Option<f64>,
    /// Coverage of the intervals.
    pub coverage: Coverage,
}

/// Counts `[inside, total]` of true values in the 95 % intervals; zero for an algorithm without intervals.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Coverage {
    /// Stiffness of the ruptured layers.
    pub stiffness: [f64; 2],
    /// Friction of the ruptured layers.
    pub friction: [f64; 2],
    /// Cumulative friction after each.
    pub cumulative: [f64; 2],
    /// Tip force, sample by sample from first contact to the deepest point.
    pub band: [f64; 2],
}

impl Score {
    /// Median detection delay in s over the detected ruptures.
    #[must_use]
    pub fn median_delay_s(&self) -> Option<f64> {
        let delays: Vec<f64> = self.ruptures.iter().filter_map(|r| r.delay_s).collect();
        (!delays.is_empty()).then(|| stylet_stats::median_of(delays))
    }

    /// Largest relative error of the stiffness over the layers.
    #[must_use]
    pub fn worst_stiffness_error(&self) -> Option<f64> {
        worst(self.layers.iter().map(|l| l.stiffness_n_per_m))
    }

    /// Largest relative error of the friction over the layers.
    #[must_use]
    pub fn worst_friction_error(&self) -> Option<f64> {
        worst(self.layers.iter().map(|l| l.friction_ns_per_m2))
    }
}

fn worst(values: impl Iterator<Item = EstimateError>) -> Option<f64> {
    values.filter_map(|c| c.relative_error).max_by(f64::total_cmp)
}
