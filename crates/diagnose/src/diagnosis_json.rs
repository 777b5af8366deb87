//! Result of a diagnosis, serialised as `diagnosis.json` (docs/reference/files.md, section "diagnosis.json").

use crate::check_json::{CheckItem, EffectVisibility};
pub use crate::parameter_json::{
    BaseParameter, Estimate, LabelledParameter, ParameterByRecording, ParameterLabel,
};
use crate::prediction::TrainingSummary;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use stylet_record::QualityNote;

/// Verdict of a diagnosis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The data agree with the scenario.
    #[default]
    None,
    /// One or more effects were identified.
    Named,
    /// Several effects explain the data equally well.
    Ambiguous,
    /// The residual has structure that no effect of the library explains.
    Unknown,
    /// No effect is missing, but parameters of the base law are outside their tolerance.
    Parameters,
}

/// An identified effect.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Cause {
    /// Identifier of the effect.
    pub effect: String,
    /// Effects that explain the data equally well, to within 3 nats.
    pub equivalent: Vec<String>,
    /// Posterior probability of this effect among the candidates tried.
    pub confidence: f64,
    /// Estimates by parameter path.
    pub parameters: BTreeMap<String, Estimate>,
    /// Gain over the model without it, in nats.
    pub gain_nats: f64,
    /// Share (0 to 1) of the base law's residual variance above the noise that reappears without this effect.
    #[serde(default)]
    pub share: f64,
    /// Paths of parameters at a bound of the search, which the data do not determine.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub at_bound: Vec<String>,
    /// Effects that include this one as a special case and that these recordings cannot distinguish from it. The simpler effect is kept,
    /// and all share its confidence.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub general_forms: Vec<String>,
    /// Remark, such as `50 Hz mains, aliased to 30 Hz`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub remark: Option<String>,
}

/// An effect that was found but is negligible, or that does not improve the prediction of held-out recordings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NegligibleEffect {
    /// Identifier of the effect.
    pub effect: String,
    /// Estimates by parameter path.
    pub parameters: BTreeMap<String, Estimate>,
    /// Why it is not reported as a cause.
    pub reason: String,
}

/// Grade of a model, or of one part of it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Letter {
    /// Predicts to within the noise, with determined parameters.
    A,
    /// Good, with a limitation that another recording would remove.
    B,
    /// Use with care.
    C,
    /// Do not rely on it.
    #[default]
    D,
}

/// One part of a grade.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct GradePart {
    /// `error`, `residual`, `parameters`, `causes` or `recordings`.
    pub part: String,
    /// Letter of this part.
    pub letter: Letter,
    /// The reason.
    pub reason: String,
}

/// Grade of an extended model.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Grade {
    /// The worst letter of the parts.
    pub letter: Letter,
    /// The parts.
    pub parts: Vec<GradePart>,
}

impl Grade {
    /// The letter with the reasons for it.
    #[must_use]
    pub fn sentence(&self) -> String {
        let worst: Vec<&str> = self
            .parts
            .iter()
            .filter(|p| p.letter == self.letter && p.letter > Letter::A)
            .map(|p| p.reason.as_str())
            .collect();
        let reasons = if worst.is_empty() { String::new() } else { format!(": {}", worst.join("; ")) };
        format!("grade {:?}{reasons}", self.letter)
    }
}

/// Improvement of the prediction.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Gain {
    /// Whether the errors are those of held-out recordings instead of fitted ones.
    pub held_out: bool,
    /// Names of the recordings.
    pub recordings: Vec<String>,
    /// RMS error of the fitted base law in N.
    pub rmse_before_n: f64,
    /// RMS error of the extended model in N.
    pub rmse_after_n: f64,
    /// RMS error (N) of the extended model given the observed ruptures, surface and friction of each recording, so that scatter between
    /// recordings does not count.
    #[serde(default)]
    pub rmse_given_scatter_n: f64,
    /// Standard deviation of the noise in N.
    pub floor_n: f64,
    /// Errors of base law and extended model per recording, in N.
    pub per_recording_n: Vec<(f64, f64)>,
}

/// A model predicts worse than the base law when its RMS error is larger by this factor.
const MIN_WORSENING: f64 = 1.25;

impl Gain {
    /// Whether held-out recordings are predicted worse than by the base law.
    pub(crate) fn is_worse(&self) -> bool {
        self.rmse_after_n > MIN_WORSENING * self.rmse_before_n
    }

    /// RMS error in N that contradicts the model: beyond the scatter between recordings, or the whole error of a model that predicts
    /// worse than the base law.
    pub(crate) fn misfit_n(&self) -> f64 {
        if self.is_worse() { self.rmse_after_n } else { self.rmse_given_scatter_n }
    }
}

/// Structure that remains in the residual.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ResidualStructureReport {
    /// Smallest p-value of the residual tests, corrected for their number.
    pub p_value: f64,
    /// Features on which the residual still depends.
    pub depends_on: Vec<String>,
    /// Gain (nats) of a model of the strongest dependence.
    pub nats: f64,
    /// Share (0 to 1) of the base law's residual variance above the noise that the extended model does not explain.
    #[serde(default)]
    pub share: f64,
}

/// A candidate of one step of the search.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SearchCandidate {
    /// Identifier of the effect.
    pub effect: String,
    /// Gain in nats over the model before this step.
    pub gain_nats: f64,
    /// Number of fitted parameters.
    pub parameters: usize,
    /// Whether it was compared only on averaged data.
    pub screened_only: bool,
}

/// One step of the forward selection.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SearchStep {
    /// Effects in the model before this step.
    pub included: Vec<String>,
    /// Candidates, best first.
    pub candidates: Vec<SearchCandidate>,
    /// Gain in nats required of the best candidate.
    pub required_nats: f64,
    /// The selected effect.
    pub selected: Option<String>,
}

/// Measurement noise.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct NoiseReport {
    /// Standard deviation in N.
    pub sd_n: f64,
    /// First two autoregressive coefficients, per block.
    pub ar: [f64; 2],
    /// Whether the noise was estimated from motion in air before the tissue.
    pub from_air: bool,
}

/// Standard deviations of the random effects between recordings.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RandomEffectSd {
    /// Relative standard deviation of the puncture force.
    pub puncture: f64,
    /// Standard deviation in m of the depth at which a layer ruptures.
    pub rupture_depth_m: f64,
    /// Standard deviation in m of the surface position; 0 where it is common to all recordings.
    pub surface_m: f64,
    /// Relative standard deviation of friction; 0 where it is common to all recordings.
    pub friction: f64,
}

/// A note on data quality.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DataQualityNote {
    /// Name of the recording.
    pub recording: String,
    /// The note.
    #[serde(flatten)]
    pub note: QualityNote,
}

/// The best model in the presence of an unmodelled force.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PartialModel {
    /// Effects of the model, causes included; some may imitate the unmodelled force.
    pub effects: Vec<String>,
    /// Share (0 to 1) of the base law's mean square held-out error above the noise that the model removes.
    pub share: f64,
}

/// A variable that the residual is a function of.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CarryingVariable {
    /// Name of the variable, as in formulas of custom effects; `path` is the length of the whole path.
    pub variable: String,
    /// How the function `f` of the variable enters the force.
    pub factor: String,
    /// Gain in nats of a piecewise linear function on recordings that were left out.
    pub gain_nats: f64,
}

/// The residual as a function of the variable that carries most of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ResidualCurve {
    /// Name of the variable.
    pub variable: String,
    /// Its unit.
    pub unit: String,
    /// How the function `f` enters the force.
    pub factor: String,
    /// Values of the variable.
    pub x: Vec<f64>,
    /// The function there.
    pub value: Vec<f64>,
    /// Lower ends of 95 % intervals (jackknife over recordings).
    pub low: Vec<f64>,
    /// Upper ends.
    pub high: Vec<f64>,
}

/// A formula for the residual, to try as a custom effect.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ProposedFormula {
    /// Name of the effect in `proposed_effects.ron`.
    pub name: String,
    /// The force in N.
    pub formula: String,
    /// The variable of the formula.
    pub variable: String,
    /// Fitted parameters.
    pub parameters: BTreeMap<String, f64>,
    /// Number of parameters.
    pub complexity: usize,
    /// RMS error in N on held-out recordings.
    pub held_out_n: f64,
}

/// What is known of a force that no effect of the library explains: no verdict, but what to try.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ProposedFormulas {
    /// Variables that the residual is a function of, largest gain first.
    pub variables: Vec<CarryingVariable>,
    /// The residual as a function of the first of them.
    pub curve: ResidualCurve,
    /// Formulas, smallest error first.
    pub proposals: Vec<ProposedFormula>,
}

/// Kind of a [`Finding`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FindingKind {
    /// The check rates the recordings unusable; the diagnosis was forced.
    Unusable,
    /// Prediction errors exceed noise and scatter between recordings.
    PredictionError,
    /// The residual depends on a feature.
    ResidualStructure,
    /// A parameter is at its bound.
    AtBound,
    /// A parameter is outside the tolerance of the assumed value.
    OutOfTolerance,
    /// The recordings have another number of layers than the scenario.
    LayerCount,
    /// Recordings differ too much for one model.
    Scatter,
    /// The noise is far above that of the scenario's sensor, or above that in air.
    NoiseLevel,
    /// A recording differs from all others.
    OutlierRecording,
    /// The search for effects ended at its limit.
    SearchLimit,
    /// With one recording, none can be held out.
    OneRecording,
    /// All recordings have the same motion.
    OneMotion,
}

/// A reason against agreement, or for less confidence.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Finding {
    /// Kind.
    pub kind: FindingKind,
    /// The finding in words, with its numbers.
    pub message: String,
}

/// Result of a diagnosis.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Diagnosis {
    /// Verdict.
    pub verdict: Verdict,
    /// Whether the simulation agrees with the data: no effect is missing, and no finding contradicts it.
    #[serde(default)]
    pub agrees: bool,
    /// Grade of the extended model; `None` for data sets of specimens.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub grade: Option<Grade>,
    /// Findings that contradict agreement, or that limit the confidence.
    #[serde(default)]
    pub findings: Vec<Finding>,
    /// Check of the recordings before the search: `items` of `check.json`.
    #[serde(default)]
    pub check: Vec<CheckItem>,
    /// Detectable size of each library effect in these recordings.
    #[serde(default)]
    pub visible_effects: Vec<EffectVisibility>,
    /// The best model in the presence of an unmodelled force.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub partial: Option<PartialModel>,
    /// Formulas for an unmodelled force, to try as custom effects.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub formulas: Option<ProposedFormulas>,
    /// Identified effects, largest gain first.
    pub causes: Vec<Cause>,
    /// Parameters of the base law as fitted.
    pub base_parameters: Vec<BaseParameter>,
    /// Identifiability of each parameter of the base law and of the causes.
    #[serde(default)]
    pub parameters: Vec<LabelledParameter>,
    /// Covariance of these parameters, in their order and units.
    #[serde(default)]
    pub covariance: Vec<Vec<f64>>,
    /// Determined parameters, fitted to each recording alone.
    #[serde(default)]
    pub by_recording: Vec<ParameterByRecording>,
    /// Effects that are not identifiable from these recordings.
    pub not_identifiable: Vec<String>,
    /// Improvement of the prediction.
    pub gain: Gain,
    /// Effects that were found but are negligible.
    #[serde(default)]
    pub negligible: Vec<NegligibleEffect>,
    /// Structure that remains in the residual.
    pub residual_structure: ResidualStructureReport,
    /// Notes on data quality.
    pub data_quality: Vec<DataQualityNote>,
    /// Steps of the search.
    pub search_steps: Vec<SearchStep>,
    /// Measurement noise.
    pub noise: NoiseReport,
    /// Standard deviations of the random effects.
    #[serde(default)]
    pub random_effect_sd: RandomEffectSd,
    /// Motions that would distinguish equivalent effects or make effects identifiable.
    pub advice: Vec<String>,
    /// Summary of the recordings for predictions with the extended scenario.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub training: Option<TrainingSummary>,
}
