//! What an experiment cannot show: effects whose signature the base parameters imitate.

use crate::fit::Residuals;
use crate::look::Look;
use crate::outcome::Cause;
use crate::search::{Candidate, Search};
use crate::starts::{FROM_THE_RAW_DATA, Hints, of};
use rayon::prelude::*;
use stylet_tissue::{EffectInfo, library};

/// An effect of plausible size that would gain less than this is invisible (nats).
const LEAST_NATS: f64 = 10.0;

/// Effects that these recordings cannot show, in the order of the library.
#[must_use]
pub fn invisible(search: &Search, shown: &Candidate) -> Vec<String> {
    let data = search.data_of(shown);
    let coarse = data.blocks(search.q, data.noise.blocks(search.q));
    let Some(look) = Look::new(&shown.model, &coarse) else { return Vec::new() };
    let hints = Hints {
        lines_hz: vec![1.0],
        breath_hz: vec![0.25],
        layers: shown.model.assumed.layers.len(),
        depth_m: 0.0,
        drops_m: (1..)
            .map(|k| 0.01 * f64::from(k))
            .take_while(|d| *d < shown.model.assumed.end_m() - shown.model.assumed.surface_m)
            .collect(),
        membranes: Vec::new(),
        force_n: search.force_n,
    };
    let entries: Vec<&'static EffectInfo> = library()
        .filter(|i| !FROM_THE_RAW_DATA.contains(&i.id) && !shown.model.names().contains(&i.id))
        .collect();
    let seen: Vec<f64> = entries
        .par_iter()
        .map_init(Residuals::default, |work, info| {
            let mut most: f64 = 0.0;
            for mut start in of(info, &hints) {
                for (value, p) in start.choice.values.iter_mut().zip(info.parameters) {
                    if p.strength && p.low >= 0.0 && info.parameters.len() == 1 && !p.log {
                        *value = p.start;
                    }
                }
                if start.quadrature {
                    start.choice.values[0] = info.parameters[0].start;
                }
                if let Some(s) = look.at(&start, work) {
                    most = most.max(s.visible);
                }
                if most > LEAST_NATS {
                    break;
                }
            }
            most
        })
        .collect();
    entries.iter().zip(seen).filter(|(_, nats)| *nats < LEAST_NATS).map(|(i, _)| i.id.to_owned()).collect()
}

/// Which motion would tell more.
#[must_use]
pub fn advice(causes: &[Cause], invisible: &[String]) -> Vec<String> {
    let mut advice = Vec::new();
    for cause in causes {
        let apart: Vec<&str> = cause
            .equivalent
            .iter()
            .filter(|e| !crate::diagnose::nests(e, &cause.effect))
            .map(String::as_str)
            .collect();
        if apart.is_empty() {
            continue;
        }
        advice.push(format!(
            "{} and {} explain these recordings equally well. A motion with a rippled speed, a hold inside every layer and a \
             retraction tells most of them apart.",
            cause.effect,
            apart.join(", ")
        ));
    }
    let friction = [
        "coulomb_friction",
        "stribeck_friction",
        "presliding_friction",
        "power_law_friction",
        "asymmetric_friction",
    ];
    if invisible.iter().any(|i| friction.contains(&i.as_str())) {
        advice.push(
            "Laws of friction do not show at one constant speed: vary the speed within each layer, and retract.".to_owned(),
        );
    }
    if invisible.iter().any(|i| i == "force_gain") {
        advice.push(
            "A wrong gain of the force sensor looks like other stiffness, friction and puncture forces: check it with a known weight."
                .to_owned(),
        );
    }
    advice
}
