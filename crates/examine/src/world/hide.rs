//! Hiding effects, ingredients and shapes in a case, at the strength aimed at.

use super::case::Setup;
use super::hidden::{self, For};
use super::id::{CaseId, Hide, World};
use super::ingredients::{self, INGREDIENTS};
use super::outside::{SHAPES, Shape};
use super::strength::{Beside, largest_n, left_n};
use crate::reality::effect::{Effect, IDS};
use crate::reality::rich::Ingredients;
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};

/// Effects that a tissue of one layer cannot have, or that cannot be told apart from one another when together.
fn fits(effect: &Effect, setup: &Setup) -> bool {
    let punctured = setup.truth.layers.iter().any(|l| l.puncture_n.is_some());
    match effect {
        Effect::BoundaryShift { .. } => setup.truth.layers.len() > 1,
        Effect::RateDependentPuncture { .. } => punctured,
        _ => true,
    }
}

/// Pairs of which one contains the other, or that are one and the same for the base law.
fn apart(a: &Effect, b: &Effect) -> bool {
    const FAMILIES: [&[&str]; 3] = [
        &["coulomb_friction", "stribeck_friction", "presliding_friction"],
        &["boundary_shift", "position_scale"],
        &["low_pass_lag", "time_delay"],
    ];
    a.id() != b.id() && !FAMILIES.iter().any(|f| f.contains(&a.id()) && f.contains(&b.id()))
}

/// Instrument faults, as issue and data sheets name them.
const INSTRUMENT: [&str; 8] = [
    "force_gain",
    "force_bias",
    "force_drift",
    "periodic_interference",
    "saturation",
    "quantisation",
    "time_delay",
    "low_pass_lag",
];

fn number_of(id: &str) -> usize {
    IDS.iter().position(|x| *x == id).unwrap_or(0)
}

/// Hides what the case's name asks for, `target_n` in N of residual in all.
pub fn hide(rng: &mut ChaCha8Rng, id: &CaseId, setup: &mut Setup, target_n: f64) {
    let largest = largest_n(setup);
    let sd = setup.noise.sd_n;
    let truth = setup.truth.clone();
    let case = For {
        tissue: &truth,
        largest_n: largest,
        rate_hz: setup.amounts.rate_hz,
        coefficients: setup.amounts.coefficients,
        size: id.size,
    };
    if id.world == World::Rich {
        enrich(rng, id, setup, target_n);
    }
    let count = match id.hide {
        Hide::One | Hide::Two | Hide::Three if id.world == World::Rich => 0,
        Hide::Clean | Hide::Outside => 0,
        Hide::One | Hide::Beside | Hide::Instrument => 1,
        Hide::Two => 2,
        Hide::Three => 3,
    };
    let each = target_n / f64::from(count.max(1) as u32).sqrt();
    for k in 0..count {
        let effect = (0..200u64).find_map(|turn| {
            let which = match (id.hide, k) {
                // Every effect equally often; where one does not fit, the next.
                (Hide::One, _) => (shuffled(id.seed, id.index, IDS.len()) + turn as usize) % IDS.len(),
                (Hide::Instrument, _) => number_of(INSTRUMENT[(id.index + turn) as usize % INSTRUMENT.len()]),
                (Hide::Beside, _) if id.world == World::Rich => {
                    number_of(INSTRUMENT[1 + (id.index + turn) as usize % (INSTRUMENT.len() - 1)])
                }
                (Hide::Beside, _) => (id.index as usize * 7 + turn as usize) % IDS.len(),
                (_, 0) => (shuffled(id.seed, id.index, IDS.len()) + turn as usize) % IDS.len(),
                _ => rng.random_range(0..IDS.len()),
            };
            let e = hidden::draw(rng, which, &case);
            // Where several are asked for, none is one that nobody can see.
            let lone = matches!(id.hide, Hide::One | Hide::Instrument);
            let seen = lone || !matches!(e, Effect::ForceGain { .. });
            (seen && fits(&e, setup) && setup.effects.iter().all(|o| apart(o, &e))).then_some(e)
        });
        let Some(effect) = effect else { continue };
        setup.effects.push(strengthened(setup, effect, each, largest));
    }
    if id.hide == Hide::Outside || (id.hide == Hide::Beside && id.world == World::Plain) {
        let mut u = [0.0; 6];
        u.iter_mut().for_each(|x| *x = rng.random());
        let kind = id.index as usize % SHAPES.len();
        let mut shape = Shape::new(kind, u, sd);
        for _ in 0..2 {
            let left = left_n(setup, &[], Some(&shape), Beside::Common);
            shape = shape.sized((shape.size_n * target_n / left.max(1e-6)).min(5.0));
        }
        setup.shape = Some(shape);
    }
    setup.strength_sd = match (&setup.shape, count) {
        (None, 0) if setup.rich == Ingredients::default() => 0.0,
        (Some(shape), 0) => left_n(setup, &[], Some(shape), Beside::Common) / sd,
        _ => left_n(setup, &setup.effects, None, Beside::Nothing) / sd,
    };
}

/// How many ingredients of the rich law a case has, and they.
fn enrich(rng: &mut ChaCha8Rng, id: &CaseId, setup: &mut Setup, target_n: f64) {
    let count = match id.hide {
        Hide::One | Hide::Beside => 1,
        Hide::Two => 2,
        Hide::Three => 3,
        Hide::Clean | Hide::Outside | Hide::Instrument => 0,
    };
    let truth = setup.truth.clone();
    let mut all = Ingredients::default();
    for k in 0..count {
        let turn = if k == 0 { 0 } else { rng.random_range(1..INGREDIENTS.len()) };
        let which = (shuffled(id.seed, id.index, INGREDIENTS.len()) + turn) % INGREDIENTS.len();
        let mut one = Ingredients::default();
        ingredients::add(rng, which, &truth, id.size, &mut one);
        for _ in 0..5 {
            setup.rich = one;
            let left = left_n(setup, &[], None, Beside::Nothing);
            let factor = (target_n / f64::from(count).sqrt() / left.max(1e-9)).clamp(0.05, 20.0);
            match ingredients::scaled(&one, factor) {
                Some(next) if !(0.87..1.15).contains(&factor) && next != one => one = next,
                _ => break,
            }
        }
        all = ingredients::together(&all, &one);
    }
    setup.rich = all;
}

/// A permutation of `0..n` that changes with every round: the `index`-th entry.
fn shuffled(seed: u64, index: u64, n: usize) -> usize {
    let round = index / n as u64;
    let mut rng = ChaCha8Rng::seed_from_u64(seed ^ round.wrapping_mul(0x9e37_79b9_7f4a_7c15));
    let mut order: Vec<usize> = (0..n).collect();
    for k in (1..n).rev() {
        order.swap(k, rng.random_range(0..=k));
    }
    order[(index % n as u64) as usize]
}

/// The effect at the strength aimed at, as nearly as plausible numbers allow.
fn strengthened(setup: &Setup, effect: Effect, target_n: f64, largest_n: f64) -> Effect {
    let mut effect = effect;
    for _ in 0..5 {
        let left = left_n(setup, &[effect], None, Beside::Nothing);
        let factor = (target_n / left.max(1e-9)).clamp(0.05, 20.0);
        if (0.87..1.15).contains(&factor) {
            break;
        }
        match hidden::scaled(&effect, factor, largest_n) {
            Some(next) if next != effect => effect = next,
            _ => break,
        }
    }
    effect
}
