//! (b1, b2) Friction estimated online, and in sinusoidal motion, is slightly lower.

use super::claim_definition::{Definition, GELS, KNOWN, PUBLISHED, known, protocol, published};
use crate::effect_size::{Bar, Measured, Part, Scale};
use crate::friction_estimates::{MOTIONS, Method, PHANTOMS, estimates, over};
use crate::study_conditions::View;

/// *Slightly* lower: by more than nothing and by less than a quarter.
const SLIGHTLY: Bar = Bar::Between(0.75, 1.0);

fn online_over(view: &View<'_>, offline: Method) -> Measured {
    let mut parts = Vec::new();
    for (p, phantom) in PHANTOMS.iter().enumerate() {
        for (m, motion) in MOTIONS.iter().enumerate() {
            let ratio = over(&estimates(view, p, m, Method::Online), &estimates(view, p, m, offline));
            parts.push(Part::new(format!("{}, {motion}", phantom.name), ratio));
        }
    }
    Measured { scale: Scale::Ratio, parts }
}

fn sinusoidal_over_constant(view: &View<'_>, methods: &[(Method, &str)]) -> Measured {
    let mut parts = Vec::new();
    for (p, phantom) in PHANTOMS.iter().enumerate() {
        for (method, name) in methods {
            let ratio = over(&estimates(view, p, 1, *method), &estimates(view, p, 0, *method));
            parts.push(Part::new(format!("{}, {name}", phantom.name), ratio));
        }
    }
    Measured { scale: Scale::Ratio, parts }
}

/// Online and sinusoidal together, over the mean of the other three.
fn together(view: &View<'_>) -> Measured {
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
        Part::new(phantom.name, over(&estimates(view, p, 1, Method::Online), &mean))
    });
    Measured { scale: Scale::Ratio, parts: parts.collect() }
}

const METHODS: [(Method, &str); 2] = [(Method::Offline, "offline"), (Method::Online, "online")];

pub(super) fn online() -> Definition {
    Definition::new(protocol!("b1"), |v| online_over(v, Method::Offline), SLIGHTLY, &GELS)
        .also("offline with K estimated too, nothing of the drop in it", |v| {
            online_over(v, Method::OfflineBoth)
        })
        .also(KNOWN, |v| online_over(&known(v), Method::Offline))
        .also(PUBLISHED, |v| online_over(&published(v), Method::Offline))
}

pub(super) fn sinusoidal() -> Definition {
    Definition::new(protocol!("b2"), |v| sinusoidal_over_constant(v, &METHODS), SLIGHTLY, &GELS)
        .also("offline alone", |v| sinusoidal_over_constant(v, &METHODS[..1]))
        .also("online alone", |v| sinusoidal_over_constant(v, &METHODS[1..]))
        .also(KNOWN, |v| sinusoidal_over_constant(&known(v), &METHODS))
        .also(PUBLISHED, |v| sinusoidal_over_constant(&published(v), &METHODS))
        .also("online and sinusoidal together, over the mean of the other three", together)
}
