//! What the report draws: predictions, residuals and how they depend on what was done.

use crate::diagnose::Examined;
use crate::held_out::by_its_own;
use crate::outcome::Verdict;
use stylet_identify::fit::Fit;
use stylet_identify::linear::dot;
use stylet_tissue::Slab;

/// Curves of one recording.
#[derive(Clone, Debug, Default)]
pub struct Curves {
    /// Time in s.
    pub time_s: Vec<f64>,
    /// Position in m.
    pub position_m: Vec<f64>,
    /// Velocity in m/s.
    pub velocity_mps: Vec<f64>,
    /// Measured force in N.
    pub force_n: Vec<f64>,
    /// Residual of the re-fitted base law in N, ruptures where the data show them.
    pub base_n: Vec<f64>,
    /// Residual of the extended model in N.
    pub extended_n: Vec<f64>,
    /// Residual of the extended model with its own ruptures in N.
    pub free_n: Vec<f64>,
    /// Whether the sample was compared.
    pub used: Vec<bool>,
    /// Instants in s at which layers ruptured.
    pub ruptures_s: Vec<f64>,
    /// Active layer of every sample, 1-based.
    pub layer: Vec<usize>,
}

/// The fit that the diagnosis stands by.
#[must_use]
pub fn shown(examined: &Examined) -> &Fit {
    let d = &examined.diagnosis;
    if d.verdict == Verdict::Unknown && d.causes.is_empty() {
        &examined.search.base
    } else {
        &examined.search.best
    }
}

/// Curves of every recording.
#[must_use]
pub fn curves(examined: &Examined) -> Vec<Curves> {
    let search = &examined.search;
    let best = shown(examined);
    let data = &search.data;
    data.blocks
        .iter()
        .enumerate()
        .map(|(r, b)| {
            let t: Vec<f64> = (0..b.len()).map(|k| 0.5 * (b.from_s[k] + b.to_s[k])).collect();
            let (position_m, velocity_mps) = t.iter().map(|t| b.motion.at(*t)).unzip();
            let ruptures = &best.model.instants[r];
            Curves {
                force_n: b.f.clone(),
                free_n: by_its_own(&best.model, data, r).map_or_else(|| vec![f64::NAN; b.len()], |l| l.e),
                base_n: search.base.residuals.e[r].clone(),
                extended_n: best.residuals.e[r].clone(),
                used: b.used.clone(),
                ruptures_s: ruptures.iter().copied().filter(|r| r.is_finite()).collect(),
                layer: t.iter().map(|t| 1 + ruptures.iter().filter(|r| **r <= *t).count()).collect(),
                time_s: t,
                position_m,
                velocity_mps,
            }
        })
        .collect()
}

/// Root mean square of a residual by layer (rows; the last: behind the last layer) and phase (advance, hold,
/// retraction), NaN where there are fewer than 20 samples.
#[must_use]
pub fn by_layer_and_phase(curves: &[Curves], pick: fn(&Curves) -> &[f64], layers: usize) -> Vec<[f64; 3]> {
    let mut sums = vec![[(0.0, 0.0_f64); 3]; layers + 2];
    for c in curves {
        for (i, e) in pick(c).iter().enumerate().filter(|(i, _)| c.used[*i]) {
            let v = c.velocity_mps[i];
            let phase = if v > 1e-5 { 0 } else { 1 + usize::from(v < -1e-5) };
            let row = if c.layer[i] == 1 && c.position_m[i] < 0.0 { 0 } else { c.layer[i].min(layers + 1) };
            sums[row][phase].0 += e * e;
            sums[row][phase].1 += 1.0;
        }
    }
    sums.iter().map(|row| row.map(|(s, n)| if n < 20.0 { f64::NAN } else { (s / n).sqrt() })).collect()
}

/// Mean of a residual in bins of an abscissa: bin middles and means.
#[must_use]
pub fn binned(x: &[f64], e: &[f64], used: &[bool], bins: usize) -> (Vec<f64>, Vec<f64>) {
    let (low, high) = x.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(*x), b.max(*x)));
    let wide = (high - low) / bins as f64;
    if wide.is_nan() || wide <= 0.0 {
        return (Vec::new(), Vec::new());
    }
    let mut sums = vec![(0.0, 0.0); bins];
    for ((x, e), _) in x.iter().zip(e).zip(used).filter(|(_, u)| **u) {
        let k = (((x - low) / wide) as usize).min(bins - 1);
        sums[k].0 += e;
        sums[k].1 += 1.0;
    }
    sums.iter()
        .enumerate()
        .filter(|(_, s)| s.1 >= 5.0)
        .map(|(k, s)| (low + (k as f64 + 0.5) * wide, s.0 / s.1))
        .unzip()
}

/// Correlations of a residual with what was done: name and coefficient.
#[must_use]
pub fn correlations(
    curves: &[Curves],
    pick: fn(&Curves) -> &[f64],
    slabs: &[Slab],
) -> Vec<(&'static str, f64)> {
    let mut columns: Vec<Vec<f64>> = vec![Vec::new(); 7];
    let mut e = Vec::new();
    for c in curves {
        for i in (0..c.time_s.len()).filter(|i| c.used[*i]) {
            let (z, v) = (c.position_m[i], c.velocity_mps[i]);
            let inside: f64 = slabs.iter().map(|s| s.inside_m(z)).sum();
            let sign = stylet_tissue::effect::sgn(v);
            for (column, x) in
                columns.iter_mut().zip([c.time_s[i], z, v, sign, inside * v, inside * sign, c.force_n[i]])
            {
                column.push(x);
            }
            e.push(pick(c)[i]);
        }
    }
    let centred = |x: &[f64]| {
        let mean = x.iter().sum::<f64>() / x.len().max(1) as f64;
        x.iter().map(|x| x - mean).collect::<Vec<_>>()
    };
    let e = centred(&e);
    [
        "time",
        "depth",
        "velocity",
        "direction",
        "length inside x velocity",
        "length inside x direction",
        "force",
    ]
    .into_iter()
    .zip(&columns)
    .map(|(name, x)| {
        let x = centred(x);
        (name, dot(&x, &e) / (dot(&x, &x) * dot(&e, &e)).sqrt().max(1e-300))
    })
    .collect()
}
