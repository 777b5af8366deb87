//! The twelve friction estimates of the supplement's Fig. 2: three phantoms, two motions, two methods.

use crate::all_runs::Study;
use crate::paper_experiments::Case;
use crate::study_conditions::View;

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

/// Method of the friction estimate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Least squares over the whole layer with all force as friction (supplement sec. III).
    Offline,
    /// Least squares of K and b over the whole layer, without the drop.
    OfflineBoth,
    /// The online algorithm, multi-layer model.
    Online,
}

/// Estimates of b in N s/m² by seed; `None` if the online algorithm did not find the exit.
#[must_use]
pub fn estimates(view: &View<'_>, phantom: usize, motion: usize, method: Method) -> Vec<Option<f64>> {
    let case = PHANTOMS[phantom].cases[motion];
    match method {
        Method::Offline => view.offline(case).iter().map(|o| o.friction_only).collect(),
        Method::OfflineBoth => view
            .offline(case)
            .iter()
            .map(|o| o.without_drop.first().copied().flatten().map(|e| e.friction_ns_per_m2))
            .collect(),
        Method::Online => view.ml(case).iter().map(|o| o.online_friction(0)).collect(),
    }
}

/// One estimate over another, by seed.
#[must_use]
pub fn over(a: &[Option<f64>], b: &[Option<f64>]) -> Vec<Option<f64>> {
    // A clipped estimate of zero has no logarithm.
    a.iter().zip(b).map(|(a, b)| Some((*a)? / (*b)?).filter(|r| *r > 0.0 && r.is_finite())).collect()
}

/// The true friction of a phantom in N s/m².
#[must_use]
pub fn true_friction(study: &Study, phantom: usize) -> Option<f64> {
    let outcome = View::primary(study).ml(PHANTOMS[phantom].cases[0]).first()?;
    Some(outcome.score.layers.first()?.friction_ns_per_m2.truth)
}
