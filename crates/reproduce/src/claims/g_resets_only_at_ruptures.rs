//! (g) Resetting the covariance only at ruptures reconstructs the force poorly.

use super::claim_definition::{
    Definition, KNOWN_DEPTH, PUBLISHED_TUNING, protocol, with_known_depth, with_published_tuning,
};
use crate::algorithm_variant::Ablation;
use crate::assumed_value_changes::AssumedValue;
use crate::effect_size::{Criterion, ExperimentValues, Measured, Scale};
use crate::paper_experiments::Case;
use crate::study_conditions::View;

/// Poorly: a reconstruction error this many times that of the 40 Hz reset.
const POORLY: Criterion = Criterion::Above(2.0);

/// The targets of the supplement's Figs 10, 11, 12.
const TARGETS: [Case; 3] = [Case::Gel70Constant, Case::LatexSinusoidal, Case::Liver];

/// Assumed values of one gel, stack and liver.
pub(super) const ASSUMED_VALUES: [AssumedValue; 13] = [
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
    AssumedValue::TravelInAir,
    AssumedValue::TimeBehindTarget,
];

fn ratio(view: &View<'_>, cases: &[Case]) -> Measured {
    let parts = cases.iter().map(|&case| {
        let often = view.ml(case);
        let rarely = view.without(case, Ablation::OnlyRuptures);
        let ratio = often
            .iter()
            .zip(rarely)
            .map(|(a, b)| Some(b.score.reconstruction_rms_n? / a.score.reconstruction_rms_n?));
        ExperimentValues::new(case.name(), ratio)
    });
    Measured { scale: Scale::Ratio, parts: parts.collect() }
}

pub(super) fn definition() -> Definition {
    Definition::new(protocol!("g"), |v| ratio(v, &TARGETS), POORLY, &ASSUMED_VALUES)
        .with_sensitivity("quadratic elasticity (Okamura 2004)", |v| ratio(v, &[Case::LiverQuadratic]))
        .with_sensitivity(KNOWN_DEPTH, |v| ratio(&with_known_depth(v), &TARGETS))
        .with_sensitivity(PUBLISHED_TUNING, |v| ratio(&with_published_tuning(v), &TARGETS))
}
