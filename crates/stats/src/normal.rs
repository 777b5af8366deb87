//! The standard normal distribution.

use core::f64::consts::{SQRT_2, TAU};

/// The 97.5 % quantile: half width of a 95 % interval in standard deviations.
pub const Z95: f64 = 1.959_963_984_540_054;

/// Logarithm of the density at `x`.
#[must_use]
pub fn ln_pdf(x: f64) -> f64 {
    -0.5 * (x * x + libm::log(TAU))
}

/// Probability of a value below `x`. Relative accuracy holds far into the lower tail.
#[must_use]
pub fn cdf(x: f64) -> f64 {
    0.5 * libm::erfc(-x / SQRT_2)
}

/// Probability of a value above `x`. Relative accuracy holds far into the upper tail.
#[must_use]
pub fn sf(x: f64) -> f64 {
    0.5 * libm::erfc(x / SQRT_2)
}

/// The quantile at probability `p`: P. J. Acklam's rational approximation, then one step of Halley's method on
/// `erfc`, which leaves an error below 1e-13. Infinite at 0 and 1, `NaN` outside.
#[must_use]
pub fn quantile(p: f64) -> f64 {
    const A: [f64; 6] = [
        -3.969_683_028_665_376e1,
        2.209_460_984_245_205e2,
        -2.759_285_104_469_687e2,
        1.383_577_518_672_69e2,
        -3.066_479_806_614_716e1,
        2.506_628_277_459_239,
    ];
    const B: [f64; 5] = [
        -5.447_609_879_822_406e1,
        1.615_858_368_580_409e2,
        -1.556_989_798_598_866e2,
        6.680_131_188_771_972e1,
        -1.328_068_155_288_572e1,
    ];
    const C: [f64; 6] = [
        -7.784_894_002_430_293e-3,
        -3.223_964_580_411_365e-1,
        -2.400_758_277_161_838,
        -2.549_732_539_343_734,
        4.374_664_141_464_968,
        2.938_163_982_698_783,
    ];
    const D: [f64; 4] =
        [7.784_695_709_041_462e-3, 3.224_671_290_700_398e-1, 2.445_134_137_142_996, 3.754_408_661_907_416];
    if !(p > 0.0 && p < 1.0) {
        return match p {
            0.0 => f64::NEG_INFINITY,
            1.0 => f64::INFINITY,
            _ => f64::NAN,
        };
    }
    let horner = |c: &[f64], x: f64| c.iter().fold(0.0, |sum, k| sum * x + k);
    if p > 1.0 - 0.02425 {
        // Exact, and the lower tail keeps its relative accuracy.
        return -quantile(1.0 - p);
    }
    let x = if p < 0.02425 {
        let q = libm::sqrt(-2.0 * libm::log(p));
        horner(&C, q) / (horner(&D, q) * q + 1.0)
    } else {
        let q = p - 0.5;
        let r = q * q;
        horner(&A, r) * q / (horner(&B, r) * r + 1.0)
    };
    let error = cdf(x) - p;
    let step = error * libm::sqrt(TAU) * libm::exp(0.5 * x * x);
    x - step / (1.0 + 0.5 * x * step)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_infinite_at_the_ends_and_nan_outside() {
        assert_eq!((quantile(0.0), quantile(1.0)), (f64::NEG_INFINITY, f64::INFINITY));
        assert!(quantile(-0.1).is_nan() && quantile(1.1).is_nan() && quantile(f64::NAN).is_nan());
        assert!((quantile(0.975) - Z95).abs() < 1e-15);
    }

    #[test]
    fn tails_are_symmetric_and_the_density_is_the_derivative_of_the_distribution() {
        for x in [-6.0, -1.3, 0.0, 0.4, 2.7] {
            assert_eq!(cdf(x), sf(-x));
            let slope = (cdf(x + 1e-5) - cdf(x - 1e-5)) / 2e-5;
            assert!((slope - libm::exp(ln_pdf(x))).abs() < 1e-9, "{x}");
        }
    }

    #[test]
    fn quantile_and_distribution_function_are_inverse() {
        for p in [1e-200, 1e-9, 0.0242, 0.0243, 0.2, 0.4999, 0.5] {
            assert!((cdf(quantile(p)) / p - 1.0).abs() < 1e-12, "{p}");
        }
        // The upper half mirrors the lower one, on either side of where the approximation changes.
        for p in [1e-6, 0.0242, 0.0243, 0.2, 0.4999] {
            assert!((quantile(1.0 - p) + quantile(p)).abs() < 1e-10, "{p}");
        }
    }
}
