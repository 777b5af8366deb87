//! Propagates the uncertainty of the estimated noise into the information matrix, by a parametric bootstrap.
//!
//! Fitted parameters absorb part of the slow noise, so the residual underestimates it; and noise with a time constant of ten seconds is
//! estimated from a few dozen independent segments. Each replicate simulates noise from its estimate, projects out the fitted parameters,
//! and estimates the noise again from the residual (Efron and Tibshirani 1993, chapter 6).

use rand::Rng;
use rand_distr::{Distribution, StandardNormal};
use stylet_identify::fit::Linearization;
use stylet_identify::likelihood::FitData;
use stylet_identify::noise::NoiseSource;
use stylet_stats::linear_algebra::{SymmetricMatrix, dot};
use stylet_stats::parallel::*;

/// Number of bootstrap replicates: a compromise between cost and the accuracy of their variance.
const REPLICATES: usize = 8;

/// Information matrix under the noise of `data` instead of that of `matrix`.
fn under_noise(columns: &[RecordingColumn], matrix: &SymmetricMatrix, data: &FitData) -> SymmetricMatrix {
    let now: Vec<Vec<f64>> = columns.iter().map(|c| data.whiten(c.recording, &c.e)).collect();
    let mut changed = matrix.clone();
    for (i, a) in columns.iter().enumerate() {
        for (j, b) in columns.iter().enumerate().take(i + 1).filter(|(_, b)| b.recording == a.recording) {
            changed.add(a.at.max(b.at), a.at.min(b.at), dot(&now[i], &now[j]) - dot(&a.w, &b.w));
        }
    }
    changed
}

/// Information matrices under bootstrap estimates of the noise; `matrix` is the one under the noise of `data`.
pub fn bootstrap_noise(
    linearization: &Linearization,
    data: &FitData,
    matrix: &SymmetricMatrix,
    rng: &mut impl Rng,
) -> Vec<SymmetricMatrix> {
    let columns = recording_columns(linearization, data);
    let factor = matrix.cholesky();
    let drawn: Vec<Vec<Vec<f64>>> = (0..REPLICATES)
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
            under_noise(&columns, matrix, &data.with_estimated_noise(&e, NoiseSource::Bootstrap))
        })
        .collect()
}

/// Derivative of one recording's force with respect to one parameter.
struct RecordingColumn {
    /// Index of the parameter in the information matrix.
    at: usize,
    recording: usize,
    /// Whitened derivative.
    w: Vec<f64>,
    /// Derivative in N.
    e: Vec<f64>,
}

/// Non-zero Jacobian columns of each recording.
fn recording_columns(linearization: &Linearization, data: &FitData) -> Vec<RecordingColumn> {
    let shared = linearization.shared.len();
    let mut out = Vec::new();
    for recording in 0..data.recording_count() {
        for (k, column) in linearization.columns.iter().enumerate() {
            let at = if k < shared { k } else { linearization.index_of(k - shared, recording) };
            let Some(w) = column.innovations.get(recording).filter(|w| w.iter().any(|x| *x != 0.0)) else {
                continue;
            };
            out.push(RecordingColumn { at, recording, e: data.unwhiten(recording, w), w: w.clone() });
        }
    }
    out
}
