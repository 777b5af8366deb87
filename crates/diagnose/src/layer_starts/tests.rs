use super::*;
use crate::test_fixtures::{assumed_layers, blocks_of, uniform_sequence};
use std::sync::Arc;
use stylet_identify::model::Assumptions;
use stylet_tissue::{ForceLaw, ForceLawState, Tissue};

/// Thickness (m), stiffness (N/m), friction (N s/m²), puncture force (N): the first layer ruptures before its face.
const LAYERS: [[f64; 4]; 3] = [[0.02, 100.0, 6e3, 1.5], [0.03, 40.0, 9e3, 0.8], [0.03, 70.0, 5e3, 1.4]];
const SURFACE_M: f64 = 0.004;

fn tissue() -> Tissue {
    let layer = |&[thickness_m, stiffness_n_per_m, friction_ns_per_m2, puncture_n]: &[f64; 4]| Layer {
        name: String::new(),
        thickness_m,
        stiffness_n_per_m,
        friction_ns_per_m2,
        puncture_n: Some(puncture_n),
    };
    Tissue { surface_m: SURFACE_M, layers: LAYERS.iter().map(layer).collect() }
}

/// Insertions at these speeds (m/s) with noise of 5 mN and a further force after each rupture, in the layer where it happened; assumed are
/// numbers that are wrong by factors of 3.
fn insertions(speeds: &[f64], remaining_n: f64) -> PreparedRecordings {
    let tissue = tissue();
    let law = ForceLaw::new(&tissue, &[]).expect("a law");
    let mut noise = uniform_sequence(5);
    let blocks = speeds.iter().map(|speed| {
        let mut state = ForceLawState::default();
        let (mut t, mut z, mut f) = (Vec::new(), Vec::new(), Vec::new());
        for k in 0..(0.077 / speed / 5e-3) as usize {
            // The speed changes, so that friction and stiffness are separable.
            let (at, rate) = (5e-3 * k as f64, 1.0 + 0.3 * (1.3 * 5e-3 * k as f64).sin());
            let place = speed * (at + 0.3 / 1.3 * (1.0 - (1.3 * at).cos()));
            let force_n = law.step(&mut state, at, place, speed * rate, |_| {}).total_n;
            let ruptured = (0..3).any(|l| {
                let broken_m = tissue.front_m(l) + LAYERS[l][3] / LAYERS[l][1];
                place > broken_m && place < tissue.front_m(l) + LAYERS[l][0]
            });
            t.push(at);
            z.push(place);
            f.push(force_n + f64::from(u8::from(ruptured)) * remaining_n + 0.017 * (noise() - 0.5));
        }
        blocks_of(t, z, f)
    });
    let mut assumed =
        Assumptions::clone(&assumed_layers(&LAYERS.map(|[d, k, b, _]| [3.0 * d, k / 3.0, 3.0 * b])));
    assumed.tissue.layers.iter_mut().zip(LAYERS).for_each(|(l, [.., f])| l.puncture_n = Some(3.0 * f));
    PreparedRecordings::new(Arc::new(assumed), blocks.collect(), 0.0)
}

fn off(found: f64, expected: f64) -> f64 {
    (found / expected - 1.0).abs()
}

#[test]
fn the_first_start_has_the_true_layers_whatever_was_assumed() {
    for remaining_n in [0.0, 0.4] {
        let prepared = insertions(&[4e-3, 9e-3], remaining_n);
        let starts = layer_starts(&prepared, SURFACE_M);
        let first = starts.first().expect("a start");
        for (found, [d, k, b, f]) in first.layers.iter().zip(LAYERS) {
            assert!(off(found.stiffness_n_per_m, k) < 0.1, "{remaining_n}: {found:?}");
            assert!(off(found.friction_ns_per_m2, b) < 0.35, "{remaining_n}: {found:?}");
            assert!(off(found.puncture_n.expect("a rupture"), f) < 0.1, "{remaining_n}: {found:?}");
            // The needle does not reach the back of the last layer.
            assert!(d == LAYERS[2][0] || off(found.thickness_m, d) < 0.15, "{remaining_n}: {found:?}");
        }
        assert!(first.rms_n < 0.05 * prepared.largest_force_n(), "{}", first.rms_n);
        assert!(starts.windows(2).all(|s| s[0].rms_n <= s[1].rms_n));
    }
}

/// The rupture of a layer is at its drop, or where the needle passes the position if the recording shows no drop there.
#[test]
fn rupture_times_are_those_of_the_drops() {
    let mut prepared = insertions(&[4e-3, 9e-3], 0.0);
    let crossing_s = prepared.drops[1].remove(1).time_s;
    let first = layer_starts(&prepared, SURFACE_M).swap_remove(0);
    let drop_times_s: Vec<f64> = prepared.drops[0].iter().map(|d| d.time_s).collect();
    assert!(first.rupture_times_s[0].iter().all(|t| drop_times_s.contains(t)), "{first:?}");
    let nearest = first.rupture_times_s[1].iter().map(|t| (t - crossing_s).abs()).fold(1.0, f64::min);
    assert!(nearest < 2.0 * ROW_S, "{nearest}");
}

#[test]
fn assignments_keep_the_order_and_a_layer_may_stay_whole() {
    assert_eq!(subsets(3, &[1, 2]).len(), 6);
    assert!(subsets(4, &[3]).iter().all(|s| s.windows(2).all(|k| k[0] < k[1])));
    let starts = layer_starts(&insertions(&[4e-3, 9e-3], 0.0), SURFACE_M);
    let ruptures = |s: &LayerStart| s.rupture_times_s[0].iter().filter(|t| t.is_finite()).count();
    assert!(starts.iter().any(|s| ruptures(s) == 2) && starts.iter().any(|s| ruptures(s) == 3));
    // More layers than the regression has columns for: no start.
    let mut prepared = insertions(&[4e-3], 0.0);
    let mut many = Assumptions::clone(&prepared.assumed);
    many.tissue.layers = vec![many.tissue.layers[0].clone(); MAX_LAYERS + 1];
    prepared.assumed = Arc::new(many);
    assert!(layer_starts(&prepared, SURFACE_M).is_empty());
}
