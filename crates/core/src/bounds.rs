//! Bounds that hold for any bounds and values: unlike `clamp`, they do not panic where the lower bound is above the upper one.

/// The larger of the two; the bound if `x` is NaN. One instruction, where `f64::max` takes several.
#[inline(always)]
pub(crate) fn at_least(bound: f64, x: f64) -> f64 {
    if x > bound { x } else { bound }
}

/// The smaller of the two; the bound if `x` is NaN.
#[inline(always)]
pub(crate) fn at_most(bound: f64, x: f64) -> f64 {
    if x < bound { x } else { bound }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_replace_nan_and_may_cross() {
        assert_eq!([at_least(1.0, 2.0), at_least(1.0, 0.5), at_least(1.0, f64::NAN)], [2.0, 1.0, 1.0]);
        assert_eq!([at_most(1.0, 2.0), at_most(1.0, 0.5), at_most(1.0, f64::NAN)], [1.0, 0.5, 1.0]);
        assert_eq!(at_least(2.0, at_most(1.0, 3.0)), 2.0);
    }
}
