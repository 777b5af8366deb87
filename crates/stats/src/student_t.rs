//! Student's t distribution, for any positive number of degrees of freedom (infinitely many: normal).

use crate::{normal, special_functions};

/// Probability of a value below `x`.
#[must_use]
pub fn cdf(x: f64, dof: f64) -> f64 {
    sf(-x, dof)
}

/// Probability of a value above `x`; relative accuracy holds far into the tail.
#[must_use]
pub fn sf(x: f64, dof: f64) -> f64 {
    if dof.is_nan() || dof <= 0.0 || x.is_nan() {
        return f64::NAN;
    }
    if dof == f64::INFINITY {
        return normal::sf(x);
    }
    if x < 0.0 {
        return 1.0 - sf(-x, dof);
    }
    if x == f64::INFINITY {
        return 0.0;
    }
    let whole = dof + x * x;
    0.5 * special_functions::regularised_beta(dof / 2.0, 0.5, dof / whole, x * x / whole)
}

/// The quantile at probability `p`: `quantile(0.975, 1.0)` is 12.706. Infinite at 0 and 1, `NaN` outside.
#[must_use]
pub fn quantile(p: f64, dof: f64) -> f64 {
    if dof.is_nan() || dof <= 0.0 || !(0.0..=1.0).contains(&p) {
        return f64::NAN;
    }
    if dof == f64::INFINITY || p == 0.0 || p == 1.0 {
        return normal::quantile(p);
    }
    if p == 0.5 {
        return 0.0;
    }
    let (rest, sign) = if p < 0.5 { (p, -1.0) } else { (1.0 - p, 1.0) };
    sign * special_functions::invert(|x| sf(x, dof) < rest, -normal::quantile(rest).min(-1e-9))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_agree_with_published_tables() {
        // Two-sided 95 %; any textbook.
        for (dof, t) in
            [(1.0, 12.706), (2.0, 4.303), (3.0, 3.182), (4.0, 2.776), (14.0, 2.145), (100.0, 1.984)]
        {
            assert!((quantile(0.975, dof) - t).abs() < 5e-4, "{dof}: {}", quantile(0.975, dof));
        }
        assert!((quantile(0.975, f64::INFINITY) - normal::Z95).abs() < 1e-15);
        assert!(quantile(0.975, 0.0).is_nan() && cdf(1.0, -1.0).is_nan());
    }

    #[test]
    fn one_degree_of_freedom_is_cauchy() {
        for x in [-30.0, -1.0, -0.2, 0.0, 0.7, 5.0, 1e6] {
            let exact = 0.5 + libm::atan(x) / core::f64::consts::PI;
            assert!((cdf(x, 1.0) - exact).abs() < 1e-14, "{x}: {}", cdf(x, 1.0));
        }
    }

    #[test]
    fn results_are_nan_outside_the_range_and_exact_at_its_ends() {
        for dof in [0.0, -1.0, f64::NAN] {
            assert!(sf(1.0, dof).is_nan() && quantile(0.3, dof).is_nan(), "{dof}");
        }
        assert!(sf(f64::NAN, 3.0).is_nan() && quantile(-0.1, 3.0).is_nan() && quantile(1.1, 3.0).is_nan());
        assert_eq!((sf(f64::INFINITY, 3.0), sf(f64::NEG_INFINITY, 3.0), sf(0.0, 3.0)), (0.0, 1.0, 0.5));
        assert_eq!((quantile(0.0, 3.0), quantile(1.0, 3.0)), (f64::NEG_INFINITY, f64::INFINITY));
        assert_eq!((quantile(0.5, 3.0), quantile(0.5, f64::INFINITY)), (0.0, 0.0));
        assert_eq!(sf(0.7, f64::INFINITY), normal::sf(0.7));
    }

    #[test]
    fn two_degrees_of_freedom_have_a_closed_form() {
        for p in [1e-9, 0.01, 0.2, 0.499_999, 0.500_001, 0.7, 0.9999] {
            let a: f64 = 2.0 * p - 1.0;
            let exact = a * (2.0 / (1.0 - a * a)).sqrt();
            // The tail that is asked for loses digits in `2 p - 1`, not in the quantile.
            assert!((quantile(p, 2.0) / exact - 1.0).abs() < 1e-7, "{p}: {} {exact}", quantile(p, 2.0));
        }
        for x in [-7.0, -0.4, 0.0, 1.0, 30.0_f64] {
            let exact = 0.5 - x / (2.0 * (2.0 + x * x).sqrt());
            assert!((sf(x, 2.0) - exact).abs() < 1e-14, "{x}");
        }
    }
}
