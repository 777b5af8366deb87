//! An effect that is not in the library.

use crate::custom_equation::{CustomDefinition, EquationSample, MAX_STATES};
use crate::custom_text::Place;
use crate::effect::{BaseMotion, Effect, EffectState, InsertionState, TipState, sgn};
use crate::effect_info::EffectInfo;
use alloc::vec::Vec;

/// An effect that is not in the library: its definition and the values of its parameters.
///
/// A definition stays in memory until the program ends.
#[derive(Clone, Debug, PartialEq)]
pub struct Custom {
    info: &'static EffectInfo,
    definition: &'static CustomDefinition,
    values: Vec<f64>,
}

impl Custom {
    /// The effect of a definition with these values.
    pub(crate) fn with_values(info: &'static EffectInfo, values: &[f64]) -> Option<Self> {
        let definition = info.custom.filter(|_| values.len() == info.parameters.len())?;
        Some(Self { info, definition, values: values.into() })
    }

    /// The entry of the effect.
    #[must_use]
    pub fn entry(&self) -> &'static EffectInfo {
        self.info
    }

    /// Text and equation.
    pub(crate) fn definition(&self) -> &'static CustomDefinition {
        self.definition
    }

    /// The parameters, in the order of the definition.
    #[must_use]
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// Advances travel and states to a sample, and returns the value there.
    ///
    /// State: travel since the last change of direction, with the sign of the direction; for each state its value and the
    /// part of its rate that does not depend on it; exponent and growth of the first state in the last step.
    fn advance(&self, mut sample: EquationSample, dz_m: f64, memory: &mut EffectState) -> f64 {
        let definition = self.definition;
        if definition.uses_travel {
            // Jitter of the measured position at rest must not count as a change of direction.
            let direction = sgn(sample.v_mps);
            if direction != 0.0 {
                let before = if direction * memory[0] >= 0.0 { memory[0] } else { 0.0 };
                memory[0] = before + direction * dz_m.abs();
            }
            sample.travel_m = memory[0].abs();
        }
        let count = definition.text.state.0.len().min(MAX_STATES);
        let mut states = [0.0; MAX_STATES];
        for (k, state) in states.iter_mut().enumerate().take(count) {
            *state = memory[1 + 2 * k];
        }
        let before = states;
        for k in 0..count {
            let (rate, slope) = definition.equation.rate(k, &sample, &self.values, &before);
            // Exact for a rate that is linear in the state, with coefficients that are linear in time (exponential
            // Rosenbrock method: Hochbruck and Ostermann 2010).
            let source = rate - slope * before[k];
            let exponent = slope * sample.dt_s;
            let growth = if k > 0 {
                libm::expm1(exponent)
            } else {
                if memory[5] != exponent {
                    (memory[5], memory[6]) = (exponent, libm::expm1(exponent));
                }
                memory[6]
            };
            let (first, second) = weights(exponent, growth);
            let old = memory[2 + 2 * k];
            states[k] += growth * before[k] + sample.dt_s * (first * old + second * (source - old));
            (memory[1 + 2 * k], memory[2 + 2 * k]) = (states[k], source);
        }
        definition.equation.value(&sample, &self.values, &states)
    }
}

/// The functions `(e^x - 1)/x` and `(e^x - 1 - x)/x²` for a `growth` of `e^x - 1`.
fn weights(x: f64, growth: f64) -> (f64, f64) {
    if x.abs() < 1e-4 {
        (1.0 + x * (0.5 + x / 6.0), 0.5 + x * (1.0 / 6.0 + x / 24.0))
    } else {
        let first = growth / x;
        (first, (first - 1.0) / x)
    }
}

/// The acceleration over a step in m/s²; zero at the first sample.
fn acceleration(tip: &TipState) -> f64 {
    if tip.dt_s > 0.0 { tip.dv_mps / tip.dt_s } else { 0.0 }
}

/// The sample of an effect along the shaft or at the tip.
fn sample_of(tip: &TipState, at: &InsertionState) -> EquationSample {
    EquationSample {
        time_s: tip.time_s,
        dt_s: tip.dt_s,
        z_m: tip.z_m,
        v_mps: tip.v_mps,
        a_mps2: acceleration(tip),
        depth_m: at.slabs.get(tip.ruptured).map_or(0.0, |slab| tip.z_m - slab.front_m),
        layer: (tip.ruptured + 1) as f64,
        travel_m: 0.0,
        inserted_m: at.inside_m,
        elastic_n: at.elastic_n,
        friction_n: at.friction_n,
        force_n: at.elastic_n + at.friction_n,
    }
}

impl Effect for Custom {
    fn info(&self) -> &'static EffectInfo {
        self.info
    }
    fn is_inactive(&self) -> bool {
        let mut strengths = self.info.parameters.iter().zip(&self.values).filter(|(p, _)| p.strength);
        strengths.all(|(p, value)| *value == p.inactive)
    }
    fn has_state(&self) -> bool {
        !self.definition.text.state.is_empty() || self.definition.uses_travel
    }
    fn relative_motion(&self, time_s: f64, z_m: f64, v_mps: f64) -> (f64, f64) {
        let sample = EquationSample { time_s, z_m, v_mps, ..EquationSample::default() };
        let equation = &self.definition.equation;
        let moved = equation.value(&sample, &self.values, &[0.0; MAX_STATES]);
        let (by_time, by_position) = equation.slopes(&sample, &self.values);
        (z_m - moved, v_mps - by_time - by_position * v_mps)
    }
    fn relax(&self, tip: &TipState, depth_m: f64, elastic_n: f64, state: &mut EffectState) -> f64 {
        let sample = EquationSample {
            time_s: tip.time_s,
            dt_s: tip.dt_s,
            z_m: tip.z_m,
            v_mps: tip.v_mps,
            a_mps2: acceleration(tip),
            depth_m,
            layer: (tip.ruptured + 1) as f64,
            elastic_n,
            ..EquationSample::default()
        };
        elastic_n + self.advance(sample, tip.dz_m, state)
    }
    fn on_rupture(&self, _released_n: f64, _z_m: f64, state: &mut EffectState) {
        if self.definition.text.place == Place::Elastic {
            state[1..5].fill(0.0);
        }
    }
    fn shaft_force(&self, tip: &TipState, at: &InsertionState, state: &mut EffectState) -> f64 {
        self.advance(sample_of(tip, at), tip.dz_m, state)
    }
    fn tip_force(&self, tip: &TipState, at: &InsertionState, state: &mut EffectState) -> f64 {
        self.advance(sample_of(tip, at), tip.dz_m, state)
    }
    fn tool_force(&self, base: &BaseMotion, force_n: f64, state: &mut EffectState) -> f64 {
        let sample = EquationSample {
            time_s: base.time_s,
            dt_s: base.dt_s,
            z_m: base.z_m,
            v_mps: base.v_mps,
            a_mps2: base.a_mps2,
            force_n,
            ..EquationSample::default()
        };
        self.advance(sample, base.v_mps * base.dt_s, state) - force_n
    }
}
