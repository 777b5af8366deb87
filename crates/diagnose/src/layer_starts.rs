//! Start values of the layers for each way of assigning force drops to them.
//!
//! Given faces and ruptures, the base law is linear in stiffness and friction. The most significant drops are assigned to the layers in
//! every order-preserving way; for each way the faces are searched on a grid and the rest is fitted by non-negative least squares. A
//! constant force after each rupture is fitted too, so that a cutting force or an incomplete release does not shift the faces.

use crate::base_law_fit::PreparedRecordings;
use stylet_identify::block_averages::BlockAverages;
use stylet_identify::force_drops::ForceDrop;
use stylet_identify::model::NO_RUPTURE;
use stylet_identify::rupture_assignment::RETRACED_M;
use stylet_stats::least_squares::NormalEquations;
use stylet_stats::parallel::*;
use stylet_tissue::Layer;

/// Drops of different recordings closer than this (m) are the same.
const SAME_DROP_M: f64 = 1.5e-3;
/// Largest number of drops that are assigned, the most significant ones.
const MAX_DROPS: usize = 7;
/// Largest number of layers; with more there are no starts.
const MAX_LAYERS: usize = 6;
/// Grid points of a face between two ruptures.
const FACE_STEPS: usize = 8;
/// Rounds of the search for the faces; the grid is halved in each.
const FACE_ROUNDS: usize = 3;
/// Seconds that are averaged into one row of the regression.
const ROW_S: f64 = 0.1;

/// Layers with start values, and the rupture times that they are fitted to.
#[derive(Clone, Debug)]
pub(crate) struct LayerStart {
    /// The layers.
    pub layers: Vec<Layer>,
    /// Rupture times (s) of the layers in each recording.
    pub rupture_times_s: Vec<Vec<f64>>,
    /// RMS residual (N) of the regression.
    pub rms_n: f64,
}

/// Starts for a surface position in m, the one with the smallest residual first.
pub(crate) fn layer_starts(prepared: &PreparedRecordings, surface_m: f64) -> Vec<LayerStart> {
    let assumed = &prepared.assumed.tissue.layers;
    let count = assumed.len();
    let tables: Vec<Table> =
        prepared.blocks.iter().zip(&prepared.drops).map(|(b, d)| Table::new(b, d)).collect();
    let drops = places_of_drops(&tables, surface_m);
    if count > MAX_LAYERS {
        return Vec::new();
    }
    let chosen = subsets(drops.len(), &[count.saturating_sub(1), count]);
    let mut starts: Vec<LayerStart> = chosen
        .par_iter()
        .filter_map(|chosen| {
            let ruptures_m: Vec<f64> = chosen.iter().map(|k| drops[*k]).collect();
            start_for(&tables, assumed, surface_m, &ruptures_m)
        })
        .collect();
    starts.sort_by(|a, b| a.rms_n.total_cmp(&b.rms_n));
    starts
}

/// One row per interval of a recording: time, position, velocity, force.
struct Table {
    rows: Vec<[f64; 4]>,
    drops: Vec<ForceDrop>,
    deepest_m: f64,
}

impl Table {
    fn new(blocks: &BlockAverages, drops: &[ForceDrop]) -> Self {
        let block_s = blocks.block_s();
        let b = blocks.coarsened(((ROW_S / block_s).round() as usize).max(1));
        let at = |k: usize| {
            let time_s = b.mid_s(k);
            let (position_m, velocity_mps) = b.motion.at(time_s);
            [time_s, position_m, velocity_mps, b.force_n[k]]
        };
        let rows: Vec<[f64; 4]> = (0..b.len()).filter(|k| b.used[*k]).map(at).collect();
        let mut deepest_m = f64::NEG_INFINITY;
        let mut drops = drops.iter().copied().peekable();
        let mut new_ground = Vec::new();
        for row in &rows {
            while let Some(drop) = drops.next_if(|d| d.time_s <= row[0]) {
                if drop.position_m > deepest_m - RETRACED_M {
                    new_ground.push(drop);
                }
            }
            deepest_m = deepest_m.max(row[1]);
        }
        Self { rows, drops: new_ground, deepest_m }
    }

    /// Time (s) of the rupture at a position.
    fn rupture_time_s(&self, position_m: f64) -> f64 {
        let off = |d: &&ForceDrop| (d.position_m - position_m).abs();
        let nearest = self.drops.iter().min_by(|a, b| off(a).total_cmp(&off(b)));
        match nearest.filter(|d| off(d) < SAME_DROP_M) {
            Some(drop) => drop.time_s,
            None => self.rows.iter().find(|r| r[1] >= position_m).map_or(NO_RUPTURE, |r| r[0]),
        }
    }
}

/// Positions (m) of the most significant drops behind the surface, in ascending order; drops of several recordings at the same place count
/// as one.
fn places_of_drops(tables: &[Table], surface_m: f64) -> Vec<f64> {
    let mut left: Vec<Vec<ForceDrop>> = tables
        .iter()
        .map(|t| t.drops.iter().copied().filter(|d| d.position_m > surface_m).collect())
        .collect();
    let mut groups: Vec<(f64, f64)> = Vec::new();
    while let Some(first) = left.iter().flatten().copied().max_by(|a, b| a.score.total_cmp(&b.score)) {
        let (mut count, mut sum_m, mut score) = (0.0, 0.0, 0.0);
        for drops in &mut left {
            let (same, other): (Vec<ForceDrop>, Vec<ForceDrop>) =
                drops.iter().partition(|d| (d.position_m - first.position_m).abs() < SAME_DROP_M);
            if let Some(d) = same.iter().max_by(|a, b| a.score.total_cmp(&b.score)) {
                count += 1.0;
                sum_m += d.position_m;
                score += d.score;
            }
            *drops = other;
        }
        groups.push((sum_m / count, score));
    }
    groups.sort_by(|a, b| b.1.total_cmp(&a.1));
    groups.truncate(MAX_DROPS);
    let mut positions: Vec<f64> = groups.into_iter().map(|g| g.0).collect();
    positions.sort_by(f64::total_cmp);
    positions
}

/// All subsets of `0..n` with one of the given sizes, in ascending order.
fn subsets(n: usize, sizes: &[usize]) -> Vec<Vec<usize>> {
    let with = |mask: u32| (0..n).filter(|k| mask >> k & 1 == 1).collect::<Vec<usize>>();
    (0..1_u32 << n).map(with).filter(|s| sizes.contains(&s.len())).collect()
}

/// The start in which the first layers rupture at these positions (m).
fn start_for(tables: &[Table], assumed: &[Layer], surface_m: f64, ruptures_m: &[f64]) -> Option<LayerStart> {
    let count = assumed.len();
    let deepest_m = tables.iter().map(|t| t.deepest_m).fold(f64::NEG_INFINITY, f64::max);
    let times_s: Vec<Vec<f64>> = tables
        .iter()
        .map(|t| (0..count).map(|l| ruptures_m.get(l).map_or(NO_RUPTURE, |m| t.rupture_time_s(*m))).collect())
        .collect();
    // Faces: surface, interfaces, back. A face lies between the rupture before it and the next one.
    let mut faces_m = vec![surface_m];
    faces_m.extend((0..count).map(|l| ruptures_m.get(l).copied().unwrap_or(deepest_m)));
    let spans: Vec<(f64, f64)> = (0..count)
        .map(|l| {
            let from = faces_m[l + 1];
            let to = ruptures_m.get(l + 1).copied().unwrap_or(deepest_m);
            if assumed[l].puncture_n.is_some() { (from, to.max(from)) } else { (from, from) }
        })
        .collect();
    let mut best = regress(tables, &times_s, &faces_m)?;
    for round in 0..FACE_ROUNDS {
        for l in 0..count {
            let (from, to) = spans[l];
            let middle = faces_m[l + 1];
            let step = (to - from) / FACE_STEPS as f64 / f64::from(1_u32 << round);
            let grid = |k: usize| {
                let k = k as f64;
                if round == 0 { from + k * step } else { middle + (k - 0.5 * FACE_STEPS as f64) * step }
            };
            for at in (0..FACE_STEPS).map(grid).filter(|at| *at >= from && *at < to) {
                let mut moved = faces_m.clone();
                moved[l + 1] = at;
                if let Some(other) = regress(tables, &times_s, &moved).filter(|o| o.1 < best.1) {
                    (best, faces_m) = (other, moved);
                }
            }
        }
    }
    let (x, rms_n) = best;
    let layers = (0..count)
        .map(|l| {
            let depth_m = faces_m[l + 1] - faces_m[l];
            let rupture_m = ruptures_m.get(l);
            Layer {
                stiffness_n_per_m: x[l],
                friction_ns_per_m2: x[count + l],
                thickness_m: if rupture_m.is_some() { depth_m } else { assumed[l].thickness_m.max(depth_m) },
                puncture_n: assumed[l]
                    .puncture_n
                    .map(|assumed_n| rupture_m.map_or(assumed_n, |m| x[l] * (m - faces_m[l]))),
                ..assumed[l].clone()
            }
        })
        .collect();
    Some(LayerStart { layers, rupture_times_s: times_s, rms_n })
}

/// Non-negative stiffness of all layers, their friction, the forces (N) that stay after their ruptures; and the RMS residual in N.
fn regress(tables: &[Table], times_s: &[Vec<f64>], faces_m: &[f64]) -> Option<(Vec<f64>, f64)> {
    let count = faces_m.len() - 1;
    let mut sums = NormalEquations::<{ 3 * MAX_LAYERS }>::new(3 * count);
    let (mut yy, mut n) = (0.0, 0.0);
    for (table, times_s) in tables.iter().zip(times_s) {
        for [time_s, position_m, velocity_mps, force_n] in &table.rows {
            let mut row = [0.0; 3 * MAX_LAYERS];
            for l in 0..count {
                let depth_m = position_m - faces_m[l];
                let inside_m = depth_m.clamp(0.0, (faces_m[l + 1] - faces_m[l]).max(0.0));
                row[count + l] = inside_m * velocity_mps;
                if depth_m > 0.0 && inside_m == depth_m && *time_s < times_s[l] {
                    row[l] = depth_m;
                }
                if depth_m > 0.0 && inside_m == depth_m && *time_s > times_s[l] {
                    row[2 * count + l] = 1.0;
                }
            }
            sums.add(&row, *force_n);
            yy += force_n * force_n;
            n += 1.0;
        }
    }
    let (all, moments) = (sums.matrix(), sums.moments());
    let mut kept: Vec<usize> = (0..3 * count).collect();
    loop {
        let right: Vec<f64> = kept.iter().map(|k| moments[*k]).collect();
        let x = all.submatrix(&kept).cholesky().solve(&right);
        let lowest = (0..kept.len()).min_by(|a, b| x[*a].total_cmp(&x[*b]))?;
        if x[lowest] < 0.0 {
            kept.remove(lowest);
            continue;
        }
        let explained: f64 = x.iter().zip(&right).map(|(x, m)| x * m).sum();
        let mut full = vec![0.0; 3 * count];
        kept.iter().zip(&x).for_each(|(k, x)| full[*k] = *x);
        return Some((full, ((yy - explained).max(0.0) / f64::max(n, 1.0)).sqrt()));
    }
}

#[cfg(test)]
mod tests;
