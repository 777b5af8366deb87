use stylet_tissue::{AnyEffect, Effect, EffectInfo};

/// An effect of the model: library entry and parameter values in the library's order.
#[derive(Clone, Debug, PartialEq)]
pub struct EffectTerm {
    /// Library entry.
    pub info: &'static EffectInfo,
    /// Parameter values.
    pub values: Vec<f64>,
}

impl EffectTerm {
    /// An effect with these values.
    #[must_use]
    pub fn new(info: &'static EffectInfo, values: &[f64]) -> Self {
        Self { info, values: values.to_vec() }
    }

    /// The term of an effect.
    #[must_use]
    pub fn of(effect: &AnyEffect) -> Self {
        Self { info: effect.info(), values: effect.parameters() }
    }

    /// The effect as the tissue model takes it; `None` when the values are invalid.
    #[must_use]
    pub fn effect(&self) -> Option<AnyEffect> {
        self.info.with_parameters(&self.values)
    }

    pub(super) fn coordinates(&self) -> Vec<f64> {
        self.effect().map_or_else(|| self.values.clone(), |e| e.coordinates())
    }
}
