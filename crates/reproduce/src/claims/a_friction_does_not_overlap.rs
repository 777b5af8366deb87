//! (a1) The friction estimates of the three isinglass phantoms do not overlap.

use super::claim_definition::{
    Definition, GELS, KNOWN_DEPTH, PUBLISHED_TUNING, protocol, with_known_depth, with_published_tuning,
};
use crate::effect_size::{Criterion, ExperimentValues, Measured, Scale};
use crate::friction_estimates::{MOTIONS, Method, PHANTOMS, estimates};
use crate::study_conditions::View;

fn gaps(view: &View<'_>, methods: &[Method]) -> Measured {
    let of = |phantom: usize| -> Vec<Vec<Option<f64>>> {
        (0..MOTIONS.len())
            .flat_map(|motion| methods.iter().map(move |m| estimates(view, phantom, motion, *m)))
            .collect()
    };
    let parts = (1..PHANTOMS.len()).map(|stronger| {
        let (below, above) = (of(stronger - 1), of(stronger));
        let seeds = below.iter().chain(&above).map(Vec::len).min().unwrap_or(0);
        let gap = |seed: usize| {
            let at = |all: &[Vec<Option<f64>>]| all.iter().map(|e| e[seed]).collect::<Option<Vec<f64>>>();
            let highest = at(&below)?.into_iter().fold(0.0, f64::max);
            let lowest = at(&above)?.into_iter().fold(f64::INFINITY, f64::min);
            Some(lowest / highest).filter(|gap| *gap > 0.0 && gap.is_finite())
        };
        let name = format!("{} over {}", PHANTOMS[stronger].name, PHANTOMS[stronger - 1].name);
        ExperimentValues::new(name, (0..seeds).map(gap))
    });
    Measured { scale: Scale::SmallestRatio, parts: parts.collect() }
}

const BOTH: [Method; 2] = [Method::Offline, Method::Online];

pub(super) fn definition() -> Definition {
    Definition::new(protocol!("a1"), |v| gaps(v, &BOTH), Criterion::Above(1.0), &GELS)
        .with_sensitivity("offline alone", |v| gaps(v, &[Method::Offline]))
        .with_sensitivity(KNOWN_DEPTH, |v| gaps(&with_known_depth(v), &BOTH))
        .with_sensitivity(PUBLISHED_TUNING, |v| gaps(&with_published_tuning(v), &BOTH))
}
