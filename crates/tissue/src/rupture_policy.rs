//! Who decides that a layer gives way: the law itself, or somebody who saw it in measured data.

use crate::force::{Rupture, TissueForce};
use crate::force_law::ForceLaw;
use crate::force_law_state::ForceLawState;

/// How near the active layer is to its rupture at one sample, before it gives way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RuptureCriterion {
    /// Layer, 1-based.
    pub layer: usize,
    /// Its elastic force in N, after all effects of shape and history.
    pub elastic_n: f64,
    /// The force in N at which it ruptures, after all effects; infinity when only its far face does.
    pub puncture_n: f64,
    /// Tip position in metres, relative to the tissue.
    pub tip_m: f64,
    /// Its far face in metres.
    pub far_m: f64,
}

impl RuptureCriterion {
    /// Whether the law ruptures the layer here.
    #[must_use]
    #[inline]
    pub fn is_met(&self) -> bool {
        self.elastic_n >= self.puncture_n || self.tip_m >= self.far_m
    }
}

/// Decides on ruptures and hears of them.
pub(crate) trait RupturePolicy {
    /// Whether the active layer gives way.
    fn ruptures(&mut self, strain: &RuptureCriterion) -> bool;
    /// It did.
    fn on_rupture(&mut self, rupture: Rupture);
}

/// The law decides.
pub(crate) struct CriterionRuptures<F>(pub F);

impl<F: FnMut(Rupture)> RupturePolicy for CriterionRuptures<F> {
    #[inline]
    fn ruptures(&mut self, strain: &RuptureCriterion) -> bool {
        strain.is_met()
    }
    #[inline]
    fn on_rupture(&mut self, rupture: Rupture) {
        (self.0)(rupture);
    }
}

/// As many layers give way as somebody says.
struct Imposed<F> {
    ruptured: usize,
    on_strain: F,
}

impl<F: FnMut(RuptureCriterion)> RupturePolicy for Imposed<F> {
    #[inline]
    fn ruptures(&mut self, strain: &RuptureCriterion) -> bool {
        (self.on_strain)(*strain);
        strain.layer <= self.ruptured
    }
    #[inline]
    fn on_rupture(&mut self, _: Rupture) {}
}

impl ForceLaw {
    /// [`Law::step`] with the ruptures imposed: at this sample `ruptured` layers have given way,
    /// whatever their force and the tip's position. Reports the strain of the layer that was active
    /// before (and of every layer that becomes active in this step).
    ///
    /// For fitting: with the ruptures where measured data show them, the force is smooth in nearly
    /// every parameter, and the strain says how far the law is from rupturing there by itself. Fed
    /// with the law's own ruptures it gives the same bits as [`Law::step`].
    #[inline]
    pub fn step_imposed(
        &self,
        state: &mut ForceLawState,
        time_s: f64,
        z_m: f64,
        v_mps: f64,
        ruptured: usize,
        on_strain: impl FnMut(RuptureCriterion),
    ) -> TissueForce {
        self.step_with_policy(state, time_s, z_m, v_mps, &mut Imposed { ruptured, on_strain })
    }
}
