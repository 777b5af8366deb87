//! The effect library: one file per effect.
//!
//! [`AnyEffect`] is the closed list that scenarios can name. A new effect takes one file and two lines here: its module,
//! and its place in the list below, which is the order of the measurement chain.

use crate::effect::{BaseMotion, Effect, EffectState, InsertionState, TipState};
use crate::effect_info::{EffectInfo, ParameterError};
use crate::layer_geometry::Slab;
use alloc::vec::Vec;
use parameters::ParameterVector;

#[macro_use]
mod parameters;

// Declared outside the macro, so that rustfmt and cargo-mutants see them.
mod asymmetric_friction;
mod boundary_shift;
mod coulomb_friction;
mod custom;
mod cutting_force;
mod deep_indentation;
mod delayed_puncture;
mod drive_friction;
mod force_bias;
mod force_drift;
mod force_gain;
mod force_spikes;
mod hidden_membrane;
mod incomplete_release;
mod layer_coupling;
mod layer_stiffening;
mod loading_hysteresis;
mod low_pass_lag;
mod needle_compliance;
mod nonlinear_elasticity;
mod periodic_interference;
mod position_dependent_force;
mod position_scale;
mod power_law_friction;
mod presliding_friction;
mod quantisation;
mod rate_dependent_puncture;
mod release_depth;
mod respiration;
mod saturation;
mod shaft_slip;
mod soft_boundary;
mod stress_relaxation;
mod stribeck_friction;
mod time_delay;
mod tool_inertia;
mod viscoelastic_presliding;
mod zero_step;

/// Declares [`AnyEffect`], whose variants scenarios write in camel case, and passes every hook on to the variant.
macro_rules! effects {
    ($($module:ident :: $name:ident),* $(,)?) => {
        $(pub use $module::*;)*

        /// Any effect of the library, as a scenario's `effects` list writes it.
        #[derive(Clone, Debug, PartialEq)]
        #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
        pub enum AnyEffect {
            $(#[doc = concat!("See [`", stringify!($name), "`].")] $name($name),)*
            /// An effect that is not in the library, see [`Custom`].
            Custom(Custom),
        }

        $(impl $name {
            /// Id in snake case, as in results.
            pub const ID: &'static str = stringify!($module);
        })*

        $(impl From<$name> for AnyEffect {
            fn from(effect: $name) -> Self { Self::$name(effect) }
        })*

        impl From<Custom> for AnyEffect {
            fn from(effect: Custom) -> Self { Self::Custom(effect) }
        }

        /// The entries of all effects, in the order of the chain.
        const LIBRARY: &[fn() -> &'static EffectInfo] = &[$($name::entry),*];

        /// Order of the effects in the chain.
        enum Rank { $($name,)* Custom }

        impl AnyEffect {
            /// Position in the chain among all effects of the library; custom effects come last in their stage.
            pub(crate) fn rank(&self) -> usize {
                match self { $(Self::$name(_) => Rank::$name as usize,)* Self::Custom(_) => Rank::Custom as usize }
            }

            /// The effect of this id with these parameters, in the order of
            /// [`EffectInfo::parameters`]; `None` for an unknown id or a wrong number of them.
            #[must_use]
            pub fn from_parameters(id: &str, values: &[f64]) -> Option<Self> {
                match id {
                    $(stringify!($module) => $name::from_values(values).map(Self::$name),)*
                    _ => None,
                }
            }

            /// The parameters, in the order of [`EffectInfo::parameters`].
            #[must_use]
            pub fn parameters(&self) -> Vec<f64> {
                match self { $(Self::$name(effect) => effect.values(),)* Self::Custom(effect) => effect.values().into() }
            }

            /// The parameters in coordinates for fitting: as many as parameters, in their order.
            #[must_use]
            pub fn coordinates(&self) -> Vec<f64> {
                match self { $(Self::$name(effect) => effect.coordinates(),)* Self::Custom(effect) => effect.values().into() }
            }

            /// The effect of this id at these coordinates.
            #[must_use]
            pub fn from_coordinates(id: &str, coordinates: &[f64]) -> Option<Self> {
                match id {
                    $(stringify!($module) => $name::from_coordinates(coordinates).map(Self::$name),)*
                    _ => None,
                }
            }

            fn check_together(&self) -> Result<(), ParameterError> {
                match self { $(Self::$name(effect) => effect.check_together(),)* Self::Custom(_) => Ok(()) }
            }
        }

        effects!(@delegate [$($name)* Custom]
            fn info() -> &'static EffectInfo;
            fn is_inactive() -> bool;
            fn has_state() -> bool;
            fn modify_layers(slabs: &mut [Slab]) -> ();
            fn relative_motion(time_s: f64, z_m: f64, v_mps: f64) -> (f64, f64);
            fn elastic_force(k_n_per_m: f64, x_m: f64, force_n: f64) -> f64;
            fn relax(tip: &TipState, depth_m: f64, elastic_n: f64, state: &mut EffectState) -> f64;
            fn puncture_force(threshold_n: f64, v_mps: f64) -> f64;
            fn puncture_force_after_load(layer: usize, dt_s: f64, elastic_n: f64, threshold_n: f64, state: &mut EffectState) -> f64;
            fn retained_force(released_n: f64) -> f64;
            fn on_rupture(released_n: f64, z_m: f64, state: &mut EffectState) -> ();
            fn friction_velocity(v_mps: f64) -> f64;
            fn friction_factor(v_mps: f64) -> f64;
            fn shaft_force(tip: &TipState, at: &InsertionState, state: &mut EffectState) -> f64;
            fn on_layer_rupture(layer: usize, released_n: f64, state: &mut EffectState) -> ();
            fn relax_layer(layer: usize, dt_s: f64, elastic_n: f64, state: &mut EffectState) -> f64;
            fn layer_friction(tip: &TipState, slabs: &[Slab], sliding_mps: f64, state: &mut EffectState) -> f64;
            fn ruptures_membrane(z_m: f64, slabs: &[Slab], state: &mut EffectState) -> bool;
            fn tip_force(tip: &TipState, at: &InsertionState, state: &mut EffectState) -> f64;
            fn tool_force(base: &BaseMotion, force_n: f64, state: &mut EffectState) -> f64;
            fn sensor_output(time_s: f64, dt_s: f64, force_n: f64, state: &mut EffectState) -> f64;
            fn mean_sensor_output(time_s: f64, span_s: f64, samples: f64, force_n: f64, state: &mut EffectState) -> f64;
            fn sensor_output_at_end(time_s: f64, span_s: f64, force_n: f64, state: &mut EffectState) -> f64;
            fn delay_s() -> f64;
            fn membrane_depth_m() -> Option<f64>;
            fn position_factor() -> f64;
        );
    };

    // Every hook of the trait, passed on to the effect.
    (@delegate $names:tt $(fn $hook:ident($($argument:ident: $type:ty),*) -> $result:ty;)*) => {
        impl Effect for AnyEffect {
            $(effects!(@hook $names $hook [$($argument: $type),*] ($($argument),*) $result);)*
            effects!(@scale $names);
        }
    };
    (@scale [$($name:ident)*]) => {
        fn scale_friction(&mut self, factor: f64) {
            match self { $(Self::$name(effect) => effect.scale_friction(factor),)* }
        }
        fn scale_puncture(&mut self, layer: usize, factor: f64) {
            match self { $(Self::$name(effect) => effect.scale_puncture(layer, factor),)* }
        }
    };
    (@hook [$($name:ident)*] $hook:ident [$($parameters:tt)*] $call:tt $result:ty) => {
        #[inline]
        fn $hook(&self, $($parameters)*) -> $result {
            match self { $(Self::$name(effect) => effect.$hook $call,)* }
        }
    };
}

pub use custom::Custom;

effects! {
    boundary_shift::BoundaryShift,
    deep_indentation::DeepIndentation,
    layer_coupling::LayerCoupling,
    layer_stiffening::LayerStiffening,
    release_depth::ReleaseDepth,
    respiration::Respiration,
    needle_compliance::NeedleCompliance,
    nonlinear_elasticity::NonlinearElasticity,
    loading_hysteresis::LoadingHysteresis,
    stress_relaxation::StressRelaxation,
    rate_dependent_puncture::RateDependentPuncture,
    delayed_puncture::DelayedPuncture,
    incomplete_release::IncompleteRelease,
    soft_boundary::SoftBoundary,
    power_law_friction::PowerLawFriction,
    asymmetric_friction::AsymmetricFriction,
    coulomb_friction::CoulombFriction,
    stribeck_friction::StribeckFriction,
    presliding_friction::PreslidingFriction,
    viscoelastic_presliding::ViscoelasticPresliding,
    shaft_slip::ShaftSlip,
    cutting_force::CuttingForce,
    hidden_membrane::HiddenMembrane,
    tool_inertia::ToolInertia,
    drive_friction::DriveFriction,
    position_dependent_force::PositionDependentForce,
    force_gain::ForceGain,
    low_pass_lag::LowPassLag,
    time_delay::TimeDelay,
    force_bias::ForceBias,
    force_drift::ForceDrift,
    zero_step::ZeroStep,
    periodic_interference::PeriodicInterference,
    force_spikes::ForceSpikes,
    saturation::Saturation,
    quantisation::Quantisation,
    position_scale::PositionScale,
}

impl AnyEffect {
    /// Checks that every parameter is within its physical range.
    ///
    /// # Errors [`ParameterError`] with the first parameter that is not.
    pub fn check(&self) -> Result<(), ParameterError> {
        for (parameter, value) in self.info().parameters.iter().zip(self.parameters()) {
            let allowed = (parameter.low, parameter.high);
            if !(allowed.0 <= value && value <= allowed.1) {
                return Err(ParameterError { effect: self.id(), path: parameter.path, value, allowed });
            }
        }
        self.check_together()
    }
}

impl EffectInfo {
    /// The effect with these parameters; `None` for a wrong number of them.
    #[must_use]
    pub fn with_parameters(&'static self, values: &[f64]) -> Option<AnyEffect> {
        match self.custom {
            Some(_) => Custom::with_values(self, values).map(AnyEffect::Custom),
            None => AnyEffect::from_parameters(self.id, values),
        }
    }

    /// The effect at these coordinates for fitting; `None` for a wrong number of them.
    #[must_use]
    pub fn with_coordinates(&'static self, coordinates: &[f64]) -> Option<AnyEffect> {
        match self.custom {
            Some(_) => Custom::with_values(self, coordinates).map(AnyEffect::Custom),
            None => AnyEffect::from_coordinates(self.id, coordinates),
        }
    }
}

/// Effects that act on one layer at a time, which a search over single insertions does not consider.
const PER_LAYER: [&str; 7] = [
    "deep_indentation",
    "layer_coupling",
    "layer_stiffening",
    "release_depth",
    "delayed_puncture",
    "viscoelastic_presliding",
    "shaft_slip",
];

/// The general effects in the order of the chain (docs/reference/model.md, Effects).
pub fn general_effects() -> impl Iterator<Item = &'static EffectInfo> {
    LIBRARY.iter().map(|entry| entry()).filter(|entry| !PER_LAYER.contains(&entry.id))
}

/// Effects that act on one layer at a time, found in measured insertions.
pub fn per_layer_effects() -> impl Iterator<Item = &'static EffectInfo> {
    LIBRARY.iter().map(|entry| entry()).filter(|entry| PER_LAYER.contains(&entry.id))
}

/// The entry of one effect, general or per layer.
#[must_use]
pub fn effect_info(id: &str) -> Option<&'static EffectInfo> {
    general_effects().chain(per_layer_effects()).find(|entry| entry.id == id)
}
