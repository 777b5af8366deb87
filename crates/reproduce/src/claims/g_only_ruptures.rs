//! (g) Resetting the covariance only at ruptures reconstructs the force poorly.

use super::claim_definition::{Definition, KNOWN, PUBLISHED, known, protocol, published};
use crate::algorithm_variant::Ablation;
use crate::assumed_value_changes::Number;
use crate::effect_size::{Bar, Measured, Part, Scale};
use crate::paper_experiments::Case;
use crate::study_conditions::View;

/// Poorly: a reconstruction error this many times that of the 40 Hz reset.
const POORLY: Bar = Bar::Above(2.0);

/// The targets of the supplement's Figs 10, 11, 12.
const TARGETS: [Case; 3] = [Case::Gel70Constant, Case::LatexSinusoidal, Case::Liver];

/// Assumed values of one gel, stack and liver.
pub(super) const NUMBERS: [Number; 13] = [
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
    Number::Start,
    Number::Behind,
];

fn ratio(view: &View<'_>, cases: &[Case]) -> Measured {
    let parts = cases.iter().map(|&case| {
        let often = view.ml(case);
        let rarely = view.without(case, Ablation::OnlyRuptures);
        let ratio = often
            .iter()
            .zip(rarely)
            .map(|(a, b)| Some(b.score.reconstruction_rms_n? / a.score.reconstruction_rms_n?));
        Part::new(case.name(), ratio)
    });
    Measured { scale: Scale::Ratio, parts: parts.collect() }
}

pub(super) fn definition() -> Definition {
    Definition::new(protocol!("g"), |v| ratio(v, &TARGETS), POORLY, &NUMBERS)
        .also("quadratic elasticity (Okamura 2004)", |v| ratio(v, &[Case::LiverQuadratic]))
        .also(KNOWN, |v| ratio(&known(v), &TARGETS))
        .also(PUBLISHED, |v| ratio(&published(v), &TARGETS))
}
