//! Errors of a choice: parts of a set predicted by laws that were chosen, parts and all, without them.
//!
//! Which law a set needs, and which parts of it, is said by recordings left out; said of all of them it has seen every one. Here each
//! part of the set is kept away from the choice, too, which leaves parts of what is left out in its turn (Varma and Simon 2006).

use crate::repeated_insertions::cross_validation::{refit_without, training_recordings};
use crate::repeated_insertions::model_selection::{
    CandidateModels, REFIT_TURNS, ScoredModel, ablate, active_effects, best_candidate, folds, predict_fold,
    with_coarse_blocks,
};
use crate::repeated_insertions::population_prediction::Population;
use crate::repeated_insertions::start_values::SegmentedRecording;
use serde::Serialize;

/// What parts of a set are predicted to.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NestedCrossValidation {
    /// By a law that was chosen with them, and fitted without them (N).
    pub selected_with_n: f64,
    /// By a law that was chosen and fitted without them (N).
    pub selected_without_n: f64,
    /// What the laws have that were chosen without each part.
    pub effects: Vec<Vec<String>>,
}

/// Chooses a law without each part of the set in turn. Where the fits begin was found with all of it. `None` when a part leaves too few.
#[must_use]
pub fn nested_cross_validation(
    laws: &CandidateModels,
    runs: &[&SegmentedRecording],
) -> Option<NestedCrossValidation> {
    let (mut errors, mut chosen) = (Vec::new(), Vec::new());
    for fold in folds(runs.len()) {
        let some = training_recordings(runs, &fold);
        let of = |law: &ScoredModel| {
            Some(ScoredModel::new(
                law.family,
                refit_without(&with_coarse_blocks(&law.set_fit), &fold, &[REFIT_TURNS])?,
                &some,
            ))
        };
        let (base, slip) = (of(&laws.base)?, laws.slip.as_ref().and_then(of));
        let library = laws.library.as_ref().and_then(of);
        let mut best = best_candidate(&base, slip.as_ref(), library.as_ref()).clone();
        ablate(&mut best, &some);
        let tried = [Some(&laws.base), laws.slip.as_ref(), laws.library.as_ref()];
        let days = tried
            .into_iter()
            .flatten()
            .find(|l| l.family == best.family)
            .map(|l| &l.set_fit.fit.model.day_of);
        let population = Population::from_fit(&best.set_fit, &some);
        errors.extend(
            predict_fold(&population, days.map_or(&[][..], Vec::as_slice), runs, &fold)
                .into_iter()
                .map(|e| e.1.rmse_n),
        );
        chosen.push(active_effects(&best.set_fit.fit.model).into_iter().map(str::to_owned).collect());
    }
    let selected_without_n = stylet_stats::mean(&errors);
    selected_without_n.is_finite().then(|| NestedCrossValidation {
        selected_with_n: laws.best.held_out_n(),
        selected_without_n: selected_without_n,
        effects: chosen,
    })
}

#[cfg(test)]
mod tests {
    use super::nested_cross_validation;
    use crate::repeated_insertions::SegmentedRecording;
    use crate::repeated_insertions::model_selection::{CandidateModels, ModelFamily, ScoredModel};
    use crate::test_fixtures;
    use stylet_tissue::{AnyEffect, CoulombFriction, ForceBias};

    /// Friction that the base law has not, and a bias that is none: without each run the one is chosen and the other is not.
    #[test]
    fn a_law_is_chosen_anew_without_every_part_of_a_set() {
        let rubs: AnyEffect = CoulombFriction { c_n_per_m: 150.0 }.into();
        let bias: AnyEffect = ForceBias { force_n: 1e-3 }.into();
        let speeds =
            [[0.008, 1e-4], [0.008, -1e-4], [0.016, 0.0], [0.016, 1e-4], [0.008, 0.0], [0.016, -1e-4]];
        let runs = test_fixtures::simulated_recordings(std::slice::from_ref(&rubs), &speeds);
        let runs: Vec<&SegmentedRecording> = runs.iter().collect();
        let base = ScoredModel::new(ModelFamily::Base, test_fixtures::fit_from_truth(&[], &runs), &runs);
        let library = ScoredModel::new(
            ModelFamily::Library,
            test_fixtures::fit_from_truth(&[bias, rubs], &runs),
            &runs,
        );
        let laws = CandidateModels {
            base,
            best: library.clone(),
            library: Some(library),
            slip: None,
            terms: Vec::new(),
        };
        let told = nested_cross_validation(&laws, &runs).expect("six runs");
        assert_eq!(told.effects, vec![vec!["coulomb_friction".to_owned()]; 6]);
        assert_eq!(told.selected_with_n, laws.best.held_out_n());
        assert!((told.selected_without_n / told.selected_with_n - 1.0).abs() < 0.2, "{told:?}");
    }
}
