//! Which cases an examination consists of: a pure function of seed and index.

use super::draw::{Drawn, case};
use super::motion::Motions;
use super::outside::{OUTSIDE, Outside};
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use stylet_tissue::{AnyEffect, CoulombFriction, Effect, EffectInfo, ForceGain, StribeckFriction};

/// What kind of case.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// Nothing hidden.
    Clean,
    /// One effect of the library.
    Single,
    /// Two of them.
    Two,
    /// One outside the library.
    Outside,
}

/// Strength aimed at.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Size {
    /// At least 5 noise standard deviations after re-fitting the base.
    Strong,
    /// 0.5 to 5.
    Medium,
    /// 0.15 to 0.5.
    Faint,
    /// Less.
    Below,
}

impl Size {
    /// The class of a strength.
    #[must_use]
    pub fn of(strength: f64) -> Self {
        match strength {
            s if s >= 5.0 => Size::Strong,
            s if s >= 0.5 => Size::Medium,
            s if s >= 0.15 => Size::Faint,
            _ => Size::Below,
        }
    }
}

/// A case before its strength is known.
#[derive(Clone, Debug)]
pub struct Sketch {
    /// Kind.
    pub kind: Kind,
    /// Strength aimed at.
    pub target: f64,
    /// What is drawn.
    pub drawn: Drawn,
}

/// The sketch of a case. Of twenty cases eight are clean, eight have one effect, two have two, two one
/// outside the library.
#[must_use]
pub fn sketch(seed: u64, index: u64) -> Sketch {
    let (round, place) = (index / 20, index % 20);
    let turn = round * 8 + place;
    match place {
        0..8 => sketch_of(seed, index, Kind::Clean, turn),
        8..16 => sketch_of(seed, index, Kind::Single, turn),
        16..18 => sketch_of(seed, index, Kind::Two, turn),
        // Counted by themselves, so that every shape comes at every strength.
        _ => sketch_of(seed, index, Kind::Outside, round * 2 + place - 18),
    }
}

/// The sketch of a case of a given kind; `turn` goes round the effects and the sizes.
#[must_use]
pub fn sketch_of(seed: u64, index: u64, kind: Kind, turn: u64) -> Sketch {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(index + 1);
    let ar = [0.0, 0.5, 0.9][rng.random_range(0..3)];
    let size = match kind {
        Kind::Two => 0,
        Kind::Outside => (turn / OUTSIDE.len() as u64) % 3,
        _ => (turn / 27) % 3,
    };
    let mut between = |lo: f64, hi: f64| lo + (hi - lo) * rng.random::<f64>();
    let target = match size {
        0 => between(5.5_f64.ln(), 12.0_f64.ln()).exp(),
        1 => between(0.6_f64.ln(), 4.0_f64.ln()).exp(),
        _ => between(0.18_f64.ln(), 0.45_f64.ln()).exp(),
    };
    let mut drawn = Drawn {
        seed: seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ index.wrapping_mul(0xbf58_476d_1ce4_e5b9),
        effects: Vec::new(),
        outside: None,
        noise_n: 0.02,
        ar: [ar, 0.0],
        off: 0.15,
        motions: Motions::Rich,
        scatter: 0.0,
        velocity_noise_mps: 0.0,
    };
    let entries: Vec<&'static EffectInfo> = stylet_tissue::general_effects().collect();
    let fitted: Vec<&'static EffectInfo> =
        entries.iter().copied().filter(|i| i.id != ForceGain::ID).collect();
    match kind {
        Kind::Clean => {}
        Kind::Single => {
            let info = entries[(turn % entries.len() as u64) as usize];
            drawn.effects.extend(draw_effect(info, &mut between));
        }
        Kind::Two => {
            let count = fitted.len() as f64;
            let first = fitted[between(0.0, count) as usize];
            let mut second = first;
            while second.id == first.id || one_in_the_other(first.id, second.id) {
                second = fitted[between(0.0, count) as usize];
            }
            drawn.effects.extend(draw_effect(first, &mut between));
            drawn.effects.extend(draw_effect(second, &mut between));
        }
        Kind::Outside => {
            let u = [between(0.0, 1.0), between(0.0, 1.0), between(0.0, 1.0), between(0.0, 1.0)];
            drawn.outside = Some(Outside::new(turn as usize, u, 0.02 * target));
        }
    }
    Sketch { kind, target, drawn }
}

/// What makes a case harder than the diagnosis assumes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Harder {
    /// Noise of second order.
    Ar2,
    /// Puncture forces that scatter 3 % between recordings.
    Scatter,
    /// Noise of 0.1 mm/s on the measured velocity.
    Velocity,
    /// An effect outside the library on top, about as strong.
    AndOutside,
    /// One recording alone.
    One,
}

impl Harder {
    /// The sketch made harder.
    #[must_use]
    pub fn make(self, mut sketch: Sketch) -> Sketch {
        let drawn = &mut sketch.drawn;
        match self {
            Harder::Ar2 => drawn.ar = [1.3, -0.6],
            Harder::Scatter => drawn.scatter = 0.03,
            Harder::Velocity => drawn.velocity_noise_mps = 1e-4,
            Harder::One => drawn.motions = Motions::One,
            Harder::AndOutside => {
                let u = [0.3, 0.5, 0.7, 0.4];
                drawn.outside = Some(Outside::new(drawn.seed as usize, u, 0.02 * sketch.target));
            }
        }
        sketch
    }
}

/// Coulomb and Stribeck friction together are a Stribeck friction, exactly.
fn one_in_the_other(a: &str, b: &str) -> bool {
    let pair = [CoulombFriction::ID, StribeckFriction::ID];
    pair.contains(&a) && pair.contains(&b)
}

/// An effect with shapes drawn over plausible ranges and a first strength.
fn draw_effect(info: &EffectInfo, between: &mut dyn FnMut(f64, f64) -> f64) -> Option<AnyEffect> {
    let log = |between: &mut dyn FnMut(f64, f64) -> f64, lo: f64, hi: f64| between(lo.ln(), hi.ln()).exp();
    let sign = if between(0.0, 1.0) < 0.5 { -1.0 } else { 1.0 };
    let starts: Vec<f64> = info.parameters.iter().map(|p| p.start).collect();
    let values: Vec<f64> = match AnyEffect::from_parameters(info.id, &starts)? {
        AnyEffect::StressRelaxation(_) => vec![0.3, log(between, 0.2, 8.0)],
        AnyEffect::StribeckFriction(_) => vec![3.0, 3.0 * between(1.8, 3.5), log(between, 0.6e-3, 3e-3)],
        AnyEffect::PreslidingFriction(_) => vec![4.0, log(between, 2e-4, 3e-3)],
        AnyEffect::PowerLawFriction(_) => vec![if sign < 0.0 { 0.7 } else { 1.3 }],
        AnyEffect::HiddenMembrane(_) => vec![between(0.008, 0.085), log(between, 80.0, 400.0), 0.5],
        AnyEffect::BoundaryShift(_) => vec![if between(0.0, 1.0) < 0.5 { 1.0 } else { 2.0 }, sign * 0.002],
        AnyEffect::Respiration(_) => vec![0.001, between(0.15, 0.4), between(-3.0, 3.0)],
        AnyEffect::PeriodicInterference(_) => vec![0.03, log(between, 0.5, 40.0), between(-3.0, 3.0)],
        AnyEffect::NeedleCompliance(_) => vec![800.0],
        AnyEffect::Saturation(_) => vec![3.0],
        AnyEffect::ForceSpikes(_) => vec![between(0.2, 1.0), 1.0],
        AnyEffect::NonlinearElasticity(_) => vec![5.0],
        AnyEffect::PositionScale(_) | AnyEffect::AsymmetricFriction(_) => vec![sign * 0.03],
        AnyEffect::RateDependentPuncture(_) => vec![sign * 0.08],
        AnyEffect::ForceBias(_) | AnyEffect::ForceDrift(_) | AnyEffect::ForceGain(_) => {
            vec![sign * starts[0]]
        }
        _ => starts,
    };
    AnyEffect::from_parameters(info.id, &values)
}

/// The effect stronger by a factor.
#[must_use]
pub fn scaled(effect: &AnyEffect, factor: f64, largest_n: f64) -> Option<AnyEffect> {
    let mut v = effect.parameters();
    match effect {
        AnyEffect::StribeckFriction(_) => {
            v[0] *= factor;
            v[1] *= factor;
        }
        AnyEffect::StressRelaxation(_) => v[0] = (v[0] * factor).min(0.8),
        AnyEffect::PowerLawFriction(_) => v[0] = 1.0 + ((v[0] - 1.0) * factor).clamp(-0.7, 0.8),
        AnyEffect::HiddenMembrane(_) => v[2] = (v[2] * factor.sqrt().clamp(0.3, 3.0)).min(3.0),
        AnyEffect::BoundaryShift(_) => v[1] = (v[1] * factor).clamp(-0.012, 0.012),
        AnyEffect::NeedleCompliance(_) => v[0] = (v[0] / factor).clamp(80.0, 2e4),
        AnyEffect::Saturation(_) => {
            v[0] = largest_n * (1.0 - (1.0 - v[0] / largest_n).max(0.02) * factor.sqrt()).clamp(0.25, 0.995)
        }
        AnyEffect::ForceSpikes(_) => v[1] *= factor,
        AnyEffect::IncompleteRelease(_) => v[0] = (v[0] * factor).min(0.9),
        AnyEffect::AsymmetricFriction(_) => v[0] = (v[0] * factor).clamp(-0.8, 0.8),
        AnyEffect::PositionScale(_) => v[0] = (v[0] * factor).clamp(-0.15, 0.15),
        AnyEffect::RateDependentPuncture(_) => v[0] = (v[0] * factor).clamp(-0.3, 0.3),
        AnyEffect::ForceGain(_) => v[0] = (v[0] * factor).clamp(-0.2, 0.2),
        AnyEffect::Respiration(_) => v[0] = (v[0] * factor).min(0.012),
        AnyEffect::SoftBoundary(_) => v[0] = (v[0] * factor).min(0.015),
        AnyEffect::LowPassLag(_) => v[0] = (v[0] * factor).min(0.6),
        AnyEffect::TimeDelay(_) => v[0] = (v[0] * factor).min(0.4),
        AnyEffect::NonlinearElasticity(_) => v[0] = (v[0] * factor).min(60.0),
        AnyEffect::ToolInertia(_) => v[0] = (v[0] * factor).min(5.0),
        _ => v[0] *= factor,
    }
    AnyEffect::from_parameters(effect.id(), &v)
}

/// Largest force of a case, for placing a saturation.
#[must_use]
pub fn largest_force(drawn: &Drawn) -> f64 {
    let mut plain = drawn.clone();
    plain.effects.retain(|e| !matches!(e, AnyEffect::Saturation(_)));
    case(&plain).recordings.iter().flat_map(|r| &r.force_n).fold(0.0_f64, |m, f| m.max(f.abs()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    /// 24 cells of shape and strength, two of twenty cases each: 480 cases go round twice.
    #[test]
    fn every_shape_outside_the_library_is_drawn_equally_often_at_every_strength() {
        let mut cells: BTreeMap<(usize, u64), usize> = BTreeMap::new();
        for index in 0..480 {
            let sketch = sketch(1, index);
            if let Some(shape) = &sketch.drawn.outside {
                let size = Size::of(sketch.target) as u64;
                *cells.entry((shape.kind, size)).or_default() += 1;
            }
        }
        assert_eq!(cells.len(), 3 * OUTSIDE.len());
        assert!(cells.values().all(|n| *n == 2), "{cells:?}");
    }
}
