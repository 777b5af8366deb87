//! What may be the case: the model that stands, and what may be true beside it.

use stylet_identify::model::{EffectTerm, Model};
use stylet_tissue::{EffectInfo, FitScale, Proposal};

/// Something that may be the case: effects beside the stem that all candidates share.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// Name for people: an effect's id, `none`, `unknown`.
    pub name: String,
    /// Effects beside the stem; the one that gives the name is the last.
    pub effects: Vec<EffectTerm>,
    /// Probability before the next insertion.
    pub probability: f64,
}

/// The name of "nothing beside the law".
pub const NONE: &str = "none";
/// The name of "something that the library lacks".
pub const UNKNOWN: &str = "unknown";

impl Candidate {
    /// Nothing beside the stem.
    #[must_use]
    pub fn without_effect(weight: f64) -> Self {
        Self { name: NONE.to_owned(), effects: Vec::new(), probability: weight }
    }

    /// One effect beside the stem.
    #[must_use]
    pub fn with_effect(choice: EffectTerm, weight: f64) -> Self {
        Self { name: choice.info.id.to_owned(), effects: vec![choice], probability: weight }
    }

    /// The model of this candidate.
    #[must_use]
    pub fn build_model(&self, stem: &Model) -> Model {
        let mut model = stem.clone();
        model.effects.extend(self.effects.iter().cloned());
        model
    }

    /// Whether this is a special case of another candidate.
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

/// The effect at the size that the library calls typical; none for what is read off the raw samples or belongs to one layer.
#[must_use]
pub fn typical_effect(info: &'static EffectInfo) -> Option<EffectTerm> {
    if matches!(info.proposal, Proposal::RawSamples | Proposal::PerLayer) {
        return None;
    }
    let shape = match info.proposal {
        // The shape in the middle of those that a search begins from.
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
    let choice = EffectTerm::new(info, &values);
    choice.effect().filter(|e| e.check().is_ok())?;
    Some(choice)
}

/// The same effect `times` as strong.
#[must_use]
pub fn scaled_values(choice: &EffectTerm, times: f64) -> Vec<f64> {
    choice
        .info
        .parameters
        .iter()
        .zip(&choice.values)
        .map(|(p, x)| match (p.strength, p.fit_scale()) {
            (false, _) => *x,
            (true, FitScale::Reciprocal) => x / times,
            (true, _) => p.inactive + times * (x - p.inactive),
        })
        .collect()
}
