//! Where the layers ruptured in the data: law-guided segmentation, then the edge of each drop.
//!
//! With the base law and the number of ruptured layers per sample as hidden state, the best monotone
//! path through the states minimises a robust misfit (Viterbi); coefficients and path are improved in
//! turn. The instant is then the place near the path's change where two straight lines with a step
//! between them fit the force less its friction best.

use crate::fit::{rho, solve};
use crate::model::Model;
use crate::track::{NEVER, Track};
use stylet_tissue::{Slab, Tissue};

/// No sample.
const NONE: usize = usize::MAX;

/// Samples per second of the first pass.
const COARSE_HZ: f64 = 50.0;

/// Where the layers ruptured in the data.
#[derive(Clone, Debug, Default)]
pub struct Found {
    /// Instants (s) per recording and layer.
    pub instants: Vec<Vec<f64>>,
    /// How far (s) each may be moved at a time: infinitely, but for those at clear drops.
    pub reach: Vec<Vec<f64>>,
    /// Per recording the instants (s) of drops that no rupture took, and whether they are clear.
    pub spare: Vec<Vec<(f64, bool)>>,
}

/// A drop from one sample of the first pass to the next, and one that takes its time.
pub const SHARP: usize = 1;
/// See [`SHARP`].
pub const SMEARED: usize = 10;

impl Found {
    /// Whether some layer ruptures elsewhere in `other`.
    #[must_use]
    pub fn differs(&self, other: &Self) -> bool {
        const APART_S: f64 = 0.8;
        let pairs = self.instants.iter().flatten().zip(other.instants.iter().flatten());
        pairs.into_iter().any(|(a, b)| a != b && (a - b).abs() >= APART_S)
    }
}

/// How far (s) a rupture at a clear drop may be moved at a time: no law that lacks an effect drags it away.
const CLEAR_S: f64 = 0.4;

/// Finds the ruptures in every recording, how far they may be moved, and first values of stiffness and
/// friction. A drop is over `within` samples of the first pass.
#[must_use]
pub fn find(model: &mut Model, tracks: &[Track], within: usize) -> Found {
    let q = (tracks.first().map_or(1.0, |t| t.sample_hz) / COARSE_HZ).round().max(1.0) as usize;
    let coarse: Vec<Track> = tracks.iter().map(|t| t.blocks(q, &[])).collect();
    let range = coarse.iter().flat_map(|t| &t.f).fold(0.0_f64, |m, f| m.max(f.abs()));
    let mut paths: Vec<Vec<usize>> = Vec::new();
    for turn in 0..5 {
        let scale = range * [0.1, 0.05, 0.03, 0.02, 0.02][turn];
        let new: Vec<Vec<usize>> = coarse.iter().map(|t| path(&model.tissue, t, scale, within)).collect();
        let same = new == paths;
        paths = new;
        refit(model, &coarse, &paths);
        if same {
            break;
        }
    }
    let friction: Vec<(Vec<f64>, &Track)> =
        tracks.iter().map(|t| (without_friction(&model.tissue, t), t)).collect();
    let instants: Vec<Vec<f64>> = paths
        .iter()
        .zip(&friction)
        .map(|(path, (force, track))| {
            let mut previous = 0;
            path.iter()
                .map(|&r| {
                    if r == NONE {
                        return NEVER;
                    }
                    let at = edge(force, track, (r * q).min(track.len() - 1), 2 * q).max(previous);
                    previous = at;
                    track.before(at)
                })
                .collect()
        })
        .collect();
    let slabs = Slab::stack(&model.tissue);
    let mut found = Found { instants, ..Found::default() };
    for (k, (track, path)) in coarse.iter().zip(&paths).enumerate() {
        let drops = drops(&slabs, track, within);
        let clear = |r: usize| drops.get(r).is_some_and(|d| *d >= 1.0);
        found.reach.push(path.iter().map(|&r| if clear(r) { CLEAR_S } else { f64::INFINITY }).collect());
        let taken = |i: usize| path.iter().any(|r| r.abs_diff(i) <= 2 * DROP_SIDE);
        let spare = (0..track.len()).filter(|i| drops[*i] > 0.0 && !taken(*i));
        let (force, fine) = &friction[k];
        let at = |i: usize| fine.before(edge(force, fine, (i * q).min(fine.len() - 1), 2 * q));
        found.spare.push(spare.map(|i| (at(i), clear(i))).collect());
    }
    found
}

fn friction(slabs: &[Slab], z: f64, v: f64) -> f64 {
    v * slabs.iter().map(|s| s.friction_ns_per_m2 * s.inside_m(z)).sum::<f64>()
}

fn without_friction(tissue: &Tissue, track: &Track) -> Vec<f64> {
    let slabs = Slab::stack(tissue);
    (0..track.len()).map(|i| track.f[i] - friction(&slabs, track.z[i], track.v[i])).collect()
}

/// What a rupture costs where the force does not drop: more than any misfit of a law that lacks an effect.
const WITHOUT_DROP: f64 = 1e5;
/// Samples of the first pass on each side of a drop.
const DROP_SIDE: usize = 3;
/// Share of the largest force that is a full drop.
const DROP_SHARE: f64 = 0.03;

/// How much of a clear drop the force shows at each sample, 0 (less than half of one) to 1. Friction changes with the velocity, and how
/// much is not known yet: half of what is believed counts against.
fn drops(slabs: &[Slab], track: &Track, within: usize) -> Vec<f64> {
    let n = track.len();
    let range = track.f.iter().fold(1e-9_f64, |m, f| m.max(f.abs()));
    let viscous: Vec<f64> = (0..n).map(|i| friction(slabs, track.z[i], track.v[i])).collect();
    let mean = |x: &[f64], from: usize| x[from..from + DROP_SIDE].iter().sum::<f64>() / DROP_SIDE as f64;
    let span = |x: &[f64]| {
        let (lo, hi) = x.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(*x), h.max(*x)));
        hi - lo
    };
    let mut out = vec![0.0; n];
    for i in DROP_SIDE..n.saturating_sub(DROP_SIDE + within - 1) {
        let drop = |x: &[f64]| mean(x, i - DROP_SIDE) - mean(x, i + within);
        let free = drop(&track.f) - drop(&viscous);
        let doubt = 0.5 * span(&viscous[i - DROP_SIDE..i + within + DROP_SIDE]);
        out[i] = (2.0 * (free - doubt) / (DROP_SHARE * range) - 1.0).max(0.0);
    }
    // A drop serves one rupture: only its peak stays.
    let reach = 2 * DROP_SIDE;
    let peak = |i: usize| {
        let (from, to) = (i.saturating_sub(reach), (i + reach + 1).min(n));
        (from..to).all(|j| if j < i { out[j] < out[i] } else { out[j] <= out[i] })
    };
    (0..n).map(|i| if out[i] > 0.0 && peak(i) { out[i].min(1.0) } else { 0.0 }).collect()
}

/// The best path: per layer the sample at which it has ruptured.
fn path(tissue: &Tissue, track: &Track, scale: f64, within: usize) -> Vec<usize> {
    let slabs = Slab::stack(tissue);
    let states = slabs.len() + 1;
    let n = track.len();
    let mut cost = vec![0.0; states];
    for c in cost.iter_mut().skip(1) {
        *c = f64::INFINITY;
    }
    let mut from: Vec<u8> = vec![0; n * states];
    let drops = drops(&slabs, track, within);
    let mut deepest = f64::NEG_INFINITY;
    for i in 0..n {
        let free = track.f[i] - friction(&slabs, track.z[i], track.v[i]);
        deepest = deepest.max(track.z[i]);
        for s in (0..states).rev() {
            let mut best = cost[s];
            let mut came = s;
            // A layer can only give way once the tip is well inside.
            if s > 0 {
                let slab = &slabs[s - 1];
                let elastic = slab.stiffness_n_per_m * (deepest - slab.front_m).max(0.0);
                let share = (elastic / slab.puncture_n).max((deepest - slab.front_m) / slab.thickness_m);
                let here = cost[s - 1] + WITHOUT_DROP * (1.0 - drops[i]);
                if share > 0.4 && here < best {
                    best = here;
                    came = s - 1;
                }
            }
            let elastic =
                slabs.get(s).map_or(0.0, |a| a.stiffness_n_per_m * (track.z[i] - a.front_m).max(0.0));
            // Far beyond its far face a layer cannot be whole.
            let late = slabs.get(s).map_or(0.0, |a| ((track.z[i] - a.far_m()) / 0.01).max(0.0));
            let misfit = if track.used[i] { rho((free - elastic) / scale) } else { 0.0 };
            cost[s] = best + misfit + 0.02 * late * late;
            from[i * states + s] = came as u8;
        }
    }
    // A layer far behind the tip has ruptured, drop or none.
    for (s, cost) in cost.iter_mut().enumerate() {
        let whole = slabs.iter().skip(s).filter(|slab| deepest > slab.far_m() + 0.2 * slab.thickness_m);
        *cost += WITHOUT_DROP * whole.count() as f64;
    }
    let mut state = (0..states).min_by(|a, b| cost[*a].total_cmp(&cost[*b])).unwrap_or(0);
    let mut out = vec![NONE; slabs.len()];
    for i in (0..n).rev() {
        let came = usize::from(from[i * states + state]);
        if came < state {
            out[state - 1] = i;
            state = came;
        }
    }
    out
}

/// Stiffness and friction by least squares with the ruptures where they are, drawn to what was assumed.
fn refit(model: &mut Model, tracks: &[Track], paths: &[Vec<usize>]) {
    let layers = model.assumed.layers.len();
    let slabs = Slab::stack(&model.assumed);
    let m = 2 * layers;
    let mut h = vec![vec![0.0; m]; m];
    let mut g = vec![0.0; m];
    let range = tracks.iter().flat_map(|t| &t.f).fold(0.0_f64, |m, f| m.max(f.abs()));
    let sd = 0.02 * range.max(1e-9);
    for (track, path) in tracks.iter().zip(paths) {
        let mut row = vec![0.0; m];
        for i in 0..track.len() {
            if !track.used[i] {
                continue;
            }
            let active = path.iter().filter(|r| **r <= i).count();
            let (z, v) = (track.z[i], track.v[i]);
            let mut predicted = 0.0;
            for (l, slab) in slabs.iter().enumerate() {
                row[l] = if l == active { slab.stiffness_n_per_m * (z - slab.front_m).max(0.0) } else { 0.0 };
                row[layers + l] = slab.friction_ns_per_m2 * slab.inside_m(z) * v;
                predicted += row[l] * model.tissue.layers[l].stiffness_n_per_m
                    / slab.stiffness_n_per_m.max(1e-12)
                    + row[layers + l] * model.tissue.layers[l].friction_ns_per_m2
                        / slab.friction_ns_per_m2.max(1e-12);
            }
            let off = ((track.f[i] - predicted) / (3.0 * sd)).abs().max(1.0);
            let weight = 1.0 / (sd * sd * off);
            for a in 0..m {
                if row[a] == 0.0 {
                    continue;
                }
                g[a] += weight * row[a] * track.f[i];
                for b in 0..m {
                    h[a][b] += weight * row[a] * row[b];
                }
            }
        }
    }
    let prior = 1.0 / (model.tolerance * model.tolerance).max(1e-12);
    for a in 0..m {
        h[a][a] += prior;
        g[a] += prior;
    }
    let Some(x) = solve(&h, &g) else { return };
    let bound = |x: f64| x.clamp(1.0 - model.tolerance, 1.0 + model.tolerance);
    for (l, (layer, assumed)) in model.tissue.layers.iter_mut().zip(&model.assumed.layers).enumerate() {
        layer.stiffness_n_per_m = assumed.stiffness_n_per_m * bound(x[l]);
        layer.friction_ns_per_m2 = assumed.friction_ns_per_m2 * bound(x[layers + l]);
    }
}

/// The first sample after the drop nearest to `near`: least squares of a line on both sides.
fn edge(force: &[f64], track: &Track, near: usize, half_width: usize) -> usize {
    const SIDE: usize = 8;
    let n = force.len();
    let reach = half_width + (0.06 * track.sample_hz) as usize;
    let (from, to) = (near.saturating_sub(reach).max(SIDE), (near + reach).min(n.saturating_sub(SIDE)));
    let mut best = (f64::INFINITY, near);
    for k in from..to {
        let left = line(&force[k - SIDE..k]);
        let right = line(&force[k..k + SIDE]);
        let whole = line(&force[k - SIDE..k + SIDE]);
        let drop = left.1 - right.0;
        // What the step explains, counted when the force falls.
        let gain = if drop > 0.0 { left.2 + right.2 - whole.2 } else { 0.0 };
        if gain < best.0 {
            best = (gain, k);
        }
    }
    best.1
}

/// Least-squares line: its value half a step before the first point, half a step after the last, and the
/// sum of squares.
fn line(y: &[f64]) -> (f64, f64, f64) {
    let n = y.len() as f64;
    let mid = 0.5 * (n - 1.0);
    let mean = y.iter().sum::<f64>() / n;
    let (mut sxy, mut sxx) = (0.0, 0.0);
    for (i, y) in y.iter().enumerate() {
        let x = i as f64 - mid;
        sxy += x * (y - mean);
        sxx += x * x;
    }
    let slope = sxy / sxx;
    let ss = y.iter().enumerate().map(|(i, y)| (y - mean - slope * (i as f64 - mid)).powi(2)).sum();
    (mean - slope * (mid + 0.5), mean + slope * (mid + 0.5), ss)
}
