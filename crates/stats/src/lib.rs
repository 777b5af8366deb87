//! Statistics and small numerics.
//!
//! | module | contents |
//! |---|---|
//! | [`order_statistics`] | median, quantiles (one definition), interval of a quantile |
//! | [`streaming_quantiles`] | exact quantiles of more values than fit into memory |
//! | [`confidence_interval`] | Wilson interval of a rate, Student interval of a mean |
//! | [`normal`], [`student_t`] | density, tails, quantiles |
//! | [`special_functions`] | incomplete gamma and beta functions, chi-square tail |
//! | [`moments`] | mean, variance, RMS |
//! | [`robust_loss`] | Huber loss and weight |
//! | [`robust_linear_prediction`] | linear prediction by robust least squares |
//! | [`golden_section`](mod@golden_section) | minimum of a function of one variable |
//! | [`least_squares`] | linear least squares by normal equations |
//! | [`linear_algebra`] | small dense matrices: Cholesky factor, scalar product |
//! | [`spectrum`] | power spectrum of evenly sampled signals, detection of tones |
//! | [`number_format`] | numbers as text: significant digits, per cent, p-values |
//! | [`parallel`] | parallel maps in order |
//! | [`interpolation`], [`rank_correlation`] | linear interpolation; ranks and Spearman's correlation |
//!
//! All functions use `f64` and are deterministic (`libm`, sums in the order given: the same bits on every machine and for
//! any number of threads); `tests/against_scipy.rs` compares them with SciPy. Undefined results are `NaN`, as in NumPy:
//! the median of an empty slice, a quantile at a probability outside 0 to 1.

pub mod confidence_interval;
pub mod golden_section;
pub mod interpolation;
pub mod least_squares;
pub mod linear_algebra;
pub mod moments;
pub mod normal;
pub mod number_format;
pub mod order_statistics;
pub mod parallel;
pub mod rank_correlation;
pub mod robust_linear_prediction;
pub mod robust_loss;
pub mod special_functions;
pub mod spectrum;
pub mod streaming_quantiles;
pub mod student_t;

pub use confidence_interval::{Interval, mean_interval, wilson, wilson_at};
pub use golden_section::golden_section;
pub use interpolation::interpolate;
pub use moments::{UNIFORM_SD, mean, rms, sd, variance};
pub use normal::Z95;
pub use order_statistics::{
    MAD_TO_SD, extremes, median, median_of, quantile, quantile_interval, quantile_of, quantile_of_sorted,
    sorted, third_difference_sd,
};
pub use rank_correlation::spearman;
pub use streaming_quantiles::quantiles_of_stream;

/// Compiles the examples of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadmeExamples;
