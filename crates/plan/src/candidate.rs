//! Candidate models: effects that may be present in addition to the base model.

use stylet_identify::model::{EffectTerm, Model};
use stylet_tissue::{EffectInfo, FitScale, Proposal};

/// Effects that may be present in addition to the base model of all candidates.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// Name: an effect's id, `none`, `unknown`.
    pub name: String,
    /// Additional effects; the candidate is named after the last one.
    pub effects: Vec<EffectTerm>,
    /// Probability before the next insertion.
    pub probability: f64,
}

/// Name of the candidate without an additional effect.
pub const NONE: &str = "none";
/// Name of the candidate for an effect outside the library.
pub const UNKNOWN: &str = "unknown";

impl Candidate {
    /// No additional effect.
    #[must_use]
    pub fn without_effect(weight: f64) -> Self {
        Self { name: NONE.to_owned(), effects: Vec::new(), probability: weight }
    }

    /// One additional effect.
    #[must_use]
    pub fn with_effect(term: EffectTerm, weight: f64) -> Self {
        Self { name: term.info.id.to_owned(), effects: vec![term], probability: weight }
    }

    /// The model of this candidate.
    #[must_use]
    pub fn build_model(&self, base: &Model) -> Model {
        let mut model = base.clone();
        model.effects.extend(self.effects.iter().cloned());
        model
    }

    /// Whether this candidate is a special case of another one.
    #[must_use]
    pub fn is_special_case_of(&self, other: &Self) -> bool {
        let last = |c: &Self| c.effects.last().map(|c| c.info);
        match (last(self), last(other)) {
            (None, Some(_)) => true,
            (Some(a), Some(b)) => a.nested_in.contains(&b.id),
            _ => false,
        }
    }
}

/// The effect at the library's typical size; `None` for effects read off the raw samples or tied to one layer.
#[must_use]
pub fn typical_effect(info: &'static EffectInfo) -> Option<EffectTerm> {
    if matches!(info.proposal, Proposal::RawSamples | Proposal::PerLayer) {
        return None;
    }
    let shape = match info.proposal {
        // Use the middle one of the start shapes.
        Proposal::LinearColumns(groups) => groups.get((groups.len().max(1) - 1) / 2).and_then(|g| g.first()),
        _ => None,
    };
    let values: Vec<f64> = info
        .parameters
        .iter()
        .enumerate()
        .map(|(k, p)| match shape.and_then(|s| s.get(k)) {
            Some(x) if !p.strength => *x,
            _ => p.start,
        })
        .collect();
    let term = EffectTerm::new(info, &values);
    term.effect().filter(|e| e.check().is_ok())?;
    Some(term)
}

/// Parameter values of the effect at `times` its strength.
#[must_use]
pub fn scaled_values(term: &EffectTerm, times: f64) -> Vec<f64> {
    term.info
        .parameters
        .iter()
        .zip(&term.values)
        .map(|(p, x)| match (p.strength, p.fit_scale()) {
            (false, _) => *x,
            (true, FitScale::Reciprocal) => x / times,
            (true, _) => p.inactive + times * (x - p.inactive),
        })
        .collect()
}
