//! Scores: what the online algorithm found against what the simulation knows (SPEC section 10).
#![forbid(unsafe_code)]

mod detection;
mod hearing;
mod offline;
mod online;
mod score;
mod scorer;
mod trace;
mod with_law;

pub use detection::{EARLIEST_S, LATEST_S, RuptureScore, match_ruptures};
pub use hearing::{Hearing, STORAGE_SAMPLES, core_for};
pub use offline::{LayerSample, OfflineEstimate, offline};
pub use online::{Measured, Online};
pub use score::{Compared, Coverage, EnhancementScore, LayerScore, Score};
pub use scorer::{Heard, Moment, Scorer};
pub use stylet_record::LayerTruth;
pub use trace::{Trace, algorithm_name, coefficients, model_name, score_run};
pub use with_law::WithLaw;
