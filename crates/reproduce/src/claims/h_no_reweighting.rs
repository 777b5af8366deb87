//! (h1) 40 Hz without re-weighting reconstructs much better than resets only at ruptures; (h2) it compensates
//! little.

use super::claim_definition::{
    Definition, KNOWN_DEPTH, PUBLISHED_TUNING, protocol, with_known_depth, with_published_tuning,
};
use super::g_resets_only_at_ruptures::ASSUMED_VALUES;
use crate::algorithm_variant::Ablation;
use crate::effect_size::{Criterion, ExperimentValues, Measured, Scale};
use crate::paper_experiments::Case;
use crate::study_conditions::View;

/// The targets of the supplement's Figs 13, 14, 15.
const TARGETS: [Case; 3] = [Case::Gel70Sinusoidal, Case::LatexSinusoidal, Case::Liver];

fn reconstruction(view: &View<'_>) -> Measured {
    let parts = TARGETS.iter().map(|&case| {
        let without = view.without(case, Ablation::NoReweight);
        let rarely = view.without(case, Ablation::OnlyRuptures);
        let ratio = without
            .iter()
            .zip(rarely)
            .map(|(a, b)| Some(a.score.reconstruction_rms_n? / b.score.reconstruction_rms_n?));
        ExperimentValues::new(case.name(), ratio)
    });
    Measured { scale: Scale::Ratio, parts: parts.collect() }
}

fn compensation(view: &View<'_>) -> Measured {
    let parts = TARGETS.iter().map(|&case| {
        let runs = view.without(case, Ablation::NoReweight);
        ExperimentValues::new(
            case.name(),
            runs.iter().map(|o| if o.estimated > 0 { o.cumulative_ratio } else { None }),
        )
    });
    Measured { scale: Scale::Mean, parts: parts.collect() }
}

pub(super) fn reconstructs() -> Definition {
    Definition::new(protocol!("h1"), reconstruction, Criterion::Below(0.5), &ASSUMED_VALUES)
        .with_sensitivity(KNOWN_DEPTH, |v| reconstruction(&with_known_depth(v)))
        .with_sensitivity(PUBLISHED_TUNING, |v| reconstruction(&with_published_tuning(v)))
}

pub(super) fn compensates() -> Definition {
    Definition::new(protocol!("h2"), compensation, Criterion::Below(0.1), &ASSUMED_VALUES)
        .with_sensitivity(KNOWN_DEPTH, |v| compensation(&with_known_depth(v)))
        .with_sensitivity(PUBLISHED_TUNING, |v| compensation(&with_published_tuning(v)))
}
