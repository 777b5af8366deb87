//! (b1, b2) Friction estimated online, and in sinusoidal motion, is slightly lower.

use super::claim_definition::{
    Definition, GELS, KNOWN_DEPTH, PUBLISHED_TUNING, protocol, with_known_depth, with_published_tuning,
};
use crate::effect_size::{Criterion, ExperimentValues, Measured, Scale};
use crate::friction_estimates::{MOTIONS, Method, PHANTOMS, estimates, over};
use crate::study_conditions::View;

/// *Slightly* lower: by more than nothing and by less than a quarter.
const SLIGHTLY: Criterion = Criterion::Between(0.75, 1.0);

fn online_over(view: &View<'_>, offline: Method) -> Measured {
    let mut parts = Vec::new();
    for (p, phantom) in PHANTOMS.iter().enumerate() {
        for (m, motion) in MOTIONS.iter().enumerate() {
            let ratio = over(&estimates(view, p, m, Method::Online), &estimates(view, p, m, offline));
            parts.push(ExperimentValues::new(format!("{}, {motion}", phantom.name), ratio));
        }
    }
    Measured { scale: Scale::Ratio, parts }
}

fn sinusoidal_over_constant(view: &View<'_>, methods: &[(Method, &str)]) -> Measured {
    let mut parts = Vec::new();
    for (p, phantom) in PHANTOMS.iter().enumerate() {
        for (method, name) in methods {
            let ratio = over(&estimates(view, p, 1, *method), &estimates(view, p, 0, *method));
            parts.push(ExperimentValues::new(format!("{}, {name}", phantom.name), ratio));
        }
    }
    Measured { scale: Scale::Ratio, parts }
}

/// Online and sinusoidal together, over the mean of the other three.
fn online_and_sinusoidal(view: &View<'_>) -> Measured {
    let parts = PHANTOMS.iter().enumerate().map(|(p, phantom)| {
        let others = [
            estimates(view, p, 0, Method::Offline),
            estimates(view, p, 1, Method::Offline),
            estimates(view, p, 0, Method::Online),
        ];
        let seeds = others.iter().map(Vec::len).min().unwrap_or(0);
        let mean: Vec<Option<f64>> = (0..seeds)
            .map(|seed| others.iter().map(|o| o[seed]).sum::<Option<f64>>().map(|sum| sum / 3.0))
            .collect();
        ExperimentValues::new(phantom.name, over(&estimates(view, p, 1, Method::Online), &mean))
    });
    Measured { scale: Scale::Ratio, parts: parts.collect() }
}

const METHODS: [(Method, &str); 2] = [(Method::Offline, "offline"), (Method::Online, "online")];

pub(super) fn online() -> Definition {
    Definition::new(protocol!("b1"), |v| online_over(v, Method::Offline), SLIGHTLY, &GELS)
        .with_sensitivity("offline with K estimated too, nothing of the drop in it", |v| {
            online_over(v, Method::OfflineBoth)
        })
        .with_sensitivity(KNOWN_DEPTH, |v| online_over(&with_known_depth(v), Method::Offline))
        .with_sensitivity(PUBLISHED_TUNING, |v| online_over(&with_published_tuning(v), Method::Offline))
}

pub(super) fn sinusoidal() -> Definition {
    Definition::new(protocol!("b2"), |v| sinusoidal_over_constant(v, &METHODS), SLIGHTLY, &GELS)
        .with_sensitivity("offline alone", |v| sinusoidal_over_constant(v, &METHODS[..1]))
        .with_sensitivity("online alone", |v| sinusoidal_over_constant(v, &METHODS[1..]))
        .with_sensitivity(KNOWN_DEPTH, |v| sinusoidal_over_constant(&with_known_depth(v), &METHODS))
        .with_sensitivity(PUBLISHED_TUNING, |v| sinusoidal_over_constant(&with_published_tuning(v), &METHODS))
        .with_sensitivity(
            "online and sinusoidal together, over the mean of the other three",
            online_and_sinusoidal,
        )
}
