//! Description of each effect, for listing (`stylet effects`), validation and fitting.

use crate::chain_stage::ChainStage;
use crate::custom_equation::CustomDefinition;

/// Description of one effect of the library.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct EffectInfo {
    /// Stable name in snake case.
    pub id: &'static str,
    /// The equation, in the symbols of docs/reference/model.md.
    pub equation: &'static str,
    /// Literature, or where it was measured.
    pub source: &'static str,
    /// Signature by which it is recognised in a recording.
    pub signature: &'static str,
    /// Stage in the chain.
    pub stage: ChainStage,
    /// Its parameters, in the order of [`AnyEffect::parameters`](crate::AnyEffect::parameters).
    pub parameters: &'static [ParameterInfo],
    /// The same effect with more terms, if there is such a variant.
    pub extended: Option<&'static EffectInfo>,
    /// Start values of a search for it.
    pub proposal: Proposal,
    /// Ids of effects that contain this one as a special case.
    pub nested_in: &'static [&'static str],
    /// Whether the effect also fits forces of another origin: a tone or a tissue motion fits any periodic force, presliding
    /// friction any hysteresis at a reversal. Together with an unmodelled force such an effect needs stronger evidence.
    pub absorbs_unmodelled: bool,
    /// Whether it belongs to the sensor's baseline: a force in air too, of any size and sign, that does not depend on the
    /// tissue. Such effects are searched for before all others.
    pub baseline: bool,
    /// The definition of an effect that is not in the library.
    #[cfg_attr(feature = "serde", serde(skip))]
    pub custom: Option<&'static CustomDefinition>,
}

impl EffectInfo {
    /// Fields that most entries share: a per-layer effect without an extended form.
    pub const DEFAULTS: Self = Self {
        id: "",
        equation: "",
        source: "",
        signature: "",
        stage: ChainStage::Geometry,
        parameters: &[],
        extended: None,
        proposal: Proposal::PerLayer,
        nested_in: &[],
        absorbs_unmodelled: false,
        baseline: false,
        custom: None,
    };

    /// The parameter of this path, including further terms of the extended form.
    #[must_use]
    pub fn parameter(&self, path: &str) -> Option<&'static ParameterInfo> {
        let larger = self.extended.map_or(&[][..], |l| l.parameters);
        self.parameters.iter().chain(larger).find(|p| p.path == path)
    }
}

/// Start values of a search for an effect in measured data.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum Proposal {
    /// Groups of parameter vectors. The change of force at each vector is a column of a regression; the columns of a group
    /// enter together, and their coefficients scale the strengths. Several groups: shapes in which the force is not linear.
    LinearColumns(&'static [&'static [&'static [f64]]]),
    /// One column per inner face, moved by this many metres; the first parameter is the layer in front of it.
    LayerFaces(f64),
    /// A motion of the tissue at each of a grid of frequencies: columns from the sensitivity to depth and speed.
    TissueMotion,
    /// A spectral line of the residual.
    SpectralTone,
    /// A membrane at any depth.
    MembraneRupture,
    /// The [extended form](EffectInfo::extended) of an effect that is already in the model: factors on its parameters,
    /// repeated to the length of the extended form.
    SplitTerm(&'static [&'static [f64]]),
    /// Found in the raw samples, without a force law.
    RawSamples,
    /// Acts on one layer at a time: not a candidate for single insertions.
    PerLayer,
}

/// How a parameter enters a fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FitScale {
    /// Unchanged.
    Linear,
    /// By its logarithm: a time constant, a frequency.
    Log,
    /// By its reciprocal: a stiffness that is infinite when inactive.
    Reciprocal,
}

/// One parameter of an effect.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct ParameterInfo {
    /// Path from the effect, as in outputs: `c_n_per_m`, `terms.0.fraction`.
    pub path: &'static str,
    /// Unit; empty for a ratio or a count.
    pub unit: &'static str,
    /// Meaning, for listings.
    pub meaning: &'static str,
    /// Smallest value that makes sense physically.
    pub low: f64,
    /// Largest value that makes sense physically.
    pub high: f64,
    /// Value at which the effect vanishes, together with the other strengths. For a shape parameter any valid value.
    pub inactive: f64,
    /// Whether the parameter is a strength; otherwise it only shapes the effect (a frequency, a time constant, a depth).
    pub strength: bool,
    /// Typical value, a start value of fits.
    pub start: f64,
    /// Search range of fits, for forces of 0.5-6 N, layers of 5-80 mm and speeds of 0.5-13 mm/s.
    pub search: (f64, f64),
    /// Value for the reference insertion of `stylet effects`, where the typical value has no visible effect.
    #[cfg_attr(feature = "serde", serde(skip))]
    pub demonstration: Option<f64>,
    /// Whether the search is on a logarithmic scale.
    pub log: bool,
    /// Whether only integers are valid.
    pub integer: bool,
    /// Whether it is a frequency that does not depend on the commanded motion.
    pub clock: bool,
    /// Typical standard deviation between recordings; zero for a parameter that is common to all.
    pub between_recordings_sd: f64,
    /// Normal prior (mean, standard deviation) from other measurements, where one data set does not identify it.
    #[cfg_attr(feature = "serde", serde(skip))]
    pub measured_prior: Option<(f64, f64)>,
}

impl ParameterInfo {
    /// How the parameter enters a fit: strengths unchanged, so that a fit may shrink them to zero, shapes by their logarithm
    /// where `log` is set.
    #[must_use]
    pub fn fit_scale(&self) -> FitScale {
        match (self.strength, self.inactive == f64::INFINITY) {
            (true, true) => FitScale::Reciprocal,
            (false, _) if self.log => FitScale::Log,
            _ => FitScale::Linear,
        }
    }

    /// A strength.
    #[must_use]
    pub const fn strength(path: &'static str, unit: &'static str, meaning: &'static str) -> Self {
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
            clock: false,
            between_recordings_sd: 0.0,
            measured_prior: None,
        }
    }

    /// A shape parameter.
    #[must_use]
    pub const fn shape(path: &'static str, unit: &'static str, meaning: &'static str) -> Self {
        Self { strength: false, ..Self::strength(path, unit, meaning) }
    }

    /// Physical range, both ends included.
    #[must_use]
    pub const fn allowed(self, low: f64, high: f64) -> Self {
        Self { low, high, ..self }
    }

    /// Inactive value.
    #[must_use]
    pub const fn inactive(self, value: f64) -> Self {
        Self { inactive: value, ..self }
    }

    /// Typical value and search range.
    #[must_use]
    pub const fn search(self, start: f64, low: f64, high: f64) -> Self {
        Self { start, search: (low, high), ..self }
    }

    /// Value for the reference insertion.
    #[must_use]
    pub const fn demonstration(self, value: f64) -> Self {
        Self { demonstration: Some(value), ..self }
    }

    /// Logarithmic search.
    #[must_use]
    pub const fn log(self) -> Self {
        Self { log: true, ..self }
    }

    /// Differs between recordings, with this standard deviation.
    #[must_use]
    pub const fn between_recordings_sd(self, sd: f64) -> Self {
        Self { between_recordings_sd: sd, ..self }
    }

    /// Normal prior with this mean and standard deviation.
    #[must_use]
    pub const fn measured_prior(self, mean: f64, sd: f64) -> Self {
        Self { measured_prior: Some((mean, sd)), ..self }
    }

    /// Marks a frequency that does not depend on the commanded motion.
    #[must_use]
    pub const fn clock(self) -> Self {
        Self { clock: true, ..self }
    }

    /// Integers only.
    #[must_use]
    pub const fn integer(self) -> Self {
        Self { integer: true, ..self }
    }
}

/// A parameter outside its physical range.
#[derive(Clone, Debug, PartialEq)]
pub struct ParameterError {
    /// Id of the effect.
    pub effect: &'static str,
    /// Path of the parameter.
    pub path: &'static str,
    /// The invalid value.
    pub value: f64,
    /// Valid range, both ends included.
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
