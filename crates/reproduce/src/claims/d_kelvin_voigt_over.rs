//! (d) Kelvin-Voigt over-compensates on 25 % isinglass in sinusoidal motion.

use super::{Claim, numbers};
use crate::case::Case;
use crate::spread::Spread;
use crate::study::Study;
use crate::variant::{Protocol, Variant};
use crate::verdict::{Condition, Verdict};

/// Over-compensation: a cumulative friction this much above the true one, visible in a figure.
const VISIBLY: f64 = 1.05;

pub(super) fn claim(study: &Study) -> Claim {
    let mut conditions = Vec::new();
    let mut list = Vec::new();
    for (name, protocol) in [
        ("depth known", Protocol::KnownDepth),
        ("depth unknown, s1 = 0.15 N", Protocol::Paper),
        ("depth unknown, s1 = 0.03 N", Protocol::Sensitive),
    ] {
        let kv = study.at(Case::Gel25Sinusoidal, Variant::kv(protocol));
        let ml = study.at(Case::Gel25Sinusoidal, Variant::ml(protocol));
        let over = kv.iter().map(|o| o.cumulative_ratio.is_some_and(|r| r > VISIBLY));
        conditions.push(Condition::new(name, over));
        list.push((format!("D / true D, KV, {name}"), Spread::of(kv.iter().map(|o| o.cumulative_ratio))));
        list.push((format!("D / true D, ML, {name}"), Spread::of(ml.iter().map(|o| o.cumulative_ratio))));
    }
    Claim {
        id: 'd',
        claim: "KV over-compensates on 25 % isinglass in sinusoidal motion.",
        figure: "S Fig. 5",
        rule: "In a seed, KV's cumulative friction at the end is more than 5 % above the true one.".to_owned(),
        verdict: Verdict::of(&conditions, "the noise, and that only with s1 = 0.03 N; otherwise KV compensates too little, not too much"),
        seeds: study.seeds,
        conditions,
        numbers: numbers(list),
        headline: &["D / true D, KV, depth known", "D / true D, KV, depth unknown, s1 = 0.03 N"],
        remark: "Behind the gel f = D v, so that D above the true one is an enhanced force below zero. A ratio of zero: nothing was \
                 compensated."
            .to_owned(),
    }
}
