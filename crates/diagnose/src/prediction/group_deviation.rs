//! Deviation of a group of recordings from the model: its parameters and prior standard deviations (`docs/reference/spreads.md`).

use serde::{Deserialize, Serialize};
use std::sync::Arc;
use stylet_identify::model::{Assumptions, Model};
use stylet_tissue::Effect;

/// Number of parameters of a deviation.
pub const PARAMETERS: usize = 4;
/// One value for each of `surface`, `force`, `friction` and `puncture`.
pub type Values = [f64; PARAMETERS];

/// A parameter of a group's deviation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Refit {
    /// Position of the surface.
    Surface,
    /// Factor of all forces of the tissue.
    Force,
    /// Factor of the friction of all layers, in addition to that of all forces.
    Friction,
    /// Factor of the puncture force of all layers, in addition to that of all forces.
    Puncture,
}

impl Refit {
    /// All parameters, in the order of the deviations: surface, force, friction, puncture force.
    pub const ALL: [Self; PARAMETERS] = [Self::Surface, Self::Force, Self::Friction, Self::Puncture];

    /// The shift in m for a deviation of the surface, else the factor.
    #[must_use]
    pub fn shift_or_factor(self, deviation: f64) -> f64 {
        if self == Self::Surface { deviation } else { libm::exp(deviation) }
    }
}

/// What differs between groups of recordings.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Factor {
    /// Another needle.
    Needle,
    /// Another specimen or batch of the tissue.
    Tissue,
    /// Another day or set-up.
    Setup,
}

impl Factor {
    /// All factors.
    pub const ALL: [Self; 3] = [Self::Needle, Self::Tissue, Self::Setup];

    /// Standard deviations between groups: surface in m, the others of natural logarithms.
    #[must_use]
    pub const fn sd(self) -> Values {
        match self {
            Self::Needle => NEEDLE_SD,
            Self::Tissue => TISSUE_SD,
            Self::Setup => SETUP_SD,
        }
    }

    /// Name of the factor.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Needle => "needle",
            Self::Tissue => "tissue",
            Self::Setup => "set-up",
        }
    }
}

/// Standard deviations between needles: surface (m), logarithms of force, friction and puncture force.
const NEEDLE_SD: Values = [0.5e-3, 0.2, 0.25, 0.25];
/// Standard deviations between specimens or batches of tissue, as in [`NEEDLE_SD`].
const TISSUE_SD: Values = [1.5e-3, 0.25, 0.2, 0.25];
/// Standard deviations between days or set-ups, as in [`NEEDLE_SD`].
const SETUP_SD: Values = [1e-3, 0.05, 0.1, 0.1];
/// Standard deviations between recordings of one group before any is known: surface (m), logarithms of force, friction and puncture force.
pub const RECORDING_SD: Values = [0.2e-3, 0.03, 0.05, 0.1];
/// Standard deviation of the exponent with which force depends on speed, for speeds without training recordings.
pub const RATE_EXPONENT_SD: f64 = 0.1;

/// Standard deviations of an unseen group that differs in the factors `varying`.
pub fn group_sd(varying: &[Factor]) -> Values {
    std::array::from_fn(|k| varying.iter().map(|f| f.sd()[k].powi(2)).sum::<f64>().sqrt())
}

/// Model of recording `r` in a group with this deviation; the factor of all forces is applied to the predicted force instead.
pub fn deviating_model(model: &Model, r: usize, deviation: &Values) -> Model {
    let [surface_m, _, ln_friction, ln_puncture] = *deviation;
    let mut out = model.clone();
    out.per_recording[r].surface_m += surface_m;
    out.per_recording[r].ln_friction += ln_friction;
    if ln_puncture != 0.0 {
        let factor = libm::exp(ln_puncture);
        let mut effects = out.assumed.known_effects.clone();
        for (k, layer) in out.tissue.layers.iter_mut().enumerate() {
            layer.puncture_n = layer.puncture_n.map(|f| f * factor);
            effects.iter_mut().for_each(|e| e.scale_puncture(k + 1, factor));
        }
        out.assumed = Arc::new(Assumptions { known_effects: effects, ..Assumptions::clone(&model.assumed) });
    }
    out
}
