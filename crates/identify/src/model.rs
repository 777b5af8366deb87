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
            let (low, high) = (at - BEYOND * sd, at + BEYOND * sd);
            out.push(Number { role: Role::Surface, low, high, mean: at, sd, step: 1e-7 });
        }
        if self.free.thickness {
            for (layer, l) in b.tissue.layers.iter().enumerate() {
                let (d, sd) = (l.thickness_m, b.thickness_tolerance[layer] * l.thickness_m);
                if sd > 0.0 {
                    let (low, high) = ((d - BEYOND * sd).max(0.05 * d), d + BEYOND * sd);
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
/// How many standard deviations of their priors surface and thicknesses may go.
const BEYOND: f64 = 2.0;
