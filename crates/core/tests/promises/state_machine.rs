//! Promise: simulated runs make every transition of the table, for one of its triggers, and no other.

use crate::support::{constant, enhance, insertion, sinusoid};
use std::collections::BTreeSet;
use stylet_core::config::{Depths, Model};
use stylet_core::{Cause, EnhanceConfig, Output, State, TRANSITIONS, Trigger};
use stylet_tissue::Tissue;

fn number(state: State) -> usize {
    State::ALL.iter().position(|s| *s == state).expect("a state")
}

/// Runs that together make all transitions: constant and sinusoidal, both models, known depths, holds, and a reversal at the
/// sample after a rupture.
fn runs() -> Vec<Vec<Output>> {
    let mut runs = Vec::new();
    for model in [Model::MultiLayer, Model::KelvinVoigt] {
        let config = EnhanceConfig { model, ..EnhanceConfig::paper() };
        for seed in 1..4 {
            runs.push(enhance(&config, &constant(0.02, seed).samples));
            runs.push(enhance(&config, &sinusoid(0.02, seed).samples));
            runs.push(enhance(&config, &constant(0.1, seed).samples));
        }
        let known = EnhanceConfig { depths: Depths::Known(vec![0.01, 0.02, 0.02]), ..config.clone() };
        runs.push(enhance(&known, &constant(0.02, 1).samples));
        // A slope below the threshold of the derivative: only the CUSUM detects the drop.
        let slow = |_| 0.0008;
        runs.push(enhance(
            &config,
            &insertion(&Tissue::three_gels(), -0.002, 45.0, 200.0, 0.02, 1, slow).samples,
        ));
        let hold = |t: f64| if (20.0..23.0).contains(&t) { 0.0 } else { 0.0023 };
        runs.push(enhance(
            &config,
            &insertion(&Tissue::three_gels(), -0.005, 50.0, 200.0, 0.02, 1, hold).samples,
        ));
    }
    let config = EnhanceConfig::paper();
    let forward = constant(0.02, 1);
    let found =
        enhance(&config, &forward.samples).iter().position(|o| o.detection.is_some()).expect("a rupture");
    let mut back = forward.samples;
    for sample in &mut back[found + 1..] {
        sample.velocity_mps = -0.0023;
    }
    runs.push(enhance(&config, &back));
    runs
}

#[test]
fn simulated_runs_make_exactly_the_transitions_of_the_table() {
    let table: BTreeSet<(usize, usize)> =
        TRANSITIONS.iter().map(|t| (number(t.from), number(t.to))).collect();
    assert_eq!(table.len(), TRANSITIONS.len(), "transitions are unique");
    let mut made = BTreeSet::new();
    for run in runs() {
        let mut state = State::default();
        for out in run {
            if out.state != state {
                made.insert((number(state), number(out.state)));
            }
            state = out.state;
        }
    }
    assert_eq!(made, table);
}

#[test]
fn a_rupture_is_declared_for_a_reason_that_the_table_gives() {
    let mut causes = BTreeSet::new();
    for run in runs() {
        let mut state = State::default();
        for out in run {
            if let Some(detection) = out.detection {
                let trigger = match detection.cause {
                    Cause::Cusum => Trigger::CusumAlarm,
                    Cause::DerivativeTrailingEdge => Trigger::TrailingEdge,
                    Cause::KnownFace => Trigger::KnownFace,
                };
                let arrow = TRANSITIONS.iter().find(|t| t.from == state && t.to == out.state);
                assert!(
                    arrow.is_some_and(|t| t.triggers.contains(&trigger)),
                    "{state:?} to {:?}: {trigger:?}",
                    out.state
                );
                causes.insert(detection.cause.name());
            }
            state = out.state;
        }
    }
    assert!(causes.contains("CUSUM") && causes.contains("known face"), "{causes:?}");
}
