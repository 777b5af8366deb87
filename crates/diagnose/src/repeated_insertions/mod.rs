//! Sets of repeated insertions on the one engine: what varies between recordings and days is random, the law is shared.
//!
//! | module | what lives there |
//! |---|---|
//! | [`dataset`] | the description of a set, its files |
//! | [`first`] | the first guess: what the raw force says of faces, loads and releases |
//! | [`fitted`] | the fit from several starts, judged by the law's own discrepancy |
//! | [`laws`] | the base law, what the library adds, a shaft that slips: which predicts recordings left out |
//! | [`population`] | an insertion nobody has seen: draws from what varies, mean and band |
//! | [`nested`](mod@nested) | parts of the set predicted by laws that were chosen without them |
//! | [`alike`](mod@alike) | what runs of one speed leave alike, learned beside the law |
//! | [`left_out`] | recordings and whole days left out; the mean of the others as the floor; by phase |
//! | [`instrument`] | what a motion in air and a known load show of the instrument, and what they exclude |
//! | [`compose`] | layers measured alone, put together |
//! | [`study`](mod@study) | all of it; [`numbers`], [`repeats`](mod@repeats) and [`scenario`] say it |
//! | [`specimens`] | many specimens, each indented once and held |

pub mod cross_validation;
pub mod dataset;
pub mod diagnose_set;
pub mod empirical_discrepancy;
pub mod indentation_relaxation;
pub mod instrument_faults;
pub mod layer_composition;
pub mod mean_scenario;
pub mod model_selection;
pub mod multistart_fit;
pub mod nested_cross_validation;
pub mod parameter_estimates;
pub mod population_prediction;
pub mod repeatability_report;
pub mod start_values;

pub use start_values::SegmentedRecording;
