//! Draws the true layers and the layers that the scenario assumes.

use super::draw_motion::{log_uniform, uniform};
use super::misspecification_amounts::{LayerStack, MisspecificationAmounts};
use crate::simulator::tissue::{Layer, Tissue};
use rand::RngExt;
use rand::rngs::ChaCha8Rng;

/// Share of the layers that are punctured by force.
const PUNCTURED: f64 = 0.65;
/// The deepest usual stack in m.
const USUAL_END_M: f64 = 0.11;
/// The deepest stack in m.
const DEEPEST_M: f64 = 0.2;

/// The assumed layers.
pub fn draw_assumed_tissue(rng: &mut ChaCha8Rng, stack: LayerStack) -> Tissue {
    let count = match stack {
        LayerStack::Usual => [2, 3, 3, 4][rng.random_range(0..4)],
        LayerStack::Few => rng.random_range(1..=2),
        LayerStack::Five => 5,
        LayerStack::Six => 6,
    };
    let (thick, stiff, rub): ((f64, f64), (f64, f64), (f64, f64)) = match stack {
        LayerStack::Usual => ((15e-3, 45e-3), (30.0, 150.0), (4e3, 2e4)),
        LayerStack::Few => ((20e-3, 60e-3), (10.0, 300.0), (2e3, 2e4)),
        LayerStack::Five => ((6e-3, 30e-3), (30.0, 500.0), (3e3, 2e4)),
        LayerStack::Six => ((3e-3, 40e-3), (10.0, 1000.0), (1e3, 2e4)),
    };
    let end = if stack == LayerStack::Usual { USUAL_END_M } else { DEEPEST_M };
    let punctured = rng.random_range(0..count);
    let mut layers: Vec<Layer> = Vec::new();
    for i in 0..count {
        let thickness_m = uniform(rng, thick.0, thick.1);
        // The drop must exceed the noise and stay within the range of a force sensor.
        let least = stiff.0.max(0.3 / thickness_m);
        let most = stiff.1.min(12.0 / thickness_m).max(least);
        let stiffness_n_per_m = log_uniform(rng, least, most);
        let full = stiffness_n_per_m * thickness_m;
        let force = uniform(rng, 0.5, 0.9) * full;
        let has = (uniform(rng, 0.0, 1.0) < PUNCTURED || i == punctured) && (0.2..=10.0).contains(&force);
        layers.push(Layer {
            thickness_m,
            stiffness_n_per_m,
            friction_ns_per_m2: log_uniform(rng, rub.0, rub.1),
            puncture_n: has.then_some(force),
        });
    }
    let total: f64 = layers.iter().map(|l| l.thickness_m).sum();
    if total > end {
        for layer in &mut layers {
            layer.thickness_m *= end / total;
            layer.puncture_n = layer.puncture_n.map(|f| f * end / total);
        }
    }
    Tissue { surface_m: 0.0, layers: layers.into_iter().map(rounded).collect() }
}

/// Values rounded as a user would write them.
fn rounded(l: Layer) -> Layer {
    let to = |x: f64, step: f64| (x / step).round() * step;
    Layer {
        thickness_m: to(l.thickness_m, 1e-4),
        stiffness_n_per_m: to(l.stiffness_n_per_m, 0.1),
        friction_ns_per_m2: to(l.friction_ns_per_m2, 10.0),
        puncture_n: l.puncture_n.map(|f| to(f, 0.01)),
    }
}

/// A random error of 0.5 to 1 times `size`, of either sign.
fn signed_error(rng: &mut ChaCha8Rng, size: f64) -> f64 {
    let sign = if rng.random::<bool>() { 1.0 } else { -1.0 };
    sign * size * uniform(rng, 0.5, 1.0)
}

/// Draws the true stack. The draws do not depend on the amounts, so that the same insertion occurs at every severity.
pub fn draw_true_tissue(rng: &mut ChaCha8Rng, assumed: &Tissue, amounts: &MisspecificationAmounts) -> Tissue {
    let mut truth = assumed.clone();
    truth.surface_m += signed_error(rng, 1.0) * amounts.surface_m;
    for layer in &mut truth.layers {
        layer.thickness_m *= 1.0 + signed_error(rng, 1.0) * amounts.thickness;
        layer.stiffness_n_per_m *= 1.0 + signed_error(rng, 1.0) * amounts.coefficients;
        layer.friction_ns_per_m2 *= 1.0 + signed_error(rng, 1.0) * amounts.coefficients;
        let factor = 1.0 + signed_error(rng, 1.0) * amounts.coefficients;
        // Below the elastic force at the far face, so that a layer with a puncture force ruptures by force.
        let most = 0.95 * layer.stiffness_n_per_m * layer.thickness_m;
        layer.puncture_n = layer.puncture_n.map(|f| (f * factor).min(most));
    }
    truth
}

/// Draws a guessed stack: every parameter is off by an independent factor.
pub fn draw_guessed_tissue(
    rng: &mut ChaCha8Rng,
    assumed: &Tissue,
    amounts: &MisspecificationAmounts,
) -> Tissue {
    let mut guess = assumed.clone();
    let mut factor = || log_uniform(rng, 1.0 / amounts.guess, amounts.guess);
    for layer in &mut guess.layers {
        layer.thickness_m *= factor();
        layer.stiffness_n_per_m *= factor();
        layer.friction_ns_per_m2 *= factor();
        layer.puncture_n = layer.puncture_n.map(|f| f * factor());
    }
    guess
}

/// Draws the stack of one recording, with its scatter.
pub fn draw_encountered_tissue(
    rng: &mut ChaCha8Rng,
    truth: &Tissue,
    amounts: &MisspecificationAmounts,
) -> Tissue {
    let mut normal = || {
        let x: f64 = rand_distr::Distribution::sample(&rand_distr::StandardNormal, rng);
        // An experimenter would discard a specimen three standard deviations off.
        x.clamp(-2.5, 2.5)
    };
    let mut it = truth.clone();
    let rub = 1.0 + amounts.scatter_friction * normal();
    let first = truth.layers.first().map_or(0.0, |l| l.thickness_m);
    it.surface_m += amounts.scatter_surface * first * normal();
    for layer in &mut it.layers {
        layer.friction_ns_per_m2 *= rub;
        let factor = 1.0 + amounts.scatter_puncture * normal();
        layer.puncture_n = layer.puncture_n.map(|f| f * factor);
    }
    it.surface_m += signed_error(rng, amounts.surface_each_m);
    it
}

/// The assumed scenario as RON text (docs/reference/files.md).
#[must_use]
pub fn scenario_ron(name: &str, tissue: &Tissue, rate_hz: f64) -> String {
    use core::fmt::Write as _;
    let mut out = String::new();
    let _ = write!(
        out,
        "Scenario(\n    name: \"{name}\",\n    source: \"drawn\",\n    tissue: (\n        surface_m: {:?},\n        layers: [\n",
        tissue.surface_m
    );
    for (i, l) in tissue.layers.iter().enumerate() {
        let _ = write!(
            out,
            "            (name: \"layer {}\", thickness_m: {:?}, stiffness_n_per_m: {:?}, friction_ns_per_m2: {:?}",
            i + 1,
            l.thickness_m,
            l.stiffness_n_per_m,
            l.friction_ns_per_m2
        );
        if let Some(f) = l.puncture_n {
            let _ = write!(out, ", puncture_n: Some({f:?})");
        }
        out.push_str("),\n");
    }
    let _ = write!(
        out,
        "        ],\n    ),\n    motion: Recorded,\n    sample_hz: {rate_hz:?},\n    tolerance: 0.3,\n)\n"
    );
    out
}
