//! Errors of a choice: parts of a set predicted by laws that were chosen, parts and all, without them.
//!
//! Which law a set needs, and which parts of it, is said by recordings left out; said of all of them it has seen every one. Here each
//! part of the set is kept away from the choice, too, which leaves parts of what is left out in its turn (Varma and Simon 2006).

use crate::set::first::Insertion;
use crate::set::laws::{Law, Laws, TURNS, best_of, coarse, effects, folds, foretold, parts};
use crate::set::left_out::{fit_without, staying};
use crate::set::population::Population;
use serde::Serialize;

/// What parts of a set are predicted to.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Nested {
    /// By a law that was chosen with them, and fitted without them (N).
    pub chosen_with_n: f64,
    /// By a law that was chosen and fitted without them (N).
    pub chosen_without_n: f64,
    /// What the laws have that were chosen without each part.
    pub effects: Vec<Vec<String>>,
}

/// Chooses a law without each part of the set in turn. Where the fits begin was found with all of it. `None` when a part leaves too few.
#[must_use]
pub fn nested(laws: &Laws, runs: &[&Insertion]) -> Option<Nested> {
    let (mut errors, mut chosen) = (Vec::new(), Vec::new());
    for fold in folds(runs.len()) {
        let some = staying(runs, &fold);
        let of =
            |law: &Law| Some(Law::new(law.kind, fit_without(&coarse(&law.fitted), &fold, &[TURNS])?, &some));
        let (base, slip) = (of(&laws.base)?, laws.slip.as_ref().and_then(of));
        let library = laws.library.as_ref().and_then(of);
        let mut best = best_of(&base, slip.as_ref(), library.as_ref()).clone();
        parts(&mut best, &some);
        let tried = [Some(&laws.base), laws.slip.as_ref(), laws.library.as_ref()];
        let days =
            tried.into_iter().flatten().find(|l| l.kind == best.kind).map(|l| &l.fitted.fit.model.day_of);
        let population = Population::of(&best.fitted, &some);
        errors.extend(
            foretold(&population, days.map_or(&[][..], Vec::as_slice), runs, &fold)
                .into_iter()
                .map(|e| e.1.rmse_n),
        );
        chosen.push(effects(&best.fitted.fit.model).into_iter().map(str::to_owned).collect());
    }
    let chosen_without_n = stylet_stats::mean(&errors);
    chosen_without_n.is_finite().then(|| Nested {
        chosen_with_n: laws.best.left_out_n(),
        chosen_without_n,
        effects: chosen,
    })
}

#[cfg(test)]
mod tests {
    use super::nested;
    use crate::made;
    use crate::set::Insertion;
    use crate::set::laws::{Kind, Law, Laws};
    use stylet_tissue::{AnyEffect, CoulombFriction, ForceBias};

    /// Friction that the base law has not, and a bias that is none: without each run the one is chosen and the other is not.
    #[test]
    fn a_law_is_chosen_anew_without_every_part_of_a_set() {
        let rubs: AnyEffect = CoulombFriction { c_n_per_m: 150.0 }.into();
        let bias: AnyEffect = ForceBias { force_n: 1e-3 }.into();
        let speeds =
            [[0.008, 1e-4], [0.008, -1e-4], [0.016, 0.0], [0.016, 1e-4], [0.008, 0.0], [0.016, -1e-4]];
        let runs = made::insertions(std::slice::from_ref(&rubs), &speeds);
        let runs: Vec<&Insertion> = runs.iter().collect();
        let base = Law::new(Kind::Base, made::settled(&[], &runs), &runs);
        let library = Law::new(Kind::Library, made::settled(&[bias, rubs], &runs), &runs);
        let laws =
            Laws { base, best: library.clone(), library: Some(library), slip: None, parts: Vec::new() };
        let told = nested(&laws, &runs).expect("six runs");
        assert_eq!(told.effects, vec![vec!["coulomb_friction".to_owned()]; 6]);
        assert_eq!(told.chosen_with_n, laws.best.left_out_n());
        assert!((told.chosen_without_n / told.chosen_with_n - 1.0).abs() < 0.2, "{told:?}");
    }
}
