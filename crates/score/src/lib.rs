//! Scores: what the online algorithm found against what the simulation knows (SPEC section 10).
#![forbid(unsafe_code)]

mod enhancement_trace;
mod enhancer_with_model;
mod measured_score;
mod model_friction_score;
mod offline_least_squares;
mod rupture_matching;
mod score;
mod scorer;

pub use enhancement_trace::{Trace, algorithm_name, coefficients, model_name, score_run};
pub use enhancer_with_model::{EnhancerWithModel, MAX_STORED_SAMPLES, enhancer_for};
pub use measured_score::{MeasuredRecording, MeasuredScore};
pub use model_friction_score::ModelFrictionScore;
pub use offline_least_squares::{LayerSample, OfflineEstimate, fit_layer_offline};
pub use rupture_matching::{MATCH_EARLIEST_S, MATCH_LATEST_S, RuptureScore, match_ruptures};
pub use score::{Coverage, EnhancementScore, EstimateError, LayerScore, Score};
pub use scorer::{EnhancedSample, Scorer, TrueSample};
pub use stylet_record::LayerTruth;
