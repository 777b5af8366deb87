//! Definition of effects that are not in the library, and the start values of a search for them.

use crate::chain_stage::ChainStage;
use crate::custom_equation::{CustomDefinition, MAX_PARAMETERS, MAX_STATES};
use crate::custom_names::GrowingList;
use crate::custom_text::Place;
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};
use crate::effects::{Custom, effect_info};
use alloc::boxed::Box;
use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;

/// All definitions of this program.
static DEFINED: GrowingList<&'static EffectInfo> = GrowingList::new();

/// The entry of an effect of the library, or of the custom effect that was defined last with this id.
#[must_use]
pub fn known_effect_info(id: &str) -> Option<&'static EffectInfo> {
    effect_info(id).or_else(|| DEFINED.iter().filter(|info| info.id == id).last().copied())
}

impl Custom {
    /// Defines an effect by an equation, with the parameters at their start values.
    ///
    /// `info.stage` and `info.custom` are set here.
    ///
    /// # Errors
    /// When the name is one of the library, when there are too many parameters or states, or when no parameter is a
    /// strength.
    pub fn define(info: EffectInfo, definition: CustomDefinition) -> Result<Self, String> {
        let EffectInfo { id, parameters, .. } = info;
        let named = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
        if !id.starts_with(|c: char| c.is_ascii_lowercase()) || !id.chars().all(named) {
            return Err(format!("`{id}` is no name of an effect; use small letters, digits and `_`"));
        }
        if effect_info(id).is_some() {
            return Err(format!("`{id}` is an effect of the library; use another name"));
        }
        if parameters.len() > MAX_PARAMETERS || definition.states > MAX_STATES {
            return Err(format!("at most {MAX_PARAMETERS} parameters and {MAX_STATES} states are possible"));
        }
        if !parameters.iter().any(|p| p.strength) {
            return Err(
                "no parameter is a strength; give one an inactive value, at which the effect vanishes".into(),
            );
        }
        let stage = match definition.place {
            Place::Elastic => ChainStage::Relaxation,
            Place::Friction => ChainStage::Friction,
            Place::Tip => ChainStage::Tip,
            Place::Sensor => ChainStage::Tool,
            Place::Motion => ChainStage::Kinematics,
        };
        let definition: &'static CustomDefinition = Box::leak(Box::new(definition));
        let info = EffectInfo { stage, custom: Some(definition), proposal: columns(parameters), ..info };
        let info: &'static EffectInfo = Box::leak(Box::new(info));
        let added = DEFINED.find_or_add(|_| false, || Ok::<_, String>(info));
        added?;
        let start: Vec<f64> = parameters.iter().map(|p| p.start).collect();
        Self::with_values(info, &start).ok_or_else(|| "the definition has no equation".into())
    }
}

/// Values over the search range of a shape parameter, as shares of the range.
const SHAPE_GRID: [f64; 5] = [0.5, 0.25, 0.75, 0.05, 0.95];
/// Most combinations of shapes that a search starts from.
const MAX_COMBINATIONS: usize = 32;

/// Start values of a search: every strength alone, at combinations of the shapes.
fn columns(parameters: &[ParameterInfo]) -> Proposal {
    let mut combinations: Vec<Vec<f64>> = alloc::vec![Vec::new()];
    let shapes = parameters.iter().filter(|p| !p.strength).count();
    for p in parameters {
        let (low, high) = p.search;
        let values: Vec<f64> = if p.strength {
            alloc::vec![p.inactive]
        } else {
            let count = match shapes {
                1 | 2 => 5,
                3 => 3,
                _ => 2,
            };
            let on_scale = |share: &f64| {
                if p.log && low > 0.0 {
                    low * libm::pow(high / low, *share)
                } else {
                    low + share * (high - low)
                }
            };
            core::iter::once(p.start).chain(SHAPE_GRID.iter().skip(1).map(on_scale)).take(count).collect()
        };
        combinations = combinations
            .iter()
            .flat_map(|c| values.iter().map(move |v| c.iter().copied().chain([*v]).collect()))
            .take(MAX_COMBINATIONS)
            .collect();
    }
    let groups: Vec<&'static [&'static [f64]]> = combinations
        .iter()
        .map(|shape| {
            let strengths = parameters.iter().enumerate().filter(|(_, p)| p.strength);
            let vectors: Vec<&'static [f64]> = strengths
                .map(|(k, p)| {
                    let mut vector = shape.clone();
                    vector[k] = p.start;
                    &*vector.leak()
                })
                .collect();
            &*vectors.leak()
        })
        .collect();
    Proposal::LinearColumns(groups.leak())
}
