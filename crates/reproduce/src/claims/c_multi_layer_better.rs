//! (c) Behind the layer the multi-layer model's enhanced force is nearer to zero than Kelvin-Voigt's, and
//! on the liver the multi-layer model renders the elastic part better.

use super::{Claim, numbers};
use crate::case::Case;
use crate::outcome::Outcome;
use crate::spread::Spread;
use crate::study::{NOISE_MN, Study};
use crate::variant::{Protocol, Sensor, Variant};
use crate::verdict::{Condition, Verdict};

type Measure = fn(&Outcome) -> Option<f64>;

fn behind(outcome: &Outcome) -> Option<f64> {
    outcome.after_exit
}

fn elastic(outcome: &Outcome) -> Option<f64> {
    outcome.elastic_error
}

pub(super) fn claim(study: &Study) -> Claim {
    let gels = [Case::Gel25Constant, Case::Gel50Constant, Case::Gel25Sinusoidal, Case::Gel50Sinusoidal];
    let known = gels.map(|case| (case, Protocol::KnownDepth, Sensor::ForceTorque, behind as Measure));
    let unknown = gels.map(|case| (case, Protocol::Paper, Sensor::ForceTorque, behind as Measure));
    let liver = [
        (Case::Liver, Protocol::Paper, Sensor::ForceTorque, elastic as Measure),
        (Case::LiverArm, Protocol::Paper, Sensor::Virtual, elastic as Measure),
    ];
    let mut conditions = Vec::new();
    let mut list = Vec::new();
    for (case, protocol, sensor, measure) in known.into_iter().chain(unknown).chain(liver) {
        let of = |variant| study.runs(case, NOISE_MN, sensor, variant);
        let (kv, ml) = (of(Variant::kv(protocol)), of(Variant::ml(protocol)));
        let name = match (protocol, sensor) {
            (Protocol::KnownDepth, _) => format!("{}, depth known", case.name()),
            (_, Sensor::Virtual) => format!("elastic part, {}, virtual sensor", case.name()),
            _ if case == Case::Liver => format!("elastic part, {}", case.name()),
            _ => format!("{}, depth unknown", case.name()),
        };
        let nearer = kv.iter().zip(ml).map(|(kv, ml)| match (measure(kv), measure(ml)) {
            (Some(kv), Some(ml)) => ml < kv,
            _ => false,
        });
        conditions.push(Condition::new(name.clone(), nearer));
        list.push((format!("{name}, KV"), Spread::of(kv.iter().map(measure))));
        list.push((format!("{name}, ML"), Spread::of(ml.iter().map(measure))));
    }
    Claim {
        id: 'c',
        claim: "Behind the layer ML's enhanced force is nearer to zero than KV's; on the liver ML renders the elastic part better.",
        figure: "S Figs 3-6, 8; M Fig. 13",
        rule: "In a seed, RMS(enhanced)/RMS(measured) behind the layer, once compensated, is smaller for ML than for KV; on the \
               liver, RMS(enhanced - true elastic)/RMS(true elastic) up to the last rupture is."
            .to_owned(),
        verdict: Verdict::of(&conditions, "whether the exit is found at all and on the motion: see the conditions"),
        seeds: study.seeds,
        conditions,
        numbers: numbers(list),
        remark: "Where neither model finds the exit, nothing is compensated, both leave the whole force and neither is nearer to zero."
            .to_owned(),
    }
}
