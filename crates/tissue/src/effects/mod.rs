//! The effects library: one file per effect.
//!
//! [`AnyEffect`] is the closed list that scenarios can name; adding an effect is one file and one
//! line in the list below.

use crate::effect::{Effect, Memory, Moment, Place};
use crate::slab::Slab;

/// Declares the effect modules and the enum that scenarios write in camel case.
macro_rules! effects {
    ($($module:ident :: $name:ident),* $(,)?) => {
        $(mod $module; pub use $module::*;)*

        /// Any effect of the library, as a scenario's `effects` list writes it.
        #[derive(Clone, Debug, PartialEq)]
        #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
        pub enum AnyEffect {
            $(#[doc = concat!("See [`", stringify!($name), "`].")] $name($name),)*
        }

        $(impl From<$name> for AnyEffect {
            fn from(effect: $name) -> Self { Self::$name(effect) }
        })*

        impl AnyEffect {
            fn inner(&self) -> &dyn Effect {
                match self { $(Self::$name(effect) => effect,)* }
            }
        }
    };
}

effects! {
    respiration::Respiration,
    nonlinear_elasticity::NonlinearElasticity,
    stress_relaxation::StressRelaxation,
    incomplete_release::IncompleteRelease,
    coulomb_friction::CoulombFriction,
    tool_inertia::ToolInertia,
}

impl Effect for AnyEffect {
    fn id(&self) -> &'static str {
        self.inner().id()
    }
    fn place(&self) -> Place {
        self.inner().place()
    }
    fn is_neutral(&self) -> bool {
        self.inner().is_neutral()
    }
    fn shape(&self, slabs: &mut [Slab]) {
        self.inner().shape(slabs);
    }
    fn relative(&self, time_s: f64, z_m: f64, v_mps: f64) -> (f64, f64) {
        self.inner().relative(time_s, z_m, v_mps)
    }
    fn elastic(&self, k_n_per_m: f64, x_m: f64, force_n: f64) -> f64 {
        self.inner().elastic(k_n_per_m, x_m, force_n)
    }
    fn relax(&self, dt_s: f64, elastic_n: f64, memory: &mut Memory) -> f64 {
        self.inner().relax(dt_s, elastic_n, memory)
    }
    fn puncture(&self, threshold_n: f64, v_mps: f64) -> f64 {
        self.inner().puncture(threshold_n, v_mps)
    }
    fn on_rupture(&self, released_n: f64, z_m: f64, memory: &mut Memory) {
        self.inner().on_rupture(released_n, z_m, memory);
    }
    fn friction_velocity(&self, v_mps: f64) -> f64 {
        self.inner().friction_velocity(v_mps)
    }
    fn shaft_force(&self, moment: &Moment, inside_m: f64, memory: &mut Memory) -> f64 {
        self.inner().shaft_force(moment, inside_m, memory)
    }
    fn tip_force(&self, moment: &Moment, slabs: &[Slab], memory: &mut Memory) -> f64 {
        self.inner().tip_force(moment, slabs, memory)
    }
    fn tool_force(&self, v_mps: f64, a_mps2: f64) -> f64 {
        self.inner().tool_force(v_mps, a_mps2)
    }
}
