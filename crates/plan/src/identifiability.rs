//! Identifiability: which effects an experiment can show, from which strength on, and which it cannot
//! distinguish.

use crate::candidate::{NONE, scaled_values};
use crate::information_state::InformationState;
use crate::motion_search::DISTINGUISHABLE_NATS;
use serde::Serialize;
use std::collections::BTreeMap;
use stylet_diagnose::EQUIVALENCE_NATS;
use stylet_identify::model::EffectTerm;

/// Identifiability of one effect.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EffectIdentifiability {
    /// Effect id.
    pub effect: String,
    /// Nats at its typical size, with all fitted parameters eliminated.
    pub nats: f64,
    /// Whether that suffices to identify it.
    pub identifiable: bool,
    /// Typical parameter values.
    pub typical: BTreeMap<String, f64>,
    /// Parameter values at the smallest identifiable size; `None` when no plausible size is identifiable.
    pub smallest_detectable: Option<BTreeMap<String, f64>>,
    /// Effects that explain the typical force equally well, to within the width of a class.
    pub indistinguishable_from: Vec<String>,
    /// The nearest other effect and its distance in nats.
    pub nearest: Option<(String, f64)>,
}

/// Identifiability of all effects: `identifiability.json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Identifiability {
    /// Effects in the order of the library.
    pub effects: Vec<EffectIdentifiability>,
    /// Effects that are not identifiable at their typical size.
    pub not_identifiable: Vec<String>,
    /// Classes of effects that cannot be distinguished at their typical sizes.
    pub classes: Vec<Vec<String>>,
    /// Correlations of the effects' columns with the base parameters eliminated, in the order of `effects`.
    pub correlation: Vec<Vec<f64>>,
    /// Pairwise separation in nats, in the order of `effects`.
    pub nats: Vec<Vec<f64>>,
    /// Standard deviation of the noise of a block of 20 ms in N.
    pub noise_n: f64,
}

/// Largest plausible multiple of the typical size.
const MAX_PLAUSIBLE_FACTOR: f64 = 30.0;

/// Whether the library accepts these parameter values.
fn valid(term: &EffectTerm, values: &[f64]) -> bool {
    EffectTerm::new(term.info, values).effect().is_some_and(|e| e.check().is_ok())
}

/// Identifiability from the available information.
#[must_use]
pub fn identifiability(state: &InformationState) -> Identifiability {
    let information = state.current();
    let of: Vec<usize> =
        (0..state.candidates.len()).filter(|k| !state.candidates[*k].effects.is_empty()).collect();
    let null = state.candidates.iter().position(|c| c.name == NONE);
    let nats: Vec<Vec<f64>> = of
        .iter()
        .map(|i| {
            of.iter()
                .map(|j| if i == j { 0.0 } else { state.separation_nats(&information, *i.min(j), *i.max(j)) })
                .collect()
        })
        .collect();
    let correlation =
        of.iter().map(|i| of.iter().map(|j| state.correlation(&information, *i, *j)).collect()).collect();
    let mut effects = Vec::new();
    for (row, k) in of.iter().enumerate() {
        let c = &state.candidates[*k];
        let Some(term) = c.effects.last() else { continue };
        let separation = null.map_or(0.0, |n| state.separation_nats(&information, n.min(*k), n.max(*k)));
        let values_by_name = |values: &[f64]| -> BTreeMap<String, f64> {
            term.info.parameters.iter().zip(values).map(|(p, x)| (p.path.to_owned(), *x)).collect()
        };
        let times = (DISTINGUISHABLE_NATS / separation.max(1e-12)).sqrt();
        effects.push(EffectIdentifiability {
            effect: c.name.clone(),
            nats: separation,
            identifiable: separation >= DISTINGUISHABLE_NATS,
            typical: values_by_name(&term.values),
            smallest_detectable: Some(scaled_values(term, times))
                .filter(|x| times <= MAX_PLAUSIBLE_FACTOR && valid(term, x))
                .map(|x| values_by_name(&x)),
            indistinguishable_from: Vec::new(),
            nearest: of
                .iter()
                .enumerate()
                .filter(|(other, _)| *other != row)
                .map(|(other, j)| (state.name(*j).to_owned(), nats[row][other]))
                .min_by(|a, b| a.1.total_cmp(&b.1)),
        });
    }
    let visible: Vec<bool> = effects.iter().map(|e| e.identifiable).collect();
    let like = |i: usize, j: usize| i != j && visible[i] && visible[j] && nats[i][j] < EQUIVALENCE_NATS;
    let names: Vec<String> = effects.iter().map(|e| e.effect.clone()).collect();
    for (i, effect) in effects.iter_mut().enumerate() {
        effect.indistinguishable_from =
            (0..names.len()).filter(|j| like(i, *j)).map(|j| names[j].clone()).collect();
    }
    // Classes are the connected components of the similarity graph.
    let mut class: Vec<usize> = (0..names.len()).collect();
    for i in 0..names.len() {
        for j in 0..i {
            if like(i, j) && class[i] != class[j] {
                let (from, to) = (class[i], class[j]);
                class.iter_mut().filter(|c| **c == from).for_each(|c| *c = to);
            }
        }
    }
    let classes = (0..names.len())
        .map(|k| (0..names.len()).filter(|i| class[*i] == k).map(|i| names[i].clone()).collect::<Vec<_>>())
        .filter(|c| c.len() > 1)
        .collect();
    Identifiability {
        not_identifiable: effects.iter().filter(|e| !e.identifiable).map(|e| e.effect.clone()).collect(),
        effects,
        classes,
        correlation,
        nats,
        noise_n: state.noise.sd_n(),
    }
}
