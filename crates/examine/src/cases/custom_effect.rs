//! Effects that the caller defines: the force law comes with them, everything else of a case is drawn as for the library's effects.

use crate::simulator::force_law::ForceLaw;
use crate::simulator::tissue::Tissue;
use core::fmt::Debug;
use std::sync::Arc;

/// An effect that the caller defines.
pub trait CustomEffect: Debug + Send + Sync {
    /// Name, as an answer gives it.
    fn id(&self) -> &str;

    /// Parameters by their paths.
    fn parameters(&self) -> Vec<(String, f64)>;

    /// The effect with other parameters than the typical ones, drawn by uniform numbers in 0..1.
    fn with_random_parameters(&self, uniform: &mut dyn FnMut() -> f64) -> Arc<dyn CustomEffect>;

    /// The effect `factor` times as strong, within its allowed values.
    fn scaled(&self, factor: f64) -> Arc<dyn CustomEffect>;

    /// The force law of a tissue with this effect, and without any other.
    fn law(&self, tissue: &Tissue) -> Box<dyn ForceLaw>;
}
