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

fn tip(outcome: &Outcome) -> Option<f64> {
    outcome.score.enhancement.rms_relative
}

pub(super) fn claim(study: &Study) -> Claim {
    let gels = [Case::Gel25Constant, Case::Gel50Constant, Case::Gel25Sinusoidal, Case::Gel50Sinusoidal];
    let gel = |protocol: Protocol, known: &'static str| {
        gels.map(|case| {
            let name = format!("{}, depth {known}", case.name());
            (name, case, protocol, Sensor::ForceTorque, behind as Measure)
        })
    };
    let (known, unknown) = (gel(Protocol::KnownDepth, "known"), gel(Protocol::Paper, "unknown"));
    let liver = [("elastic part", elastic as Measure), ("tip force", tip as Measure)];
    let on_liver = liver.into_iter().flat_map(|(what, measure)| {
        [(Case::Liver, Sensor::ForceTorque), (Case::LiverArm, Sensor::Virtual)].map(|(case, sensor)| {
            (format!("{what}, liver, {} sensor", sensor.name()), case, Protocol::Paper, sensor, measure)
        })
    });
    let mut conditions = Vec::new();
    let mut list = Vec::new();
    for (name, case, protocol, sensor, measure) in known.into_iter().chain(unknown).chain(on_liver) {
        let of = |variant| study.runs(case, NOISE_MN, sensor, variant);
        let (kv, ml) = (of(Variant::kv(protocol)), of(Variant::ml(protocol)));
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
               liver, RMS(enhanced - true elastic)/RMS(true elastic) up to the last rupture is, and so is the same against the tip force f - D v, which \
               is what enhancement is after."
            .to_owned(),
        verdict: Verdict::of(&conditions, "what is asked: behind a gel whose exit is found ML is nearer to zero (where it is not, neither is); on the liver ML is nearer to the true tip force by \
             force/torque sensor, KV to the elastic part alone"),
        seeds: study.seeds,
        conditions,
        numbers: numbers(list),
        headline: &["isinglass 50 %, constant, depth known, KV", "isinglass 50 %, constant, depth known, ML", "tip force, liver, force/torque sensor, KV", "tip force, liver, force/torque sensor, ML"],
        remark: "Where neither model finds the exit, nothing is compensated, both leave the whole force and neither is nearer to zero. On the liver KV takes away \
                 too much behind the first rupture; that happens to remove local friction too and so comes nearer to the elastic force alone (S Fig. 8)."
            .to_owned(),
    }
}
