//! Definition of effects that are not in the library, and the start values of a search for them.

use crate::chain_stage::ChainStage;
use crate::custom_equation::{CustomDefinition, Equation};
use crate::custom_error::CustomError;
use crate::custom_names::{GrowingList, static_name};
use crate::custom_text::{CustomText, Place};
use crate::effect_info::{EffectInfo, ParameterInfo, Proposal};
use crate::effects::{Custom, effect_info};
use crate::equation_inputs::{EquationInputs, check_vanishing};
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
    /// Defines an effect whose equation is code.
    ///
    /// `text` has no `force`, and an empty equation for each state. Scenarios refer to the effect by this text, with other
    /// values of the parameters. A second definition of a name replaces the first for the texts that are read later.
    ///
    /// # Errors
    /// [`CustomError`] with the field.
    pub fn define(text: &CustomText, equation: Box<dyn Equation>) -> Result<Self, CustomError> {
        if text.force.is_some() {
            return Err(CustomError::new("force", "is a formula, and the equation is code; leave one out"));
        }
        if let Some((name, _)) = text.state.0.iter().find(|(_, rate)| !rate.is_empty()) {
            let what = "is a formula, and the force is code; give both as formulas or both as code";
            return Err(CustomError::new(format!("state.{name}"), what));
        }
        let parameters = EquationInputs::new(text)?.parameters;
        Self::with_values_of(text, add_definition(&text.without_values(), parameters, equation)?)
    }
}

/// Adds a definition; `text` has no values.
pub(crate) fn add_definition(
    text: &CustomText,
    parameters: Vec<ParameterInfo>,
    equation: Box<dyn Equation>,
) -> Result<&'static EffectInfo, CustomError> {
    check_vanishing(text.place, &*equation, &parameters)?;
    let id = &*text.name;
    let named = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
    let wrong = |what: &str| Err(CustomError::new("name", format!("`{id}` {what}")));
    if !id.starts_with(|c: char| c.is_ascii_lowercase()) || !id.chars().all(named) {
        return wrong("is no name of an effect; use small letters, digits and `_`");
    }
    if effect_info(id).is_some() {
        return wrong("is an effect of the library; use another name");
    }
    let stage = match text.place {
        Place::Elastic => ChainStage::Relaxation,
        Place::Friction => ChainStage::Friction,
        Place::Tip => ChainStage::Tip,
        Place::Sensor => ChainStage::Tool,
        Place::Motion => ChainStage::Kinematics,
    };
    let uses_travel = equation.uses_travel();
    let definition: &'static CustomDefinition =
        Box::leak(Box::new(CustomDefinition { text: text.clone(), uses_travel, equation }));
    let info: &'static EffectInfo = Box::leak(Box::new(EffectInfo {
        id: static_name(id),
        equation: static_name(&equation_of(text)),
        source: if text.source.is_empty() { "defined by the user" } else { static_name(&text.source) },
        signature: "defined by the user",
        stage,
        custom: Some(definition),
        proposal: columns(&parameters),
        parameters: parameters.leak(),
        ..EffectInfo::DEFAULTS
    }));
    DEFINED.find_or_add(|_| false, || Ok(info)).copied()
}

/// The effect in code that a text without `force` and without values refers to.
pub(crate) fn defined_in_code(text: &CustomText) -> Result<&'static EffectInfo, CustomError> {
    let name = &text.name;
    let in_code = |info: &&'static EffectInfo| Some((*info, &info.custom?.text));
    let last =
        DEFINED.iter().filter_map(in_code).filter(|(_, t)| t.name == *name && t.force.is_none()).last();
    let Some((info, known)) = last else {
        let what = format!(
            "is left out, and this program defines no effect `{name}`; give a formula, or read the scenario with the program that \
             defines the effect"
        );
        return Err(CustomError::new("force", what));
    };
    match first_difference(text, known) {
        None => Ok(info),
        Some(path) => {
            let what = format!("differs from the definition of `{name}` in this program; only values may");
            Err(CustomError::new(path, what))
        }
    }
}

/// Path of the first field in which two texts without formulas differ.
fn first_difference(text: &CustomText, known: &CustomText) -> Option<String> {
    let names = |t: &CustomText| t.parameters.0.iter().map(|(name, _)| name.clone()).collect::<Vec<_>>();
    let whole = [
        ("place", text.place == known.place),
        ("state", text.state == known.state),
        ("source", text.source == known.source),
        ("parameters", names(text) == names(known)),
    ];
    let whole = whole.iter().find(|(_, same)| !same).map(|(field, _)| String::from(*field));
    whole.or_else(|| {
        text.parameters.0.iter().zip(&known.parameters.0).find_map(|((name, a), (_, b))| {
            let fields = [
                ("start", a.start == b.start),
                ("prior", a.prior == b.prior),
                ("unit", a.unit == b.unit),
                ("inactive", a.inactive == b.inactive),
                ("meaning", a.meaning == b.meaning),
            ];
            let field = fields.iter().find(|(_, same)| !same)?.0;
            Some(format!("parameters.{name}.{field}"))
        })
    })
}

/// The equation for listings; code is shown as a function of the effect's name.
fn equation_of(text: &CustomText) -> String {
    let code = format!("{}(...)", text.name);
    let force = text.force.as_ref().unwrap_or(&code);
    let mut out = match text.place {
        Place::Elastic => format!("f_K -> f_K + {force}"),
        Place::Friction | Place::Tip => format!("+ {force}"),
        Place::Sensor => format!("f -> {force}"),
        Place::Motion => format!("z -> z - ({force})"),
    };
    for (_, equation) in text.state.0.iter().filter(|(_, equation)| !equation.is_empty()) {
        out.push_str(", ");
        out.push_str(equation);
    }
    out
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
