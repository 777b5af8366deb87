//! (c1) Behind the layer the multi-layer model's enhanced force is nearer to zero than Kelvin-Voigt's; (c2) on
//! the liver the multi-layer model renders the elastic part better.

use super::claim_definition::{
    Definition, GELS, KNOWN_DEPTH, PUBLISHED_TUNING, protocol, with_known_depth, with_published_tuning,
};
use crate::algorithm_variant::{Ablation, Sensor};
use crate::assumed_value_changes::AssumedValue;
use crate::effect_size::{Criterion, ExperimentValues, Measured, Scale};
use crate::paper_experiments::Case;
use crate::run_outcome::Outcome;
use crate::study_conditions::View;

fn ml_over_kv(
    view: &View<'_>,
    case: Case,
    sensor: Sensor,
    value: fn(&Outcome) -> Option<f64>,
    asks_for_an_estimate: bool,
) -> ExperimentValues {
    let of = |kelvin_voigt| view.runs(case, sensor, kelvin_voigt, Ablation::None);
    let ratio = of(false).iter().zip(of(true)).map(|(ml, kv)| {
        if asks_for_an_estimate && ml.estimated + kv.estimated == 0 {
            return None;
        }
        Some(value(ml)? / value(kv)?).filter(|r| r.is_finite() && *r > 0.0)
    });
    ExperimentValues::new(case.name(), ratio)
}

fn after_exit(view: &View<'_>, cases: &[Case]) -> Measured {
    let part = |c: &Case| ml_over_kv(view, *c, Sensor::ForceTorque, |o| o.after_exit, true);
    Measured { scale: Scale::Ratio, parts: cases.iter().map(part).collect() }
}

const CONSTANT: [Case; 2] = [Case::Gel25Constant, Case::Gel50Constant];
const SINUSOIDAL: [Case; 2] = [Case::Gel25Sinusoidal, Case::Gel50Sinusoidal];

pub(super) fn force_after_exit() -> Definition {
    Definition::new(
        protocol!("c1"),
        |v| after_exit(v, &CONSTANT),
        Criterion::Below(1.0),
        &[&GELS[..], &[AssumedValue::TimeBehindTarget]].concat(),
    )
    .with_sensitivity("sinusoidal velocity (Figs 5 and 6)", |v| after_exit(v, &SINUSOIDAL))
    .with_sensitivity(KNOWN_DEPTH, |v| after_exit(&with_known_depth(v), &CONSTANT))
    .with_sensitivity(PUBLISHED_TUNING, |v| after_exit(&with_published_tuning(v), &CONSTANT))
}

fn liver(view: &View<'_>, case: Case, sensor: Sensor, value: fn(&Outcome) -> Option<f64>) -> Measured {
    Measured { scale: Scale::Ratio, parts: vec![ml_over_kv(view, case, sensor, value, false)] }
}

fn elastic(outcome: &Outcome) -> Option<f64> {
    outcome.elastic_error
}

/// Assumed values of the liver on the slide.
const LIVER: [AssumedValue; 6] = [
    AssumedValue::Noise,
    AssumedValue::LiverStiffness,
    AssumedValue::LiverFriction,
    AssumedValue::LiverPuncture,
    AssumedValue::LiverThickness,
    AssumedValue::TravelInAir,
];

pub(super) fn on_the_liver() -> Definition {
    use Sensor::{ForceTorque, Virtual};
    let primary = |v: &View<'_>| liver(v, Case::Liver, ForceTorque, elastic);
    Definition::new(protocol!("c2"), primary, Criterion::Below(1.0), &LIVER)
        .with_sensitivity("against the tip force f - D v, which is what enhancement is after", |v| {
            liver(v, Case::Liver, ForceTorque, |o| o.score.enhancement.rms_relative)
        })
        .with_sensitivity("virtual sensor (M Fig. 13)", |v| liver(v, Case::LiverArm, Virtual, elastic))
        .with_sensitivity("quadratic elasticity (Okamura 2004)", |v| {
            liver(v, Case::LiverQuadratic, ForceTorque, elastic)
        })
        .with_sensitivity(KNOWN_DEPTH, |v| liver(&with_known_depth(v), Case::Liver, ForceTorque, elastic))
}
