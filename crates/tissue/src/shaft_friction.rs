//! Predicted friction along the shaft: the force law replayed along recorded positions, with imposed ruptures.

use crate::effects::AnyEffect;
use crate::force_law::ForceLaw;
use crate::force_law_state::ForceLawState;
use crate::measurement_chain::{MeasurementChain, MeasurementState, SensorInput};

/// Causal prediction of the friction along the shaft, sample by sample.
///
/// While advancing it is the friction of the passed layers, the difference of total and tip force
/// ([`TissueForce::tip_n`](crate::TissueForce::tip_n)); in retraction it is the whole friction, since no force acts on the
/// tip. It passes through the sensor effects that scale, lag or delay a force; bias, drift, interference and drive friction
/// are left out, and clipping and rounding are not modelled.
#[derive(Clone, Debug)]
pub struct ShaftFriction {
    law: ForceLaw,
    sensor: MeasurementChain,
    state: ForceLawState,
    sensor_state: MeasurementState,
}

impl ShaftFriction {
    /// The friction of `law` as recorded at about `sample_hz`, through those sensor effects among `effects` that scale, lag
    /// or delay a force.
    #[must_use]
    pub fn new(law: ForceLaw, effects: &[AnyEffect], sample_hz: f64) -> Self {
        let passes = |e: &&AnyEffect| {
            matches!(
                e,
                AnyEffect::ForceGain(_)
                    | AnyEffect::LowPassLag(_)
                    | AnyEffect::TimeDelay(_)
                    | AnyEffect::PositionScale(_)
            )
        };
        let effects: alloc::vec::Vec<AnyEffect> = effects.iter().filter(passes).cloned().collect();
        let sensor = MeasurementChain::new(&effects);
        let sensor_state = sensor.start(sample_hz);
        Self { law, sensor, state: ForceLawState::default(), sensor_state }
    }

    /// Friction in N at the next sample of a recording when `ruptured` layers are ruptured. NaN when the sample is not
    /// finite; the state is then unchanged.
    pub fn step(&mut self, time_s: f64, position_m: f64, velocity_mps: f64, ruptured: usize) -> f64 {
        if !(time_s + position_m + velocity_mps).is_finite() {
            return f64::NAN;
        }
        let (z_m, v_mps) = (self.sensor.true_position(position_m), self.sensor.true_position(velocity_mps));
        let force = self.law.step_imposed(&mut self.state, time_s, z_m, v_mps, ruptured, |_| {});
        let tissue_n = if v_mps < 0.0 { force.friction_n } else { force.total_n - force.tip_n };
        let reading = SensorInput { time_s, velocity_mps: v_mps, tissue_n, ..SensorInput::default() };
        self.sensor.step(&mut self.sensor_state, &reading)
    }
}

#[cfg(test)]
mod tests {
    use super::ShaftFriction;
    use crate::{ForceBias, ForceGain, ForceLaw, Layer, PositionScale, Tissue};
    use alloc::vec;

    fn law() -> ForceLaw {
        let layer = |friction_ns_per_m2| Layer {
            name: "gel".into(),
            thickness_m: 0.02,
            stiffness_n_per_m: 50.0,
            friction_ns_per_m2,
            puncture_n: None,
        };
        ForceLaw::base(&Tissue { surface_m: 0.0, layers: vec![layer(4000.0), layer(6000.0)] })
    }

    fn near(found: f64, expected: f64) {
        assert!((found - expected).abs() < 1e-12, "{found} for {expected}");
    }

    #[test]
    fn passed_layers_rub_while_advancing_and_all_layers_in_retraction() {
        let mut shaft = ShaftFriction::new(law(), &[], 100.0);
        near(shaft.step(0.0, 0.01, 0.002, 0), 0.0);
        near(shaft.step(5.0, 0.018, 0.002, 1), 0.002 * 4000.0 * 0.018);
        near(shaft.step(10.0, 0.025, 0.002, 1), 0.002 * 4000.0 * 0.02);
        // A sample that is not finite changes nothing.
        assert!(shaft.step(11.0, f64::NAN, 0.002, 2).is_nan());
        near(shaft.step(12.0, 0.025, 0.0, 1), 0.0);
        near(shaft.step(13.0, 0.025, -0.002, 1), -0.002 * (4000.0 * 0.02 + 6000.0 * 0.005));
    }

    #[test]
    fn gain_scales_the_friction_bias_does_not_and_a_position_scale_is_undone() {
        let effects = [
            ForceGain { eps: 0.5 }.into(),
            ForceBias { force_n: 3.0 }.into(),
            PositionScale { eps: 0.25 }.into(),
        ];
        let mut shaft = ShaftFriction::new(law(), &effects, 100.0);
        near(shaft.step(0.0, 1.25 * 0.01, 1.25 * 0.002, 0), 0.0);
        near(shaft.step(10.0, 1.25 * 0.025, 1.25 * 0.002, 1), 1.5 * 0.002 * 4000.0 * 0.02);
    }
}
