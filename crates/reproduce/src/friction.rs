//! The twelve friction estimates of the supplement's Fig. 2: three phantoms, two motions, two methods.

use crate::case::Case;
use crate::study::Study;
use crate::variant::{Protocol, Variant};

/// An isinglass phantom.
#[derive(Clone, Copy, Debug)]
pub struct Phantom {
    /// Name.
    pub name: &'static str,
    /// Insertions at constant and at sinusoidal velocity.
    pub cases: [Case; 2],
}

/// By concentration.
pub const PHANTOMS: [Phantom; 3] = [
    Phantom { name: "25 %", cases: Case::GELS[0] },
    Phantom { name: "50 %", cases: Case::GELS[1] },
    Phantom { name: "70 %", cases: Case::GELS[2] },
];

/// Constant and sinusoidal.
pub const MOTIONS: [&str; 2] = ["constant", "sinusoidal"];

/// How friction is estimated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Least squares over the whole layer, all force being friction (supplement sec. III).
    Offline,
    /// The online algorithm, multi-layer model.
    Online(Protocol),
}

/// The estimate in N s/m²; none when the online algorithm did not find the exit.
#[must_use]
pub fn estimate(study: &Study, phantom: usize, motion: usize, method: Method, seed: usize) -> Option<f64> {
    let case = PHANTOMS.get(phantom)?.cases.get(motion).copied()?;
    match method {
        Method::Offline => study.at(case, Variant::ml(Protocol::KnownDepth)).get(seed)?.friction_only,
        Method::Online(protocol) => study.at(case, Variant::ml(protocol)).get(seed)?.online_friction(0),
    }
}

/// The same over all seeds.
pub fn estimates(
    study: &Study,
    phantom: usize,
    motion: usize,
    method: Method,
) -> impl Iterator<Item = Option<f64>> + '_ {
    (0..study.seeds as usize).map(move |seed| estimate(study, phantom, motion, method, seed))
}

/// The true friction of a phantom in N s/m².
#[must_use]
pub fn true_friction(study: &Study, phantom: usize) -> Option<f64> {
    let case = PHANTOMS.get(phantom)?.cases[0];
    let outcome = study.at(case, Variant::ml(Protocol::KnownDepth)).first()?;
    Some(outcome.score.layers.first()?.friction_ns_per_m2.truth)
}
