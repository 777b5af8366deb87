//! Statistics, each in one place.
//!
//! | module | what |
//! |---|---|
//! | [`order`] | median, quantiles (one definition), MAD scale, interval of a quantile |
//! | [`interval`] | Wilson interval of a rate, Student interval of a mean |
//! | [`normal`], [`student`], [`tails`] | distributions: densities, tails, quantiles |
//! | [`robust`] | Huber and Student losses, weights, M-estimate of location |
//! | [`ar`] | autoregressive noise: fit, order, exact whitening, likelihood |
//! | [`foretell`] | what the numbers of a row foretell of its first one, by robust least squares |
//! | [`moments`] | sums in order, compensated; running mean and variance |
//! | [`select`] | quantiles of more numbers than memory holds |
//! | [`linear`] | small dense matrices: Cholesky, products |
//! | [`spectrum`] | power of evenly sampled columns, its lines |
//! | [`number_format`] | numbers as text: significant digits, per cent, p-values |
//! | [`rank`] | ranks and Spearman's correlation |
//!
//! Everything is `f64`, deterministic (`libm`, sums in the order given: the same bits on every machine and for any
//! number of threads), and held against SciPy in `tests/against_scipy.rs`.
//!
//! Undefined results are `NaN` (as in NumPy): the median of nothing, a quantile at a probability outside 0 to 1.

pub mod autoregressive;
pub mod confidence_interval;
pub mod interpolation;
pub mod linear_algebra;
pub mod moments;
pub mod normal;
pub mod number_format;
pub mod order_statistics;
pub mod rank_correlation;
pub mod robust_linear_prediction;
pub mod robust_loss;
pub mod special_functions;
pub mod spectrum;
pub mod streaming_quantiles;
pub mod student_t;

pub use autoregressive::{Ar, Criterion};
pub use confidence_interval::{Interval, mean_interval, wilson, wilson_at};
pub use interpolation::interpolate;
pub use moments::{Moments, Sum, mean, rms, sd, variance};
pub use order_statistics::{
    MAD_TO_SD, extremes, mad_scale, median, median_of, quantile, quantile_interval, quantile_of,
    quantile_of_sorted, sorted, third_difference_sd,
};
pub use rank_correlation::spearman;
pub use robust_loss::Loss;
pub use streaming_quantiles::quantiles_of_stream;

/// Standard deviation of a number spread evenly over one, to three digits.
pub const UNIFORM_SD: f64 = 0.289;

/// Half width of the two-sided 95 % interval of a normal distribution, in standard deviations.
pub const Z95: f64 = 1.959_963_984_540_054;
