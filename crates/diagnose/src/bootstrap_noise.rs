//! How well the noise is told by what a fit leaves.
//!
//! The numbers of a fit follow a slow noise as far as they can, and what they followed is missing in the residuals that tell how slow the
//! noise is; and a wander of ten seconds is told by a few dozen stretches. So noise is drawn as it was estimated, the same numbers are
//! fitted to it, and the noise is estimated again from what they leave (a parametric bootstrap: Efron and Tibshirani 1993, chapter 6).

use rand::Rng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;
use stylet_identify::fit::Linearization;
use stylet_identify::likelihood::FitData;
use stylet_identify::noise::NoiseSource;
use stylet_stats::linear_algebra::{SymmetricMatrix, dot};

/// So many times.
const TIMES: usize = 8;

/// The normal matrix under another noise.
fn under(columns: &[One], matrix: &SymmetricMatrix, data: &FitData) -> SymmetricMatrix {
    let now: Vec<Vec<f64>> = columns.iter().map(|c| data.whiten(c.recording, &c.e)).collect();
    let mut changed = matrix.clone();
    for (i, a) in columns.iter().enumerate() {
        for (j, b) in columns.iter().enumerate().take(i + 1).filter(|(_, b)| b.recording == a.recording) {
            changed.add(a.at.max(b.at), a.at.min(b.at), dot(&now[i], &now[j]) - dot(&a.w, &b.w));
        }
    }
    changed
}

/// The normal matrix under noises estimated again. `matrix` is the one under the noise of `data`, which drew them.
#[must_use]
pub fn bootstrap_noise(
    tangent: &Linearization,
    data: &FitData,
    matrix: &SymmetricMatrix,
    rng: &mut impl Rng,
) -> Vec<SymmetricMatrix> {
    let columns = plain(tangent, data);
    let factor = matrix.cholesky();
    let drawn: Vec<Vec<Vec<f64>>> = (0..TIMES)
        .map(|_| {
            let mut normal = |n: usize| (0..n).map(|_| StandardNormal.sample(rng)).collect();
            data.recordings.iter().map(|b| normal(b.len())).collect()
        })
        .collect();
    drawn
        .into_par_iter()
        .map(|mut w: Vec<Vec<f64>>| {
            let mut slope = vec![0.0; matrix.size];
            for c in &columns {
                slope[c.at] += dot(&c.w, &w[c.recording]);
            }
            let followed = factor.solve(&slope);
            for c in &columns {
                w[c.recording].iter_mut().zip(&c.w).for_each(|(w, x)| *w -= followed[c.at] * x);
            }
            let e: Vec<Vec<f64>> = w.iter().enumerate().map(|(r, w)| data.unwhiten(r, w)).collect();
            under(&columns, matrix, &data.with_estimated_noise(&e, NoiseSource::Bootstrap))
        })
        .collect()
}

/// What a number changes in one recording.
struct One {
    /// Where the number stands in the normal matrix.
    at: usize,
    recording: usize,
    /// Whitened.
    w: Vec<f64>,
    /// In N.
    e: Vec<f64>,
}

/// Columns recording by recording.
fn plain(tangent: &Linearization, data: &FitData) -> Vec<One> {
    let shared = tangent.shared.len();
    let mut out = Vec::new();
    for recording in 0..data.recording_count() {
        for (k, column) in tangent.columns.iter().enumerate() {
            let at = if k < shared { k } else { tangent.index_of(k - shared, recording) };
            let Some(w) = column.innovations.get(recording).filter(|w| w.iter().any(|x| *x != 0.0)) else {
                continue;
            };
            out.push(One { at, recording, e: data.unwhiten(recording, w), w: w.clone() });
        }
    }
    out
}
