//! When a layer ruptures: by the rupture criterion of the force law, or imposed from measured data.

use crate::force::Rupture;

/// The quantities of the rupture criterion of the active layer at one sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RuptureCriterion {
    /// Layer, 1-based.
    pub layer: usize,
    /// Its elastic force in N, after all elastic and relaxation effects.
    pub elastic_n: f64,
    /// Its puncture force in N, after all effects; infinite when only the far face ruptures it.
    pub puncture_n: f64,
    /// Tip position in metres, relative to the tissue.
    pub tip_m: f64,
    /// Its far face in metres.
    pub far_m: f64,
}

impl RuptureCriterion {
    /// Whether the layer ruptures by force or at its far face.
    #[must_use]
    #[inline]
    pub fn is_met(&self) -> bool {
        self.elastic_n >= self.puncture_n || self.tip_m >= self.far_m
    }
}

/// Decides on ruptures and is notified of them.
pub(crate) trait RupturePolicy {
    /// Whether the active layer ruptures.
    fn ruptures(&mut self, criterion: &RuptureCriterion) -> bool;
    /// Called after a rupture.
    fn on_rupture(&mut self, rupture: Rupture);
}

/// Ruptures by the criterion.
pub(crate) struct CriterionRuptures<F>(pub F);

impl<F: FnMut(Rupture)> RupturePolicy for CriterionRuptures<F> {
    #[inline]
    fn ruptures(&mut self, criterion: &RuptureCriterion) -> bool {
        criterion.is_met()
    }
    #[inline]
    fn on_rupture(&mut self, rupture: Rupture) {
        (self.0)(rupture);
    }
}

/// Ruptures exactly the first `ruptured` layers, regardless of the criterion.
pub(crate) struct ImposedRuptures<F> {
    pub ruptured: usize,
    pub on_criterion: F,
}

impl<F: FnMut(RuptureCriterion)> RupturePolicy for ImposedRuptures<F> {
    #[inline]
    fn ruptures(&mut self, criterion: &RuptureCriterion) -> bool {
        (self.on_criterion)(*criterion);
        criterion.layer <= self.ruptured
    }
    #[inline]
    fn on_rupture(&mut self, _: Rupture) {}
}
