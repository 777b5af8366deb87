use super::{best_significant, start_count};
use crate::repeated_insertions::ablation::tests::stick_slip;
use crate::repeated_insertions::scored_model::ModelFamily;
use crate::test_fixtures;

#[test]
fn the_best_fit_is_kept_unless_another_predicts_significantly_better() {
    let candidate = |errors: &[f64]| {
        test_fixtures::unmeasured_candidate(ModelFamily::ShaftSlip, &[stick_slip(1)], errors, 0.0)
    };
    let first = [1.0, 1.1, 0.9, 1.2, 1.0];
    let chosen = |others: &[[f64; 5]]| {
        let all = [first].iter().chain(others).map(|e| candidate(e)).collect();
        best_significant(all).expect("a law").errors_n
    };
    assert_eq!(chosen(&[]), first);
    assert_eq!(chosen(&[[1.02, 1.1, 0.9, 0.3, 1.0]]), first);
    let (better, best) = ([0.8, 0.9, 0.7, 1.0, 0.8], [0.7, 0.8, 0.6, 0.9, 0.7]);
    assert_eq!(chosen(&[better, best, better]), best);
    assert!(best_significant(Vec::new()).is_none());
}

#[test]
fn few_recordings_get_more_starts() {
    assert_eq!([1, 4, 5, 10, 12, 13, 40].map(start_count), [72, 72, 60, 30, 25, 24, 24]);
    assert_eq!(start_count(0), 72);
}
