//! Promise: the algorithm's switches that the supplement and the laboratory leave open really run: to the
//! letter it loses what the completions give, and the derivative may act on drops.

use stylet_reproduce::algorithm_variant::Setup;
use stylet_reproduce::all_runs::Study;
use stylet_reproduce::paper_experiments::Case;
use stylet_reproduce::run_outcome::Outcome;
use stylet_reproduce::study_conditions::View;

const CASES: [Case; 2] = [Case::LatexConstant, Case::LatexSinusoidal];
const SETUPS: [Setup; 3] = [Setup::Tuned, Setup::Literal, Setup::FallingForce];

fn look(study: &Study) -> Vec<Vec<Vec<Outcome>>> {
    let of = |case: Case, setup: Setup| View::primary(study).setup(setup).ml(case).to_vec();
    SETUPS.iter().map(|s| CASES.iter().map(|c| of(*c, *s)).collect()).collect()
}

/// Median over the seeds of the largest relative error of K.
fn worst_stiffness(runs: &[Outcome]) -> f64 {
    let mut errors: Vec<f64> = runs.iter().filter_map(|o| o.score.worst_stiffness_error()).collect();
    errors.sort_by(f64::total_cmp);
    errors.get(errors.len() / 2).copied().unwrap_or(f64::INFINITY)
}

#[test]
fn the_literal_algorithm_estimates_worse_and_its_derivative_may_act_on_drops() {
    let planning = Study::planning(1, 8);
    let _ = look(&planning);
    let found = look(&Study::run(&planning.plan(), &|| {}).expect("shipped scenarios"));
    for (setup, of_setup) in SETUPS.iter().zip(&found) {
        for (case, runs) in CASES.iter().zip(of_setup) {
            let all = runs.iter().filter(|o| o.found_all()).count();
            println!(
                "{setup:?}, {}: exact in {all} of {}, K off by {:.3}",
                case.name(),
                runs.len(),
                worst_stiffness(runs)
            );
            assert_eq!(runs.len(), 8);
        }
    }
    assert_eq!(found.len(), 3);
    let (tuned, literal, falling) = (&found[0], &found[1], &found[2]);
    assert_ne!(tuned, literal, "the switch does something");
    for (case, (a, b)) in CASES.iter().zip(tuned.iter().zip(literal)) {
        assert!(worst_stiffness(b) > worst_stiffness(a), "{case:?}: to the letter is not worse");
    }
    for runs in falling {
        assert!(runs.iter().all(Outcome::found_all), "the latex stack does not need the rising force");
    }
}

#[test]
fn where_the_drop_is_small_the_derivative_on_drops_finds_none_of_what_the_rising_force_finds() {
    let of = |study: &Study, setup: Setup| View::primary(study).setup(setup).ml(Case::Gel50Constant).to_vec();
    let planning = Study::planning(1, 8);
    let _ = (of(&planning, Setup::Tuned), of(&planning, Setup::FallingForce));
    let study = Study::run(&planning.plan(), &|| {}).expect("shipped scenarios");
    let (rising, falling) = (of(&study, Setup::Tuned), of(&study, Setup::FallingForce));
    assert_eq!((rising.len(), falling.len()), (8, 8));
    assert!(rising.iter().all(Outcome::found_all));
    assert!(falling.iter().all(|o| o.score.missed == 1 && o.score.false_alarms == 0));
}
