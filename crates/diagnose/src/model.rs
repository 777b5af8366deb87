//! A model under trial: base parameters and effects as one vector of numbers for the fit.

use stylet_tissue::{AnyEffect, EffectInfo, Law, Measurement, Tissue};

/// What a number of the vector is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Role {
    /// Stiffness, friction or puncture force of a layer (0-based), relative to what was assumed.
    Base {
        /// Layer, 0-based.
        layer: usize,
        /// 0: stiffness, 1: friction, 2: puncture force.
        what: usize,
    },
    /// Parameter of an effect.
    Effect {
        /// Which effect of the model.
        effect: usize,
        /// Which of its parameters.
        parameter: usize,
    },
}

/// One number of the vector.
#[derive(Clone, Copy, Debug)]
pub struct Slot {
    /// What it is.
    pub role: Role,
    /// Smallest value.
    pub low: f64,
    /// Largest value.
    pub high: f64,
    /// Step of the numeric derivative.
    pub step: f64,
    /// Step-like in the force: sought by trying, not by derivatives.
    pub stepped: bool,
}

/// One effect of a model: which, with which variant (a whole-numbered parameter is part of the choice).
#[derive(Clone, Debug)]
pub struct Choice {
    /// The library's entry.
    pub info: &'static EffectInfo,
    /// Values, in the library's order.
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
}

/// Base parameters and effects.
#[derive(Clone, Debug)]
pub struct Model {
    /// The tissue as fitted.
    pub tissue: Tissue,
    /// The tissue as assumed.
    pub assumed: Tissue,
    /// Tolerance of the base parameters, relative.
    pub tolerance: f64,
    /// The effects that are believed already (the scenario's own), not fitted.
    pub given: Vec<AnyEffect>,
    /// The effects under trial.
    pub effects: Vec<Choice>,
    /// A number that is not fitted.
    pub held: Option<Role>,
}

/// A model ready to be replayed.
pub struct Compiled {
    /// The law.
    pub law: Law,
    /// The measuring chain.
    pub chain: Measurement,
    /// True position over recorded one.
    pub to_true: f64,
    /// Delay of the chain in s.
    pub delay_s: f64,
    /// The chain smears jumps.
    pub smears: bool,
    /// The chain changes the force.
    pub measures: bool,
    /// The instant of a rupture between two samples matters afterwards.
    pub feels_instants: bool,
}

impl Model {
    /// The base model.
    #[must_use]
    pub fn base(tissue: &Tissue, tolerance: f64, given: &[AnyEffect]) -> Self {
        Self {
            tissue: tissue.clone(),
            assumed: tissue.clone(),
            tolerance,
            given: given.to_vec(),
            effects: Vec::new(),
            held: None,
        }
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
        model
    }

    /// Names of the effects.
    #[must_use]
    pub fn names(&self) -> Vec<&'static str> {
        self.effects.iter().map(|e| e.info.id).collect()
    }

    /// The effect taken last, or "".
    #[must_use]
    pub fn last_name(&self) -> &'static str {
        self.effects.last().map_or("", |e| e.info.id)
    }

    /// Number of fitted numbers that belong to effects.
    #[must_use]
    pub fn extra(&self) -> usize {
        self.effects.iter().map(|e| e.info.parameters.iter().filter(|p| !p.whole).count()).sum()
    }

    /// Law and chain; `None` when the library refuses the values.
    #[must_use]
    pub fn compile(&self) -> Option<Compiled> {
        let mut effects = self.given.clone();
        for choice in &self.effects {
            effects.push(choice.effect()?);
        }
        let law = Law::new(&self.tissue, &effects).ok()?;
        let chain = Measurement::new(&effects);
        let delay_s = effects
            .iter()
            .map(|e| if let AnyEffect::TimeDelay(delay) = e { delay.delay_s } else { 0.0 })
            .sum();
        let smears = effects.iter().any(|e| matches!(e, AnyEffect::LowPassLag(_)));
        let feels_instants = effects.iter().any(|e| {
            matches!(
                e,
                AnyEffect::StressRelaxation(_)
                    | AnyEffect::NeedleCompliance(_)
                    | AnyEffect::LowPassLag(_)
                    | AnyEffect::TimeDelay(_)
                    | AnyEffect::SoftBoundary(_)
                    | AnyEffect::IncompleteRelease(_)
            )
        });
        let (to_true, measures) = (chain.true_position(1.0), !chain.is_plain());
        Some(Compiled { law, to_true, measures, chain, delay_s, smears, feels_instants })
    }

    /// The numbers that are fitted.
    #[must_use]
    pub fn slots(&self) -> Vec<Slot> {
        let mut slots = Vec::new();
        let (low, high) = (1.0 - self.tolerance, 1.0 + self.tolerance);
        for (layer, assumed) in self.assumed.layers.iter().enumerate() {
            let sizes =
                [assumed.stiffness_n_per_m, assumed.friction_ns_per_m2, assumed.puncture_n.unwrap_or(0.0)];
            for (what, size) in sizes.into_iter().enumerate() {
                if size > 0.0 {
                    let role = Role::Base { layer, what };
                    slots.push(Slot { role, low, high, step: 1e-4, stepped: false });
                }
            }
        }
        for (effect, choice) in self.effects.iter().enumerate() {
            for (parameter, p) in choice.info.parameters.iter().enumerate().filter(|(_, p)| !p.whole) {
                let role = Role::Effect { effect, parameter };
                let membrane = choice.info.id == "hidden_membrane";
                let (from, to) = p.search;
                let slot = if membrane && parameter == 0 {
                    Slot { role, low: 1e-4, high: 1.0, step: 1e-5, stepped: true }
                } else if in_logarithm(choice.info, parameter) {
                    let (low, high) = ((from / 10.0).max(p.low), (to * 10.0).min(p.high));
                    // A frequency is told by the phase at the end of a recording.
                    let step = if p.unit == "Hz" { 2e-5 / choice.values[parameter].max(1e-3) } else { 2e-3 };
                    Slot { role, low: low.max(1e-12).ln(), high: high.ln(), step, stepped: false }
                } else if choice.info.id.ends_with("phase_rad") || p.unit == "rad" {
                    Slot { role, low: -100.0, high: 100.0, step: 1e-3, stepped: false }
                } else {
                    let wide = to - from;
                    let (low, high) = ((from - wide).max(p.low), (to + 3.0 * wide).min(p.high));
                    Slot { role, low, high, step: 1e-3 * p.start.abs().max(1e-4), stepped: false }
                };
                slots.push(slot);
            }
        }
        slots.retain(|s| Some(s.role) != self.held);
        slots
    }

    /// Whether the effect taken last has shrunk to the smallest strength that is searched: then it is not there, and
    /// what it gains comes from what the fit may do beside it (ruptures between samples).
    #[must_use]
    pub fn last_vanishes(&self) -> bool {
        let Some(choice) = self.effects.last() else { return false };
        choice.info.parameters.iter().zip(&choice.values).enumerate().any(|(k, (p, value))| {
            let least = (p.search.0 / 10.0).max(p.low);
            p.strength && p.neutral == 0.0 && in_logarithm(choice.info, k) && *value <= 1.05 * least
        })
    }

    /// The value of a number.
    #[must_use]
    pub fn get(&self, slot: &Slot) -> f64 {
        match slot.role {
            Role::Base { layer, what } => {
                base_value(&self.tissue, layer, what) / base_value(&self.assumed, layer, what)
            }
            Role::Effect { effect, parameter } => {
                let choice = &self.effects[effect];
                let value = choice.values[parameter];
                if slot.stepped {
                    value + choice.values[2] / choice.values[1] // where the membrane breaks
                } else if in_logarithm(choice.info, parameter) {
                    value.max(1e-300).ln()
                } else {
                    value
                }
            }
        }
    }

    /// Sets all numbers at once.
    pub fn set(&mut self, slots: &[Slot], p: &[f64]) {
        let mut breaks_at = Vec::new();
        for (slot, &x) in slots.iter().zip(p) {
            let x = x.clamp(slot.low, slot.high);
            match slot.role {
                Role::Base { layer, what } => {
                    let value = x * base_value(&self.assumed, layer, what);
                    let l = &mut self.tissue.layers[layer];
                    match what {
                        0 => l.stiffness_n_per_m = value,
                        1 => l.friction_ns_per_m2 = value,
                        _ => l.puncture_n = Some(value),
                    }
                }
                Role::Effect { effect, parameter } => {
                    let choice = &mut self.effects[effect];
                    if slot.stepped {
                        breaks_at.push((effect, x));
                    } else if in_logarithm(choice.info, parameter) {
                        choice.values[parameter] = x.exp();
                    } else {
                        choice.values[parameter] = x;
                    }
                }
            }
        }
        for (effect, at) in breaks_at {
            let values = &mut self.effects[effect].values;
            values[0] = (at - values[2] / values[1]).max(0.0);
        }
        for choice in &mut self.effects {
            match (choice.info.id, &mut choice.values[..]) {
                ("stribeck_friction", [c, c_static, _]) => *c_static = c_static.max(*c),
                ("stress_relaxation", [g1, _, g2, _]) => *g2 = g2.min(1.0 - *g1),
                _ => {}
            }
        }
    }

    /// All numbers.
    #[must_use]
    pub fn vector(&self, slots: &[Slot]) -> Vec<f64> {
        slots.iter().map(|s| self.get(s).clamp(s.low, s.high)).collect()
    }
}

/// Whether a parameter is fitted in its logarithm: shapes that the library wants so, and strengths in
/// which the force is far from linear.
#[must_use]
pub fn in_logarithm(info: &EffectInfo, parameter: usize) -> bool {
    let p = &info.parameters[parameter];
    p.log
        && (!p.strength
            || matches!(
                info.id,
                "needle_compliance" | "low_pass_lag" | "time_delay" | "soft_boundary" | "hidden_membrane"
            ))
}

/// A base parameter: 0 stiffness, 1 friction, 2 puncture force.
#[must_use]
pub fn base_value(tissue: &Tissue, layer: usize, what: usize) -> f64 {
    let l = &tissue.layers[layer];
    match what {
        0 => l.stiffness_n_per_m,
        1 => l.friction_ns_per_m2,
        _ => l.puncture_n.unwrap_or(f64::INFINITY),
    }
}
