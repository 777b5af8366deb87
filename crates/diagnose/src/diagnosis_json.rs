//! Result of a diagnosis, serialised as `diagnosis.json` (docs/reference/files.md, section "diagnosis.json").

use crate::check_json::{CheckItem, EffectVisibility};
use crate::prediction::TrainingSummary;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use stylet_record::QualityNote;
use stylet_stats::number_format::significant;

/// Verdict of a diagnosis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The data agree with the scenario.
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

/// A value with its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// Best value.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
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
    /// Gain in nats.
    pub gain_nats: f64,
    /// Share of the base law's residual variance beyond the noise that returns without this effect, 0 to 1.
    #[serde(default)]
    pub share: f64,
    /// Paths of parameters that stand at a bound of the search: the data do not determine them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub at_bound: Vec<String>,
    /// Effects that hold this one as a special case and that these recordings cannot separate from it: the simpler one is
    /// kept, and they share its confidence.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub general_forms: Vec<String>,
    /// What else is known, such as `50 Hz mains, aliased to 30 Hz`.
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

/// A parameter of the base law.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BaseParameter {
    /// Layer, 1-based; 0 for the whole tissue.
    pub layer: usize,
    /// Name of the parameter.
    pub name: String,
    /// Value in the scenario.
    pub assumed: f64,
    /// Fitted value.
    pub value: f64,
    /// Lower end of the 95 % interval.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Whether the assumed value lies outside the interval.
    pub changed: bool,
    /// Whether the estimate lies at a bound of the tolerance.
    pub at_bound: bool,
    /// Whether the value is only a lower limit: a puncture force that no recording reached, which is at least `low`.
    #[serde(default)]
    pub at_least: bool,
    /// Whether the whole interval lies outside the tolerance that the scenario states.
    #[serde(default)]
    pub out_of_tolerance: bool,
}

/// What the recordings say about a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ParameterLabel {
    /// The data bound it on both sides, or to 10 %.
    Determined,
    /// The data bound it on one side.
    OneSided,
    /// The data do not bound it: the estimate is that of the prior.
    NotIdentifiable,
    /// Known only together with another parameter.
    TradesWith,
    /// It stands at a bound of the search.
    AtBound,
}

/// A parameter of the base law or of a cause, with what the recordings say about it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LabelledParameter {
    /// Layer, 1-based; 0 for the whole tissue and for effects.
    pub layer: usize,
    /// Effect that it belongs to; `None` for the base law.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub effect: Option<String>,
    /// Name, or path in the effect.
    pub name: String,
    /// What the recordings say about it.
    pub label: ParameterLabel,
    /// The parameter whose estimate it correlates with most, by 0.9 or more.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub trades_with: Option<String>,
    /// That correlation, -1 to 1; 0 without such a parameter.
    #[serde(default)]
    pub correlation: f64,
}

impl LabelledParameter {
    pub(crate) fn new(layer: usize, effect: Option<&str>, name: &str, label: ParameterLabel) -> Self {
        let (effect, name) = (effect.map(str::to_owned), name.to_owned());
        Self { layer, effect, name, label, trades_with: None, correlation: 0.0 }
    }
}

impl LabelledParameter {
    /// The label in words.
    #[must_use]
    pub fn label_in_words(&self) -> String {
        match (self.label, &self.trades_with) {
            (ParameterLabel::Determined, _) => "determined".to_owned(),
            (ParameterLabel::OneSided, _) => "bounded on one side only".to_owned(),
            (ParameterLabel::NotIdentifiable, _) => "not identifiable".to_owned(),
            (ParameterLabel::AtBound, _) => "at its bound".to_owned(),
            (ParameterLabel::TradesWith, Some(partner)) => {
                format!("trades with {partner}, correlation {}", significant(self.correlation, 2))
            }
            (ParameterLabel::TradesWith, None) => "trades with others".to_owned(),
        }
    }
}

impl std::fmt::Display for LabelledParameter {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        match (&self.effect, self.layer) {
            (Some(effect), _) => write!(f, "{} of {effect}", self.name),
            (None, 0) => write!(f, "{}", self.name),
            (None, layer) => write!(f, "{} of layer {layer}", self.name),
        }
    }
}

/// A parameter fitted to each recording alone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ParameterByRecording {
    /// Its name.
    pub parameter: String,
    /// Value and 95 % interval of each recording, in the order of `gain.recordings`; `None` where the recording does not determine it.
    pub estimates: Vec<Option<Estimate>>,
    /// p-value of differences as large as these when the recordings have one value (Cochran's Q).
    pub p_value: f64,
}

/// Grade of a model, or of one part of it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Letter {
    /// Predicts to the noise, from what the recordings determine.
    A,
    /// Good, with a limit that another recording would lift.
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
    /// Its letter.
    pub letter: Letter,
    /// The reason.
    pub reason: String,
}

/// Grade of an extended model.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Grade {
    /// The worst of the parts.
    pub letter: Letter,
    /// The parts.
    pub parts: Vec<GradePart>,
}

impl Grade {
    /// The letter with the reasons that keep it from being better.
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
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Gain {
    /// Whether the errors are those of held-out recordings.
    pub held_out: bool,
    /// Names of the recordings.
    pub recordings: Vec<String>,
    /// RMS error of the fitted base law in N.
    pub rmse_before_n: f64,
    /// RMS error of the extended model in N.
    pub rmse_after_n: f64,
    /// The same with ruptures, surface and friction of each recording as observed: what scatter between recordings does not
    /// explain.
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
    #[must_use]
    pub fn is_worse(&self) -> bool {
        self.rmse_after_n > MIN_WORSENING * self.rmse_before_n
    }

    /// RMS error in N that contradicts the model: beyond the scatter between recordings, or the whole error of a model that predicts
    /// worse than the base law.
    #[must_use]
    pub fn misfit_n(&self) -> f64 {
        if self.is_worse() { self.rmse_after_n } else { self.rmse_given_scatter_n }
    }
}

/// Structure that remains in the residual.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ResidualStructureReport {
    /// Smallest p-value of the residual tests, corrected for their number.
    pub p_value: f64,
    /// Features on which the residual still depends.
    pub depends_on: Vec<String>,
    /// Nats that the strongest dependence explains.
    pub nats: f64,
    /// Share of the base law's residual variance beyond the noise that the extended model does not explain, 0 to 1.
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
    /// Whether it was compared on averaged data only.
    pub screened_only: bool,
}

/// One step of the forward selection.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SearchStep {
    /// Effects in the model before this step.
    pub included: Vec<String>,
    /// Candidates, best first.
    pub candidates: Vec<SearchCandidate>,
    /// Gain in nats that the best candidate needed.
    pub required_nats: f64,
    /// The selected effect.
    pub selected: Option<String>,
}

/// Measurement noise.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
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

/// The best model beside an unmodelled force.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PartialModel {
    /// Effects of the model, causes included; some may imitate the unmodelled force.
    pub effects: Vec<String>,
    /// Share of the base law's mean square held-out error beyond the noise that the model removes, 0 to 1.
    pub share: f64,
}

/// Kind of a [`Finding`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FindingKind {
    /// The check of the recordings says that a diagnosis means nothing; it was forced.
    Unusable,
    /// The model predicts the recordings worse than noise and scatter between them explain.
    PredictionError,
    /// The residual depends on a feature.
    ResidualStructure,
    /// A parameter stands at its bound.
    AtBound,
    /// A parameter is outside the tolerance of the assumed value.
    OutOfTolerance,
    /// The recordings show another number of layers than the scenario has.
    LayerCount,
    /// Recordings differ too much for one model.
    Scatter,
    /// The noise is far above that of the scenario's sensor, or above that in air.
    NoiseLevel,
    /// A recording is not like the others.
    OutlierRecording,
    /// One recording: none could be held out.
    OneRecording,
    /// All recordings have the same motion.
    OneMotion,
}

/// A reason against agreement with the data, or for less confidence.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Finding {
    /// Kind.
    pub kind: FindingKind,
    /// The finding in words, with its numbers.
    pub message: String,
}

/// Result of a diagnosis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Diagnosis {
    /// Verdict.
    pub verdict: Verdict,
    /// Whether the simulation agrees with the data: no effect is missing, and no finding contradicts.
    #[serde(default)]
    pub agrees: bool,
    /// Grade of the extended model; `None` for data sets of specimens.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub grade: Option<Grade>,
    /// Findings that contradict agreement, or that limit the confidence.
    #[serde(default)]
    pub findings: Vec<Finding>,
    /// What the recordings allow, found before the search: `items` of `check.json`.
    #[serde(default)]
    pub check: Vec<CheckItem>,
    /// From which size on each effect of the library would be seen in these recordings.
    #[serde(default)]
    pub visible_effects: Vec<EffectVisibility>,
    /// The best model beside an unmodelled force, kept in `extended.ron`; only with the verdict `unknown`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub partial: Option<PartialModel>,
    /// Identified effects, largest gain first.
    pub causes: Vec<Cause>,
    /// Parameters of the base law as fitted.
    pub base_parameters: Vec<BaseParameter>,
    /// What the recordings say about each parameter of the base law and of the causes.
    #[serde(default)]
    pub parameters: Vec<LabelledParameter>,
    /// Covariance of these parameters, in their order and units.
    #[serde(default)]
    pub covariance: Vec<Vec<f64>>,
    /// Parameters that the recordings determine, fitted to each recording alone.
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
    /// Motions that would separate equivalent effects or show those that are not identifiable.
    pub advice: Vec<String>,
    /// What the recordings show about the extended scenario, for predictions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub training: Option<TrainingSummary>,
}
