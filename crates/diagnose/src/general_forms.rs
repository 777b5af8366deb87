//! Finds effects that include a cause as a special case and that the recordings cannot distinguish from it.
//!
//! The selection prefers the special case unless the gain of the general effect exceeds its additional penalty. If the motion cannot show
//! the difference, this preference is only a convention; the general forms are then reported and share the confidence.

use crate::competing_effects::EQUIVALENCE_NATS;
use crate::diagnosis_json::Cause;
use crate::selection_state::Search;
use stylet_identify::model::EffectTerm;
use stylet_identify::score_test::ScoreTest;
use stylet_tissue::{EffectInfo, ParameterInfo, effect_info};

/// Lists the general forms that the recordings cannot distinguish from each cause, and divides the confidence among them.
pub(crate) fn mark_general_forms(causes: &mut [Cause], search: &Search) {
    let nested = |c: &&mut Cause| effect_info(&c.effect).is_some_and(|i| !i.nested_in.is_empty());
    let mut nested: Vec<&mut Cause> = causes.iter_mut().filter(nested).collect();
    if nested.is_empty() {
        return;
    }
    let score_test = ScoreTest::new(&search.best, &search.data);
    for cause in &mut nested {
        let Some(term) = search.best.model.effects.iter().find(|e| e.info.id == cause.effect) else {
            continue;
        };
        let general = term.info.nested_in.iter().filter_map(|id| effect_info(id));
        let special =
            general.filter(|g| !cause.equivalent.iter().any(|e| e == g.id) && is_alike(g, term, &score_test));
        cause.general_forms = special.map(|g| g.id.to_owned()).collect();
        cause.confidence /= 1.0 + cause.general_forms.len() as f64;
    }
}

/// Whether a general effect of typical shape and of the cause's strength would, after refitting all parameters, differ from the cause by
/// less than [`EQUIVALENCE_NATS`].
fn is_alike(general: &'static EffectInfo, cause: &EffectTerm, score_test: &ScoreTest) -> bool {
    let strength = cause.info.parameters.iter().zip(&cause.values).find(|(p, _)| p.strength);
    let Some(size) = strength.map(|(p, value)| value / p.start).filter(|s| s.is_finite()) else {
        return false;
    };
    let typical = |p: &ParameterInfo| if p.strength { size * p.start } else { p.start };
    let values: Vec<f64> = general.parameters.iter().map(typical).collect();
    score_test
        .effect_column(&EffectTerm::new(general, &values))
        .is_some_and(|column| score_test.gain(&[column]).detectable_nats < EQUIVALENCE_NATS)
}
