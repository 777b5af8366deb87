//! (h) 40 Hz without re-weighting reconstructs well and compensates little.

use super::{Claim, numbers};
use crate::case::Case;
use crate::spread::Spread;
use crate::study::Study;
use crate::variant::{Protocol, Variant};
use crate::verdict::{Condition, Verdict};

/// Well: a reconstruction error of at most a tenth of the measured force (RMS).
const WELL: f64 = 0.1;
/// Little: at most a tenth of the true cumulative friction.
const LITTLE: f64 = 0.1;

pub(super) fn claim(study: &Study) -> Claim {
    let mut conditions = Vec::new();
    let mut list = Vec::new();
    for (case, without, with) in [
        (Case::Gel70Sinusoidal, Protocol::NoReweightKnown, Protocol::KnownDepth),
        (Case::LatexSinusoidal, Protocol::NoReweight, Protocol::Paper),
        (Case::Liver, Protocol::NoReweight, Protocol::Paper),
    ] {
        let (without, with) = (study.at(case, Variant::ml(without)), study.at(case, Variant::ml(with)));
        let well = without.iter().map(|o| o.reconstruction.is_some_and(|r| r <= WELL));
        conditions.push(Condition::new(format!("reconstructs well, {}", case.name()), well));
        let little = without.iter().map(|o| o.cumulative_ratio.is_some_and(|r| r <= LITTLE));
        conditions.push(Condition::new(format!("compensates little, {}", case.name()), little));
        let name = case.name();
        list.push((
            format!("RMS error / RMS force, {name}"),
            Spread::of(without.iter().map(|o| o.reconstruction)),
        ));
        list.push((
            format!("D / true D without, {name}"),
            Spread::of(without.iter().map(|o| o.cumulative_ratio)),
        ));
        list.push((format!("D / true D with, {name}"), Spread::of(with.iter().map(|o| o.cumulative_ratio))));
    }
    Claim {
        id: 'h',
        claim: "40 Hz without re-weighting reconstructs well and compensates little.",
        figure: "S Figs 13-15",
        rule: "In a seed, the RMS reconstruction error is at most 10 % of the RMS force; the cumulative friction at the end is at \
               most 10 % of the true one."
            .to_owned(),
        verdict: Verdict::of(&conditions, "the target: the latex stack, sinusoidal, is not reconstructed well, because uncompensated friction makes false ruptures"),
        seeds: study.seeds,
        conditions,
        numbers: numbers(list),
        headline: &["RMS error / RMS force, latex stack, sinusoidal", "RMS error / RMS force, bovine liver, constant", "D / true D without, latex stack, sinusoidal", "D / true D without, bovine liver, constant"],
        remark: "The single gel with its depth known, so that there is something to compensate. At 2.3 mm/s the friction's column of the \
                 regressor is 0.0023 of the other: with equal priors nearly all force goes to the stiffness."
            .to_owned(),
    }
}
