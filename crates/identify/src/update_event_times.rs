//! Moves rupture times by direct search: a derivative sees only the block in which a time lies.

use crate::likelihood::{FitData, ReplayCache};
use crate::model::{Model, NO_RUPTURE};
use rayon::prelude::*;

/// Trial moves in blocks, in either direction.
const MOVES_BLOCKS: [f64; 6] = [0.5, 1.0, 2.0, 4.0, 9.0, 20.0];
/// Smallest gain in nats for which a time is moved.
const MIN_GAIN_NATS: f64 = 1e-6;

/// Moves every rupture time to the best of its neighbourhood, of the law's own rupture time and of the given
/// force drops (s, per recording). Returns true when one moved.
pub fn update_event_times(model: &mut Model, data: &FitData, drops: &[Vec<f64>]) -> bool {
    let fixed = model.clone();
    let moved: Vec<(Vec<f64>, bool)> = (0..data.recording_count())
        .into_par_iter()
        .map(|r| {
            let none = Vec::new();
            update_one_recording(&fixed, data, r, drops.get(r).unwrap_or(&none))
        })
        .collect();
    let any = moved.iter().any(|m| m.1);
    model.rupture_times_s = moved.into_iter().map(|m| m.0).collect();
    any
}

fn update_one_recording(model: &Model, data: &FitData, r: usize, drops: &[f64]) -> (Vec<f64>, bool) {
    let mut instants = model.rupture_times_s[r].clone();
    let Some(mut trail) = ReplayCache::new(model, data, r) else { return (instants, false) };
    let b = &data.recordings[r];
    let block_s = b.sample_step_s * b.samples_per_block as f64;
    let (first, last) = b.span_s();
    let own = trail.free_rupture_times();
    let mut best = trail.nats_with_ruptures(model, data, r, &instants);
    let mut moved = false;
    // All rupture times of the law at once: an earlier one shifts the later ones.
    if own.iter().zip(&instants).any(|(a, b)| a != b) {
        let value = trail.nats_with_ruptures(model, data, r, &own);
        if value < best - MIN_GAIN_NATS {
            (best, moved) = (value, true);
            instants.clone_from(&own);
            trail.rebase(data, r, &instants);
        }
    }
    for layer in 0..instants.len() {
        let low = if layer > 0 { instants[layer - 1] } else { first };
        if low == NO_RUPTURE {
            break;
        }
        let high = instants.get(layer + 1).copied().unwrap_or(NO_RUPTURE).min(last);
        let now = instants[layer];
        let mut tried: Vec<f64> = drops.to_vec();
        tried.push(own[layer]);
        if now < NO_RUPTURE {
            tried.extend(MOVES_BLOCKS.iter().flat_map(|m| [now - m * block_s, now + m * block_s]));
        }
        if layer + 1 == instants.len() || instants[layer + 1] == NO_RUPTURE {
            tried.push(NO_RUPTURE);
        }
        for t in tried {
            if (t < low || t > high) && t != NO_RUPTURE || t == instants[layer] {
                continue;
            }
            let was = std::mem::replace(&mut instants[layer], t);
            let value = trail.nats_with_ruptures(model, data, r, &instants);
            if value < best - MIN_GAIN_NATS {
                (best, moved) = (value, true);
                trail.rebase(data, r, &instants);
            } else {
                instants[layer] = was;
            }
        }
    }
    (instants, moved)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::block_averages::{BLOCK_S, BlockAverages};
    use crate::likelihood::replay;
    use crate::model::Assumptions;
    use crate::noise::Noise;
    use std::sync::Arc;
    use stylet_record::Recording;
    use stylet_tissue::{Layer, Tissue};

    /// Three layers of 15 mm, 100 N/m each; insertion at 5 mm/s.
    fn model(puncture: [f64; 3]) -> Model {
        let layer = |k: usize| Layer {
            thickness_m: 0.015,
            stiffness_n_per_m: 100.0,
            friction_ns_per_m2: 2000.0,
            puncture_n: Some(puncture[k]),
            name: String::new(),
        };
        let belief = Assumptions {
            tissue: Tissue { surface_m: 0.005, layers: (0..3).map(layer).collect() },
            known_effects: Vec::new(),
            tolerance: vec![0.3; 3],
            thickness_tolerance: vec![0.1; 3],
            surface_tolerance_m: 0.002,
        };
        Model::base(Arc::new(belief), 1)
    }

    /// Data simulated with ruptures at these times, up to `to_s` seconds.
    fn data(model: &Model, instants: &[f64], to_s: f64) -> FitData {
        let n = (to_s * 200.0).round() as usize;
        let t: Vec<f64> = (0..n).map(|k| k as f64 * 0.005).collect();
        let z = t.iter().map(|t| 0.005 * t).collect();
        let r = Recording::new(t, z, vec![0.0; n]).expect("a recording");
        let mut blocks = BlockAverages::new(&r, &[], BLOCK_S);
        let silent = FitData::new(Arc::new(vec![blocks.clone()]), Noise::white(0.01), 0.0);
        let truth = Model { rupture_times_s: vec![instants.to_vec()], ..model.clone() };
        blocks.force_n = replay(&truth, &silent, 0).expect("a replay").force_n;
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
                    let (told, any) = moved(&m, &truth, &from, &[], 11.0);
                    assert!(any);
                    for (told, truth) in told.iter().zip(truth) {
                        assert!((told - truth).abs() < 1e-9, "{blocks} {layer}: {told} for {truth}");
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
        let (told, any) = moved(&m, &truth, &from, &[6.017, 7.7], 11.0);
        assert!(any && told == truth, "{told:?}");
        assert_ne!(moved(&m, &truth, &from, &[], 11.0).0, truth);
    }

    #[test]
    fn all_ruptures_of_the_law_are_tried_together() {
        // By force each layer ruptures 10 mm behind its front: an earlier rupture delays the later ones.
        let m = model([1.0; 3]);
        let own = {
            let silent = data(&m, &[NO_RUPTURE; 3], 11.0);
            ReplayCache::new(&m, &silent, 0).expect("a trail").free_rupture_times()
        };
        assert!(own.iter().all(|t| *t < 11.0), "{own:?}");
        let from: Vec<f64> = own.iter().map(|t| t - 1.3).collect();
        let (told, any) = moved(&m, &own, &from, &[], 11.0);
        assert!(any && told == own, "{told:?} for {own:?}");
    }

    #[test]
    fn ruptures_can_appear_and_disappear() {
        let m = model([1.3, 1.3, 100.0]);
        // The last layer: at a force drop.
        let truth = [3.013, 6.017, 8.551];
        let (told, any) = moved(&m, &truth, &[3.013, 6.017, NO_RUPTURE], &[8.551], 9.5);
        assert!(any && told == truth, "{told:?}");
        // Without a drop it did not rupture.
        let never = [3.013, 6.017, NO_RUPTURE];
        let (told, any) = moved(&m, &never, &[3.013, 6.017, 9.1], &[], 9.5);
        assert!(any && told == never, "{told:?}");
        // A layer before a ruptured one has ruptured.
        let (told, _) = moved(&m, &never, &[3.1, NO_RUPTURE, NO_RUPTURE], &[6.017, 3.013], 9.5);
        assert_eq!(told, never);
        let (told, _) = moved(&m, &[NO_RUPTURE; 3], &[NO_RUPTURE; 3], &[], 2.5);
        assert_eq!(told, [NO_RUPTURE; 3]);
    }

    #[test]
    fn rupture_times_stay_ordered_and_inside_the_recording() {
        let m = model([1.3; 3]);
        let truth = [3.013, 6.017, 8.551];
        // Drops tried for every layer, most out of order, some outside the recording.
        let drops: Vec<f64> = (-10..=130).map(|k| 0.1 * f64::from(k)).collect();
        for from in [[5.0, 5.01, 5.02], [1.0, 9.0, 9.1], [0.1, 0.2, 10.0], [3.0, 3.0, 3.0]] {
            let (told, _) = moved(&m, &truth, &from, &drops, 11.0);
            assert!(told[0] <= told[1] && told[1] <= told[2], "{told:?}");
            assert!(told.iter().all(|t| *t == NO_RUPTURE || (-0.0025..=11.0).contains(t)), "{told:?}");
        }
    }

    #[test]
    fn each_recording_uses_its_own_drops() {
        let mut m = model([1.3; 3]);
        m.scatter.rupture_force = 0.3;
        m.scatter.rupture_depth_m = 5e-3;
        let (one, two) = ([3.013, 6.017, 8.551], [3.113, 6.317, 8.951]);
        let blocks =
            vec![data(&m, &one, 11.0).recordings[0].clone(), data(&m, &two, 11.0).recordings[0].clone()];
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
}
