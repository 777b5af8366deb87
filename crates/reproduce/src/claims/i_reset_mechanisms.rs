//! (i) Resetting at a constant frequency and when the uncertainty falls below a threshold are equivalent.

use super::claim_definition::{Definition, protocol};
use crate::algorithm_variant::Ablation;
use crate::assumed_value_changes::AssumedValue;
use crate::effect_size::{Criterion, ExperimentValues, Measured, Scale};
use crate::paper_experiments::Case;
use crate::run_outcome::Outcome;
use crate::study_conditions::View;

/// Equivalent: within a quarter, as is customary (0.8 to 1.25).
const EQUIVALENT: Criterion = Criterion::Below(1.25);

/// All insertions by force/torque sensor.
const ALL: [Case; 10] = [
    Case::Gel25Constant,
    Case::Gel25Sinusoidal,
    Case::Gel50Constant,
    Case::Gel50Sinusoidal,
    Case::Gel70Constant,
    Case::Gel70Sinusoidal,
    Case::LatexConstant,
    Case::LatexSinusoidal,
    Case::Liver,
    Case::Abdomen,
];

/// Ratio of the larger to the smaller value.
fn larger_over_smaller(view: &View<'_>, scale: Scale, value: fn(&Outcome) -> Option<f64>) -> Measured {
    let parts = ALL.iter().map(|&case| {
        let frequency = view.ml(case);
        let threshold = view.without(case, Ablation::Trace);
        let fold = frequency.iter().zip(threshold).map(|(a, b)| {
            let ratio = value(a)? / value(b)?;
            Some(ratio.max(1.0 / ratio)).filter(|r| r.is_finite())
        });
        ExperimentValues::new(case.name(), fold)
    });
    Measured { scale, parts: parts.collect() }
}

fn enhanced(outcome: &Outcome) -> Option<f64> {
    outcome.score.enhancement.rms_relative
}

const ASSUMED_VALUES: [AssumedValue; 15] = [
    AssumedValue::Noise,
    AssumedValue::GelStiffness,
    AssumedValue::GelFriction,
    AssumedValue::GelContrast,
    AssumedValue::StackStiffness,
    AssumedValue::StackFriction,
    AssumedValue::LatexPuncture,
    AssumedValue::LiverStiffness,
    AssumedValue::LiverFriction,
    AssumedValue::LiverPuncture,
    AssumedValue::LiverThickness,
    AssumedValue::AbdomenStiffness,
    AssumedValue::AbdomenFriction,
    AssumedValue::TravelInAir,
    AssumedValue::TimeBehindTarget,
];

pub(super) fn definition() -> Definition {
    Definition::new(
        protocol!("i"),
        |v| larger_over_smaller(v, Scale::Ratio, enhanced),
        EQUIVALENT,
        &ASSUMED_VALUES,
    )
    .with_sensitivity("reconstruction error instead of the enhanced force's", |v| {
        larger_over_smaller(v, Scale::Ratio, |o| o.score.reconstruction_rms_n)
    })
    .with_sensitivity("the insertion that differs most", |v| {
        larger_over_smaller(v, Scale::LargestRatio, enhanced)
    })
}
