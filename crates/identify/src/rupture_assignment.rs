//! Assigns force drops to layers: the cheapest assignment in layer order, by dynamic programming.
//!
//! A layer is expected to rupture where its force or its far interface says, within the assumed tolerances.
//! Without a drop, the law's own rupture position is used at the cost of the drop that should have been
//! visible.

use crate::block_averages::BlockAverages;
use crate::force_drops::ForceDrop;
use crate::model::{Model, NO_RUPTURE};

/// Cost of an unassigned drop as a share of its nats, up to [`MAX_PENALTY_NATS`].
const UNASSIGNED_SHARE: f64 = 0.15;
/// Largest cost in nats of a drop without a layer, or of a layer without a drop.
const MAX_PENALTY_NATS: f64 = 12.0;
/// Standard deviation of the logarithm of a drop's size.
const LN_SIZE_SD: f64 = 0.6;
/// A layer passed by this many standard deviations must have ruptured.
const PASSED_SD: f64 = 2.5;

/// Recordings agree on a rupture position within this distance (m).
const AGREEMENT_M: f64 = 1e-3;
/// No layer ruptures where the needle is further back than it has been by this distance (m).
const RETRACED_M: f64 = 1e-3;
/// Expected rupture of a layer.
#[derive(Clone, Copy, Debug, PartialEq)]
struct ExpectedRupture {
    front_m: f64,
    position_m: f64,
    sd_m: f64,
    stiffness_n_per_m: f64,
}

/// Expected ruptures; `trust` scales the assumed tolerances.
fn expected_ruptures(model: &Model, trust: f64) -> Vec<ExpectedRupture> {
    let b = &model.assumed;
    let mut front = model.tissue.surface_m;
    let mut variance = (0.6 * b.surface_tolerance_m).powi(2);
    let mut out = Vec::new();
    for (l, layer) in model.tissue.layers.iter().enumerate() {
        let thickness_sd = 0.6 * b.thickness_tolerance[l] * layer.thickness_m;
        let by_face = front + layer.thickness_m;
        let face_sd = (variance + thickness_sd * thickness_sd).sqrt();
        let stretch = layer.puncture_n.map_or(f64::INFINITY, |f| f / layer.stiffness_n_per_m.max(1e-9));
        let stretch_sd = 0.85 * b.tolerance[l] * stretch;
        let (place_m, sd) = if front + stretch < by_face {
            (front + stretch, (variance + stretch_sd * stretch_sd).sqrt())
        } else if stretch.is_finite() {
            // Either condition may come first.
            (by_face, face_sd.hypot(0.3 * stretch_sd))
        } else {
            (by_face, face_sd)
        };
        out.push(ExpectedRupture {
            front_m: front,
            position_m: place_m,
            sd_m: (trust * sd).hypot(2e-4 + 0.01 * layer.thickness_m),
            stiffness_n_per_m: layer.stiffness_n_per_m,
        });
        front = by_face;
        variance += thickness_sd * thickness_sd;
    }
    out
}

/// Rupture times (s) of all layers in several recordings. Where most recordings agree on a layer's rupture
/// position, it ruptures there in the others too, with or without a visible drop.
#[must_use]
pub fn assign_ruptures(
    model: &Model,
    blocks: &[BlockAverages],
    drops: &[Vec<ForceDrop>],
    trust: f64,
    noise_n: f64,
) -> Vec<Vec<f64>> {
    let layers = expected_ruptures(model, trust);
    let given = |layers: &[ExpectedRupture]| -> Vec<Vec<f64>> {
        blocks.iter().zip(drops).map(|(b, d)| assign_one_recording(layers, b, d, noise_n)).collect()
    };
    let first = given(&layers);
    let at =
        |r: usize, l: usize| first[r].get(l).filter(|t| t.is_finite()).map(|t| blocks[r].motion.at(*t).0);
    let mut agreed = layers.clone();
    for (l, layer) in agreed.iter_mut().enumerate() {
        let places: Vec<f64> = (0..blocks.len()).filter_map(|r| at(r, l)).collect();
        if places.is_empty() {
            continue;
        }
        let middle = stylet_stats::order_statistics::median(&mut places.clone());
        let near = places.iter().filter(|z| (**z - middle).abs() < AGREEMENT_M).count();
        if near > 1 && 2 * near > blocks.len() && near < blocks.len() {
            (layer.position_m, layer.sd_m) = (middle, AGREEMENT_M);
        }
    }
    if agreed == layers { first } else { given(&agreed) }
}

/// Rupture times (s) of all layers in one recording.
fn assign_one_recording(
    layers: &[ExpectedRupture],
    b: &BlockAverages,
    drops: &[ForceDrop],
    noise_n: f64,
) -> Vec<f64> {
    let z: Vec<f64> = (0..b.len()).map(|k| b.motion.at(0.5 * (b.start_s[k] + b.end_s[k])).0).collect();
    let deepest = z.iter().fold(f64::NEG_INFINITY, |m, z| m.max(*z));
    let crossing = |place: f64| {
        z.iter().position(|z| *z >= place).map_or(NO_RUPTURE, |k| 0.5 * (b.start_s[k] + b.end_s[k]))
    };
    let mut so_far = f64::NEG_INFINITY;
    let reached: Vec<f64> = z
        .iter()
        .map(|z| {
            so_far = so_far.max(*z);
            so_far
        })
        .collect();
    let new_ground =
        |d: &&ForceDrop| reached.get(b.block_at(d.time_s)).is_none_or(|r| d.position_m > r - RETRACED_M);
    let drops: Vec<ForceDrop> = drops.iter().filter(new_ground).copied().collect();
    // Candidates per layer: time and cost; assigning a drop saves its cost as unassigned.
    let spare = |d: &ForceDrop| (UNASSIGNED_SHARE * 0.5 * d.score * d.score).min(MAX_PENALTY_NATS);
    let candidates: Vec<Vec<(f64, f64)>> = layers
        .iter()
        .map(|l| {
            let mut c: Vec<(f64, f64)> = drops
                .iter()
                .filter(|d| d.position_m > l.front_m - 2.0 * l.sd_m)
                .map(|d| {
                    let off = (d.position_m - l.position_m) / l.sd_m;
                    let size = l.stiffness_n_per_m * (d.position_m - l.front_m).max(1e-4);
                    let ratio = libm::log(d.size_n.max(1e-6) / size.max(1e-6)) / LN_SIZE_SD;
                    (d.time_s, 0.5 * off * off + (0.5 * ratio * ratio).min(4.0) - spare(d))
                })
                .collect();
            let seen = l.stiffness_n_per_m * (l.position_m - l.front_m) / noise_n.max(1e-9);
            if deepest >= l.position_m {
                c.push((crossing(l.position_m), (0.02 * seen * seen).min(MAX_PENALTY_NATS)));
            }
            let beyond = ((deepest - l.position_m) / l.sd_m - PASSED_SD).max(0.0);
            c.push((NO_RUPTURE, 0.5 * beyond * beyond + if beyond > 0.0 { 2.0 } else { 0.0 }));
            c
        })
        .collect();
    // Cheapest sequence of increasing times.
    let mut cost: Vec<Vec<(f64, usize)>> = Vec::new();
    for (l, own) in candidates.iter().enumerate() {
        let row = own
            .iter()
            .map(|(t, c)| {
                if l == 0 {
                    return (*c, 0);
                }
                let before = candidates[l - 1].iter().zip(&cost[l - 1]).enumerate();
                let allowed =
                    before.filter(|(_, (p, _))| p.0 < *t || (p.0 == NO_RUPTURE && *t == NO_RUPTURE));
                allowed
                    .map(|(k, (_, best))| (best.0 + c, k))
                    .min_by(|a, b| a.0.total_cmp(&b.0))
                    .unwrap_or((f64::INFINITY, 0))
            })
            .collect();
        cost.push(row);
    }
    let mut out = vec![NO_RUPTURE; layers.len()];
    let mut at = cost
        .last()
        .map_or(0, |row| (0..row.len()).min_by(|a, b| row[*a].0.total_cmp(&row[*b].0)).unwrap_or(0));
    for l in (0..layers.len()).rev() {
        if !cost[l][at].0.is_finite() {
            break;
        }
        out[l] = candidates[l][at].0;
        at = cost[l][at].1;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::block_averages::BLOCK_S;
    use crate::model::Assumptions;
    use std::sync::Arc;
    use stylet_record::Recording;
    use stylet_tissue::{Layer, Tissue};

    /// Layers by thickness (mm), stiffness (N/m) and puncture force (N), starting at 10 mm; tolerances of a
    /// fifth and a tenth.
    fn model(layers: &[(f64, f64, Option<f64>)]) -> Model {
        let layer = |&(thick_mm, stiffness_n_per_m, puncture_n): &(f64, f64, Option<f64>)| Layer {
            thickness_m: thick_mm * 1e-3,
            stiffness_n_per_m,
            friction_ns_per_m2: 4000.0,
            puncture_n,
            name: String::new(),
        };
        let belief = Assumptions {
            tissue: Tissue { surface_m: 0.01, layers: layers.iter().map(layer).collect() },
            known_effects: Vec::new(),
            tolerance: vec![0.2; layers.len()],
            thickness_tolerance: vec![0.1; layers.len()],
            surface_tolerance_m: 0.002,
        };
        Model::base(Arc::new(belief), 1)
    }

    /// Insertion at 10 mm/s from 0.1 mm to `to_mm`.
    fn blocks(to_mm: f64) -> BlockAverages {
        let n = (to_mm / 10.0 * 200.0).round() as usize + 1;
        let t: Vec<f64> = (0..n).map(|k| k as f64 * 0.005).collect();
        let z = t.iter().map(|t| 0.0001 + 0.01 * t).collect();
        BlockAverages::new(&Recording::new(t, z, vec![0.0; n]).expect("a recording"), &[], BLOCK_S)
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

    fn are(told: &[f64], wanted: &[f64]) {
        let near = |(a, b): (&f64, &f64)| a == b || (a - b).abs() < 1e-9;
        assert!(told.len() == wanted.len() && told.iter().zip(wanted).all(near), "{told:?} for {wanted:?}");
    }

    #[test]
    fn expected_rupture_is_by_force_or_at_the_far_interface() {
        let m = model(&[(20.0, 200.0, Some(2.0)), (10.0, 100.0, Some(3.0)), (30.0, 50.0, None)]);
        let told = expected_ruptures(&m, 0.5);
        // 0.6 times the assumed tolerances in mm: the surface, each thickness.
        let (surface, first, second, third) = (0.6 * 2.0_f64, 0.6 * 2.0_f64, 0.6 * 1.0_f64, 0.6 * 3.0_f64);
        let own = |sd_mm: f64, thick_mm: f64| 1e-3 * (0.5 * sd_mm).hypot(0.2 + 0.01 * thick_mm);
        let wanted = [
            // 2 N at 200 N/m are 10 mm, known to 17 %.
            (10.0, 20.0, own(surface.hypot(0.17 * 10.0), 20.0), 200.0),
            // 3 N at 100 N/m are 30 mm: the interface may come first.
            (30.0, 40.0, own(surface.hypot(first).hypot(second).hypot(0.3 * 0.17 * 30.0), 10.0), 100.0),
            (40.0, 70.0, own(surface.hypot(first).hypot(second).hypot(third), 30.0), 50.0),
        ];
        for (told, (front_mm, place_mm, sd_m, stiffness)) in told.iter().zip(wanted) {
            assert!((told.front_m - 1e-3 * front_mm).abs() < 1e-12, "{told:?}");
            assert!((told.position_m - 1e-3 * place_mm).abs() < 1e-12, "{told:?}");
            assert!((told.sd_m - sd_m).abs() < 1e-12, "{told:?} for {sd_m}");
            assert_eq!(told.stiffness_n_per_m, stiffness);
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
        are(&places(&m, 60.0, &[]), &[first(20.0), first(50.0)]);
        are(&places(&m, 49.0, &[]), &[first(20.0), NO_RUPTURE]);
        are(&places(&m, 19.0, &[]), &[NO_RUPTURE, NO_RUPTURE]);
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
            let told = places(&m, 19.9, &[drop(at_mm, size_n, score)]);
            told[0].is_finite().then(|| are(&told, &[at_mm])).is_some()
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
        are(&places(&m, 60.0, &[one, two]), &[20.4, 39.0]);
        // The order of the input does not matter.
        are(&places(&m, 60.0, &[two, one]), &[20.4, 39.0]);
        // A single drop belongs to the nearer layer; the other one ruptures where expected.
        let told = places(&m, 60.0, &[drop(37.0, 2.0, 15.0)]);
        assert!((told[0] - 20.0).abs() < 0.25 && told[1] == 37.0, "{told:?}");
        // A layer does not rupture after the one behind it.
        let near = model(&[(20.0, 200.0, Some(3.0)), (20.0, 200.0, Some(0.2))]);
        // Expected at 25 and 31 mm; drops at 30 and 28 mm of any size.
        let told = places(&near, 60.0, &[drop(28.0, 2.0, 30.0), drop(30.0, 2.0, 30.0)]);
        are(&told, &[28.0, 30.0]);
        // Behind a layer that did not rupture none does.
        are(&places(&m, 19.0, &[drop(18.9, 1e-6, 0.1)]), &[NO_RUPTURE, NO_RUPTURE]);
    }

    /// Insertion at 10 mm/s to `to_mm`, a hold, retraction after 5 s.
    fn there_and_back(to_mm: f64) -> BlockAverages {
        let there_s = (to_mm - 0.1) / 10.0;
        let t: Vec<f64> = (0..1800).map(|k| f64::from(k) * 0.005).collect();
        let z = t.iter().map(|t| 1e-4 + 0.01 * (t.min(there_s) - (t - 5.0).max(0.0))).collect();
        BlockAverages::new(&Recording::new(t, z, vec![0.0; 1800]).expect("a recording"), &[], BLOCK_S)
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
        let told = |drops: [&[ForceDrop]; 3]| -> Vec<f64> {
            let drops: Vec<Vec<ForceDrop>> = drops.iter().map(|d| d.to_vec()).collect();
            assign_ruptures(&m, &all, &drops, 1.0, 0.01).iter().map(|t| 0.1 + 10.0 * t[0]).collect()
        };
        let (at, far) = (drop(22.5, 2.0, 30.0), drop(26.0, 2.0, 30.0));
        let near = |told: f64| (told - 22.5).abs() < 0.2;
        assert!(near(told([&[at], &[at], &[]])[2]));
        // Half is not a majority.
        assert!(told([&[at], &[far], &[]])[1] == 26.0);
    }

    #[test]
    fn a_tissue_without_layers_has_no_rupture_times() {
        are(&places(&model(&[]), 30.0, &[drop(20.0, 1.0, 9.0)]), &[]);
    }
}
