use super::*;
use crate::test_support::{base_model, sampled};

/// Layers by thickness (mm), stiffness (N/m) and puncture force (N), starting at 10 mm; tolerances of a
/// fifth and a tenth.
fn model(layers: &[(f64, f64, Option<f64>)]) -> Model {
    let layers: Vec<_> = layers.iter().map(|&(mm, k, f)| (mm * 1e-3, k, 4000.0, f)).collect();
    base_model(0.01, &layers, (0.2, 0.1), 1)
}

/// Insertion at 10 mm/s from 0.1 mm to `to_mm`.
fn blocks(to_mm: f64) -> BlockAverages {
    let n = (to_mm / 10.0 * 200.0).round() as usize + 1;
    sampled(n, |t| 0.0001 + 0.01 * t, |_| 0.0)
}

/// A drop at a position (mm) with a size (N).
fn drop(at_mm: f64, size_n: f64, score: f64) -> ForceDrop {
    ForceDrop { time_s: (at_mm - 0.1) / 10.0, position_m: at_mm * 1e-3, size_n, score }
}

/// Assigned rupture positions in mm.
fn places(model: &Model, to_mm: f64, drops: &[ForceDrop]) -> Vec<f64> {
    assign_one_recording(&expected_ruptures(model, 1.0), &blocks(to_mm), drops, 0.01)
        .iter()
        .map(|t| 0.1 + 10.0 * t)
        .collect()
}

fn assert_all_close(actual: &[f64], expected: &[f64]) {
    let near = |(a, b): (&f64, &f64)| a == b || (a - b).abs() < 1e-9;
    assert!(
        actual.len() == expected.len() && actual.iter().zip(expected).all(near),
        "{actual:?} for {expected:?}"
    );
}

#[test]
fn expected_rupture_is_by_force_or_at_the_far_interface() {
    let m = model(&[(20.0, 200.0, Some(2.0)), (10.0, 100.0, Some(3.0)), (30.0, 50.0, None)]);
    let actual = expected_ruptures(&m, 0.5);
    // 0.6 times the assumed tolerances in mm: the surface, each thickness.
    let (surface, first, second, third) = (0.6 * 2.0_f64, 0.6 * 2.0_f64, 0.6 * 1.0_f64, 0.6 * 3.0_f64);
    let own = |sd_mm: f64, thick_mm: f64| 1e-3 * (0.5 * sd_mm).hypot(0.2 + 0.01 * thick_mm);
    let expected = [
        // 2 N at 200 N/m are 10 mm, known to 17 %.
        (10.0, 20.0, own(surface.hypot(0.17 * 10.0), 20.0), 200.0),
        // 3 N at 100 N/m are 30 mm: the interface may come first.
        (30.0, 40.0, own(surface.hypot(first).hypot(second).hypot(0.3 * 0.17 * 30.0), 10.0), 100.0),
        (40.0, 70.0, own(surface.hypot(first).hypot(second).hypot(third), 30.0), 50.0),
    ];
    for (actual, (front_mm, place_mm, sd_m, stiffness)) in actual.iter().zip(expected) {
        assert!((actual.front_m - 1e-3 * front_mm).abs() < 1e-12, "{actual:?}");
        assert!((actual.position_m - 1e-3 * place_mm).abs() < 1e-12, "{actual:?}");
        assert!((actual.sd_m - sd_m).abs() < 1e-12, "{actual:?} for {sd_m}");
        assert_eq!(actual.stiffness_n_per_m, stiffness);
    }
}

#[test]
fn without_a_drop_a_layer_ruptures_where_expected() {
    let m = model(&[(20.0, 20.0, Some(0.2)), (20.0, 2.0, None)]);
    // At 20 and 50 mm: in the middle of the first block beyond, of 0.2 mm each.
    let first = |mm: f64| {
        let b = blocks(60.0);
        let middle = |k: usize| 0.1 + 10.0 * 0.5 * (b.start_s[k] + b.end_s[k]);
        (0..b.len()).map(middle).find(|z| *z >= mm - 1e-9).expect("a block")
    };
    assert_all_close(&places(&m, 60.0, &[]), &[first(20.0), first(50.0)]);
    assert_all_close(&places(&m, 49.0, &[]), &[first(20.0), NO_RUPTURE]);
    assert_all_close(&places(&m, 19.0, &[]), &[NO_RUPTURE, NO_RUPTURE]);
}

#[test]
fn a_rupture_without_a_drop_costs_the_drop_that_should_be_visible() {
    // At 20 mm, with 10 mm of stretch over 0.01 N of noise: a missing drop costs a fiftieth of its squared
    // score, at most 12 nats. Not to rupture is free until the layer is passed by two and a half standard
    // deviations.
    let of = |stiffness: f64, to_mm: f64| {
        let m = model(&[(20.0, stiffness, Some(stiffness * 0.01))]);
        places(&m, to_mm, &[])[0].is_finite()
    };
    let sd_mm = 1.2_f64.hypot(1.7).hypot(0.4);
    // `beyond` standard deviations further: half of the square, and two nats.
    let to = |beyond: f64| 20.0 + sd_mm * (2.5 + beyond);
    let price = |stiffness: f64| (0.02 * (stiffness * 0.01 / 0.01).powi(2)).min(12.0);
    for stiffness in [12.0, 20.0, 80.0] {
        let even = (2.0 * (price(stiffness) - 2.0)).max(0.0).sqrt();
        assert!(!of(stiffness, to(even - 0.1)), "{stiffness}");
        assert!(of(stiffness, to(even + 0.1)), "{stiffness}");
    }
    // Nearly free, but only where the layer is passed.
    assert!(!of(1.0, to(-2.4)) && !of(9.0, to(-0.1)) && of(9.0, to(0.1)));
}

#[test]
fn a_drop_is_assigned_when_that_costs_less_than_leaving_it_unassigned() {
    // Expected at 20 mm; the insertion ends there, so that nothing else costs anything.
    let m = model(&[(20.0, 200.0, Some(2.0))]);
    let sd_mm = 1.2_f64.hypot(1.7).hypot(0.4);
    let taken = |at_mm: f64, size_n: f64, score: f64| {
        let actual = places(&m, 19.9, &[drop(at_mm, size_n, score)]);
        actual[0].is_finite().then(|| assert_all_close(&actual, &[at_mm])).is_some()
    };
    // A drop as large as the layer's force there, `off` standard deviations before: half of its square
    // against 0.075 of the squared score.
    for score in [5.0, 8.0, 12.0] {
        let off = (2.0 * (0.075_f64 * score * score).min(12.0)).sqrt();
        for side in [-1.0, 1.0] {
            let at = |off: f64| 20.0 + side * off * sd_mm;
            let whole = |mm: f64| 0.2 * (mm - 10.0);
            assert!(taken(at(off - 0.01), whole(at(off - 0.01)), score), "{score}");
            assert!(!taken(at(off + 0.01), whole(at(off + 0.01)), score), "{score}");
        }
    }
    // At most 12 nats.
    assert!(!taken(20.0 - 5.0 * sd_mm, 0.2, 100.0));
    // Larger or smaller by a factor: its logarithm in units of 0.6, at most four nats.
    for score in [5.0, 7.0] {
        let ratio = (0.6 * (0.15_f64 * score * score).sqrt()).exp();
        for (factor, within) in [(ratio * 0.99, true), (ratio * 1.01, false)] {
            assert_eq!(taken(20.0, 2.0 * factor, score), within, "{score}");
            assert_eq!(taken(20.0, 2.0 / factor, score), within, "{score}");
        }
    }
    assert!(taken(20.0, 2e-3, 7.5) && taken(20.0, 200.0, 7.5));
}

#[test]
fn a_drop_before_the_front_of_a_layer_is_not_assigned_to_it() {
    // Expected right behind its front at 10 mm: two standard deviations before the front is the earliest.
    let m = model(&[(20.0, 200.0, Some(0.02))]);
    let sd_mm = 1.2_f64.hypot(0.017).hypot(0.4);
    let taken = |at_mm: f64| places(&m, 10.05, &[drop(at_mm, 0.02, 9.0)])[0].is_finite();
    assert!(taken(10.0 - 1.95 * sd_mm) && !taken(10.0 - 2.05 * sd_mm));
}

#[test]
fn layers_rupture_in_order() {
    let m = model(&[(20.0, 200.0, Some(2.0)), (20.0, 200.0, Some(2.0))]);
    // At 20 and 40 mm.
    let (one, two) = (drop(20.4, 2.0, 15.0), drop(39.0, 2.0, 15.0));
    assert_all_close(&places(&m, 60.0, &[one, two]), &[20.4, 39.0]);
    // The order of the input does not matter.
    assert_all_close(&places(&m, 60.0, &[two, one]), &[20.4, 39.0]);
    // A single drop belongs to the nearer layer; the other one ruptures where expected.
    let actual = places(&m, 60.0, &[drop(37.0, 2.0, 15.0)]);
    assert!((actual[0] - 20.0).abs() < 0.25 && actual[1] == 37.0, "{actual:?}");
    // A layer does not rupture after the one behind it.
    let near = model(&[(20.0, 200.0, Some(3.0)), (20.0, 200.0, Some(0.2))]);
    // Expected at 25 and 31 mm; drops at 30 and 28 mm of any size.
    let actual = places(&near, 60.0, &[drop(28.0, 2.0, 30.0), drop(30.0, 2.0, 30.0)]);
    assert_all_close(&actual, &[28.0, 30.0]);
    // Behind a layer that did not rupture none does.
    assert_all_close(&places(&m, 19.0, &[drop(18.9, 1e-6, 0.1)]), &[NO_RUPTURE, NO_RUPTURE]);
}

/// Insertion at 10 mm/s to `to_mm`, a hold, retraction after 5 s.
fn there_and_back(to_mm: f64) -> BlockAverages {
    let there_s = (to_mm - 0.1) / 10.0;
    sampled(1800, |t| 1e-4 + 0.01 * (t.min(there_s) - (t - 5.0).max(0.0)), |_| 0.0)
}

#[test]
fn no_layer_ruptures_while_depths_are_revisited() {
    let m = model(&[(20.0, 200.0, Some(4.0))]);
    let of = |d: ForceDrop| {
        assign_one_recording(&expected_ruptures(&m, 1.0), &there_and_back(33.0), &[d], 0.01)[0]
    };
    // Expected at its far interface, 30 mm deep.
    let there = drop(29.0, 2.0, 30.0);
    let back = ForceDrop { time_s: 5.0 + 0.4, ..there };
    assert_eq!(of(there), there.time_s);
    assert_ne!(of(back), back.time_s);
}

#[test]
fn a_majority_of_recordings_determines_the_rupture_depth_of_the_others() {
    let m = model(&[(20.0, 200.0, Some(2.0))]);
    let all = [blocks(60.0), blocks(60.0), blocks(60.0)];
    let actual = |drops: [&[ForceDrop]; 3]| -> Vec<f64> {
        let drops: Vec<Vec<ForceDrop>> = drops.iter().map(|d| d.to_vec()).collect();
        assign_ruptures(&m, &all, &drops, 1.0, 0.01).iter().map(|t| 0.1 + 10.0 * t[0]).collect()
    };
    let (at, far) = (drop(22.5, 2.0, 30.0), drop(26.0, 2.0, 30.0));
    let near = |actual: f64| (actual - 22.5).abs() < 0.2;
    assert!(near(actual([&[at], &[at], &[]])[2]));
    // Half is not a majority.
    assert!(actual([&[at], &[far], &[]])[1] == 26.0);
}

#[test]
fn a_tissue_without_layers_has_no_rupture_times() {
    assert_all_close(&places(&model(&[]), 30.0, &[drop(20.0, 1.0, 9.0)]), &[]);
}
