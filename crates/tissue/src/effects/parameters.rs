//! Parameters of an effect as a vector, and helpers for effects on one layer.

use crate::effect::Effect;
use crate::effect_info::{EffectInfo, ParameterError, ParameterInfo};
use crate::layer_geometry::Slab;
use alloc::vec::Vec;

/// Implements [`ParameterVector`] for an effect whose parameters are its `f64` fields in order, with a leading 1-based layer
/// index where one is named.
macro_rules! described {
    ($name:ident { $($field:ident),* }) => {
        impl super::parameters::ParameterVector for $name {
            fn values(&self) -> alloc::vec::Vec<f64> {
                alloc::vec![$(self.$field),*]
            }
            fn from_values(values: &[f64]) -> Option<Self> {
                let [$($field),*] = *values else { return None };
                Some(Self { $($field),* })
            }
        }
    };
    ($name:ident { layer; $($field:ident),* }) => {
        impl super::parameters::ParameterVector for $name {
            fn values(&self) -> alloc::vec::Vec<f64> {
                alloc::vec![self.layer as f64, $(self.$field),*]
            }
            fn from_values(values: &[f64]) -> Option<Self> {
                let [layer, $($field),*] = *values else { return None };
                Some(Self { layer: super::parameters::layer_index(layer), $($field),* })
            }
        }
    };
}

/// The layer that an effect acts on.
pub(super) const LAYER: ParameterInfo = ParameterInfo::shape("layer", "", "layer, 1-based")
    .allowed(1.0, 1000.0)
    .inactive(1.0)
    .search(1.0, 1.0, 10.0)
    .integer();

/// The 1-based layer index of a parameter value. The cast saturates; NaN becomes 0, which is not a layer.
pub(super) fn layer_index(value: f64) -> usize {
    libm::round(value) as usize
}

/// The layer of a 1-based index, if there is one.
pub(super) fn layer_mut(slabs: &mut [Slab], layer: usize) -> Option<&mut Slab> {
    layer.checked_sub(1).and_then(|i| slabs.get_mut(i))
}

/// An effect's parameters as a vector.
pub(super) trait ParameterVector: Effect + Default {
    /// The library's entry.
    fn entry() -> &'static EffectInfo {
        Self::default().info()
    }

    /// The parameters, in the order of [`EffectInfo::parameters`].
    fn values(&self) -> Vec<f64>;

    /// The effect with these parameters; `None` when their number is wrong.
    fn from_values(values: &[f64]) -> Option<Self>;

    /// The parameters in coordinates in which the force is closer to linear, each in the scale of its parameter's
    /// [`FitScale`](crate::FitScale); by default the parameters themselves.
    fn coordinates(&self) -> Vec<f64> {
        self.values()
    }

    /// The effect at these coordinates.
    fn from_coordinates(coordinates: &[f64]) -> Option<Self> {
        Self::from_values(coordinates)
    }

    /// Conditions on several parameters together.
    fn check_together(&self) -> Result<(), ParameterError> {
        Ok(())
    }
}
