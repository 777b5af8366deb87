use super::*;
use crate::likelihood::replay;
use crate::noise::Noise;
use crate::test_support::{base_model, sampled};
use std::sync::Arc;

/// Three layers of 15 mm, 100 N/m each; insertion at 5 mm/s.
fn model(puncture: [f64; 3]) -> Model {
    base_model(0.005, &puncture.map(|f| (0.015, 100.0, 2000.0, Some(f))), (0.3, 0.1), 1)
}

/// Data simulated with ruptures at these times, up to `to_s` seconds.
fn data(model: &Model, rupture_times: &[f64], to_s: f64) -> FitData {
    let n = (to_s * 200.0).round() as usize;
    let mut blocks = sampled(n, |t| 0.005 * t, |_| 0.0);
    let unforced = FitData::new(Arc::new(vec![blocks.clone()]), Noise::white(0.01), 0.0);
    let truth = Model { rupture_times_s: vec![rupture_times.to_vec()], ..model.clone() };
    blocks.force_n = replay(&truth, &unforced, 0).expect("a replay").force_n;
    FitData::new(Arc::new(vec![blocks]), Noise::white(0.01), 0.0)
}

/// Rupture times after the update for data with ruptures at `truth`, and whether any moved.
fn moved(model: &Model, truth: &[f64], from: &[f64], drops: &[f64], to_s: f64) -> (Vec<f64>, bool) {
    let mut model = model.clone();
    // Wide scatter: the force residuals decide.
    model.scatter.rupture_force = 0.3;
    model.scatter.rupture_depth_m = 5e-3;
    model.rupture_times_s = vec![from.to_vec()];
    let data = data(&model, truth, to_s);
    let any = update_event_times(&mut model, &data, &[drops.to_vec()]);
    (model.rupture_times_s[0].clone(), any)
}

#[test]
fn rupture_times_move_to_the_force_drops() {
    let m = model([1.3; 3]);
    let truth = [3.013, 6.017, 8.551];
    // Moves of half a block, one, two, four, nine, twenty, and sums of them.
    for blocks in [0.5, 1.0, 2.0, 4.0, 9.0, 20.0] {
        for side in [-1.0, 1.0] {
            for layer in 0..3 {
                let mut from = truth;
                from[layer] += side * blocks * 0.02;
                let (actual, any) = moved(&m, &truth, &from, &[], 11.0);
                assert!(any);
                for (actual, truth) in actual.iter().zip(truth) {
                    assert!((actual - truth).abs() < 1e-9, "{blocks} {layer}: {actual} for {truth}");
                }
            }
        }
    }
    assert_eq!(moved(&m, &truth, &truth, &[], 11.0), (truth.to_vec(), false));
}

#[test]
fn a_distant_drop_is_tried() {
    let m = model([1.3; 3]);
    let truth = [3.013, 6.017, 8.551];
    let from = [3.013, 4.4, 8.551];
    let (actual, any) = moved(&m, &truth, &from, &[6.017, 7.7], 11.0);
    assert!(any && actual == truth, "{actual:?}");
    assert_ne!(moved(&m, &truth, &from, &[], 11.0).0, truth);
}

#[test]
fn all_ruptures_of_the_law_are_tried_together() {
    // By force each layer ruptures 10 mm behind its front: an earlier rupture delays the later ones.
    let m = model([1.0; 3]);
    let own = {
        let unforced = data(&m, &[NO_RUPTURE; 3], 11.0);
        ReplayCache::new(&m, &unforced, 0).expect("a trail").free_rupture_times()
    };
    assert!(own.iter().all(|t| *t < 11.0), "{own:?}");
    let from: Vec<f64> = own.iter().map(|t| t - 1.3).collect();
    let (actual, any) = moved(&m, &own, &from, &[], 11.0);
    assert!(any && actual == own, "{actual:?} for {own:?}");
}

#[test]
fn ruptures_can_appear_and_disappear() {
    let m = model([1.3, 1.3, 100.0]);
    // The last layer: at a force drop.
    let truth = [3.013, 6.017, 8.551];
    let (actual, any) = moved(&m, &truth, &[3.013, 6.017, NO_RUPTURE], &[8.551], 9.5);
    assert!(any && actual == truth, "{actual:?}");
    // Without a drop it did not rupture.
    let never = [3.013, 6.017, NO_RUPTURE];
    let (actual, any) = moved(&m, &never, &[3.013, 6.017, 9.1], &[], 9.5);
    assert!(any && actual == never, "{actual:?}");
    // A layer before a ruptured one has ruptured.
    let (actual, _) = moved(&m, &never, &[3.1, NO_RUPTURE, NO_RUPTURE], &[6.017, 3.013], 9.5);
    assert_eq!(actual, never);
    let (actual, _) = moved(&m, &[NO_RUPTURE; 3], &[NO_RUPTURE; 3], &[], 2.5);
    assert_eq!(actual, [NO_RUPTURE; 3]);
}

#[test]
fn rupture_times_stay_ordered_and_inside_the_recording() {
    let m = model([1.3; 3]);
    let truth = [3.013, 6.017, 8.551];
    // Drops tried for every layer, most out of order, some outside the recording.
    let drops: Vec<f64> = (-10..=130).map(|k| 0.1 * f64::from(k)).collect();
    for from in [[5.0, 5.01, 5.02], [1.0, 9.0, 9.1], [0.1, 0.2, 10.0], [3.0, 3.0, 3.0]] {
        let (actual, _) = moved(&m, &truth, &from, &drops, 11.0);
        assert!(actual[0] <= actual[1] && actual[1] <= actual[2], "{actual:?}");
        assert!(actual.iter().all(|t| *t == NO_RUPTURE || (-0.0025..=11.0).contains(t)), "{actual:?}");
    }
}

#[test]
fn each_recording_uses_its_own_drops() {
    let mut m = model([1.3; 3]);
    m.scatter.rupture_force = 0.3;
    m.scatter.rupture_depth_m = 5e-3;
    let (one, two) = ([3.013, 6.017, 8.551], [3.113, 6.317, 8.951]);
    let blocks = vec![data(&m, &one, 11.0).recordings[0].clone(), data(&m, &two, 11.0).recordings[0].clone()];
    let both = FitData::new(Arc::new(blocks), Noise::white(0.01), 0.0);
    m.per_recording.push(m.per_recording[0]);
    m.rupture_times_s = vec![vec![3.013, 4.4, 8.551], vec![3.113, 4.4, 8.951]];
    let first = m.clone();
    assert!(update_event_times(&mut m, &both, &[vec![6.017], vec![6.317]]));
    assert_eq!(m.rupture_times_s, [one, two]);
    // A recording without given drops is updated as well.
    let mut m = first;
    assert!(update_event_times(&mut m, &both, &[vec![6.017]]));
    assert_eq!(m.rupture_times_s[0], one);
}
