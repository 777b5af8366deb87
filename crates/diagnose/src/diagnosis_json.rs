//! What a diagnosis says: `diagnosis.json` (SPEC section 7).

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use stylet_record::QualityNote;

/// The verdict.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The simulation agrees with the data.
    None,
    /// One or more causes.
    Named,
    /// One class of effects that these data cannot tell apart.
    Ambiguous,
    /// Structure that no effect of the library explains.
    Unknown,
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

/// One cause.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cause {
    /// Effect, by its id.
    pub effect: String,
    /// Effects that explain the data as well, to within 3 nats.
    pub equivalent: Vec<String>,
    /// Probability that it is this one of the rivals tried.
    pub confidence: f64,
    /// Parameters by their paths.
    pub parameters: BTreeMap<String, Estimate>,
    /// Nats that it gains.
    pub gain_nats: f64,
    /// Share of what the base law leaves beyond the noise that is left again without it, 0 to 1.
    #[serde(default)]
    pub share: f64,
}

/// An effect that was found and is too small to matter, or that does not pay on recordings left out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NegligibleEffect {
    /// Effect, by its id.
    pub effect: String,
    /// Parameters by their paths.
    pub parameters: BTreeMap<String, Estimate>,
    /// Why it is no cause.
    pub reason: String,
}

/// A base parameter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BaseParameter {
    /// Layer, 1-based; 0 for what belongs to the whole stack.
    pub layer: usize,
    /// Field of the layer.
    pub name: String,
    /// What the scenario assumed.
    pub assumed: f64,
    /// Fitted value.
    pub value: f64,
    /// Lower end of the 95 % interval.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Whether the assumed value lies outside the interval.
    pub changed: bool,
    /// Whether the value stands at a bound of the tolerance.
    pub at_bound: bool,
}

/// The gain.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Gain {
    /// Whether the recordings took no part in the fit.
    pub held_out: bool,
    /// The recordings.
    pub recordings: Vec<String>,
    /// Root mean square of the re-fitted base law's residual in N.
    pub rmse_before_n: f64,
    /// Of the extended model's.
    pub rmse_after_n: f64,
    /// Standard deviation of the noise.
    pub floor_n: f64,
    /// Per recording: before and after in N.
    pub per_recording_n: Vec<(f64, f64)>,
}

/// What remains.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ResidualStructureReport {
    /// p-value of the strongest structure, corrected for looking at several.
    pub p_value: f64,
    /// What the residual still depends on.
    pub depends_on: Vec<String>,
    /// Nats that the strongest dependence explains.
    pub nats: f64,
    /// Share of what the base law leaves beyond the noise that is still left, 0 to 1.
    #[serde(default)]
    pub share: f64,
}

/// One rival of a step of the search.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SearchCandidate {
    /// Effect.
    pub effect: String,
    /// Nats gained over the model that stood.
    pub gain_nats: f64,
    /// Numbers fitted.
    pub parameters: usize,
    /// True when compared on averages only.
    pub screened_only: bool,
}

/// One step of the search.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SearchStep {
    /// Effects that stood.
    pub included: Vec<String>,
    /// Rivals, best first.
    pub candidates: Vec<SearchCandidate>,
    /// Nats that the best needed.
    pub required_nats: f64,
    /// The effect taken.
    pub selected: Option<String>,
}

/// The noise.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct NoiseReport {
    /// Standard deviation in N.
    pub sd_n: f64,
    /// Autoregressive coefficients per sample.
    pub ar: [f64; 2],
    /// Whether there was enough air before the tissue to tell it from the law's errors.
    pub from_air: bool,
}

/// How insertions differ from one another beyond what the law says: standard deviations.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RandomEffectSd {
    /// Of the force at which a layer is punctured, relative.
    pub puncture: f64,
    /// Of the place at which a layer gives way, in m.
    pub rupture_depth_m: f64,
    /// Of the surface, in m; 0 where one surface does for all.
    pub surface_m: f64,
    /// Of friction, relative; 0 where one does for all.
    pub friction: f64,
}

/// A remark on the data.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DataQualityNote {
    /// Recording.
    pub recording: String,
    /// Remark.
    #[serde(flatten)]
    pub note: QualityNote,
}

/// The diagnosis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Diagnosis {
    /// Verdict.
    pub verdict: Verdict,
    /// Causes, strongest first.
    pub causes: Vec<Cause>,
    /// Base parameters as fitted.
    pub base_parameters: Vec<BaseParameter>,
    /// Effects that this experiment cannot show.
    pub not_identifiable: Vec<String>,
    /// Gain.
    pub gain: Gain,
    /// Effects found that are too small to matter.
    #[serde(default)]
    pub negligible: Vec<NegligibleEffect>,
    /// What remains.
    pub residual_structure: ResidualStructureReport,
    /// Data quality.
    pub data_quality: Vec<DataQualityNote>,
    /// What was tried.
    pub search_steps: Vec<SearchStep>,
    /// Noise.
    pub noise: NoiseReport,
    /// What differs from insertion to insertion.
    #[serde(default)]
    pub random_effect_sd: RandomEffectSd,
    /// What would split an ambiguous class or show what is invisible.
    pub advice: Vec<String>,
}
