//! Equations given as formulas.

use crate::custom_equation::{Equation, EquationSample, MAX_PARAMETERS, MAX_STATES};
use crate::custom_text::Place;
use stylet_formula::{Formula, Unit};

/// A quantity that formulas can use.
pub struct Variable {
    /// Name in formulas.
    pub name: &'static str,
    /// Unit; empty for a count.
    pub unit: &'static str,
    /// Meaning, for listings.
    pub meaning: &'static str,
    /// The places that have it.
    pub places: &'static [Place],
}

const IN_TISSUE: &[Place] = &[Place::Elastic, Place::Friction, Place::Tip];
const ALONG_SHAFT: &[Place] = &[Place::Friction, Place::Tip];
const FORCES: &[Place] = &[Place::Elastic, Place::Friction, Place::Tip, Place::Sensor];
const ALL: &[Place] = &[Place::Elastic, Place::Friction, Place::Tip, Place::Sensor, Place::Motion];

const fn variable(
    name: &'static str,
    unit: &'static str,
    meaning: &'static str,
    places: &'static [Place],
) -> Variable {
    Variable { name, unit, meaning, places }
}

/// The variables of formulas.
pub const VARIABLES: [Variable; 12] = [
    variable("t", "s", "time", ALL),
    variable("z", "m", "position of the tip; of the needle's base at `Sensor`", ALL),
    variable("v", "m/s", "velocity", FORCES),
    variable("a", "m/s^2", "acceleration", FORCES),
    variable(
        "z_layer",
        "m",
        "distance of the tip behind the front face of the active layer, negative in front of it",
        IN_TISSUE,
    ),
    variable("layer", "", "number of the active layer, the first that is not ruptured", IN_TISSUE),
    variable("travel", "m", "travel since the last change of direction", FORCES),
    variable("inserted", "m", "length of needle inside the tissue", ALONG_SHAFT),
    variable("elastic", "N", "elastic force of the active layer", IN_TISSUE),
    variable("friction", "N", "friction along the shaft", ALONG_SHAFT),
    variable("total", "N", "elastic force and friction", ALONG_SHAFT),
    variable("force", "N", "force that reaches the sensor", &[Place::Sensor]),
];

/// Index of `travel`.
const TRAVEL: usize = 6;
const COUNT: usize = VARIABLES.len();

/// The unit of an equation's value.
pub(crate) fn value_unit(place: Place) -> Unit {
    if place == Place::Motion { Unit::METRE } else { Unit::NEWTON }
}

impl EquationSample {
    /// The values of the [`VARIABLES`].
    #[must_use]
    pub fn variables(&self) -> [f64; VARIABLES.len()] {
        [
            self.time_s,
            self.z_m,
            self.v_mps,
            self.a_mps2,
            self.depth_m,
            self.layer,
            self.travel_m,
            self.inserted_m,
            self.elastic_n,
            self.friction_n,
            self.force_n,
            self.force_n,
        ]
    }
}

/// An equation given as formulas of the [`VARIABLES`], then the parameters, then the states.
#[derive(Debug)]
pub(crate) struct FormulaEquation {
    pub value: Formula,
    pub rates: alloc::vec::Vec<Formula>,
    pub parameters: usize,
}

impl FormulaEquation {
    #[inline]
    fn inputs(
        &self,
        sample: &EquationSample,
        parameters: &[f64],
        states: &[f64],
    ) -> [f64; COUNT + MAX_PARAMETERS + MAX_STATES] {
        let mut out = [0.0; COUNT + MAX_PARAMETERS + MAX_STATES];
        out[..COUNT].copy_from_slice(&sample.variables());
        for (slot, value) in out.iter_mut().skip(COUNT).zip(parameters) {
            *slot = *value;
        }
        for (slot, value) in out.iter_mut().skip(COUNT + self.parameters).zip(states) {
            *slot = *value;
        }
        out
    }
}

impl Equation for FormulaEquation {
    fn value(&self, sample: &EquationSample, parameters: &[f64], states: &[f64]) -> f64 {
        self.value.program().evaluate(&self.inputs(sample, parameters, states))
    }

    fn rate(&self, index: usize, sample: &EquationSample, parameters: &[f64], states: &[f64]) -> (f64, f64) {
        let Some(rate) = self.rates.get(index) else { return (0.0, 0.0) };
        let inputs = self.inputs(sample, parameters, states);
        rate.program().evaluate_with_derivative(&inputs, COUNT + self.parameters + index)
    }

    fn uses_travel(&self) -> bool {
        self.value.uses(TRAVEL) || self.rates.iter().any(|r| r.uses(TRAVEL))
    }

    fn slopes(&self, sample: &EquationSample, parameters: &[f64]) -> (f64, f64) {
        let inputs = self.inputs(sample, parameters, &[]);
        let by = |index| self.value.program().evaluate_with_derivative(&inputs, index).1;
        (by(0), by(1))
    }
}
