use super::super::state::DropCandidate;
use super::super::test_support::{inside, sample};
use super::*;

#[test]
fn a_rupture_is_not_withdrawn_while_its_drop_may_continue() {
    let mut stylet = inside();
    stylet.candidate =
        Some(DropCandidate { from_n: 1.5, mean_n: 1.2, missing_n: 0.3, duration_s: 0.005, count: 1.0 });
    stylet.last_drop_n = (0.3, 0.02);
    let mut rival = stylet.rival_of_rupture(&sample(0.01, 1.2));
    if let Some(rival) = &mut rival {
        rival.nats = 100.0;
    }
    stylet.rival = rival;
    stylet.time_since_rupture_s = 0.9 * MAX_DROP_DURATION_S;
    assert!(!stylet.decide_rival(&sample(0.0101, 1.2)) && stylet.rival.is_some());
    stylet.time_since_rupture_s = 1.1 * MAX_DROP_DURATION_S;
    assert!(stylet.decide_rival(&sample(0.0102, 1.2)) && stylet.rival.is_none());
}
