//! The equation of an effect that is not in the library: given as formulas, or by code that implements [`Equation`].

use crate::custom_text::CustomText;
use alloc::boxed::Box;
use core::fmt::Debug;

/// Most parameters of one custom effect.
pub const MAX_PARAMETERS: usize = 8;
/// Most states of one custom effect.
pub const MAX_STATES: usize = 2;

/// One sample, as an equation gets it. Quantities that its [`Place`](crate::Place) does not have are zero.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EquationSample {
    /// Time in s.
    pub time_s: f64,
    /// Time since the previous sample in s; zero at the first.
    pub dt_s: f64,
    /// Position of the tip, or of the needle's base at [`Place::Sensor`](crate::Place::Sensor), in m.
    pub z_m: f64,
    /// Velocity in m/s.
    pub v_mps: f64,
    /// Acceleration in m/s².
    pub a_mps2: f64,
    /// Distance of the tip behind the front face of the active layer in m, negative in front of it; zero behind the last
    /// layer.
    pub depth_m: f64,
    /// Number of the active layer, the first that is not ruptured; 1-based.
    pub layer: f64,
    /// Travel since the last change of direction in m.
    pub travel_m: f64,
    /// Length of needle inside the tissue in m.
    pub inserted_m: f64,
    /// Elastic force in N.
    pub elastic_n: f64,
    /// Friction along the shaft in N.
    pub friction_n: f64,
    /// Force so far in N: elastic force and friction, or the force that reaches the sensor.
    pub force_n: f64,
}

/// The equation of a custom effect. It is stateless: the same arguments give the same result.
///
/// In a fit, a result that is not finite rejects the parameter values; in a simulation it is an error.
pub trait Equation: Debug + Send + Sync {
    /// Force in N, or length in m at [`Place::Motion`](crate::Place::Motion), for parameters and states in the order of the
    /// definition.
    fn value(&self, sample: &EquationSample, parameters: &[f64], states: &[f64]) -> f64;

    /// Rate of state `index` per second, and its derivative by that state.
    fn rate(
        &self,
        _index: usize,
        _sample: &EquationSample,
        _parameters: &[f64],
        _states: &[f64],
    ) -> (f64, f64) {
        (0.0, 0.0)
    }

    /// Whether it uses [`EquationSample::travel_m`], which is zero otherwise.
    fn uses_travel(&self) -> bool {
        true
    }

    /// At [`Place::Motion`](crate::Place::Motion): derivatives of the value by time and by position.
    fn slopes(&self, sample: &EquationSample, parameters: &[f64]) -> (f64, f64) {
        let at = |time_s: f64, z_m: f64| {
            self.value(&EquationSample { time_s, z_m, ..*sample }, parameters, &[0.0; MAX_STATES])
        };
        let (t, z, by) = (sample.time_s, sample.z_m, 1e-6);
        ((at(t + by, z) - at(t - by, z)) / (2.0 * by), (at(t, z + by) - at(t, z - by)) / (2.0 * by))
    }
}

/// Text and equation of a custom effect.
#[derive(Debug)]
pub struct CustomDefinition {
    /// The text, without values of parameters. It has no `force` where the equation is code.
    pub text: CustomText,
    /// Whether the equation uses [`EquationSample::travel_m`].
    pub uses_travel: bool,
    /// The equation.
    pub equation: Box<dyn Equation>,
}

/// Definitions are compared by identity.
impl PartialEq for CustomDefinition {
    fn eq(&self, other: &Self) -> bool {
        core::ptr::eq(self, other)
    }
}
