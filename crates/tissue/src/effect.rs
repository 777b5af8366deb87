//! The trait of an effect: one departure from the base law, with its stage in the measurement chain.
//!
//! An effect is configuration only. Its state between samples is an [`EffectState`] kept by the force law's state, so that a
//! law can be shared and its state copied. Every hook has a pass-through default; an effect overrides those of its
//! [`ChainStage`].

use crate::chain_stage::ChainStage;
use crate::effect_info::EffectInfo;
use crate::layer_geometry::Slab;

/// Velocity in m/s below which [`sgn`] is zero (0.01 mm/s in all effects; docs/reference/model.md, Effects).
pub const SGN_DEAD_BAND_MPS: f64 = 1e-5;

/// Sign with the dead band [`SGN_DEAD_BAND_MPS`]: -1, 0 or 1.
#[must_use]
#[inline]
pub fn sgn(v_mps: f64) -> f64 {
    if v_mps > SGN_DEAD_BAND_MPS {
        1.0
    } else if v_mps < -SGN_DEAD_BAND_MPS {
        -1.0
    } else {
        0.0
    }
}

/// State of one effect between samples. Zero at the start of an insertion.
pub type EffectState = [f64; 8];

/// Motion of the tip in one sample, relative to the tissue, after all kinematic effects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TipState {
    /// Time in seconds.
    pub time_s: f64,
    /// Time since the previous sample in seconds; zero at the first.
    pub dt_s: f64,
    /// Tip position in metres.
    pub z_m: f64,
    /// Travel of the tip since the previous sample in metres; zero at the first.
    pub dz_m: f64,
    /// Tip velocity in m/s.
    pub v_mps: f64,
    /// Change of the tip velocity since the previous sample in m/s; zero at the first.
    pub dv_mps: f64,
    /// Number of ruptured layers.
    pub ruptured: usize,
}

/// Forces and layers in one sample, for effects along the shaft and at the tip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InsertionState<'a> {
    /// Length of needle inside the tissue in metres.
    pub inside_m: f64,
    /// The layers in space.
    pub slabs: &'a [Slab],
    /// Elastic force in N.
    pub elastic_n: f64,
    /// Friction along the shaft in N by the base law and the effects before; zero at [`ChainStage::Release`].
    pub friction_n: f64,
}

/// Motion of the needle's base in one sample, for effects between tissue and sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BaseMotion {
    /// Time in seconds.
    pub time_s: f64,
    /// Time since the previous sample in seconds; zero at the first.
    pub dt_s: f64,
    /// Position in metres.
    pub z_m: f64,
    /// Velocity in m/s.
    pub v_mps: f64,
    /// Acceleration in m/s².
    pub a_mps2: f64,
}

/// One departure from the base law.
///
/// The hooks are called in the order of [`ChainStage`]; each takes the value that the base law and the effects before it
/// give, and returns the new one. The default of every hook passes the value through.
pub trait Effect {
    /// Equation, source, signature and parameters, for listing, validation and fitting.
    fn info(&self) -> &'static EffectInfo;

    /// Stable name in snake case, as in every output.
    fn id(&self) -> &'static str {
        self.info().id
    }

    /// Stage in the chain.
    fn stage(&self) -> ChainStage {
        self.info().stage
    }

    /// Whether the parameters make the effect vanish. Inactive effects are left out of the chain, so that the result is bit
    /// for bit that of the base law.
    fn is_inactive(&self) -> bool;

    /// Whether the effect uses its [`EffectState`].
    fn has_state(&self) -> bool {
        false
    }

    /// [`ChainStage::Geometry`]: moves faces or changes coefficients, once.
    fn modify_layers(&self, _slabs: &mut [Slab]) {}

    /// [`ChainStage::Kinematics`]: depth and velocity relative to the tissue.
    fn relative_motion(&self, _time_s: f64, z_m: f64, v_mps: f64) -> (f64, f64) {
        (z_m, v_mps)
    }

    /// [`ChainStage::Elastic`]: elastic force in N at indentation `x_m` of a layer of stiffness `k_n_per_m`; `force_n` is
    /// the value of the effects before.
    fn elastic_force(&self, _k_n_per_m: f64, _x_m: f64, force_n: f64) -> f64 {
        force_n
    }

    /// [`ChainStage::Relaxation`]: elastic force in N after relaxation, with the tip `depth_m` behind the front face of the
    /// active layer. Called once per sample and active layer.
    fn relax(&self, _tip: &TipState, _depth_m: f64, elastic_n: f64, _state: &mut EffectState) -> f64 {
        elastic_n
    }

    /// [`ChainStage::Puncture`]: force in N at which the active layer ruptures.
    fn puncture_force(&self, threshold_n: f64, _v_mps: f64) -> f64 {
        threshold_n
    }

    /// [`ChainStage::Puncture`]: force in N at which layer `layer` (1-based) ruptures, given its load history. Called with
    /// the elastic force of every step of `dt_s`.
    fn puncture_force_after_load(
        &self,
        _layer: usize,
        _dt_s: f64,
        _elastic_n: f64,
        threshold_n: f64,
        _state: &mut EffectState,
    ) -> f64 {
        threshold_n
    }

    /// [`ChainStage::Release`]: the part in N of the force released at a rupture that this effect retains for good; the
    /// release effects after it get the rest.
    fn retained_force(&self, _released_n: f64) -> f64 {
        0.0
    }

    /// Called at every rupture, with the released elastic force (N) and the position of the rupture (m). Effects reset the
    /// state of the layer here.
    fn on_rupture(&self, _released_n: f64, _z_m: f64, _state: &mut EffectState) {}

    /// [`ChainStage::Friction`]: the velocity in m/s that enters the viscous friction.
    fn friction_velocity(&self, v_mps: f64) -> f64 {
        v_mps
    }

    /// [`ChainStage::Friction`]: the factor on all friction coefficients `b_i` at the tip velocity.
    fn friction_factor(&self, _v_mps: f64) -> f64 {
        1.0
    }

    /// [`ChainStage::Friction`]: a force in N added to the shaft friction.
    fn shaft_force(&self, _tip: &TipState, _at: &InsertionState, _state: &mut EffectState) -> f64 {
        0.0
    }

    /// [`ChainStage::Friction`]: called at every rupture, with the layer (1-based) and the elastic force in N that the
    /// release effects did not retain.
    fn on_layer_rupture(&self, _layer: usize, _released_n: f64, _state: &mut EffectState) {}

    /// [`ChainStage::Friction`]: elastic force in N of layer `layer` (1-based) after relaxation, before its rupture.
    fn relax_layer(&self, _layer: usize, _dt_s: f64, elastic_n: f64, _state: &mut EffectState) -> f64 {
        elastic_n
    }

    /// [`ChainStage::Friction`]: scales the effect's own friction parameters, for a recording with `factor` times the
    /// friction. Only for effects whose strength is not a coefficient of a layer.
    fn scale_friction(&mut self, _factor: f64) {}

    /// [`ChainStage::Puncture`]: scales the effect's own puncture force of a layer (1-based).
    fn scale_puncture(&mut self, _layer: usize, _factor: f64) {}

    /// [`ChainStage::Friction`]: the force in N that a punctured layer exerts on the shaft. `sliding_mps` is the velocity
    /// that enters the viscous friction at this tip velocity, all factors included.
    fn layer_friction(
        &self,
        _tip: &TipState,
        _slabs: &[Slab],
        _sliding_mps: f64,
        _state: &mut EffectState,
    ) -> f64 {
        0.0
    }

    /// [`ChainStage::Tip`]: whether a membrane of the effect ruptures with the tip at `z_m`, which it records in its
    /// state. Called once, before the forces are added up.
    fn ruptures_membrane(&self, _z_m: f64, _slabs: &[Slab], _state: &mut EffectState) -> bool {
        false
    }

    /// [`ChainStage::Release`] and [`ChainStage::Tip`]: a force in N added at the tip.
    fn tip_force(&self, _tip: &TipState, _at: &InsertionState, _state: &mut EffectState) -> f64 {
        0.0
    }

    /// [`ChainStage::Tool`]: a force in N added between tissue and sensor to the force `force_n` so far.
    fn tool_force(&self, _base: &BaseMotion, _force_n: f64, _state: &mut EffectState) -> f64 {
        0.0
    }

    /// [`ChainStage::Sensor`]: sensor output in N for a force at `time_s`, `dt_s` after the previous sample (zero at the
    /// first).
    fn sensor_output(&self, _time_s: f64, _dt_s: f64, force_n: f64, _state: &mut EffectState) -> f64 {
        force_n
    }

    /// [`ChainStage::Sensor`]: mean sensor output in N over an interval of `span_s` seconds around `time_s` with `samples`
    /// evenly spaced samples; `force_n` is the mean input.
    fn mean_sensor_output(
        &self,
        time_s: f64,
        span_s: f64,
        _samples: f64,
        force_n: f64,
        state: &mut EffectState,
    ) -> f64 {
        self.sensor_output(time_s, span_s, force_n, state)
    }

    /// [`ChainStage::Sensor`]: sensor output in N at the end `time_s` of an interval of `span_s` seconds; `force_n` is the
    /// mean input of that interval.
    fn sensor_output_at_end(&self, time_s: f64, span_s: f64, force_n: f64, state: &mut EffectState) -> f64 {
        self.sensor_output(time_s, span_s, force_n, state)
    }

    /// [`ChainStage::Sensor`]: delay of the force in s.
    fn delay_s(&self) -> f64 {
        0.0
    }

    /// [`ChainStage::Tip`]: depth in m below the surface at which a membrane of the effect ruptures, if there is one.
    fn membrane_depth_m(&self) -> Option<f64> {
        None
    }

    /// [`ChainStage::Position`]: recorded position over true position.
    fn position_factor(&self) -> f64 {
        1.0
    }
}

/// Weights `(keep, ramp)` of a first-order lag `tau y' = x - y` over a step `dt`, for an `x` that is linear in between:
/// `y = keep y0 + (1 - keep) x0 + ramp (x1 - x0)`. Exact, hence the same lag at every sampling rate.
#[must_use]
pub(crate) fn lag_weights(dt_s: f64, time_constant_s: f64) -> (f64, f64) {
    let ratio = dt_s / time_constant_s;
    if ratio <= 0.0 || ratio.is_nan() {
        return (1.0, 0.0);
    }
    if ratio == f64::INFINITY {
        return (0.0, 1.0);
    }
    let lost = -libm::expm1(-ratio);
    (1.0 - lost, 1.0 - lost / ratio)
}

/// Whether two time steps are equal up to the rounding of time stamps, so that the weights of one hold for the other (the
/// error is below 1e-10 of a step).
#[must_use]
#[inline]
pub(crate) fn same_step(a_s: f64, b_s: f64) -> bool {
    (a_s - b_s).abs() <= 1e-10 * a_s
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An effect that overrides no hook.
    struct NoHooks;

    impl Effect for NoHooks {
        fn info(&self) -> &'static EffectInfo {
            crate::effect_info("cutting_force").expect("in the library")
        }
        fn is_inactive(&self) -> bool {
            true
        }
    }

    #[test]
    fn default_hooks_pass_values_through_and_add_no_force() {
        let (none, mut state) = (NoHooks, [0.25; 8]);
        let tip = TipState {
            time_s: 1.0,
            dt_s: 0.1,
            z_m: 0.02,
            dz_m: 0.001,
            v_mps: 0.01,
            dv_mps: 0.0,
            ruptured: 1,
        };
        let at = InsertionState { inside_m: 0.02, slabs: &[], elastic_n: 0.5, friction_n: 0.1 };
        let base = BaseMotion { time_s: 1.0, dt_s: 0.1, z_m: 0.02, v_mps: 0.01, a_mps2: 2.0 };
        assert_eq!((none.id(), none.stage(), none.has_state()), ("cutting_force", ChainStage::Tip, false));
        assert_eq!(none.relative_motion(1.0, 0.02, 0.03), (0.02, 0.03));
        assert_eq!(none.elastic_force(50.0, 0.02, 0.7), 0.7);
        assert_eq!(none.relax(&tip, 0.01, 0.7, &mut state), 0.7);
        assert_eq!(none.puncture_force(0.7, 0.01), 0.7);
        assert_eq!(none.puncture_force_after_load(1, 0.1, 0.3, 0.7, &mut state), 0.7);
        assert_eq!(none.relax_layer(1, 0.1, 0.7, &mut state), 0.7);
        assert_eq!((none.friction_velocity(0.03), none.friction_factor(0.03)), (0.03, 1.0));
        assert_eq!(none.sensor_output(1.0, 0.1, 0.7, &mut state), 0.7);
        assert_eq!(none.mean_sensor_output(1.0, 0.1, 20.0, 0.7, &mut state), 0.7);
        assert_eq!((none.position_factor(), none.delay_s(), none.membrane_depth_m()), (1.0, 0.0, None));
        assert_eq!((none.retained_force(0.7), none.tool_force(&base, 0.7, &mut state)), (0.0, 0.0));
        assert_eq!(none.shaft_force(&tip, &at, &mut state), 0.0);
        assert_eq!(none.layer_friction(&tip, &[], 0.01, &mut state), 0.0);
        assert_eq!(none.tip_force(&tip, &at, &mut state), 0.0);
        assert!(!none.ruptures_membrane(0.02, &[], &mut state));
        assert_eq!(state, [0.25; 8]);
    }

    #[test]
    fn sgn_is_zero_within_the_dead_band_and_on_its_edges() {
        let edge = SGN_DEAD_BAND_MPS;
        assert_eq!(
            [-1.0, -1.1 * edge, -edge, 0.0, edge, 1.1 * edge, 1.0].map(sgn),
            [-1.0, -1.0, 0.0, 0.0, 0.0, 1.0, 1.0]
        );
    }

    #[test]
    fn lag_weights_solve_the_first_order_equation_over_a_step() {
        // tau y' = x0 + (x1 - x0) t/dt - y from y0, by very short steps of Heun's method.
        for (dt, tau) in [(0.1, 0.3), (0.7, 0.2)] {
            let (y0, x0, x1) = (0.4, 1.5, -2.0);
            let (mut y, n) = (y0, 200_000);
            let h = dt / f64::from(n);
            for k in 0..n {
                let x = |k: i32| x0 + (x1 - x0) * f64::from(k) / f64::from(n);
                let first = (x(k) - y) / tau;
                let second = (x(k + 1) - (y + h * first)) / tau;
                y += 0.5 * h * (first + second);
            }
            let (keep, ramp) = lag_weights(dt, tau);
            assert!((keep * y0 + (1.0 - keep) * x0 + ramp * (x1 - x0) - y).abs() < 1e-9, "{dt} {tau}");
        }
        // A step of zero length changes nothing; without a lag the output is the input.
        assert_eq!(
            [lag_weights(0.0, 0.3), lag_weights(0.0, 0.0), lag_weights(0.1, 0.0)],
            [(1.0, 0.0), (1.0, 0.0), (0.0, 1.0)]
        );
        assert_eq!(lag_weights(-0.1, 0.3), (1.0, 0.0));
    }

    #[test]
    fn time_steps_are_compared_up_to_the_rounding_of_time_stamps() {
        assert!(
            same_step(0.005, 0.005) && same_step(1000.005 - 1000.0, 0.005 + 1e-13) && same_step(0.0, 0.0)
        );
        assert!(!same_step(0.005, 0.005_001) && !same_step(0.005, 0.0) && !same_step(0.005, 0.004_999));
        assert!(!same_step(0.005, 0.005 + 1e-11) && !same_step(5.0, 5.0 + 1e-8));
    }
}
