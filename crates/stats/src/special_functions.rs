//! Incomplete gamma and beta functions, and the tail of the chi-square distribution.
//!
//! Series and continued fractions (Lentz) as in Abramowitz and Stegun 6.5.29, 6.5.31, 26.5.8.

/// Most terms of a series or continued fraction; the tested range needs less than a tenth.
const MAX_TERMS: usize = 10_000;
/// Relative size of a negligible term.
const NEGLIGIBLE: f64 = 1e-16;
/// Replaces a vanishing denominator in Lentz's method.
const TINY: f64 = 1e-300;

/// Lower and upper regularised incomplete gamma function `(P(a, x), Q(a, x))`, `a > 0`, `x >= 0`; the smaller one keeps
/// its relative accuracy.
#[must_use]
pub fn regularised_gamma(a: f64, x: f64) -> (f64, f64) {
    if !(a > 0.0 && x >= 0.0) {
        return (f64::NAN, f64::NAN);
    }
    if x == 0.0 {
        return (0.0, 1.0);
    }
    if x == f64::INFINITY {
        return (1.0, 0.0);
    }
    let front = libm::exp(a * libm::log(x) - x - libm::lgamma(a));
    if x < a + 1.0 {
        let (mut term, mut sum) = (1.0 / a, 1.0 / a);
        for n in 1..MAX_TERMS {
            term *= x / (a + n as f64);
            sum += term;
            if term < sum * NEGLIGIBLE {
                break;
            }
        }
        let p = (front * sum).min(1.0);
        return (p, 1.0 - p);
    }
    let mut b = x + 1.0 - a;
    let (mut c, mut d) = (1.0 / TINY, 1.0 / b);
    let mut h = d;
    for n in 1..MAX_TERMS {
        let n = n as f64;
        let an = -n * (n - a);
        b += 2.0;
        d = 1.0 / away_from_zero(an * d + b);
        c = away_from_zero(b + an / c);
        h *= d * c;
        if (d * c - 1.0).abs() < NEGLIGIBLE {
            break;
        }
    }
    let q = (front * h).min(1.0);
    (1.0 - q, q)
}

/// Regularised incomplete beta function `I_x(a, b)` with `y = 1 - x` given, which keeps the accuracy for `x` close to one.
pub(crate) fn regularised_beta(a: f64, b: f64, x: f64, y: f64) -> f64 {
    if x <= 0.0 {
        return 0.0;
    }
    if y <= 0.0 {
        return 1.0;
    }
    let ln_front = a * ln_of(x, y) + b * ln_of(y, x) - ln_beta(a, b);
    let front = libm::exp(ln_front);
    if x < (a + 1.0) / (a + b + 2.0) {
        (front * beta_fraction(a, b, x) / a).min(1.0)
    } else {
        (1.0 - front * beta_fraction(b, a, y) / b).max(0.0)
    }
}

/// `ln x` for `x = 1 - y`, exact near one.
fn ln_of(x: f64, y: f64) -> f64 {
    if y < 0.5 { libm::log1p(-y) } else { libm::log(x) }
}

/// Logarithm of the beta function, without cancellation where one argument is much larger than the other.
pub(crate) fn ln_beta(a: f64, b: f64) -> f64 {
    /// Argument from which five terms of Stirling's series are exact to all digits.
    const LARGE: f64 = 20.0;
    let (large, small) = (a.max(b), a.min(b));
    if large < LARGE {
        return libm::lgamma(a) + libm::lgamma(b) - libm::lgamma(a + b);
    }
    // Remainder of Stirling's formula for ln gamma (Abramowitz and Stegun 6.1.41).
    let rest = |x: f64| {
        let y = 1.0 / (x * x);
        (1.0 / 12.0 - y * (1.0 / 360.0 - y * (1.0 / 1260.0 - y * (1.0 / 1680.0 - y / 1188.0)))) / x
    };
    let whole = large + small;
    libm::lgamma(small) + rest(large) - rest(whole) + small
        - (large - 0.5) * libm::log1p(small / large)
        - small * libm::log(whole)
}

fn beta_fraction(a: f64, b: f64, x: f64) -> f64 {
    let (mut c, mut d) = (1.0, 1.0 / away_from_zero(1.0 - (a + b) * x / (a + 1.0)));
    let mut h = d;
    for m in 1..MAX_TERMS {
        let m = m as f64;
        let even = m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m));
        d = 1.0 / away_from_zero(1.0 + even * d);
        c = away_from_zero(1.0 + even / c);
        h *= d * c;
        let odd = -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0));
        d = 1.0 / away_from_zero(1.0 + odd * d);
        c = away_from_zero(1.0 + odd / c);
        h *= d * c;
        if (d * c - 1.0).abs() < NEGLIGIBLE {
            break;
        }
    }
    h
}

fn away_from_zero(x: f64) -> f64 {
    if x.abs() < TINY { TINY } else { x }
}

/// Probability that a chi-square variable of `dof` degrees of freedom exceeds `x`: the p-value of twice a log-likelihood ratio.
#[must_use]
pub fn chi_square_sf(x: f64, dof: f64) -> f64 {
    if x <= 0.0 { 1.0 } else { regularised_gamma(dof / 2.0, x / 2.0).1 }
}

/// The positive argument at which `above` changes from false to true, by bisection to the last bit.
pub(crate) fn invert(above: impl Fn(f64) -> bool, guess: f64) -> f64 {
    let (mut low, mut high) = (guess, guess);
    while above(low) && low > f64::MIN_POSITIVE {
        low *= 0.5;
    }
    while !above(high) && high < f64::MAX / 4.0 {
        high *= 2.0;
    }
    loop {
        let middle = low + (high - low) / 2.0;
        if middle <= low || middle >= high {
            return middle;
        }
        if above(middle) { high = middle } else { low = middle }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tails_outside_their_range_are_one_or_nan() {
        assert_eq!(chi_square_sf(-1.0, 3.0), 1.0);
        assert!(regularised_gamma(-1.0, 1.0).0.is_nan());
    }

    #[test]
    fn two_degrees_of_freedom_are_an_exponential() {
        for x in [0.1, 1.0, 10.0, 100.0] {
            assert!((chi_square_sf(x, 2.0) / libm::exp(-x / 2.0) - 1.0).abs() < 1e-13, "{x}");
        }
    }

    // The references below were made with mpmath at 40 digits.

    #[test]
    fn the_incomplete_gamma_function_is_exact_on_both_sides_of_the_switch_from_series_to_fraction() {
        for (a, x, p, q) in [
            (0.25, 0.001, 0.19615169838272653, 0.8038483016172735),
            (0.25, 5.0, 0.9995079748755537, 0.00049202512444634),
            (1.5, 2.49, 0.8267324857697974, 0.17326751423020254),
            (1.5, 2.51, 0.8296615096194444, 0.17033849038055557),
            (3.0, 0.1, 0.00015465307026467167, 0.9998453469297354),
            (3.0, 9.0, 0.9937678048936227, 0.006232195106377317),
            (12.0, 12.9, 0.6366094288351127, 0.3633905711648873),
            (12.0, 13.1, 0.656904608707293, 0.34309539129270705),
            (60.0, 20.0, 4.233284694712903e-13, 0.9999999999995767),
            (60.0, 140.0, 0.9999999999999918, 8.169795379525076e-15),
        ] {
            let (lower, upper) = regularised_gamma(a, x);
            // Each to some bits of one, the smaller one to some bits of itself.
            assert!((lower - p).abs() < 2e-13 && (upper - q).abs() < 2e-13, "{a} {x}: {lower} {upper}");
            let smaller = if p < q { lower / p } else { upper / q };
            assert!((smaller - 1.0).abs() < 2e-13, "{a} {x}: {lower} {upper}");
        }
    }

    #[test]
    fn the_incomplete_beta_function_is_exact() {
        for (a, b, x, wanted) in [
            (0.3, 0.7, 0.01, 0.21576857250318626),
            (0.3, 0.7, 0.99, 0.9853118721013316),
            (2.0, 5.0, 0.25, 0.466064453125),
            (2.0, 5.0, 0.4, 0.76672),
            (7.5, 1.5, 0.6, 0.04812149934817907),
            (30.0, 4.0, 0.5, 7.005874067544937e-07),
            (30.0, 4.0, 0.95, 0.91919050658563),
            (25.0, 40.0, 0.3, 0.07643481617057919),
            (120.0, 0.5, 0.99, 0.12078864909692316),
        ] {
            let found = regularised_beta(a, b, x, 1.0 - x);
            assert!((found / wanted - 1.0).abs() < 2e-13, "{a} {b} {x}: {found}");
        }
    }

    #[test]
    fn ln_beta_keeps_its_digits_for_arguments_of_different_size() {
        for (a, b, wanted) in [
            (0.5, 0.5, 1.1447298858494002),
            (3.0, 4.5, -4.387480485356345),
            (19.9, 0.1, 1.9559170457709223),
            (20.0, 0.5, -0.919251844406604),
            (20.0, 20.0, -27.95199188624447),
            (0.25, 37.0, 0.38783247856317876),
            (150.0, 2.5, -12.254350153923419),
            (1e6, 0.5, -6.335390211057437),
            (1e9, 3.0, -61.47665033327929),
        ] {
            let found = ln_beta(a, b);
            assert!((found - wanted).abs() < 4e-15 * wanted.abs().max(1.0), "{a} {b}: {found} {wanted}");
            assert_eq!(found, ln_beta(b, a));
        }
    }

    #[test]
    fn incomplete_gamma_and_beta_have_their_limits() {
        assert_eq!(regularised_gamma(2.0, 0.0), (0.0, 1.0));
        assert_eq!(regularised_gamma(2.0, f64::INFINITY), (1.0, 0.0));
        for (a, x) in [(0.0, 1.0), (0.0, 0.0), (-1.0, 1.0), (1.0, -0.1), (f64::NAN, 1.0), (1.0, f64::NAN)] {
            let (lower, upper) = regularised_gamma(a, x);
            assert!(lower.is_nan() && upper.is_nan(), "{a} {x}");
        }
        assert_eq!((regularised_beta(2.0, 3.0, 0.0, 1.0), regularised_beta(2.0, 3.0, 1.0, 0.0)), (0.0, 1.0));
        assert_eq!(chi_square_sf(0.0, 3.0), 1.0);
    }

    #[test]
    fn bisection_is_exact_to_the_last_bit_from_any_guess() {
        for guess in [1e-9, 0.7, 1.0, 1.5, 1e9] {
            let root = invert(|x| x * x > 2.0, guess);
            assert!((root - 2f64.sqrt()).abs() <= f64::EPSILON, "{guess}: {root}");
        }
        // What is true or false everywhere turns at one of the ends.
        assert!(invert(|_| true, 1.0) <= f64::MIN_POSITIVE);
        assert!(invert(|_| false, 1.0) >= f64::MAX / 4.0);
    }
}
