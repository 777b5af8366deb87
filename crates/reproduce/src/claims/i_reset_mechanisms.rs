//! (i) Resetting at a constant frequency and when the uncertainty falls below a threshold are equivalent.

use super::claim_definition::{Definition, protocol};
use crate::algorithm_variant::Ablation;
use crate::assumed_value_changes::Number;
use crate::effect_size::{Bar, Measured, Part, Scale};
use crate::paper_experiments::Case;
use crate::run_outcome::Outcome;
use crate::study_conditions::View;

/// Equivalent: within a quarter, as is customary (0.8 to 1.25).
const EQUIVALENT: Bar = Bar::Below(1.25);

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
fn apart(view: &View<'_>, scale: Scale, value: fn(&Outcome) -> Option<f64>) -> Measured {
    let parts = ALL.iter().map(|&case| {
        let frequency = view.ml(case);
        let threshold = view.without(case, Ablation::Trace);
        let fold = frequency.iter().zip(threshold).map(|(a, b)| {
            let ratio = value(a)? / value(b)?;
            Some(ratio.max(1.0 / ratio)).filter(|r| r.is_finite())
        });
        Part::new(case.name(), fold)
    });
    Measured { scale, parts: parts.collect() }
}

fn enhanced(outcome: &Outcome) -> Option<f64> {
    outcome.score.enhancement.rms_relative
}

const NUMBERS: [Number; 15] = [
    Number::Noise,
    Number::GelStiffness,
    Number::GelFriction,
    Number::GelContrast,
    Number::StackStiffness,
    Number::StackFriction,
    Number::Latex,
    Number::LiverStiffness,
    Number::LiverFriction,
    Number::LiverPuncture,
    Number::LiverThickness,
    Number::AbdomenStiffness,
    Number::AbdomenFriction,
    Number::Start,
    Number::Behind,
];

pub(super) fn definition() -> Definition {
    Definition::new(protocol!("i"), |v| apart(v, Scale::Ratio, enhanced), EQUIVALENT, &NUMBERS)
        .also("reconstruction error instead of the enhanced force's", |v| {
            apart(v, Scale::Ratio, |o| o.score.reconstruction_rms_n)
        })
        .also("the insertion that differs most", |v| apart(v, Scale::LargestRatio, enhanced))
}
