//! Log evidence differences in nats, typed by the noise model under which they were computed.
//!
//! Values on different bases must not be compared: the same model gains much under the small noise of quiet stretches and little under the
//! residual noise of the larger model. The type parameter rules that out.

use core::cmp::Ordering;
use core::marker::PhantomData;
use core::ops::{Neg, Sub};

/// A value in nats on the basis `B`.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub struct Nats<B>(f64, PhantomData<B>);

/// Basis: noise estimated from the residuals of the larger of two models; priors and rupture terms of both are included.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub struct UnderLargerModelNoise;

impl<B> Nats<B> {
    /// A value in nats.
    #[must_use]
    pub const fn new(nats: f64) -> Self {
        Self(nats, PhantomData)
    }

    /// The value in nats.
    #[must_use]
    pub const fn value(self) -> f64 {
        self.0
    }

    /// Whether the gain exceeds a penalty (nats), which does not depend on the basis.
    #[must_use]
    pub fn exceeds(self, price: f64) -> bool {
        self.0 > price
    }

    /// Total order of the values.
    #[must_use]
    pub fn total_cmp(&self, other: &Self) -> Ordering {
        self.0.total_cmp(&other.0)
    }
}

impl<B> Neg for Nats<B> {
    type Output = Self;
    fn neg(self) -> Self {
        Self::new(-self.0)
    }
}

/// Subtracts a penalty, which does not depend on the basis.
impl<B> Sub<f64> for Nats<B> {
    type Output = Self;
    fn sub(self, price: f64) -> Self {
        Self::new(self.0 - price)
    }
}

#[cfg(test)]
mod tests {
    use super::{Nats, UnderLargerModelNoise};

    #[test]
    fn nats_are_ordered_and_compared_with_a_penalty() {
        let of = Nats::<UnderLargerModelNoise>::new;
        assert!(of(5.0) > of(4.0) && -of(5.0) < of(-4.0));
        assert!(of(5.0).exceeds(4.9) && !of(5.0).exceeds(5.0) && !of(f64::NEG_INFINITY).exceeds(-1e9));
        assert_eq!((of(7.5) - 2.0).value(), 5.5);
        assert_eq!(of(1.0).total_cmp(&of(2.0)), core::cmp::Ordering::Less);
    }
}
