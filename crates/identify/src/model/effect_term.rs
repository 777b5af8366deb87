use stylet_tissue::{AnyEffect, EffectInfo};

/// One effect under trial: the library's entry and its values in the library's order.
#[derive(Clone, Debug, PartialEq)]
pub struct EffectTerm {
    /// The library's entry.
    pub info: &'static EffectInfo,
    /// Values.
    pub values: Vec<f64>,
}

impl EffectTerm {
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

    pub(super) fn coordinates(&self) -> Vec<f64> {
        self.effect().map_or_else(|| self.values.clone(), |e| e.coordinates())
    }
}
