//! What is known about each effect, for listing (`stylet effects`), validating and fitting.

use crate::effect::ChainStage;
use crate::effects::LIBRARY;

/// One effect of the library: what it says, where it comes from and how it shows.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct EffectInfo {
    /// Stable name in snake case.
    pub id: &'static str,
    /// The equation, in the symbols of SPEC section 1.
    pub equation: &'static str,
    /// Who described it, or where it was measured.
    pub source: &'static str,
    /// How it is recognised in a recording.
    pub signature: &'static str,
    /// Place in the chain.
    pub stage: ChainStage,
    /// Its parameters, in the order of [`AnyEffect::parameters`](crate::AnyEffect::parameters).
    pub parameters: &'static [ParameterInfo],
    /// The same effect with more terms, if there is such a variant.
    pub extended: Option<&'static EffectInfo>,
    /// Where a search for it begins.
    pub proposal: Proposal,
    /// Ids of effects that hold this one as a special case.
    pub nested_in: &'static [&'static str],
    /// It takes the part that any force of its kind would, whatever the law behind that: a tone or a breath of whatever comes and goes,
    /// presliding friction of any play at a turn. Beside something unknown it has to act all the more by its own law to be a cause.
    pub absorbs_unmodelled: bool,
}

impl EffectInfo {
    /// What is known about the parameter of this path, further terms of the larger variant included.
    #[must_use]
    pub fn parameter(&self, path: &str) -> Option<&'static ParameterInfo> {
        let larger = self.extended.map_or(&[][..], |l| l.parameters);
        self.parameters.iter().chain(larger).find(|p| p.path == path)
    }
}

/// Where a search for an effect in measured data begins.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum Proposal {
    /// Groups of parameter vectors. What such an effect adds to the force is a column; the columns of a group act together,
    /// and their coefficients scale the strengths. Several groups: shapes in which the force is not linear.
    LinearColumns(&'static [&'static [&'static [f64]]]),
    /// One column per inner face, moved by so many metres; the first parameter is the layer before it.
    LayerFaces(f64),
    /// A motion of the tissue at any of a grid of frequencies: how the force changes with depth and speed makes the columns.
    TissueMotion,
    /// A line of the residual's spectrum.
    SpectralTone,
    /// An element that stretches and breaks, at any depth.
    MembraneRupture,
    /// The [larger form](EffectInfo::larger) of an effect that stands: factors of its numbers, repeated until they are as many.
    SplitTerm(&'static [&'static [f64]]),
    /// Read off the raw samples before any law.
    RawSamples,
    /// Describes one layer at a time: not sought in single insertions.
    PerLayer,
}

/// How a parameter enters a fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FitScale {
    /// As it is.
    Linear,
    /// By its logarithm: a time constant, a frequency.
    Log,
    /// By its reciprocal: the stiffness of what is rigid when neutral.
    Reciprocal,
}

/// One parameter of an effect.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct ParameterInfo {
    /// Path from the effect, as in outputs: `c_n_per_m`, `terms.0.fraction`.
    pub path: &'static str,
    /// Unit; empty for a ratio or a number.
    pub unit: &'static str,
    /// What it is.
    pub meaning: &'static str,
    /// Smallest value that makes sense physically.
    pub low: f64,
    /// Largest value that makes sense physically.
    pub high: f64,
    /// Value at which the effect vanishes, all strengths being at theirs. For a parameter that is
    /// not a strength just a valid value.
    pub inactive: f64,
    /// True when this parameter says how strong the effect is; false for one that only shapes it
    /// (a frequency, a time constant, a depth).
    pub strength: bool,
    /// Where a fit may start: a typical value.
    pub start: f64,
    /// Where a fit should look, for forces of 0.5-6 N, layers of 5-80 mm and 0.5-13 mm/s.
    pub search: (f64, f64),
    /// Where it shows in a reference insertion of some newtons and centimetres, when a typical value does not.
    #[cfg_attr(feature = "serde", serde(skip))]
    pub demonstration: Option<f64>,
    /// True when the search should go in the logarithm.
    pub log: bool,
    /// True when only whole numbers make sense.
    pub integer: bool,
    /// Standard deviation with which it typically differs from one insertion to the next; zero for a number of the law.
    pub between_recordings_sd: f64,
    /// Mean and standard deviation of what was measured of it elsewhere, where a set alone says too little.
    #[cfg_attr(feature = "serde", serde(skip))]
    pub measured_prior: Option<(f64, f64)>,
}

impl ParameterInfo {
    /// How the parameter enters a fit: strengths as they are (a fit may then shrink them to nothing), shapes by their
    /// logarithm where the library says so.
    #[must_use]
    pub fn fit_scale(&self) -> FitScale {
        match (self.strength, self.inactive == f64::INFINITY) {
            (true, true) => FitScale::Reciprocal,
            (false, _) if self.log => FitScale::Log,
            _ => FitScale::Linear,
        }
    }

    /// A parameter that says how strong the effect is.
    pub(crate) const fn strength(path: &'static str, unit: &'static str, meaning: &'static str) -> Self {
        Self {
            path,
            unit,
            meaning,
            low: 0.0,
            high: f64::INFINITY,
            inactive: 0.0,
            strength: true,
            start: 1.0,
            search: (0.0, 1.0),
            demonstration: None,
            log: false,
            integer: false,
            between_recordings_sd: 0.0,
            measured_prior: None,
        }
    }

    /// A parameter that only shapes the effect.
    pub(crate) const fn shape(path: &'static str, unit: &'static str, meaning: &'static str) -> Self {
        Self { strength: false, ..Self::strength(path, unit, meaning) }
    }

    /// Physical range, both ends included.
    pub(crate) const fn allowed(self, low: f64, high: f64) -> Self {
        Self { low, high, ..self }
    }

    /// Neutral value.
    pub(crate) const fn inactive(self, neutral: f64) -> Self {
        Self { inactive: neutral, ..self }
    }

    /// Typical value and range of a fit.
    pub(crate) const fn search(self, start: f64, low: f64, high: f64) -> Self {
        Self { start, search: (low, high), ..self }
    }

    /// A value that shows in a reference insertion.
    pub(crate) const fn demonstration(self, shown: f64) -> Self {
        Self { demonstration: Some(shown), ..self }
    }

    /// To be searched in the logarithm.
    pub(crate) const fn log(self) -> Self {
        Self { log: true, ..self }
    }

    /// Another value in every insertion, with this standard deviation.
    pub(crate) const fn between_recordings_sd(self, sd: f64) -> Self {
        Self { between_recordings_sd: sd, ..self }
    }

    /// Measured elsewhere with this mean and standard deviation.
    pub(crate) const fn measured_prior(self, mean: f64, sd: f64) -> Self {
        Self { measured_prior: Some((mean, sd)), ..self }
    }

    /// Whole numbers only.
    pub(crate) const fn integer(self) -> Self {
        Self { integer: true, ..self }
    }
}

/// A parameter outside its physical range.
#[derive(Clone, Debug, PartialEq)]
pub struct ParameterError {
    /// Effect, by its id.
    pub effect: &'static str,
    /// Path of the parameter.
    pub path: &'static str,
    /// The value that was given.
    pub value: f64,
    /// What would be right, both ends included.
    pub allowed: (f64, f64),
}

impl core::fmt::Display for ParameterError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let Self { effect, path, value, allowed: (low, high) } = self;
        write!(f, "{effect}: {path} is {value}; ")?;
        if *high == f64::INFINITY {
            write!(f, "it must be at least {low}")
        } else {
            write!(f, "it must lie between {low} and {high}")
        }
    }
}

impl core::error::Error for ParameterError {}

/// Effects that measured insertions asked for beyond the general library. They describe one layer at a
/// time, so that a search over single effects has no use for them.
const PER_LAYER: [&str; 7] = [
    "deep_indentation",
    "layer_coupling",
    "layer_stiffening",
    "release_depth",
    "delayed_puncture",
    "viscoelastic_presliding",
    "shaft_slip",
];

/// The general effects in the order of the chain, one entry per row of SPEC section 6.
pub fn general_effects() -> impl Iterator<Item = &'static EffectInfo> {
    LIBRARY.iter().map(|entry| entry()).filter(|entry| !PER_LAYER.contains(&entry.id))
}

/// Effects that describe one layer at a time, or how layers give way: found in measured insertions.
pub fn per_layer_effects() -> impl Iterator<Item = &'static EffectInfo> {
    LIBRARY.iter().map(|entry| entry()).filter(|entry| PER_LAYER.contains(&entry.id))
}

/// The entry of one effect.
#[must_use]
pub fn effect_info(id: &str) -> Option<&'static EffectInfo> {
    general_effects().chain(per_layer_effects()).find(|entry| entry.id == id)
}
