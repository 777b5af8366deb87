//! Result of the instrument assessment.

use crate::diagnosis_json::{Cause, Estimate};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use stylet_tissue::{AnyEffect, Effect};

/// Confidence in a fault that was measured directly, without a tissue model.
const DETECTION_CONFIDENCE: f64 = 0.99;

/// Result of the instrument assessment.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct InstrumentReport {
    /// Standard deviation of the noise in air (N).
    pub noise_n: Option<f64>,
    /// Lag-one autocorrelation of the noise.
    pub ar1: Option<f64>,
    /// Force in air at the start of a recording (N).
    pub bias_n: Option<f64>,
    /// Drift of the force in air over a recording (N).
    pub drift_n: Option<f64>,
    /// Drift of each recording (N/s) that begins and ends in air.
    #[serde(skip)]
    pub drifts_n_per_s: Vec<Option<f64>>,
    /// Amplitude (N) and frequency (Hz) of the strongest tone in air.
    pub tone: Option<(f64, f64)>,
    /// Half the force difference (N) between forward and backward motion in air.
    pub drive_friction_n: Option<f64>,
    /// Measured over known force minus one.
    pub gain: Option<f64>,
    /// Delay of the force (s).
    #[serde(default)]
    pub delay_s: Option<f64>,
    /// Low-pass time constant of the force (s).
    #[serde(default)]
    pub lag_s: Option<f64>,
    /// Excluded faults.
    pub excluded: Vec<ExcludedFault>,
    /// Detected faults.
    #[serde(default)]
    pub detected: Vec<DetectedFault>,
}

/// A detected fault.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DetectedFault {
    /// Effect id.
    pub effect: String,
    /// Parameters by path.
    pub parameters: BTreeMap<String, Estimate>,
    /// Largest force (N) caused in these recordings.
    pub max_force_n: f64,
    /// Measured evidence in words.
    pub evidence: String,
    /// The effect, used for the correction.
    #[serde(skip)]
    pub effect_model: Option<AnyEffect>,
}

impl DetectedFault {
    /// A fault with estimates of its first parameters.
    pub(super) fn new(
        effect_model: AnyEffect,
        estimates: impl IntoIterator<Item = Estimate>,
        max_force_n: f64,
        evidence: String,
    ) -> Self {
        let info = effect_model.info();
        let paths = info.parameters.iter().map(|p| p.path.to_owned());
        let (effect, parameters) = (info.id.to_owned(), paths.zip(estimates).collect());
        Self { effect, parameters, max_force_n, evidence, effect_model: Some(effect_model) }
    }

    /// Whether the recordings are corrected for it; block means remove tones, and drive friction stays.
    pub(crate) fn is_corrected(&self) -> bool {
        let stays =
            |e: &AnyEffect| matches!(e, AnyEffect::PeriodicInterference(_) | AnyEffect::DriveFriction(_));
        self.effect_model.as_ref().is_some_and(|e| !stays(e))
    }

    /// The fault as a cause of a diagnosis.
    #[must_use]
    pub fn cause(&self) -> Cause {
        Cause {
            effect: self.effect.clone(),
            confidence: DETECTION_CONFIDENCE,
            parameters: self.parameters.clone(),
            ..Cause::default()
        }
    }
}

/// A fault that the checks exclude.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ExcludedFault {
    /// Effect id.
    pub effect: String,
    /// Largest possible force (N) in these recordings.
    pub max_force_n: f64,
    /// Measured evidence in words.
    pub evidence: String,
}
