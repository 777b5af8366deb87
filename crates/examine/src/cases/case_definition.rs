//! What defines a case: misspecification, assumed and true tissue, motions, hidden effects and noise parameters.

use super::case_id::World;
use super::custom_effect::CustomEffect;
use super::misspecification_amounts::MisspecificationAmounts;
use super::unmodelled_shapes::UnmodelledShape;
use crate::simulator::effect::Effect;
use crate::simulator::force_law::ForceLaw;
use crate::simulator::motion_path::MotionPath;
use crate::simulator::plain_world::PlainWorld;
use crate::simulator::rich_world::{RichEffects, RichWorld};
use crate::simulator::sensor_noise::SensorNoise;
use crate::simulator::tissue::Tissue;
use std::sync::Arc;

/// A case without its noise realisation.
#[derive(Clone, Debug)]
pub struct CaseSetup {
    /// Amounts of misspecification.
    pub amounts: MisspecificationAmounts,
    /// The assumed layers.
    pub assumed: Tissue,
    /// The true layers.
    pub truth: Tissue,
    /// The motion of each recording.
    pub paths: Vec<MotionPath>,
    /// Parameters of the sensor noise.
    pub noise: SensorNoise,
    /// The force law of the tissue.
    pub world: World,
    /// Effects of the rich law.
    pub rich: RichEffects,
    /// Hidden effects of the library.
    pub effects: Vec<Effect>,
    /// Hidden effect that the caller defines; then there is no other.
    pub custom: Option<Arc<dyn CustomEffect>>,
    /// Hidden force outside the library.
    pub shape: Option<UnmodelledShape>,
    /// Strength of everything hidden, in noise standard deviations.
    pub strength_sd: f64,
}

impl CaseSetup {
    /// The force law of a tissue in this world. Under the rich law only effects of tool and sensor are taken from the library.
    #[must_use]
    pub fn law(&self, tissue: &Tissue, effects: &[Effect]) -> Box<dyn ForceLaw> {
        if let Some(custom) = &self.custom {
            return custom.law(tissue);
        }
        match self.world {
            World::Plain => Box::new(PlainWorld::new(tissue, effects)),
            World::Rich => Box::new(RichWorld::new(tissue, &self.rich)),
        }
    }
}
