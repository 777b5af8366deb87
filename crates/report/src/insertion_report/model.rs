//! The columns and numbers of one insertion, as the report needs them.

use crate::chart_model::Series;

/// Origin of the results, sufficient to reproduce them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Provenance {
    /// File name of the scenario or configuration.
    pub scenario_file: String,
    /// The resolved scenario with all defaults (RON).
    pub scenario_text: String,
    /// Command that reproduces the run.
    pub command: String,
    /// Seed of the random numbers; `None` for measured data.
    pub seed: Option<u64>,
    /// Version of Stylet.
    pub version: String,
    /// Hash of the results.
    pub hash: String,
}

/// A measured force: one per sensor.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ForceTrace {
    /// Name of the sensor, such as `force_torque`.
    pub sensor: String,
    /// Axial force in N, positive against the insertion.
    pub force_n: Vec<f64>,
}

/// True properties of a layer.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TrueLayer {
    /// Name.
    pub name: String,
    /// Depth of the front face.
    pub front_m: f64,
    /// Thickness.
    pub thickness_m: f64,
    /// Stiffness `K` in N/m.
    pub stiffness_n_per_m: f64,
    /// Friction `b` per metre of needle inside.
    pub friction_ns_per_m2: f64,
    /// Time at which the tip entered it (contact, or the previous rupture); `None` if never.
    pub entered_s: Option<f64>,
    /// Time of its rupture; `None` if never.
    pub ruptured_s: Option<f64>,
}

/// A true rupture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TrueRupture {
    /// Layer, counted from 1.
    pub layer: usize,
    /// Time in s, interpolated between samples.
    pub time_s: f64,
    /// Depth of the tip.
    pub depth_m: f64,
    /// `far face` or `puncture force`.
    pub cause: String,
}

/// Ground truth of a simulation.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Truth {
    /// Tip force `f - D v` with the true `D`, per sample.
    pub tip_force_n: Vec<f64>,
    /// True cumulative friction `D` of the ruptured layers, per sample; may be empty.
    pub cumulative_friction_ns_per_m: Vec<f64>,
    /// Layers, front to back.
    pub layers: Vec<TrueLayer>,
    /// Ruptures in order of time.
    pub ruptures: Vec<TrueRupture>,
}

/// A detected rupture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Detection {
    /// Time of the detection in s.
    pub time_s: f64,
    /// Position of the tip at that time.
    pub depth_m: f64,
    /// Detector: `CUSUM`, `force derivative`.
    pub trigger: String,
    /// Layer (from 1) of the true rupture it was matched to; `None` when false or when there is no truth.
    pub matched_layer: Option<usize>,
}

/// An interval in which the detection's state machine is in one state.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StateSpan {
    /// `NoRupture`, `ExpectedRupture`, `DetectedRupture`, `ForceDropMeasuring`, `ForceCompensation`; others are drawn too.
    pub state: String,
    /// Begin.
    pub from_s: f64,
    /// End.
    pub to_s: f64,
}

/// Final estimates of one layer. Relative errors are `(estimate - truth) / truth`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LayerEstimate {
    /// Layer, counted from 1.
    pub layer: usize,
    /// Time at which the re-weighted estimate became available (end of the force-drop measurement, or of the data); its point is drawn
    /// there when the layer's interval is not known from contact and detections.
    pub time_s: f64,
    /// Re-weighted stiffness.
    pub stiffness_n_per_m: Option<f64>,
    /// Half its 95 % interval, if the algorithm estimates it.
    pub stiffness_half_width: Option<f64>,
    /// Its relative error.
    pub stiffness_error: Option<f64>,
    /// Re-weighted friction per metre of needle (ML model).
    pub friction_ns_per_m2: Option<f64>,
    /// Re-weighted friction of the whole layer (KV model).
    pub friction_ns_per_m: Option<f64>,
    /// Half the 95 % interval of the friction, if the algorithm estimates it.
    pub friction_half_width: Option<f64>,
    /// Relative error of the friction.
    pub friction_error: Option<f64>,
    /// Estimated thickness.
    pub thickness_m: Option<f64>,
    /// Its relative error.
    pub thickness_error: Option<f64>,
    /// Stiffness from the offline least-squares fit over the whole layer.
    pub offline_stiffness_n_per_m: Option<f64>,
    /// Friction per metre of needle from the offline fit (ML model).
    pub offline_friction_ns_per_m2: Option<f64>,
    /// Friction of the whole layer from the offline fit (KV model).
    pub offline_friction_ns_per_m: Option<f64>,
    /// Whether the motion within the layer separates stiffness from friction in the offline fit.
    pub offline_separable: Option<bool>,
}

/// A true rupture and its matched detection.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RuptureScore {
    /// Layer, counted from 1.
    pub layer: usize,
    /// Detection minus truth; `None` when missed.
    pub delay_s: Option<f64>,
    /// Travel between the two.
    pub delay_m: Option<f64>,
    /// Time of the matched detection in s.
    pub detected_s: Option<f64>,
    /// Detector that raised it.
    pub trigger: String,
}

/// The score of a combination against the truth.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Score {
    /// One per true rupture, in the order of [`Truth::ruptures`].
    pub ruptures: Vec<RuptureScore>,
    /// True ruptures without a detection.
    pub missed: usize,
    /// Detections without a true rupture.
    pub false_detections: usize,
    /// Median delay over the found ruptures.
    pub median_delay_s: Option<f64>,
    /// The same in travel.
    pub median_delay_m: Option<f64>,
    /// True cumulative friction `D` at the end of the advance.
    pub true_cumulative_friction_ns_per_m: Option<f64>,
    /// Estimated `D` at that time.
    pub cumulative_friction_ns_per_m: Option<f64>,
    /// Its relative error.
    pub cumulative_friction_error: Option<f64>,
    /// RMS of the enhanced force's error over RMS of the tip force.
    pub enhancement_rms_relative: Option<f64>,
    /// After the tip left the last layer: RMS of the enhanced over RMS of the measured force.
    pub after_exit_relative: Option<f64>,
}

/// Results of one combination of algorithm, model and sensor.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Combination {
    /// Name, such as `paper/ml/force_torque`.
    pub name: String,
    /// Sensor it processed (see [`ForceTrace::sensor`]).
    pub sensor: String,
    /// Time of first contact in s, known or detected.
    pub contact_s: Option<f64>,
    /// How the recording begins, in words: position of the contact with its interval, and the baseline in air.
    pub contact: String,
    /// Reconstructed force: regressor times estimates plus `D v`.
    pub reconstructed_force_n: Vec<f64>,
    /// Enhanced force `f - D v`.
    pub enhanced_force_n: Vec<f64>,
    /// Lower end of the 95 % interval of the tip force in N; NaN without one.
    pub tip_force_low_n: Vec<f64>,
    /// Upper end of the 95 % interval of the tip force in N; NaN without one.
    pub tip_force_high_n: Vec<f64>,
    /// Online stiffness.
    pub stiffness_n_per_m: Vec<f64>,
    /// Online friction per metre of needle (ML model); empty for KV.
    pub friction_ns_per_m2: Vec<f64>,
    /// Online friction of the layer (KV model); empty for ML.
    pub friction_ns_per_m: Vec<f64>,
    /// Online cumulative friction `D`.
    pub cumulative_friction_ns_per_m: Vec<f64>,
    /// CUSUM statistic `g`.
    pub cusum_n2: Vec<f64>,
    /// Its alarm threshold.
    pub cusum_threshold_n2: Option<f64>,
    /// Whether the statistic is divided by its threshold and has no unit.
    pub cusum_is_normalised: bool,
    /// Drift `nu` subtracted from the squared reconstruction error at each sample, in N²; `None` where the statistic is
    /// normalised.
    pub cusum_drift_n2: Option<f64>,
    /// Filtered force derivative.
    pub force_derivative_n_per_s: Vec<f64>,
    /// Upper threshold of the derivative: a rupture is expected.
    pub derivative_on_n_per_s: Option<f64>,
    /// Lower threshold of the derivative: the trailing edge.
    pub derivative_off_n_per_s: Option<f64>,
    /// States of the detection, contiguous.
    pub states: Vec<StateSpan>,
    /// Detected ruptures.
    pub detections: Vec<Detection>,
    /// Times at which `D` was increased, in s.
    pub compensations_s: Vec<f64>,
    /// Final estimate per layer.
    pub layers: Vec<LayerEstimate>,
    /// RMS of the reconstruction error.
    pub reconstruction_rms_n: Option<f64>,
    /// Score; `None` without truth.
    pub score: Option<Score>,
}

/// All data of the report of one insertion.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RunReport {
    /// Title: the scenario's name.
    pub title: String,
    /// The scenario's source: paper and figure.
    pub source: String,
    /// Origin of the results.
    pub provenance: Provenance,
    /// Warnings about the data and repairs, shown first.
    pub notes: Vec<String>,
    /// What was done with the data and is no reason to doubt them, such as conversions of units.
    pub remarks: Vec<String>,
    /// Sample times in s, increasing.
    pub time_s: Vec<f64>,
    /// Tip position in m, positive into the tissue.
    pub position_m: Vec<f64>,
    /// Tip velocity in m/s.
    pub velocity_mps: Vec<f64>,
    /// Measured force of every sensor.
    pub forces: Vec<ForceTrace>,
    /// Ground truth; `None` for measured data.
    pub truth: Option<Truth>,
    /// One or more evaluations of the same data.
    pub combinations: Vec<Combination>,
}

impl RunReport {
    /// `what`, with the name of the combination if there are several.
    pub(super) fn label(&self, combination: &Combination, what: &str) -> String {
        if self.combinations.len() > 1 { format!("{what} · {}", combination.name) } else { what.to_owned() }
    }

    /// The curve of the `index`-th combination, widened by the number of curves drawn over it so that identical curves stay visible.
    pub(super) fn visible_below(&self, series: Series, index: usize) -> Series {
        let above = self.combinations.len().saturating_sub(index + 1);
        let width_px = series.width_px + 1.6 * above as f64;
        series.width(width_px)
    }

    pub(super) fn end_s(&self) -> f64 {
        self.time_s.last().copied().unwrap_or_default()
    }
}
