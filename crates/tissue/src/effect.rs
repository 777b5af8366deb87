//! What an effect is: one departure of reality from the base law, with its place in the chain.
//!
//! An effect is configuration only. What it has to remember between samples lives in a
//! [`Memory`] that the law keeps for it, so that a law can be shared and its state copied.
//! Every hook has a pass-through default: an effect implements the one of its [`Place`].

use crate::effect_info::EffectInfo;
use crate::layer_geometry::Slab;

/// Velocity below which `sgn` is zero, in m/s (SPEC section 6: 0.01 mm/s everywhere).
pub const SGN_DEAD_BAND_MPS: f64 = 1e-5;

/// Sign with the dead band of SPEC section 6: −1, 0 or 1.
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

/// What an effect remembers between samples. Zero at the start of an insertion.
pub type EffectState = [f64; 8];

/// Where in the chain of SPEC section 6 an effect acts. The order of the variants is the order
/// of the chain.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum ChainStage {
    /// Changes the layers before the insertion starts.
    Geometry,
    /// Changes depth and velocity of the tip relative to the tissue.
    Kinematics,
    /// Changes the elastic force as a function of depth.
    Elastic,
    /// Changes the elastic force as a function of its history.
    Relaxation,
    /// Changes the force at which a layer ruptures.
    Puncture,
    /// Changes what happens to the elastic force at a rupture.
    Release,
    /// Changes or adds to the friction along the shaft.
    Friction,
    /// Adds a force at the tip.
    Tip,
    /// Acts between tissue and sensor: arm and tool.
    Tool,
    /// Acts in the force sensor.
    Sensor,
    /// Acts on the recorded position.
    Position,
}

/// What an effect may look at in one sample. Positions and velocities are the tip's, relative to
/// the tissue, after all kinematic effects.
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
    /// Number of ruptured layers.
    pub ruptured: usize,
}

/// One departure from the base law.
///
/// The hooks are called in the order of [`Place`]; each takes the value of the base law (as the
/// effects before it left it) and returns the new one. A hook that is not overridden passes the
/// value through.
pub trait Effect {
    /// Equation, source, signature and parameters, for listing, validating and fitting.
    fn info(&self) -> &'static EffectInfo;

    /// Stable name in snake case, as in every output and in SPEC section 6.
    fn id(&self) -> &'static str {
        self.info().id
    }

    /// Place in the chain.
    fn place(&self) -> ChainStage {
        self.info().stage
    }

    /// True when the parameters make the effect vanish: it is then bypassed altogether, so that
    /// the base law comes back bit for bit.
    fn is_neutral(&self) -> bool;

    /// True when the effect uses its [`Memory`].
    fn remembers(&self) -> bool {
        false
    }

    /// [`Place::Geometry`]: moves faces or changes coefficients, once.
    fn shape(&self, _slabs: &mut [Slab]) {}

    /// [`Place::Kinematics`]: depth and velocity relative to the tissue.
    fn relative(&self, _time_s: f64, z_m: f64, v_mps: f64) -> (f64, f64) {
        (z_m, v_mps)
    }

    /// [`Place::Elastic`]: elastic force in N at indentation `x_m` of a layer of stiffness
    /// `k_n_per_m`; `force_n` is what the chain made of it so far.
    fn elastic(&self, _k_n_per_m: f64, _x_m: f64, force_n: f64) -> f64 {
        force_n
    }

    /// [`Place::Relaxation`]: the force that is left of the elastic force `elastic_n` given its
    /// history. Called once per sample and active layer.
    fn relax(&self, _dt_s: f64, elastic_n: f64, _memory: &mut EffectState) -> f64 {
        elastic_n
    }

    /// [`Place::Puncture`]: force in N at which the active layer ruptures.
    fn puncture(&self, threshold_n: f64, _v_mps: f64) -> f64 {
        threshold_n
    }

    /// [`Place::Puncture`]: force in N at which layer `layer` (1-based) ruptures, given what it bore: told of its elastic force in
    /// every step of `dt_s`.
    fn endure(
        &self,
        _layer: usize,
        _dt_s: f64,
        _elastic_n: f64,
        threshold_n: f64,
        _memory: &mut EffectState,
    ) -> f64 {
        threshold_n
    }

    /// [`Place::Release`]: the part in N of the force released at a rupture that this effect keeps
    /// back for good; the release effects after it see what is left.
    fn withheld(&self, _released_n: f64) -> f64 {
        0.0
    }

    /// Told of every rupture, with the elastic force that was released (N) and the position of
    /// the rupture (m). Effects with memory of the layer forget it here.
    fn on_rupture(&self, _released_n: f64, _z_m: f64, _memory: &mut EffectState) {}

    /// [`Place::Friction`]: the velocity that the viscous friction feels, in m/s.
    fn friction_velocity(&self, v_mps: f64) -> f64 {
        v_mps
    }

    /// [`Place::Friction`]: the factor on all friction coefficients `b_i` at the tip velocity.
    fn friction_factor(&self, _v_mps: f64) -> f64 {
        1.0
    }

    /// [`Place::Friction`]: a force in N added to the shaft friction, `inside_m` being the total
    /// length of needle inside the tissue.
    fn shaft_force(&self, _moment: &TipState, _inside_m: f64, _memory: &mut EffectState) -> f64 {
        0.0
    }

    /// [`Place::Friction`]: told of every rupture, with the layer (1-based) and the elastic force in N
    /// that the release effects did not keep back.
    fn on_layer_rupture(&self, _layer: usize, _released_n: f64, _memory: &mut EffectState) {}

    /// [`Place::Friction`]: the force in N that is left of the elastic force of layer `layer` (1-based) while it is pressed.
    fn press(&self, _layer: usize, _dt_s: f64, elastic_n: f64, _memory: &mut EffectState) -> f64 {
        elastic_n
    }

    /// [`Place::Friction`]: the effect along a shaft that is `factor` times as rough; for effects whose strength no layer holds.
    fn rubbed(&mut self, _factor: f64) {}

    /// [`Place::Puncture`]: the effect in a layer (1-based) that is `factor` times as tough; for effects that hold a puncture force.
    fn toughened(&mut self, _layer: usize, _factor: f64) {}

    /// [`Place::Friction`]: a force in N with which a punctured layer holds the shaft. `sliding_mps` is
    /// the velocity that friction feels at this tip velocity, all factors included.
    fn grip(&self, _moment: &TipState, _slabs: &[Slab], _sliding_mps: f64, _memory: &mut EffectState) -> f64 {
        0.0
    }

    /// [`Place::Tip`]: true when something of the effect's own breaks with the tip at `z_m`; told to
    /// the memory, once, before the forces are summed up.
    fn breaks(&self, _z_m: f64, _slabs: &[Slab], _memory: &mut EffectState) -> bool {
        false
    }

    /// [`Place::Release`] and [`Place::Tip`]: a force in N added at the tip.
    fn tip_force(&self, _moment: &TipState, _slabs: &[Slab], _memory: &mut EffectState) -> f64 {
        0.0
    }

    /// [`Place::Tool`]: a force in N added between tissue and sensor, from the base's velocity
    /// (m/s) and acceleration (m/s²).
    fn tool_force(&self, _v_mps: f64, _a_mps2: f64) -> f64 {
        0.0
    }

    /// [`Place::Sensor`]: what the sensor makes of a force in N at `time_s`, `dt_s` after the sample
    /// before (zero at the first).
    fn sense(&self, _time_s: f64, _dt_s: f64, force_n: f64, _memory: &mut EffectState) -> f64 {
        force_n
    }

    /// [`Place::Sensor`]: the mean of what the sensor makes of a force over a span: `force_n` is the mean of what comes
    /// in over `span_s` seconds around `time_s`, in which the sensor takes `samples` samples.
    fn sense_mean(
        &self,
        time_s: f64,
        span_s: f64,
        _samples: f64,
        force_n: f64,
        memory: &mut EffectState,
    ) -> f64 {
        self.sense(time_s, span_s, force_n, memory)
    }

    /// [`Place::Sensor`]: what the sensor makes of a force at the end of a span: `force_n` is the mean of what comes in over the
    /// `span_s` seconds before `time_s`.
    fn sense_after(&self, time_s: f64, span_s: f64, force_n: f64, memory: &mut EffectState) -> f64 {
        self.sense(time_s, span_s, force_n, memory)
    }

    /// [`Place::Sensor`]: time in s by which the whole force comes late.
    fn delay_s(&self) -> f64 {
        0.0
    }

    /// [`Place::Tip`]: depth in m below the surface at which something of the effect's own breaks, if it does.
    fn break_depth_m(&self) -> Option<f64> {
        None
    }

    /// [`Place::Position`]: recorded position over true position.
    fn position_factor(&self) -> f64 {
        1.0
    }
}

/// First-order lag `tau y' = x - y` over a step `dt` with `x` linear in between: `(keep, ramp)` such
/// that `y = keep y0 + (1 - keep) x0 + ramp (x1 - x0)`. Exact, and therefore the same lag at every
/// sampling rate; with `x` held it is the usual `y += (1 - exp(-dt/tau)) (x - y)`.
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

/// True when two time steps are the same but for the rounding of time stamps, so that weights
/// computed for one serve the other (the error is below 1e-10 of a step).
#[must_use]
#[inline]
pub(crate) fn same_step(a_s: f64, b_s: f64) -> bool {
    (a_s - b_s).abs() <= 1e-10 * a_s
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An effect that answers no hook.
    struct Nothing;

    impl Effect for Nothing {
        fn info(&self) -> &'static EffectInfo {
            crate::effect_info("cutting_force").expect("in the library")
        }
        fn is_neutral(&self) -> bool {
            true
        }
    }

    #[test]
    fn a_hook_that_an_effect_does_not_answer_passes_the_value_through() {
        let (none, mut memory) = (Nothing, [0.25; 8]);
        let moment = TipState { time_s: 1.0, dt_s: 0.1, z_m: 0.02, dz_m: 0.001, v_mps: 0.01, ruptured: 1 };
        assert_eq!((none.id(), none.place(), none.remembers()), ("cutting_force", ChainStage::Tip, false));
        assert_eq!(none.relative(1.0, 0.02, 0.03), (0.02, 0.03));
        assert_eq!(none.elastic(50.0, 0.02, 0.7), 0.7);
        assert_eq!(none.relax(0.1, 0.7, &mut memory), 0.7);
        assert_eq!(none.puncture(0.7, 0.01), 0.7);
        assert_eq!(none.endure(1, 0.1, 0.3, 0.7, &mut memory), 0.7);
        assert_eq!(none.press(1, 0.1, 0.7, &mut memory), 0.7);
        assert_eq!((none.friction_velocity(0.03), none.friction_factor(0.03)), (0.03, 1.0));
        assert_eq!(none.sense(1.0, 0.1, 0.7, &mut memory), 0.7);
        assert_eq!(none.sense_mean(1.0, 0.1, 20.0, 0.7, &mut memory), 0.7);
        assert_eq!((none.position_factor(), none.delay_s(), none.break_depth_m()), (1.0, 0.0, None));
        // What would add to the force adds nothing, nothing breaks, and nothing is remembered.
        assert_eq!((none.withheld(0.7), none.tool_force(0.01, 2.0)), (0.0, 0.0));
        assert_eq!(none.shaft_force(&moment, 0.02, &mut memory), 0.0);
        assert_eq!(none.grip(&moment, &[], 0.01, &mut memory), 0.0);
        assert_eq!(none.tip_force(&moment, &[], &mut memory), 0.0);
        assert!(!none.breaks(0.02, &[], &mut memory));
        assert_eq!(memory, [0.25; 8]);
    }

    #[test]
    fn a_sign_is_zero_within_the_dead_band_and_on_its_edges() {
        let edge = SGN_DEAD_BAND_MPS;
        assert_eq!(
            [-1.0, -1.1 * edge, -edge, 0.0, edge, 1.1 * edge, 1.0].map(sgn),
            [-1.0, -1.0, 0.0, 0.0, 0.0, 1.0, 1.0]
        );
    }

    #[test]
    fn the_weights_of_a_lag_solve_its_equation_over_a_step() {
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
        // In no time nothing changes, not even without a lag; without a lag the input comes through.
        assert_eq!(
            [lag_weights(0.0, 0.3), lag_weights(0.0, 0.0), lag_weights(0.1, 0.0)],
            [(1.0, 0.0), (1.0, 0.0), (0.0, 1.0)]
        );
        assert_eq!(lag_weights(-0.1, 0.3), (1.0, 0.0));
    }

    #[test]
    fn steps_are_the_same_but_for_the_rounding_of_time_stamps() {
        assert!(
            same_step(0.005, 0.005) && same_step(1000.005 - 1000.0, 0.005 + 1e-13) && same_step(0.0, 0.0)
        );
        assert!(!same_step(0.005, 0.005_001) && !same_step(0.005, 0.0) && !same_step(0.005, 0.004_999));
        assert!(!same_step(0.005, 0.005 + 1e-11) && !same_step(5.0, 5.0 + 1e-8));
    }
}
