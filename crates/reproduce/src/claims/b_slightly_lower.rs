//! (b) Friction estimated online, and in sinusoidal motion, is slightly lower.

use super::{Claim, numbers};
use crate::friction::{MOTIONS, Method, PHANTOMS, estimate};
use crate::spread::Spread;
use crate::study::Study;
use crate::variant::Protocol;
use crate::verdict::{Condition, Verdict};

/// *Slightly* lower: by more than nothing and by less than a quarter.
const SLIGHTLY: std::ops::Range<f64> = 0.75..1.0;

pub(super) fn claim(study: &Study) -> Claim {
    let seeds = 0..study.seeds as usize;
    let online = Method::Online(Protocol::KnownDepth);
    let phantoms = 0..PHANTOMS.len();
    let online_over_offline = |phantom: usize, motion: usize, seed: usize| {
        Some(
            estimate(study, phantom, motion, online, seed)?
                / estimate(study, phantom, motion, Method::Offline, seed)?,
        )
    };
    let sinusoidal_over_constant = |phantom: usize, method: Method, seed: usize| {
        Some(estimate(study, phantom, 1, method, seed)? / estimate(study, phantom, 0, method, seed)?)
    };
    let slightly = |ratio: Option<f64>| ratio.is_some_and(|r| SLIGHTLY.contains(&r));
    let mut conditions = Vec::new();
    let mut list = Vec::new();
    for (motion, name) in MOTIONS.iter().enumerate() {
        conditions.push(Condition::new(
            format!("online below offline, {name}"),
            seeds
                .clone()
                .map(|seed| phantoms.clone().all(|p| slightly(online_over_offline(p, motion, seed)))),
        ));
        for p in phantoms.clone() {
            let values = seeds.clone().map(|seed| online_over_offline(p, motion, seed));
            list.push((format!("online / offline, {} {name}", PHANTOMS[p].name), Spread::of(values)));
        }
    }
    for (name, method) in [("offline", Method::Offline), ("online", online)] {
        conditions.push(Condition::new(
            format!("sinusoidal below constant, {name}"),
            seeds
                .clone()
                .map(|seed| phantoms.clone().all(|p| slightly(sinusoidal_over_constant(p, method, seed)))),
        ));
        for p in phantoms.clone() {
            let values = seeds.clone().map(|seed| sinusoidal_over_constant(p, method, seed));
            list.push((format!("sinusoidal / constant, {} {name}", PHANTOMS[p].name), Spread::of(values)));
        }
    }
    Claim {
        id: 'b',
        claim: "Online estimates, and those of sinusoidal motion, are slightly lower.",
        figure: "S Fig. 2, sec. III",
        rule: "In a seed, for all three phantoms (depths known), the ratio lies between 0.75 and 1.".to_owned(),
        verdict: Verdict::of(&conditions, "method and motion: offline they are lower, online only the sinusoid's noise decides"),
        seeds: study.seeds,
        conditions,
        numbers: numbers(list),
        headline: &["online / offline, 50 % constant", "online / offline, 50 % sinusoidal", "sinusoidal / constant, 50 % offline", "sinusoidal / constant, 50 % online"],
        remark: "Where all force is taken for friction, the estimate is b + K/v on average: a faster motion, as the sinusoid is, \
                 gives less. That alone makes offline sinusoidal estimates lower, without any property of the gel."
            .to_owned(),
    }
}
