//! What is fitted: base parameters, geometry, effects, numbers of each recording's own, instants of ruptures.

use std::sync::Arc;
use stylet_tissue::{AnyEffect, Effect, EffectInfo, FitScale, Law, Measurement, Place, Tissue};

/// The instant (s) of a rupture that never was.
pub const NEVER: f64 = f64::INFINITY;

/// What is believed before any measurement, and how surely.
#[derive(Clone, Debug)]
pub struct Belief {
    /// The tissue.
    pub tissue: Tissue,
    /// Effects that the simulation has already.
    pub given: Vec<AnyEffect>,
    /// How far stiffness, friction and puncture force may be off, relative, per layer.
    pub tolerance: Vec<f64>,
    /// The same for thicknesses.
    pub thickness_tolerance: Vec<f64>,
    /// And for the position of the surface, in m.
    pub surface_tolerance_m: f64,
}

/// One effect under trial: the library's entry and its values in the library's order.
#[derive(Clone, Debug, PartialEq)]
pub struct Choice {
    /// The library's entry.
    pub info: &'static EffectInfo,
    /// Values.
    pub values: Vec<f64>,
}

impl Choice {
    /// An effect with these values.
    #[must_use]
    pub fn new(info: &'static EffectInfo, values: &[f64]) -> Self {
        Self { info, values: values.to_vec() }
    }

    /// The effect as the law takes it.
    #[must_use]
    pub fn effect(&self) -> Option<AnyEffect> {
        AnyEffect::from_parameters(self.info.id, &self.values)
    }

    fn coordinates(&self) -> Vec<f64> {
        self.effect().map_or_else(|| self.values.clone(), |e| e.coordinates())
    }
}

/// Which numbers beside `K, b, F` and the effects' are free.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Free {
    /// The position of the surface.
    pub surface: bool,
    /// The thicknesses.
    pub thickness: bool,
    /// They may be off by more than their tolerances.
    pub far: bool,
    /// A surface of each recording's own.
    pub own_surface: bool,
    /// Friction of each recording's own.
    pub own_friction: bool,
    /// Of each recording's own what effects say differs between insertions ([`stylet_tissue::ParameterInfo::differs`]).
    pub own_effects: bool,
    /// A surface of each day's own.
    pub day_surface: bool,
    /// Friction of each day's own.
    pub day_friction: bool,
}

/// Most numbers of effects that differ between insertions in one model.
pub const DIFFERING: usize = 8;

/// Numbers of one recording's own.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Own {
    /// Position of the surface beyond the common one, in m.
    pub surface_m: f64,
    /// Natural logarithm of the factor on friction.
    pub friction: f64,
    /// What effects say differs between insertions, beyond the common value, in the order of [`Model::differing`].
    pub differing: [f64; 8],
}

/// Numbers of one day's own: of recordings that were made with one set-up.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Day {
    /// Position of the surface beyond the common one, in m.
    pub surface_m: f64,
    /// Natural logarithm of the factor on friction.
    pub friction: f64,
}

/// A number of an effect that is not fitted by itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bound {
    /// Which effect of the model.
    pub effect: usize,
    /// Which of its parameters.
    pub parameter: usize,
    /// The effect whose same parameter it always equals; none: it stays as it is.
    pub like: Option<usize>,
}

/// How much insertions differ from one another, beyond the law: estimated with each model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scatter {
    /// Standard deviation of the force at a rupture, relative.
    pub force: f64,
    /// Standard deviation of the position of a face at which a layer gives way, in m.
    pub place_m: f64,
    /// Standard deviation of the surface in m.
    pub surface_m: f64,
    /// Standard deviation of the logarithm of friction.
    pub friction: f64,
    /// Standard deviations of what differs by effects, in the order of [`Model::differing`]; zero: as the library says.
    pub differing: [f64; 8],
    /// Standard deviation of the surface between days, in m.
    pub day_surface_m: f64,
    /// Standard deviation of the logarithm of friction between days.
    pub day_friction: f64,
}

impl Default for Scatter {
    /// None, and for the numbers of a recording's or day's own wide first guesses.
    fn default() -> Self {
        Self {
            force: 0.0,
            place_m: 0.0,
            surface_m: 1e-3,
            friction: 0.05,
            differing: [0.0; 8],
            day_surface_m: 1e-3,
            day_friction: 0.1,
        }
    }
}

/// What a number is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Stiffness of a layer (0-based).
    Stiffness(usize),
    /// Friction of a layer.
    Friction(usize),
    /// Puncture force of a layer.
    Puncture(usize),
    /// Position of the surface.
    Surface,
    /// Thickness of a layer.
    Thickness(usize),
    /// A parameter of an effect.
    Effect {
        /// Which effect of the model.
        effect: usize,
        /// Which of its parameters.
        parameter: usize,
    },
    /// Surface of each recording's own: as many numbers as recordings.
    OwnSurface,
    /// Friction of each recording's own.
    OwnFriction,
    /// One of the numbers that differ between insertions ([`Model::differing`]).
    OwnEffect(usize),
    /// Surface of a day.
    DaySurface(usize),
    /// Friction of a day.
    DayFriction(usize),
    /// The instant of a layer's rupture (0-based), one number per recording.
    Instant(usize),
}

impl Role {
    /// Whether every recording has such a number of its own.
    #[must_use]
    pub fn is_own(self) -> bool {
        matches!(self, Role::OwnSurface | Role::OwnFriction | Role::OwnEffect(_) | Role::Instant(_))
    }
}

/// A number of the fit.
#[derive(Clone, Copy, Debug)]
pub struct Number {
    /// What it is.
    pub role: Role,
    /// Smallest value.
    pub low: f64,
    /// Largest value.
    pub high: f64,
    /// Middle of the prior.
    pub mean: f64,
    /// Standard deviation of the prior; infinite for none.
    pub sd: f64,
    /// Step of the numeric derivative.
    pub step: f64,
}

/// A law with everything that is fitted.
#[derive(Clone, Debug)]
pub struct Model {
    /// What was believed.
    pub belief: Arc<Belief>,
    /// The tissue as fitted.
    pub tissue: Tissue,
    /// The effects under trial.
    pub effects: Vec<Choice>,
    /// Which other numbers are free.
    pub free: Free,
    /// Numbers of each recording's own.
    pub own: Vec<Own>,
    /// Scatter between insertions.
    pub scatter: Scatter,
    /// Instants (s) at which the recorded force shows the rupture of each layer, per recording.
    pub instants: Vec<Vec<f64>>,
    /// Numbers of effects that are not fitted by themselves.
    pub bound: Vec<Bound>,
    /// Per recording the day on which it was made; empty: nobody asks.
    pub day_of: Vec<usize>,
    /// Numbers of each day's own.
    pub days: Vec<Day>,
    /// Spreads between recordings and days stay as they are in a fit: somebody else tells them.
    pub steady: bool,
    /// The delay in s at which the jumps of a late force are put between samples; none: they show at their instants. The likelihood has
    /// steps in it, so that a search begins without.
    pub placed_s: Option<f64>,
}

/// A model ready to be replayed over one recording.
pub struct Compiled {
    /// The law.
    pub law: Law,
    /// The measuring chain.
    pub chain: Measurement,
    /// Whether the chain changes the force.
    pub measures: bool,
    /// True position over recorded one.
    pub to_true: f64,
    /// Delay in s.
    pub delay_s: f64,
    /// A jump of the speed is smeared before it is sampled.
    pub smears: bool,
    /// As in [`Model::placed_s`].
    pub placed_s: Option<f64>,
    /// Positions (m) at which a force at the tip may jump: faces, and where something of an effect's own breaks.
    pub breaks_m: Vec<f64>,
    /// Own puncture force of every layer in N, infinite when only its far face ruptures it.
    pub puncture_n: Vec<f64>,
    /// Stiffness of every layer in N/m.
    pub stiffness: Vec<f64>,
}

impl Model {
    /// The base law with its surface and thicknesses free.
    #[must_use]
    pub fn base(belief: Arc<Belief>, recordings: usize) -> Self {
        let layers = belief.tissue.layers.len();
        Self {
            tissue: belief.tissue.clone(),
            effects: Vec::new(),
            free: Free { surface: true, thickness: true, ..Free::default() },
            own: vec![Own::default(); recordings],
            scatter: Scatter::default(),
            instants: vec![vec![NEVER; layers]; recordings],
            bound: Vec::new(),
            day_of: Vec::new(),
            days: Vec::new(),
            steady: false,
            placed_s: None,
            belief,
        }
    }

    /// The same law for some of the recordings; days keep their numbers.
    #[must_use]
    pub fn only(&self, which: &[usize]) -> Self {
        let mut model = self.clone();
        model.own = which.iter().map(|r| self.own[*r]).collect();
        model.instants = which.iter().map(|r| self.instants[*r].clone()).collect();
        if !self.day_of.is_empty() {
            model.day_of = which.iter().map(|r| self.day_of[*r]).collect();
        }
        model
    }

    /// The numbers that differ between insertions as their effects say: effect and parameter.
    pub fn differing(&self) -> impl Iterator<Item = (usize, usize)> {
        let all = self.effects.iter().enumerate().flat_map(|(effect, choice)| {
            let own = choice.info.parameters.iter().enumerate().filter(|(_, p)| p.differs > 0.0);
            own.map(move |(parameter, _)| (effect, parameter))
        });
        all.take(DIFFERING)
    }

    /// The day of a recording.
    fn day(&self, recording: usize) -> Day {
        self.day_of.get(recording).and_then(|d| self.days.get(*d)).copied().unwrap_or_default()
    }

    /// The same with one more effect.
    #[must_use]
    pub fn with(&self, choice: Choice) -> Self {
        let mut model = self.clone();
        model.effects.push(choice);
        model
    }

    /// The same without one effect.
    #[must_use]
    pub fn without(&self, effect: usize) -> Self {
        let mut model = self.clone();
        model.effects.remove(effect);
        model.bound.retain(|b| b.effect != effect && b.like != Some(effect));
        let down = |e: &mut usize| *e -= usize::from(*e > effect);
        for b in &mut model.bound {
            down(&mut b.effect);
            b.like.as_mut().map(down);
        }
        model
    }

    /// Number of layers.
    #[must_use]
    pub fn layers(&self) -> usize {
        self.tissue.layers.len()
    }

    /// Law and chain for a recording; `None` when the library refuses the values.
    #[must_use]
    pub fn compile(&self, recording: usize) -> Option<Compiled> {
        let mut effects = self.belief.given.clone();
        let own = self.own.get(recording).copied().unwrap_or_default();
        let day = self.day(recording);
        for choice in &self.effects {
            effects.push(choice.effect()?);
        }
        if self.free.own_effects {
            let given = self.belief.given.len();
            for ((effect, parameter), beyond) in self.differing().zip(own.differing) {
                let mut choice = self.effects[effect].clone();
                choice.values[parameter] += beyond;
                effects[given + effect] = choice.effect()?;
            }
        }
        let law = if own == Own::default() && day == Day::default() {
            Law::new(&self.tissue, &effects).ok()?
        } else {
            let mut tissue = self.tissue.clone();
            tissue.surface_m += own.surface_m + day.surface_m;
            let factor = libm::exp(own.friction + day.friction);
            effects.iter_mut().for_each(|e| e.rubbed(factor));
            tissue.layers.iter_mut().for_each(|l| l.friction_ns_per_m2 *= factor);
            Law::new(&tissue, &effects).ok()?
        };
        let chain = Measurement::new(&effects);
        let surface = law.slabs().first().map_or(0.0, |s| s.front_m);
        Some(Compiled {
            to_true: chain.true_position(1.0),
            delay_s: chain.delay_s(),
            smears: chain.smears() || law.bends(),
            placed_s: self.placed_s,
            measures: !chain.is_plain(),
            breaks_m: {
                let mut places: Vec<f64> =
                    effects.iter().filter_map(Effect::break_depth_m).map(|d| surface + d).collect();
                if effects.iter().any(|e| e.place() == Place::Tip && !e.is_neutral()) {
                    places.extend(law.slabs().iter().map(stylet_tissue::Slab::far_m));
                }
                places
            },
            puncture_n: law.slabs().iter().map(|s| s.puncture_n).collect(),
            stiffness: law.slabs().iter().map(|s| s.stiffness_n_per_m).collect(),
            law,
            chain,
        })
    }

    /// Whether a thickness is further from what is believed than its tolerance allows.
    #[must_use]
    pub fn is_strained(&self, layer: usize) -> bool {
        let b = &self.belief;
        let believed = b.tissue.layers[layer].thickness_m;
        let off = (self.tissue.layers[layer].thickness_m - believed).abs();
        off > TOLERATED * b.thickness_tolerance[layer] * believed
    }

    /// The numbers that every recording shares.
    #[must_use]
    pub fn shared(&self) -> Vec<Number> {
        let mut out = Vec::new();
        let b = &self.belief;
        for (layer, l) in b.tissue.layers.iter().enumerate() {
            let tolerance = b.tolerance[layer];
            let mut relative = |role, size: f64| {
                if size > 0.0 {
                    let (low, high) = ((1.0 - tolerance).max(LEAST_SHARE), 1.0 + tolerance);
                    out.push(Number { role, low, high, mean: 1.0, sd: tolerance, step: 1e-5 });
                }
            };
            relative(Role::Stiffness(layer), l.stiffness_n_per_m);
            relative(Role::Friction(layer), l.friction_ns_per_m2);
            relative(Role::Puncture(layer), l.puncture_n.unwrap_or(0.0));
        }
        if self.free.surface && b.surface_tolerance_m > 0.0 {
            let (at, sd) = (b.tissue.surface_m, b.surface_tolerance_m);
            let (low, high) = (at - TOLERATED * sd, at + TOLERATED * sd);
            out.push(Number { role: Role::Surface, low, high, mean: at, sd, step: 1e-7 });
        }
        if self.free.thickness {
            for (layer, l) in b.tissue.layers.iter().enumerate() {
                let (d, sd) = (l.thickness_m, b.thickness_tolerance[layer] * l.thickness_m);
                if sd > 0.0 {
                    let most = if self.free.far { FARTHEST } else { TOLERATED } * sd;
                    let (low, high) = ((d - most).max(0.05 * d), d + most);
                    out.push(Number { role: Role::Thickness(layer), low, high, mean: d, sd, step: 1e-7 });
                }
            }
        }
        for (effect, choice) in self.effects.iter().enumerate() {
            let at = choice.coordinates();
            for (parameter, p) in choice.info.parameters.iter().enumerate().filter(|(_, p)| !p.whole) {
                if self.bound.iter().any(|b| b.effect == effect && b.parameter == parameter) {
                    continue;
                }
                let role = Role::Effect { effect, parameter };
                let (from, to) = p.search;
                let (low, high, step) = match p.fit_scale() {
                    FitScale::Log => {
                        let (low, high) = ((from / 10.0).max(p.low), (to * 10.0).min(p.high));
                        // A frequency is told by the phase at the end of a recording.
                        let step = if p.unit == "Hz" { 1e-6 / at[parameter].max(1e-3) } else { 1e-4 };
                        (libm::log(low.max(1e-12)), libm::log(high), step)
                    }
                    FitScale::Reciprocal => (0.0, 10.0 / from, 1e-4 / p.start),
                    FitScale::Linear => {
                        let wide = to - from;
                        let low = if p.low == 0.0 { 0.0 } else { (from - wide).max(p.low) };
                        let high = (to + 3.0 * wide).min(p.high);
                        (low, high, 1e-4 * p.start.abs().max(at[parameter].abs()).max(1e-4))
                    }
                };
                out.push(Number { role, low, high, mean: 0.0, sd: f64::INFINITY, step });
            }
        }
        let mut of_day = |role, sd, step| {
            let infinity = f64::INFINITY;
            out.push(Number { role, low: -infinity, high: infinity, mean: 0.0, sd, step });
        };
        for day in 0..self.days.len() {
            if self.free.day_surface {
                of_day(Role::DaySurface(day), self.scatter.day_surface_m, 1e-7);
            }
            if self.free.day_friction {
                of_day(Role::DayFriction(day), self.scatter.day_friction, 1e-5);
            }
        }
        out
    }

    /// Standard deviation of the `k`-th number that differs between insertions.
    #[must_use]
    pub fn differing_sd(&self, k: usize) -> f64 {
        let known = self.scatter.differing.get(k).copied().unwrap_or(0.0);
        if known > 0.0 { known } else { self.differing_said(k) }
    }

    /// The same as the library has it, before any data.
    #[must_use]
    pub fn differing_said(&self, k: usize) -> f64 {
        self.differing().nth(k).map_or(1.0, |(e, p)| self.effects[e].info.parameters[p].differs)
    }

    /// Whether some effect acts along the shaft.
    #[must_use]
    pub fn has_friction_effects(&self) -> bool {
        self.effects
            .iter()
            .filter_map(Choice::effect)
            .chain(self.belief.given.iter().cloned())
            .any(|e| e.place() == Place::Friction)
    }

    /// The numbers that each recording has of its own.
    #[must_use]
    pub fn own_numbers(&self) -> Vec<Number> {
        let infinity = f64::INFINITY;
        let number = |role, sd, step| Number { role, low: -infinity, high: infinity, mean: 0.0, sd, step };
        let mut out = Vec::new();
        if self.free.own_surface {
            out.push(number(Role::OwnSurface, self.scatter.surface_m, 1e-7));
        }
        if self.free.own_friction {
            out.push(number(Role::OwnFriction, self.scatter.friction, 1e-5));
        }
        if self.free.own_effects {
            for (k, (e, p)) in self.differing().enumerate() {
                let step = 1e-3 * self.effects[e].info.parameters[p].differs;
                out.push(number(Role::OwnEffect(k), self.differing_sd(k), step));
            }
        }
        out.extend((0..self.layers()).map(|layer| number(Role::Instant(layer), infinity, 1e-5)));
        out
    }

    /// A number's value, of recording `r` if it is its own.
    #[must_use]
    pub fn get(&self, role: Role, r: usize) -> f64 {
        let assumed = &self.belief.tissue;
        match role {
            Role::Stiffness(l) => {
                self.tissue.layers[l].stiffness_n_per_m / assumed.layers[l].stiffness_n_per_m
            }
            Role::Friction(l) => {
                self.tissue.layers[l].friction_ns_per_m2 / assumed.layers[l].friction_ns_per_m2
            }
            Role::Puncture(l) => {
                self.tissue.layers[l].puncture_n.unwrap_or(1.0) / assumed.layers[l].puncture_n.unwrap_or(1.0)
            }
            Role::Surface => self.tissue.surface_m,
            Role::Thickness(l) => self.tissue.layers[l].thickness_m,
            Role::Effect { effect, parameter } => {
                let choice = &self.effects[effect];
                let x = choice.coordinates()[parameter];
                match choice.info.parameters[parameter].fit_scale() {
                    FitScale::Linear => x,
                    FitScale::Log => libm::log(x.max(1e-300)),
                    FitScale::Reciprocal => 1.0 / x,
                }
            }
            Role::OwnSurface => self.own[r].surface_m,
            Role::OwnFriction => self.own[r].friction,
            Role::OwnEffect(k) => self.own[r].differing[k],
            Role::DaySurface(d) => self.days[d].surface_m,
            Role::DayFriction(d) => self.days[d].friction,
            Role::Instant(l) => self.instants[r][l],
        }
    }

    /// Sets a number, of recording `r` if it is its own.
    pub fn set(&mut self, role: Role, r: usize, x: f64) {
        let assumed = &self.belief.tissue;
        match role {
            Role::Stiffness(l) => {
                self.tissue.layers[l].stiffness_n_per_m = x * assumed.layers[l].stiffness_n_per_m;
            }
            Role::Friction(l) => {
                self.tissue.layers[l].friction_ns_per_m2 = x * assumed.layers[l].friction_ns_per_m2;
            }
            Role::Puncture(l) => {
                self.tissue.layers[l].puncture_n = assumed.layers[l].puncture_n.map(|f| f * x);
            }
            Role::Surface => self.tissue.surface_m = x,
            Role::Thickness(l) => self.tissue.layers[l].thickness_m = x,
            Role::Effect { effect, parameter } => {
                let choice = &mut self.effects[effect];
                let mut at = choice.coordinates();
                at[parameter] = match choice.info.parameters[parameter].fit_scale() {
                    FitScale::Linear => x,
                    FitScale::Log => libm::exp(x),
                    FitScale::Reciprocal => {
                        if x > 0.0 {
                            1.0 / x
                        } else {
                            f64::INFINITY
                        }
                    }
                };
                if let Some(effect) = AnyEffect::from_coordinates(choice.info.id, &at) {
                    choice.values = effect.parameters();
                }
                let values = choice.values.clone();
                for b in self.bound.iter().filter(|b| b.like == Some(effect)) {
                    self.effects[b.effect].values[b.parameter] = values[b.parameter];
                }
            }
            Role::OwnSurface => self.own[r].surface_m = x,
            Role::OwnFriction => self.own[r].friction = x,
            Role::OwnEffect(k) => self.own[r].differing[k] = x,
            Role::DaySurface(d) => self.days[d].surface_m = x,
            Role::DayFriction(d) => self.days[d].friction = x,
            Role::Instant(l) => self.instants[r][l] = x,
        }
    }

    /// How many numbers the effects have, and the free geometry.
    #[must_use]
    pub fn effect_numbers(&self) -> usize {
        self.effects.iter().map(|e| e.info.parameters.iter().filter(|p| !p.whole).count()).sum()
    }
}

/// Smallest share of what is believed that a stiffness, friction or puncture force may have.
const LEAST_SHARE: f64 = 0.02;
/// By how many of its tolerances a surface or a thickness may be off.
const TOLERATED: f64 = 2.0;
/// By how many of them one may be off while faces are looked for that only an effect can have moved.
const FARTHEST: f64 = 5.0;

#[cfg(test)]
mod tests {
    use super::*;
    use stylet_tissue::{Layer, info};

    fn near(told: f64, wanted: f64) {
        assert!((told - wanted).abs() <= 1e-12 * wanted.abs(), "{told} for {wanted}");
    }

    fn layer(thickness_m: f64, stiffness: f64, friction: f64, puncture_n: Option<f64>) -> Layer {
        Layer {
            thickness_m,
            stiffness_n_per_m: stiffness,
            friction_ns_per_m2: friction,
            puncture_n,
            name: String::new(),
        }
    }

    fn belief() -> Belief {
        Belief {
            tissue: Tissue {
                surface_m: 0.002,
                layers: vec![
                    layer(0.012, 90.0, 4000.0, Some(0.6)),
                    layer(0.01, 150.0, 0.0, None),
                    layer(0.03, 0.0, 6000.0, Some(1.1)),
                ],
            },
            given: Vec::new(),
            tolerance: vec![0.3, 0.99, 0.25],
            thickness_tolerance: vec![0.1, 0.6, 0.0],
            surface_tolerance_m: 0.0015,
        }
    }

    fn choice(id: &str, values: &[f64]) -> Choice {
        Choice::new(info(id).expect("in the library"), values)
    }

    fn base() -> Model {
        Model::base(Arc::new(belief()), 3)
    }

    /// Role, bounds, mean, spread, step.
    type Line = (Role, f64, f64, f64, f64, f64);

    fn are(told: &[Number], wanted: &[Line]) {
        assert_eq!(
            told.iter().map(|n| n.role).collect::<Vec<_>>(),
            wanted.iter().map(|w| w.0).collect::<Vec<_>>()
        );
        for (n, w) in told.iter().zip(wanted) {
            for (told, wanted) in [(n.low, w.1), (n.high, w.2), (n.mean, w.3), (n.sd, w.4), (n.step, w.5)] {
                assert!(
                    told == wanted || (told - wanted).abs() <= 1e-12 * wanted.abs(),
                    "{:?}: {told} for {wanted}",
                    n.role
                );
            }
        }
    }

    const NO: f64 = f64::INFINITY;

    #[test]
    fn numbers_of_the_base_law_go_as_far_as_is_believed() {
        are(
            &base().shared(),
            &[
                (Role::Stiffness(0), 0.7, 1.3, 1.0, 0.3, 1e-5),
                (Role::Friction(0), 0.7, 1.3, 1.0, 0.3, 1e-5),
                (Role::Puncture(0), 0.7, 1.3, 1.0, 0.3, 1e-5),
                // At least a fiftieth is left.
                (Role::Stiffness(1), 0.02, 1.99, 1.0, 0.99, 1e-5),
                (Role::Friction(2), 0.75, 1.25, 1.0, 0.25, 1e-5),
                (Role::Puncture(2), 0.75, 1.25, 1.0, 0.25, 1e-5),
                (Role::Surface, -0.001, 0.005, 0.002, 0.0015, 1e-7),
                (Role::Thickness(0), 0.0096, 0.0144, 0.012, 0.0012, 1e-7),
                // At least a twentieth is left.
                (Role::Thickness(1), 0.0005, 0.022, 0.01, 0.006, 1e-7),
            ],
        );
        let mut fixed = base();
        fixed.free = Free::default();
        assert_eq!(fixed.shared().len(), 6);
        // Two tolerances, or five.
        let mut far = base();
        let of = |m: &Model| m.shared().into_iter().find(|n| n.role == Role::Thickness(0)).expect("free");
        for (is_far, low, high) in [(false, 0.0096, 0.0144), (true, 0.006, 0.018)] {
            far.free.far = is_far;
            near(of(&far).low, low);
            near(of(&far).high, high);
        }
        for (thickness_m, strained) in [(0.0097, false), (0.0095, true), (0.0143, false), (0.0145, true)] {
            far.tissue.layers[0].thickness_m = thickness_m;
            assert_eq!(far.is_strained(0), strained, "{thickness_m}");
        }
        let mut sure = belief();
        sure.surface_tolerance_m = 0.0;
        assert!(!Model::base(Arc::new(sure), 1).shared().iter().any(|n| n.role == Role::Surface));
    }

    #[test]
    fn numbers_of_effects_go_as_far_as_the_library_searches() {
        let model = base()
            .with(choice("stress_relaxation", &[0.4, 3.0]))
            .with(choice("needle_compliance", &[700.0]))
            .with(choice("rate_dependent_puncture", &[-0.2]))
            .with(choice("periodic_interference", &[0.02, 4.0, 0.5]))
            .with(choice("let_go", &[2.0, 1e-3]));
        let of = |effect: usize, parameter: usize| Role::Effect { effect, parameter };
        let at = |effect: usize| model.effects[effect].coordinates();
        let ln = libm::log;
        let told: Vec<Number> =
            model.shared().into_iter().filter(|n| matches!(n.role, Role::Effect { .. })).collect();
        let line = |effect: usize, parameter: usize| {
            let p = &model.effects[effect].info.parameters[parameter];
            let (from, to) = p.search;
            let x = at(effect)[parameter].abs();
            let low = if p.low == 0.0 { 0.0 } else { (2.0 * from - to).max(p.low) };
            (
                of(effect, parameter),
                low,
                (4.0 * to - 3.0 * from).min(p.high),
                0.0,
                NO,
                1e-4 * p.start.abs().max(x).max(1e-4),
            )
        };
        let frequency =
            model.effects[3].info.parameters.iter().position(|p| p.unit == "Hz").expect("a frequency");
        let search = model.effects[3].info.parameters[frequency].search;
        let high = model.effects[3].info.parameters[frequency].high;
        let beat = (
            of(3, frequency),
            ln(search.0 / 10.0),
            ln((10.0 * search.1).min(high)),
            0.0,
            NO,
            1e-6 / at(3)[frequency],
        );
        let interference: Vec<Line> =
            (0..3).map(|p| if p == frequency { beat } else { line(3, p) }).collect();
        are(
            &told,
            &[
                &[
                    (of(0, 0), 0.0, 1.0, 0.0, NO, 4e-5),
                    (of(0, 1), ln(0.005), ln(600.0), 0.0, NO, 1e-4),
                    (of(1, 0), 0.0, 0.2, 0.0, NO, 1e-7),
                    (of(2, 0), -1.5, 2.0, 0.0, NO, 2e-5),
                ][..],
                &interference,
                // A layer is no number of a fit; where it lets go is sought from 25 mm before what is searched to 75 mm beyond.
                &[(of(4, 1), -0.03, 0.095, 0.0, NO, 2e-7)],
            ]
            .concat(),
        );
        assert_eq!(model.effect_numbers(), 2 + 1 + 1 + 3 + 1);
        // What is bound is not fitted.
        let mut bound = model.clone();
        bound.bound = vec![
            Bound { effect: 0, parameter: 1, like: None },
            Bound { effect: 3, parameter: 0, like: Some(0) },
        ];
        let left: Vec<Role> = bound.shared().iter().map(|n| n.role).collect();
        assert_eq!(left.len() + 2, model.shared().len());
        assert!(
            left.contains(&of(0, 0))
                && !left.contains(&of(0, 1))
                && !left.contains(&of(3, 0))
                && left.contains(&of(1, 0))
        );
    }

    #[test]
    fn numbers_of_recordings_and_days_have_the_spreads_between_them() {
        let mut model = base().with(choice("let_go", &[2.0, 1e-3])).with(choice("let_go", &[1.0, 2e-3]));
        let instants = |n: usize| (0..n).map(|l| (Role::Instant(l), -NO, NO, 0.0, NO, 1e-5));
        are(&model.own_numbers(), &instants(3).collect::<Vec<_>>());
        model.scatter = Scatter {
            surface_m: 7e-4,
            friction: 0.03,
            day_surface_m: 1.1e-3,
            day_friction: 0.07,
            ..Scatter::default()
        };
        model.scatter.differing[1] = 3e-4;
        (model.free.own_surface, model.free.own_friction, model.free.own_effects) = (true, true, true);
        let own = [
            (Role::OwnSurface, -NO, NO, 0.0, 7e-4, 1e-7),
            (Role::OwnFriction, -NO, NO, 0.0, 0.03, 1e-5),
            // As the library says where no spread is known.
            (Role::OwnEffect(0), -NO, NO, 0.0, 5e-4, 5e-7),
            (Role::OwnEffect(1), -NO, NO, 0.0, 3e-4, 5e-7),
        ];
        are(&model.own_numbers(), &own.into_iter().chain(instants(3)).collect::<Vec<_>>());
        assert_eq!(
            (model.differing_sd(1), model.differing_said(1), model.differing_said(7)),
            (3e-4, 5e-4, 1.0)
        );
        assert_eq!(model.differing().collect::<Vec<_>>(), [(0, 1), (1, 1)]);
        let many = (0..11).fold(base(), |m, _| m.with(choice("let_go", &[2.0, 1e-3])));
        assert_eq!(many.differing().count(), DIFFERING);
        model.days = vec![Day::default(); 2];
        let before = model.shared().len();
        (model.free.day_surface, model.free.day_friction) = (true, true);
        are(
            &model.shared()[before..],
            &[
                (Role::DaySurface(0), -NO, NO, 0.0, 1.1e-3, 1e-7),
                (Role::DayFriction(0), -NO, NO, 0.0, 0.07, 1e-5),
                (Role::DaySurface(1), -NO, NO, 0.0, 1.1e-3, 1e-7),
                (Role::DayFriction(1), -NO, NO, 0.0, 0.07, 1e-5),
            ],
        );
    }

    #[test]
    fn a_number_that_is_set_is_got_back_and_moves_no_other() {
        let mut model = base()
            .with(choice("stress_relaxation", &[0.4, 3.0]))
            .with(choice("needle_compliance", &[700.0]))
            .with(choice("respiration", &[1e-3, 0.3, 0.7]))
            .with(choice("let_go", &[2.0, 1e-3]));
        model.free = Free {
            own_surface: true,
            own_friction: true,
            own_effects: true,
            day_surface: true,
            day_friction: true,
            ..model.free
        };
        model.days = vec![Day::default(); 2];
        model.instants = vec![vec![1.5, 2.5, NEVER]; 3];
        let numbers: Vec<Number> = model.shared().into_iter().chain(model.own_numbers()).collect();
        assert_eq!(numbers.len(), 9 + 2 + 1 + 3 + 1 + 4 + 3 + 3);
        for (k, n) in numbers.iter().enumerate() {
            let mut moved = model.clone();
            let x = match n.role {
                Role::Stiffness(_) | Role::Friction(_) | Role::Puncture(_) => 1.17,
                Role::Effect { effect: 0, parameter: 1 } => libm::log(1.3),
                Role::Effect { effect: 1, .. } => 1.0 / 900.0,
                Role::Effect { .. } => model.get(n.role, 0) * 1.2,
                _ => 0.0123,
            };
            moved.set(n.role, 2, x);
            assert!((moved.get(n.role, 2) - x).abs() < 1e-12, "{:?}", n.role);
            for (other, o) in numbers.iter().enumerate().filter(|(other, _)| *other != k) {
                let was = model.get(o.role, 2);
                let now = moved.get(o.role, 2);
                assert!(now == was || (now - was).abs() < 1e-12, "{k} moves {other}");
            }
            assert_eq!(moved.get(n.role, 0) == model.get(n.role, 0), n.role.is_own(), "{:?}", n.role);
        }
        // In their own units.
        let mut moved = model.clone();
        moved.set(Role::Stiffness(1), 0, 1.2);
        moved.set(Role::Friction(2), 0, 0.9);
        moved.set(Role::Puncture(2), 0, 1.1);
        moved.set(Role::Puncture(1), 0, 1.1);
        near(moved.tissue.layers[1].stiffness_n_per_m, 180.0);
        near(moved.tissue.layers[2].friction_ns_per_m2, 5400.0);
        near(moved.tissue.layers[2].puncture_n.expect("a force"), 1.21);
        assert_eq!(moved.tissue.layers[1].puncture_n, None);
        assert_eq!(model.get(Role::Puncture(1), 0), 1.0);
        moved.set(Role::Effect { effect: 1, parameter: 0 }, 0, 0.0);
        assert_eq!(moved.effects[1].values, [f64::INFINITY]);
        assert_eq!(moved.get(Role::Effect { effect: 1, parameter: 0 }, 0), 0.0);
        moved.set(Role::Effect { effect: 1, parameter: 0 }, 0, -0.1);
        assert_eq!(moved.effects[1].values, [f64::INFINITY]);
    }

    #[test]
    fn a_number_that_is_bound_to_another_goes_with_it() {
        let mut model = base()
            .with(choice("let_go", &[1.0, 1e-3]))
            .with(choice("let_go", &[2.0, 2e-3]))
            .with(choice("let_go", &[3.0, 3e-3]));
        model.bound = vec![
            Bound { effect: 2, parameter: 1, like: Some(0) },
            Bound { effect: 1, parameter: 1, like: None },
        ];
        model.set(Role::Effect { effect: 0, parameter: 1 }, 0, 4e-3);
        let values: Vec<Vec<f64>> = model.effects.iter().map(|e| e.values.clone()).collect();
        assert_eq!(values, [vec![1.0, 4e-3], vec![2.0, 2e-3], vec![3.0, 4e-3]]);
    }

    #[test]
    fn what_is_bound_stays_bound_to_the_same_effect_when_another_goes() {
        let mut model = base();
        for k in 0..4 {
            model = model.with(choice("let_go", &[1.0, f64::from(k) * 1e-3]));
        }
        let bound = |effect: usize, like: Option<usize>| Bound { effect, parameter: 1, like };
        model.bound =
            vec![bound(0, None), bound(1, Some(2)), bound(2, Some(0)), bound(3, Some(2)), bound(3, Some(1))];
        let left = model.without(1);
        assert_eq!(left.effects.iter().map(|e| e.values[1]).collect::<Vec<_>>(), [0.0, 2e-3, 3e-3]);
        assert_eq!(left.bound, [bound(0, None), bound(1, Some(0)), bound(2, Some(1))]);
        assert_eq!(model.without(0).bound, [bound(0, Some(1)), bound(2, Some(1)), bound(2, Some(0))]);
        assert_eq!(model.without(2).bound, [bound(0, None), bound(2, Some(1))]);
        assert_eq!(model.without(3).bound, model.bound[..3]);
    }

    #[test]
    fn some_of_the_recordings_keep_their_numbers_and_days() {
        let mut model = base();
        for r in 0..3 {
            model.own[r].surface_m = 1e-3 * r as f64;
            model.instants[r] = vec![r as f64; 3];
        }
        assert_eq!(model.only(&[2, 0]).day_of, Vec::<usize>::new());
        (model.day_of, model.days) = (vec![1, 0, 2], vec![Day { surface_m: 0.5, friction: 0.1 }; 2]);
        model.days[1].surface_m = 0.7;
        let two = model.only(&[2, 0]);
        assert_eq!(two.own.iter().map(|o| o.surface_m).collect::<Vec<_>>(), [2e-3, 0.0]);
        assert_eq!(two.instants, [vec![2.0; 3], vec![0.0; 3]]);
        assert_eq!((two.day_of.clone(), two.days.clone()), (vec![2, 1], model.days.clone()));
        // A day that is not there has nothing of its own.
        assert_eq!((two.day(0), two.day(1).surface_m, two.day(5)), (Day::default(), 0.7, Day::default()));
        assert_eq!(two.layers(), 3);
    }

    #[test]
    fn a_law_is_made_with_what_a_recording_and_its_day_have_of_their_own() {
        let mut model = base()
            .with(choice("let_go", &[1.0, 1e-3]))
            .with(choice("position_scale", &[0.02]))
            .with(choice("time_delay", &[0.03]));
        let plain = model.compile(1).expect("a law");
        assert_eq!(plain.law.slabs()[0].front_m, 0.002);
        assert_eq!(plain.puncture_n, [0.6, f64::INFINITY, 1.1]);
        assert_eq!(plain.stiffness, [90.0, 150.0, 0.0]);
        assert_eq!((plain.delay_s, plain.measures, plain.smears, plain.placed_s), (0.03, true, false, None));
        near(plain.to_true, 1.0 / 1.02);
        assert!(plain.breaks_m.is_empty());
        model.own[1] = Own { surface_m: 4e-4, friction: 0.2, ..Own::default() };
        (model.day_of, model.days) = (vec![0; 3], vec![Day { surface_m: -1e-4, friction: 0.1 }]);
        model.own[1].differing[0] = 5e-4;
        let own = model.compile(1).expect("a law");
        near(own.law.slabs()[0].front_m, 0.0023);
        near(own.law.slabs()[0].friction_ns_per_m2, 4000.0 * libm::exp(0.3));
        assert_eq!(own.law.slabs()[0].release_m, 1e-3);
        near(model.compile(0).expect("a law").law.slabs()[2].friction_ns_per_m2, 6000.0 * libm::exp(0.1));
        model.free.own_effects = true;
        near(model.compile(1).expect("a law").law.slabs()[0].release_m, 1.5e-3);
        assert_eq!(model.compile(0).expect("a law").law.slabs()[0].release_m, 1e-3);
        // Beside what the simulation has already.
        let mut given = belief();
        given.given = vec![AnyEffect::from_parameters("coulomb_friction", &[2.0]).expect("an effect")];
        model.belief = Arc::new(given);
        near(model.compile(1).expect("a law").law.slabs()[0].release_m, 1.5e-3);
        // A day alone is enough for a law of its own.
        let mut days = base();
        (days.day_of, days.days) = (vec![0; 3], vec![Day { surface_m: 1e-4, friction: 0.0 }]);
        near(days.compile(0).expect("a law").law.slabs()[0].front_m, 0.0021);
    }

    #[test]
    fn a_law_breaks_at_membranes_and_where_the_tip_feels_faces() {
        let mut model = base().with(choice("hidden_membrane", &[0.005, 100.0, 0.2]));
        model.own[0].surface_m = 1e-3;
        // 0.2 N stretch it by 2 mm; the tip feels every face, too.
        let breaks = model.compile(0).expect("a law").breaks_m;
        for (told, wanted) in breaks.iter().zip([0.003 + 0.007, 0.015, 0.025, 0.055]) {
            near(*told, wanted);
        }
        assert_eq!(breaks.len(), 4);
        let neutral = base().with(choice("hidden_membrane", &[0.005, 0.0, 0.2]));
        assert!(neutral.compile(0).expect("a law").breaks_m.len() < 4);
        let smears = |id: &str, x: f64| base().with(choice(id, &[x])).compile(0).expect("a law").smears;
        assert!(
            smears("low_pass_lag", 0.02) && smears("needle_compliance", 900.0) && !smears("force_gain", 1.1)
        );
        assert!(
            !base().has_friction_effects()
                && base().with(choice("coulomb_friction", &[2.0])).has_friction_effects()
        );
        assert!(!base().with(choice("force_gain", &[1.1])).has_friction_effects());
        let mut given = belief();
        given.given = vec![AnyEffect::from_parameters("coulomb_friction", &[2.0]).expect("an effect")];
        assert!(Model::base(Arc::new(given), 1).has_friction_effects());
    }

    #[test]
    fn every_recording_has_its_own_of_what_is_its_own() {
        for role in [Role::OwnSurface, Role::OwnFriction, Role::OwnEffect(3), Role::Instant(1)] {
            assert!(role.is_own());
        }
        for role in [
            Role::Surface,
            Role::Stiffness(0),
            Role::DaySurface(0),
            Role::DayFriction(1),
            Role::Effect { effect: 0, parameter: 0 },
        ] {
            assert!(!role.is_own());
        }
    }
}
