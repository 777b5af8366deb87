//! Which law: the ingredients, and the numbers they bring.
//!
//! Shared numbers stand in one vector, in units in which a fit moves well: forces, frictions, travels
//! and times as logarithms, loading curves by their force at a reference indentation and their
//! curvature. [`Shape::tissue`] turns them into layers and effects of the library.

use serde::{Deserialize, Serialize};
use stylet_tissue::{
    AnyEffect, DeepIndentation, EffectInfo, Layer, LayerStiffening, NonlinearElasticity, PowerLawFriction,
    PronyTerm, RateDependentPuncture, StressRelaxation, Tissue, ViscoelasticPresliding,
};

/// Speed at which sliding friction is stated (m/s).
pub const REFERENCE_MPS: f64 = 1e-3;
/// Largest stiffening that `nonlinear_elasticity` takes (1/m).
const KAPPA_MOST: f64 = 1000.0;
/// Travel beyond its far face at which a layer gives way in the extended law (m): more than any stroke.
const REACH_M: f64 = 0.5;
/// Creep that no recording notices (s).
const NEVER_S: f64 = 1e6;

/// One thing by which the law departs from the base law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Ingredient {
    /// Layers stiffen with indentation, each in its own way.
    Nonlinear,
    /// One term of stress relaxation, of tissue that is pressed as of tissue that is dragged.
    Relaxation,
    /// A second term.
    SecondTerm,
    /// Friction grows with a power of the speed.
    PowerLaw,
    /// Punctured layers hold the shaft, are dragged along, and let go; every layer ruptures where the data show it.
    Presliding,
    /// Layers yield to force, not to the tip's depth.
    Indentation,
    /// Deeper layers than the first rupture where the force drops. This is the base law's own; without it they
    /// yield at a force that all runs share, or never.
    Deeper,
    /// The puncture force depends on the speed.
    RatePuncture,
    /// A general effect with its own parameters.
    General(&'static EffectInfo),
}

impl Ingredient {
    /// Effect of the library that it is.
    #[must_use]
    pub fn id(self) -> &'static str {
        match self {
            Self::Nonlinear => "nonlinear_elasticity",
            Self::Relaxation | Self::SecondTerm => "stress_relaxation",
            Self::PowerLaw => "power_law_friction",
            Self::Presliding => "viscoelastic_presliding",
            Self::Indentation => "deep_indentation",
            Self::Deeper => "puncture",
            Self::RatePuncture => "rate_dependent_puncture",
            Self::General(info) => info.id,
        }
    }

    /// The name of the step: the effect, or which part of it.
    #[must_use]
    pub fn label(self) -> String {
        match self {
            Self::SecondTerm => "stress_relaxation (second term)".to_owned(),
            Self::Deeper => "rupture of deeper layers (base law)".to_owned(),
            other => other.id().to_owned(),
        }
    }

    /// What has to stand before it makes sense.
    #[must_use]
    pub fn needs(self) -> Option<Self> {
        match self {
            Self::SecondTerm => Some(Self::Relaxation),
            _ => None,
        }
    }
}

/// One number of the shared vector.
#[derive(Clone, Debug, PartialEq)]
pub struct Number {
    /// Where it stands in outputs: `layer.1.front_m`.
    pub name: String,
    /// Lowest value, in the vector's units.
    pub low: f64,
    /// Highest value.
    pub high: f64,
    /// Where a fit may begin.
    pub start: f64,
    /// Typical change, for steps and damping.
    pub scale: f64,
    /// Whether the vector holds the logarithm.
    pub log: bool,
    /// Whether the law answers it with steps.
    pub stepped: bool,
    /// Standard deviation about the start of what is likely beforehand; infinite for most.
    pub prior: f64,
}

impl Number {
    fn linear(name: String, low: f64, high: f64, start: f64, scale: f64) -> Self {
        Self {
            name,
            low,
            high,
            start: start.clamp(low, high),
            scale,
            log: false,
            stepped: false,
            prior: f64::INFINITY,
        }
    }
    fn log(name: String, low: f64, high: f64, start: f64) -> Self {
        let start = libm::log(start.clamp(low, high));
        Self {
            name,
            low: libm::log(low),
            high: libm::log(high),
            start,
            scale: 0.3,
            log: true,
            stepped: false,
            prior: f64::INFINITY,
        }
    }
    /// The same with a standard deviation of what is likely.
    fn likely(self, prior: f64) -> Self {
        Self { prior, ..self }
    }
    /// A value of the vector in its own unit.
    #[must_use]
    pub fn value(&self, x: f64) -> f64 {
        if self.log { libm::exp(x) } else { x }
    }
}

/// What is known before any fit, from the raw data and from what is believed.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// The believed tissue: names, thickness of the last layer, friction where nothing better is known.
    pub believed: Tissue,
    /// Per layer where its front face may be (m): lowest, highest, likely.
    pub fronts_m: Vec<(f64, f64, f64)>,
    /// Per layer a force that its loading may reach (N), at an indentation (m).
    pub loads: Vec<(f64, f64)>,
    /// Largest force seen (N).
    pub force_n: f64,
    /// Whether the runs have several speeds.
    pub several_speeds: bool,
    /// Per layer whether some run shows no drop, so that the law has to say when it ruptures.
    pub unseen: Vec<bool>,
}

/// What one insertion has of its own.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Own {
    /// Shift of the surface in m.
    pub shift_m: f64,
    /// Logarithm of its friction over the mean insertion's.
    pub friction_log: f64,
    /// Per layer the puncture force in N; `None`: the shared number.
    pub puncture_n: Vec<Option<f64>>,
    /// Per layer whether the rupture leaves a drop; without one all force passes into friction.
    pub drops: Vec<bool>,
    /// Per layer where it lets go on the way back (m); `None`: at its front face.
    pub releases_m: Vec<Option<f64>>,
}

/// The form of a law.
#[derive(Clone, Debug, PartialEq)]
pub struct Shape {
    /// What is known beforehand.
    pub frame: Frame,
    /// The ingredients that stand.
    pub with: Vec<Ingredient>,
    /// Dependence of the puncture force on speed, `alpha`; read off the runs, not fitted.
    pub alpha: f64,
}

/// The numbers of the effects as a serialisable list, for reports.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NamedEffect {
    /// Effect, by its id.
    pub effect: String,
    /// Parameters by path.
    pub parameters: Vec<(String, f64)>,
}

impl Shape {
    /// The base law.
    #[must_use]
    pub fn base(frame: Frame) -> Self {
        Self { frame, with: Vec::new(), alpha: 0.0 }
    }

    /// Whether an ingredient stands.
    #[must_use]
    pub fn has(&self, ingredient: Ingredient) -> bool {
        self.with.contains(&ingredient)
    }

    /// The same with one more.
    #[must_use]
    pub fn plus(&self, ingredient: Ingredient) -> Self {
        let mut out = self.clone();
        out.with.push(ingredient);
        out
    }

    /// The same without one (and without what needs it).
    #[must_use]
    pub fn minus(&self, ingredient: Ingredient) -> Self {
        let mut out = self.clone();
        out.with.retain(|i| *i != ingredient && i.needs() != Some(ingredient));
        if ingredient == Ingredient::RatePuncture {
            out.alpha = 0.0;
        }
        out
    }

    /// Whether a layer (from zero) ruptures where the data show it.
    #[must_use]
    pub fn imposes(&self, layer: usize) -> bool {
        layer == 0 || self.has(Ingredient::Deeper) || self.has(Ingredient::Presliding)
    }

    /// Whether the law itself has to say when a layer ruptures, in some run at least.
    fn yields(&self, layer: usize) -> bool {
        self.frame.unseen[layer] || !self.imposes(layer)
    }

    /// Number of layers.
    #[must_use]
    pub fn layers(&self) -> usize {
        self.frame.believed.layers.len()
    }

    /// The numbers of the shared vector.
    #[must_use]
    pub fn numbers(&self) -> Vec<Number> {
        let mut out = Vec::new();
        let most = 50.0 * self.frame.force_n.max(0.1);
        for i in 0..self.layers() {
            let layer = i + 1;
            let (low, high, likely) = self.frame.fronts_m[i];
            out.push(Number::linear(format!("layer.{layer}.front_m"), low, high, likely, 5e-4));
            let (load, _) = self.frame.loads[i];
            out.push(Number::log(format!("layer.{layer}.load_n"), 1e-3 * load, most, load));
            if self.has(Ingredient::Nonlinear) {
                let start = if i == 0 { 0.7 } else { 0.5 };
                out.push(Number::linear(format!("layer.{layer}.curvature"), -0.3, 0.97, start, 0.2));
            }
            let friction = 0.3 * self.frame.force_n;
            out.push(Number::log(format!("layer.{layer}.sliding_n"), 1e-4 * most, most, friction));
            if self.yields(i) {
                // Where no rupture is imposed, a fit begins with none.
                let likely = if self.imposes(i) { load } else { 5.0 * load };
                let name = format!("layer.{layer}.yield_n{}", if self.imposes(i) { "" } else { ".all" });
                let mut number = Number::log(name, 0.05 * load, 20.0 * load, likely);
                number.stepped = true;
                out.push(number);
            }
            if self.has(Ingredient::Presliding) {
                out.push(Number::log(format!("layer.{layer}.delta_m"), 1e-4, 0.05, 6e-3));
                out.push(Number::linear(format!("layer.{layer}.kept"), 0.0, 1.0, 0.7, 0.1));
            }
        }
        if self.has(Ingredient::Relaxation) {
            let two = self.has(Ingredient::SecondTerm);
            // A second term begins weak and fast, so that a fit begins where the one-term law stands.
            let starts: &[(f64, f64, f64)] =
                if two { &[(0.2, 0.4, 2.0), (0.05, 0.05, 0.3)] } else { &[(0.2, 0.4, 2.0)] };
            for (j, (fraction, dragged, time)) in starts.iter().enumerate() {
                // Tissue that is never held while it is pressed hardly tells it: a fifth, give or take a tenth.
                let likely = if self.frame.unseen[0] { f64::INFINITY } else { 0.1 };
                let name = format!("terms.{j}.fraction");
                out.push(Number::linear(name, 0.0, 0.49, *fraction, 0.1).likely(likely));
                out.push(Number::log(format!("terms.{j}.time_constant_s"), 0.05, 60.0, *time));
                if self.has(Ingredient::Presliding) {
                    // Of the dragged tissue, as a share of what the terms before leave.
                    out.push(Number::linear(format!("terms.{j}.dragged"), 0.0, 0.95, *dragged, 0.1));
                }
            }
        }
        if self.has(Ingredient::PowerLaw) {
            // With one speed nothing tells how friction depends on it: as dry friction then, not at all.
            let (low, high) = if self.frame.several_speeds { (-0.7, 1.5) } else { (0.0, 0.0) };
            // Dry friction, give or take.
            out.push(Number::linear("exponent".to_owned(), low, high, 0.0, 0.1).likely(0.3));
        }
        for ingredient in &self.with {
            let Ingredient::General(info) = ingredient else { continue };
            for p in info.parameters.iter().filter(|p| !p.whole) {
                let name = format!("{}.{}", info.id, p.path);
                let (low, high) = (p.search.0.max(p.low), p.search.1.min(p.high));
                out.push(if p.log && low > 0.0 {
                    // A fit begins where the effect is weak.
                    Number::log(
                        name,
                        low,
                        high,
                        if p.strength { low + 0.05 * (p.start - low) } else { p.start },
                    )
                } else {
                    let start = if p.strength { p.neutral } else { p.start };
                    Number::linear(name, low, high, start, 0.1 * (high - low))
                });
            }
        }
        out
    }

    /// Numbers of this shape begun at another fit's values where the names agree.
    #[must_use]
    pub fn start_from(&self, names: &[Number], values: &[f64]) -> Vec<f64> {
        self.numbers()
            .iter()
            .map(|n| {
                names
                    .iter()
                    .zip(values)
                    .find(|(m, _)| m.name == n.name)
                    .map_or(n.start, |(_, x)| x.clamp(n.low, n.high))
            })
            .collect()
    }

    /// Layers and effects for one insertion.
    #[must_use]
    pub fn tissue(&self, x: &[f64], own: &Own) -> (Tissue, Vec<AnyEffect>) {
        let mut rest = x.iter();
        let mut next = || rest.next().copied().unwrap_or(0.0);
        let count = self.layers();
        let presliding = self.has(Ingredient::Presliding);
        let mut layers: Vec<LayerNumbers> = Vec::with_capacity(count);
        for i in 0..count {
            let front_m = next() + if i == 0 { own.shift_m } else { 0.0 };
            let load_n = libm::exp(next());
            let curvature = if self.has(Ingredient::Nonlinear) { next() } else { 0.0 };
            let sliding_n = libm::exp(next() + own.friction_log);
            let yield_n = if self.yields(i) { libm::exp(next()) } else { f64::INFINITY };
            let (mut delta_m, mut kept) = (0.0, 1.0);
            if presliding {
                delta_m = libm::exp(next());
                kept = next();
            }
            layers.push(LayerNumbers { front_m, load_n, curvature, sliding_n, yield_n, delta_m, kept });
        }
        let mut terms = Vec::new();
        let mut creep = Vec::new();
        if self.has(Ingredient::Relaxation) {
            let mut left = 1.0;
            for _ in 0..if self.has(Ingredient::SecondTerm) { 2 } else { 1 } {
                let term = PronyTerm { fraction: next(), time_constant_s: libm::exp(next()) };
                if presliding {
                    let fraction = left * next();
                    left -= fraction;
                    creep.push(PronyTerm { fraction, ..term });
                }
                terms.push(term);
            }
        }
        let mut effects: Vec<AnyEffect> = Vec::new();
        if self.has(Ingredient::PowerLaw) {
            effects.push(PowerLawFriction { exponent: next() }.into());
        }
        for ingredient in &self.with {
            let Ingredient::General(info) = ingredient else { continue };
            let values: Vec<f64> = info
                .parameters
                .iter()
                .map(|p| match (p.whole, p.log && p.search.0.max(p.low) > 0.0) {
                    (true, _) => p.start,
                    (false, true) => libm::exp(next()),
                    (false, false) => next(),
                })
                .collect();
            effects.extend(AnyEffect::from_parameters(info.id, &values));
        }
        if !terms.is_empty() {
            effects.push(StressRelaxation { terms: terms.clone() }.into());
        }
        if self.has(Ingredient::Indentation) {
            effects.push(DeepIndentation { reach_m: REACH_M }.into());
        }
        if self.alpha != 0.0 {
            effects.push(RateDependentPuncture { alpha: self.alpha }.into());
        }
        let kappa = |i: usize| layers[i].curvature / ((1.0 - layers[i].curvature) * self.frame.loads[i].1);
        let common = if self.has(Ingredient::Nonlinear) { kappa(0).min(KAPPA_MOST) } else { 0.0 };
        if common != 0.0 {
            effects.push(NonlinearElasticity { kappa_per_m: common }.into());
        }
        let mut out: Vec<Layer> = Vec::with_capacity(count);
        for (i, n) in layers.iter().enumerate() {
            let believed = &self.frame.believed.layers[i];
            let thickness_m = match layers.get(i + 1) {
                Some(deeper) => (deeper.front_m - n.front_m).max(1e-4),
                None => believed.thickness_m.max(0.08),
            };
            let own_kappa = kappa(i);
            if own_kappa != common {
                effects.push(LayerStiffening { layer: i + 1, kappa_per_m: own_kappa - common }.into());
            }
            let reference = self.frame.loads[i].1;
            out.push(Layer {
                name: believed.name.clone(),
                thickness_m,
                stiffness_n_per_m: n.load_n / (reference * (1.0 + own_kappa * reference)),
                friction_ns_per_m2: n.sliding_n / (thickness_m * REFERENCE_MPS),
                puncture_n: Some(own.puncture_n.get(i).copied().flatten().unwrap_or(n.yield_n))
                    .filter(|f| f.is_finite()),
            });
            if presliding {
                let kept = if own.drops.get(i).copied().unwrap_or(true) { n.kept } else { 1.0 };
                let release_m = own.releases_m.get(i).copied().flatten().map_or(0.0, |z| z - n.front_m);
                let mut left = 1.0;
                let branch = |share: f64, time_constant_s: f64| {
                    ViscoelasticPresliding {
                        layer: i + 1,
                        share,
                        delta_m: n.delta_m,
                        kept,
                        time_constant_s,
                        release_m: release_m.clamp(-0.1, 0.1),
                    }
                    .into()
                };
                for term in &creep {
                    effects.push(branch(term.fraction, term.time_constant_s));
                    left -= term.fraction;
                }
                effects.push(branch(left.max(0.0), NEVER_S));
            }
        }
        let surface_m = layers.first().map_or(0.0, |l| l.front_m);
        (Tissue { surface_m, layers: out }, effects)
    }
}

struct LayerNumbers {
    front_m: f64,
    load_n: f64,
    curvature: f64,
    sliding_n: f64,
    yield_n: f64,
    delta_m: f64,
    kept: f64,
}
