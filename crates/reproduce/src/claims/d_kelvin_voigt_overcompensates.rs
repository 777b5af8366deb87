//! (d) Kelvin-Voigt over-compensates on 25 % isinglass in sinusoidal motion.

use super::claim_definition::{
    Definition, GELS, KNOWN_DEPTH, PUBLISHED_TUNING, protocol, with_known_depth, with_published_tuning,
};
use crate::effect_size::{Criterion, ExperimentValues, Measured, Scale};
use crate::paper_experiments::Case;
use crate::study_conditions::View;

/// Over-compensation: a cumulative friction this much above the true one, visible in a figure.
pub(crate) const VISIBLE_RATIO: f64 = 1.05;

fn over_compensated(view: &View<'_>, case: Case) -> Measured {
    let over = view.kv(case).iter().map(|o| {
        let over = o.cumulative_ratio.is_some_and(|r| r > VISIBLE_RATIO);
        Some(f64::from(u8::from(over)))
    });
    Measured { scale: Scale::Share, parts: vec![ExperimentValues::new(case.name(), over)] }
}

pub(super) fn definition() -> Definition {
    let primary = |v: &View<'_>| over_compensated(v, Case::Gel25Sinusoidal);
    Definition::new(protocol!("d"), primary, Criterion::Above(0.5), &GELS)
        .with_sensitivity("50 % isinglass (Fig. 6)", |v| over_compensated(v, Case::Gel50Sinusoidal))
        .with_sensitivity(KNOWN_DEPTH, |v| over_compensated(&with_known_depth(v), Case::Gel25Sinusoidal))
        .with_sensitivity(PUBLISHED_TUNING, |v| {
            over_compensated(&with_published_tuning(v), Case::Gel25Sinusoidal)
        })
}
