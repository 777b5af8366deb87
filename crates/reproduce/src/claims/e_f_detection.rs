//! (e) The three ruptures of the latex stack are found in constant and in sinusoidal motion; (f1) the two of
//! liver and of abdomen are, with either sensor.

use super::claim_definition::{Definition, protocol};
use crate::algorithm_variant::{Ablation, Sensor, Setup};
use crate::assumed_value_changes::AssumedValue;
use crate::effect_size::{Criterion, ExperimentValues, Measured, Scale};
use crate::paper_experiments::Case;
use crate::study_conditions::{SENSITIVITY_SEEDS_ARM, View};

/// Nearly all insertions: one in ten may fail.
const NEARLY_ALL: Criterion = Criterion::Above(0.9);

type Insertion = (Case, Sensor, Setup);

fn found(view: &View<'_>, insertions: &[Insertion], kelvin_voigt: bool) -> Measured {
    let parts = insertions.iter().map(|(case, sensor, setup)| {
        let runs = view.setup(*setup).runs(*case, *sensor, kelvin_voigt, Ablation::None);
        let found = runs.iter().map(|o| Some(f64::from(u8::from(o.found_all()))));
        ExperimentValues::new(format!("{}, {} sensor", case.name(), sensor.name()), found)
    });
    Measured { scale: Scale::Share, parts: parts.collect() }
}

const fn stack(setup: Setup) -> [Insertion; 2] {
    [(Case::LatexConstant, Sensor::ForceTorque, setup), (Case::LatexSinusoidal, Sensor::ForceTorque, setup)]
}

const fn either_sensor(setup: Setup) -> [Insertion; 4] {
    [
        (Case::Liver, Sensor::ForceTorque, setup),
        (Case::Abdomen, Sensor::ForceTorque, setup),
        (Case::LiverArm, Sensor::Virtual, setup),
        (Case::AbdomenArm, Sensor::Virtual, setup),
    ]
}

const ON_THE_ARM: [Insertion; 2] = [
    (Case::LiverArm, Sensor::ForceTorque, Setup::Tuned),
    (Case::AbdomenArm, Sensor::ForceTorque, Setup::Tuned),
];
const OURS: [Insertion; 2] = [
    (Case::LiverArm, Sensor::Virtual, Setup::ScenarioThresholds),
    (Case::AbdomenArm, Sensor::Virtual, Setup::ScenarioThresholds),
];
const WITH_FRICTION: [Insertion; 2] = [
    (Case::LiverArmFriction, Sensor::Virtual, Setup::ScenarioThresholds),
    (Case::AbdomenArmFriction, Sensor::Virtual, Setup::ScenarioThresholds),
];

pub(super) fn definitions() -> [Definition; 2] {
    let assumed_values = [
        AssumedValue::Noise,
        AssumedValue::StackStiffness,
        AssumedValue::StackFriction,
        AssumedValue::LatexPuncture,
        AssumedValue::TravelInAir,
    ];
    let primary = |v: &View<'_>| found(v, &stack(Setup::Tuned), false);
    let latex = Definition::new(protocol!("e"), primary, NEARLY_ALL, &assumed_values)
        .with_sensitivity("Kelvin-Voigt model", |v| found(v, &stack(Setup::Tuned), true))
        .with_sensitivity("to the letter (Literal)", |v| found(v, &stack(Setup::Literal), false))
        .with_sensitivity("derivative on drops (Drop)", |v| found(v, &stack(Setup::FallingForce), false));
    let assumed_values = [
        AssumedValue::Noise,
        AssumedValue::LiverStiffness,
        AssumedValue::LiverFriction,
        AssumedValue::LiverPuncture,
        AssumedValue::LiverThickness,
        AssumedValue::AbdomenStiffness,
        AssumedValue::AbdomenFriction,
        AssumedValue::TravelInAir,
        AssumedValue::TorqueNoise,
        AssumedValue::VirtualSigma,
    ];
    let primary = |v: &View<'_>| found(v, &either_sensor(Setup::Tuned), false);
    let mut sensors = Definition::new(protocol!("f1"), primary, NEARLY_ALL, &assumed_values)
        .with_sensitivity("Kelvin-Voigt model", |v| found(v, &either_sensor(Setup::Tuned), true))
        .with_sensitivity("force/torque sensor on the arm", |v| found(v, &ON_THE_ARM, false))
        .with_sensitivity("virtual sensor with our detection (s1 0.015 N)", |v| found(v, &OURS, false))
        .with_sensitivity("virtual sensor with our detection, joint friction of a Panda", |v| {
            found(&v.fewer(SENSITIVITY_SEEDS_ARM), &WITH_FRICTION, false)
        })
        .with_sensitivity("derivative on drops (Drop)", |v| {
            found(v, &either_sensor(Setup::FallingForce), false)
        });
    sensors.on_arm = true;
    [latex, sensors]
}
