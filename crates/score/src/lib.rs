//! Scores of the online core: simulated recordings against their ground truth, measured recordings against the raw force. The
//! scores are defined in `docs/reference/model.md`.
#![forbid(unsafe_code)]

mod contact_finding;
mod enhancement_trace;
mod enhancer_with_model;
mod force_falls;
mod found_layers;
mod measured_score;
mod offline_least_squares;
mod rupture_matching;
mod score;
mod scorer;

pub use contact_finding::{ContactAssessor, ContactFinding, ContactHypothesis};
pub use enhancement_trace::{Trace, algorithm_name, coefficients, model_name, score_run};
pub use enhancer_with_model::{
    EnhancerWithModel, MAX_STORED_SAMPLES, RecordingScale, enhancer_for, enhancer_in_units,
};
pub use force_falls::{
    CLEAR_FALL_RATIO, ForceFall, MINOR_FALL_RATIO, ReferenceFalls, deepest_samples, describe_reference_falls,
    force_falls, reference_falls,
};
pub use found_layers::{FoundLayer, MIN_FORCE_SHARE, found_layers};
pub use measured_score::{MeasuredRecording, MeasuredScore, ModelFrictionScore};
pub use offline_least_squares::{LayerSample, OfflineEstimate, fit_layer_offline};
pub use rupture_matching::{MATCH_EARLIEST_S, MATCH_LATEST_S, RuptureScore, match_ruptures};
pub use score::{Coverage, EnhancementScore, EstimateError, LayerScore, Score};
pub use scorer::{EnhancedSample, Scorer, TrueSample};
pub use stylet_record::LayerTruth;

/// The example of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
pub struct Readme;
