//! Assigns detected force drops to layers: the assignment with the lowest cost in layer order, by dynamic programming.
//!
//! A layer is expected to rupture at its puncture force or at its far interface, within the assumed tolerances. A layer without a drop
//! ruptures at its expected position, at a cost that grows with the size of the missing drop.

use crate::block_averages::BlockAverages;
use crate::force_drops::ForceDrop;
use crate::model::{Model, NO_RUPTURE};

/// Cost of an unassigned drop as a share of its significance (half its squared score, nats), up to [`MAX_PENALTY_NATS`].
const UNASSIGNED_SHARE: f64 = 0.15;
/// Largest cost (nats) of a drop without a layer, or of a layer without a drop.
const MAX_PENALTY_NATS: f64 = 12.0;
/// Standard deviation of the logarithm of a drop's size about the expected elastic force.
const LN_SIZE_SD: f64 = 0.6;
/// A layer that is passed by more than this many standard deviations without a rupture is penalised.
const PASSED_SD: f64 = 2.5;

/// Distance (m) within which recordings agree on a rupture position.
const AGREEMENT_M: f64 = 1e-3;
/// Drops further behind the deepest position so far than this distance (m) are not assigned.
pub const RETRACED_M: f64 = 1e-3;
/// Expected rupture of a layer: position of its front and of the rupture, standard deviation, stiffness.
#[derive(Clone, Copy, Debug, PartialEq)]
struct ExpectedRupture {
    front_m: f64,
    position_m: f64,
    sd_m: f64,
    stiffness_n_per_m: f64,
}

/// Expected ruptures of all layers; `trust` scales the assumed tolerances.
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
            // The puncture force may be reached before the interface.
            (by_face, libm::hypot(face_sd, 0.3 * stretch_sd))
        } else {
            (by_face, face_sd)
        };
        out.push(ExpectedRupture {
            front_m: front,
            position_m: place_m,
            sd_m: libm::hypot(trust * sd, 2e-4 + 0.01 * layer.thickness_m),
            stiffness_n_per_m: layer.stiffness_n_per_m,
        });
        front = by_face;
        variance += thickness_sd * thickness_sd;
    }
    out
}

/// Rupture times (s) of all layers in all recordings. If most recordings agree on a layer's rupture position, that position becomes the
/// expectation for all of them.
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
    let z: Vec<f64> = (0..b.len()).map(|k| b.motion.at(b.mid_s(k)).0).collect();
    let deepest = z.iter().fold(f64::NEG_INFINITY, |m, z| m.max(*z));
    let crossing = |place: f64| z.iter().position(|z| *z >= place).map_or(NO_RUPTURE, |k| b.mid_s(k));
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
    // Candidates per layer: time and cost (nats); an assigned drop saves its cost as unassigned.
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
            let score = l.stiffness_n_per_m * (l.position_m - l.front_m) / noise_n.max(1e-9);
            if deepest >= l.position_m {
                c.push((crossing(l.position_m), (0.02 * score * score).min(MAX_PENALTY_NATS)));
            }
            let beyond = ((deepest - l.position_m) / l.sd_m - PASSED_SD).max(0.0);
            c.push((NO_RUPTURE, 0.5 * beyond * beyond + if beyond > 0.0 { 2.0 } else { 0.0 }));
            c
        })
        .collect();
    // Cheapest sequence of increasing times.
    let mut cost: Vec<Vec<(f64, usize)>> = Vec::new();
    for (l, of_layer) in candidates.iter().enumerate() {
        let row = of_layer
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
mod tests;
