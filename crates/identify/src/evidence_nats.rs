//! Nats that say by what they were reckoned, so that two currencies cannot be compared.
//!
//! A log-likelihood means nothing beside another one under other noise: what a model gains is large under the noise that the smaller
//! model leaves in quiet stretches, and small under all that the larger one leaves.

use core::cmp::Ordering;
use core::marker::PhantomData;
use core::ops::{Neg, Sub};

/// Nats of a basis `B`.
#[derive(Debug)]
pub struct Nats<B>(f64, PhantomData<B>);

/// A gain under the noise that the larger of two models leaves, priors and ruptures of both included.
#[derive(Clone, Copy, Debug)]
pub struct UnderLargerModelNoise;

impl<B> Nats<B> {
    /// So many.
    #[must_use]
    pub const fn new(nats: f64) -> Self {
        Self(nats, PhantomData)
    }

    /// Their number, for writing down.
    #[must_use]
    pub const fn value(self) -> f64 {
        self.0
    }

    /// Whether this gain is more than `price` nats: what fitted numbers cost is the same on every basis.
    #[must_use]
    pub fn exceeds(self, price: f64) -> bool {
        self.0 > price
    }

    /// The order of their numbers.
    #[must_use]
    pub fn total_cmp(&self, other: &Self) -> Ordering {
        self.0.total_cmp(&other.0)
    }
}

impl<B> Clone for Nats<B> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<B> Copy for Nats<B> {}

impl<B> PartialEq for Nats<B> {
    fn eq(&self, other: &Self) -> bool {
        self.0 == other.0
    }
}

impl<B> PartialOrd for Nats<B> {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        self.0.partial_cmp(&other.0)
    }
}

impl<B> Neg for Nats<B> {
    type Output = Self;
    fn neg(self) -> Self {
        Self::new(-self.0)
    }
}

/// Less a price, which is the same on every basis.
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
    fn nats_of_one_basis_are_ordered_and_pay_a_price_below_them() {
        let of = Nats::<UnderLargerModelNoise>::new;
        assert!(of(5.0) > of(4.0) && -of(5.0) < of(-4.0));
        assert!(of(5.0).exceeds(4.9) && !of(5.0).exceeds(5.0) && !of(f64::NEG_INFINITY).exceeds(-1e9));
        assert_eq!((of(7.5) - 2.0).value(), 5.5);
        assert_eq!(of(1.0).total_cmp(&of(2.0)), core::cmp::Ordering::Less);
    }
}
