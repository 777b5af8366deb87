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

pub mod alike;
pub mod compose;
pub mod dataset;
pub mod first;
pub mod fitted;
pub mod instrument;
pub mod laws;
pub mod left_out;
pub mod nested;
pub mod numbers;
pub mod population;
pub mod repeats;
pub mod scenario;
pub mod specimens;
pub mod study;

pub use first::Insertion;
