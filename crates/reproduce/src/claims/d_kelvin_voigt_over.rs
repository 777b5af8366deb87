//! (d) Kelvin-Voigt over-compensates on 25 % isinglass in sinusoidal motion.

use super::claim_definition::{Definition, GELS, KNOWN, PUBLISHED, known, protocol, published};
use crate::effect_size::{Bar, Measured, Part, Scale};
use crate::paper_experiments::Case;
use crate::study_conditions::View;

/// Over-compensation: a cumulative friction this much above the true one, visible in a figure.
pub(crate) const VISIBLY: f64 = 1.05;

fn over_compensated(view: &View<'_>, case: Case) -> Measured {
    let over = view.kv(case).iter().map(|o| {
        let over = o.cumulative_ratio.is_some_and(|r| r > VISIBLY);
        Some(f64::from(u8::from(over)))
    });
    Measured { scale: Scale::Share, parts: vec![Part::new(case.name(), over)] }
}

pub(super) fn definition() -> Definition {
    let primary = |v: &View<'_>| over_compensated(v, Case::Gel25Sinusoidal);
    Definition::new(protocol!("d"), primary, Bar::Above(0.5), &GELS)
        .also("50 % isinglass (Fig. 6)", |v| over_compensated(v, Case::Gel50Sinusoidal))
        .also(KNOWN, |v| over_compensated(&known(v), Case::Gel25Sinusoidal))
        .also(PUBLISHED, |v| over_compensated(&published(v), Case::Gel25Sinusoidal))
}
