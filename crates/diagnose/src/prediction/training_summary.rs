//! Computes the summary of the training recordings: model discrepancy and scatter between recordings.

use super::group_deviation::{PARAMETERS, RECORDING_SD, Values};
use super::group_update::{Observation, estimate_recording};
use super::insertion_course::{BINS, Curve, DepthRange, curve_of, pooled, value_at};
use super::prediction_band::{BAND_LEVEL, band_edges};
use super::prepared::Prepared;
use super::training_curves::{TrainingRun, TrainingSummary};
use stylet_stats::parallel::*;

/// Lag (s) at which the autocorrelation of the error is evaluated: several blocks, but short compared with an insertion.
const CORRELATION_LAG_S: f64 = 0.2;
/// Bounds of the autocorrelation at that lag, which limit the correlation time to 0.04 s and 20 s.
const CORRELATION_BOUNDS: (f64, f64) = (0.01, 0.99);
/// Weight of the documented standard deviations between recordings, in recordings.
const PRIOR_RECORDINGS: f64 = 2.0;
/// Trial factors of the discrepancy's standard deviation; the first whose band contains [`BAND_LEVEL`] of the samples is used.
const MISFIT_SCALES: [f64; 9] = [0.6, 0.7, 0.8, 0.9, 1.0, 1.2, 1.4, 1.7, 2.0];
/// Reciprocal resolution (1/N) of the stored curves: 1 µN.
const STORED_DECIMALS: f64 = 1e6;

fn stored(curve: Curve) -> Curve {
    curve.into_iter().map(|x| x.map(|x| (x * STORED_DECIMALS).round() / STORED_DECIMALS)).collect()
}

/// Sum of the products of compared blocks with those `lag` blocks before.
fn lagged_sum(e: &[f64], used: &[bool], lag: usize) -> f64 {
    (lag..e.len()).filter(|k| used[*k] && used[k - lag]).map(|k| e[k] * e[k - lag]).sum()
}

/// Summary of the training recordings; `None` when the model cannot be evaluated on them.
pub(super) fn summarise(prepared: &Prepared) -> Option<TrainingSummary> {
    let Prepared { data, courses, names, uncertainty, .. } = prepared;
    let n = names.len();
    let range = courses.iter().map(|c| c.range).reduce(|a, b| DepthRange {
        start_m: a.start_m.min(b.start_m),
        deepest_m: a.deepest_m.max(b.deepest_m),
    })?;
    let forces: Vec<Vec<f64>> =
        (0..n).into_par_iter().map(|r| prepared.free_run(r)).collect::<Option<_>>()?;
    let places: Vec<Vec<f64>> =
        courses.iter().zip(data.recordings.iter()).map(|(c, b)| c.places(b, range, 0.0)).collect();
    let residuals: Vec<Vec<f64>> = (0..n)
        .map(|r| data.recordings[r].force_n.iter().zip(&forces[r]).map(|(y, f)| y - f).collect())
        .collect();
    let curve = |r: usize, values: &[f64]| curve_of(&places[r], &data.recordings[r].used, values);
    let runs = (0..n)
        .map(|r| TrainingRun {
            name: names[r].clone(),
            speed_mps: courses[r].speed_mps,
            stroke_m: courses[r].range.deepest_m,
            force_n: stored(curve(r, &data.recordings[r].force_n)),
            residual_n: stored(curve(r, &residuals[r])),
        })
        .collect();
    let mut out = TrainingSummary {
        range,
        runs,
        residual_rms_n: 0.0,
        discrepancy_sd_n: Vec::new(),
        correlation_s: 0.0,
        recording_sd: RECORDING_SD,
    };
    let mean_residuals: Vec<Curve> = out
        .runs
        .iter()
        .enumerate()
        .map(|(r, run)| out.mean_residual(run.speed_mps, run.stroke_m, Some(r)))
        .collect();
    // Residuals of each recording after subtraction of the mean residual of the others.
    let left: Vec<Vec<f64>> = (0..n)
        .map(|r| {
            let mean = |place: &f64| value_at(&mean_residuals[r], *place).unwrap_or(0.0);
            residuals[r].iter().zip(&places[r]).map(|(e, place)| e - mean(place)).collect()
        })
        .collect();
    let mean_square = |of: &dyn Fn(usize) -> Vec<f64>| {
        let curves: Vec<Curve> = (0..n).map(|r| curve(r, &of(r))).collect();
        pooled(&mean_of_known(&curves))
    };
    let total = mean_square(&|r| left[r].iter().map(|e| e * e).collect());
    let draws: Vec<Vec<Vec<f64>>> =
        (0..n).into_par_iter().map(|r| uncertainty.draws(&prepared.model, data, r)).collect();
    let variance = |r: usize| {
        let column = |k: usize| draws[r].iter().map(|d| d[k]).collect::<Vec<f64>>();
        (0..residuals[r].len()).map(|k| stylet_stats::variance(&column(k))).collect::<Vec<f64>>()
    };
    let explained = mean_square(&variance);
    let beyond = |(t, x): (&Option<f64>, &Option<f64>)| {
        Some((t.as_ref()? - x.as_ref()? - uncertainty.block_n.powi(2)).max(0.0).sqrt())
    };
    let discrepancy: Curve = total.iter().zip(&explained).map(beyond).collect();
    // The standard deviation is scaled to the nominal coverage, because discrepancies are not normal.
    let coverage = |scale: f64| {
        let each = (0..n).into_par_iter().map(|r| {
            let b = &data.recordings[r];
            let sd_n = |k: usize| {
                libm::hypot(uncertainty.block_n, scale * value_at(&discrepancy, places[r][k]).unwrap_or(0.0))
            };
            let (low, high) = band_edges(&draws[r], sd_n);
            // The mean residual would shift band and force by the same amount, so it is omitted from both.
            let inside = |k: &usize| (low[*k]..=high[*k]).contains(&(forces[r][*k] + left[r][*k]));
            let used: Vec<usize> = (0..b.len()).filter(|k| b.used[*k] && *k < low.len()).collect();
            (used.iter().filter(|k| inside(k)).count() as f64, used.len() as f64)
        });
        let (inside, blocks) = each.into_iter().fold((0.0, 0.0), |a: (f64, f64), b| (a.0 + b.0, a.1 + b.1));
        inside / blocks.max(1.0)
    };
    let scale = MISFIT_SCALES.into_iter().find(|scale| coverage(*scale) >= BAND_LEVEL);
    let scale = scale.unwrap_or(MISFIT_SCALES[MISFIT_SCALES.len() - 1]);
    out.discrepancy_sd_n = stored(discrepancy.iter().map(|d| d.map(|d| scale * d)).collect());
    let (mut square, mut lagged, mut blocks) = (0.0, 0.0, 0.0);
    for (e, b) in left.iter().zip(data.recordings.iter()) {
        let lag = (CORRELATION_LAG_S / b.block_s()).round().max(1.0) as usize;
        square += lagged_sum(e, &b.used, 0);
        lagged += lagged_sum(e, &b.used, lag);
        blocks += b.compared_block_count() as f64;
    }
    out.residual_rms_n = (square / f64::max(blocks, 1.0)).sqrt().max(uncertainty.block_n);
    let correlation = (lagged / square.max(1e-300)).clamp(CORRELATION_BOUNDS.0, CORRELATION_BOUNDS.1);
    out.correlation_s = -CORRELATION_LAG_S / libm::log(correlation);
    out.recording_sd = recording_sd(&Prepared { training: Some(&out), ..prepared.clone() }, &mean_residuals)?;
    Some(out)
}

/// Mean per bin over the curves with a value there.
fn mean_of_known(curves: &[Curve]) -> Curve {
    (0..BINS)
        .map(|k| {
            let known: Vec<f64> = curves.iter().filter_map(|c| c[k]).collect();
            (!known.is_empty()).then(|| stylet_stats::mean(&known))
        })
        .collect()
}

/// Standard deviations of the training recordings about the model, with the documented ones as prior.
fn recording_sd(prepared: &Prepared, mean_residuals: &[Curve]) -> Option<Values> {
    let wide = super::group_deviation::group_sd(&super::group_deviation::Factor::ALL);
    let each: Vec<Values> = (0..prepared.names.len())
        .into_par_iter()
        .map(|r| {
            let b = &prepared.data.recordings[r];
            let observed = Observation { force_n: &b.force_n, used: &b.used, weight: prepared.weight(r) };
            let force = |u: &Values| prepared.force(r, u, &mean_residuals[r]);
            Some(estimate_recording(&observed, force, wide)?.deviation)
        })
        .collect::<Option<_>>()?;
    let square = |k: usize| each.iter().map(|u| u[k] * u[k]).sum::<f64>();
    let count = PRIOR_RECORDINGS + each.len() as f64;
    let sd: [f64; PARAMETERS] =
        std::array::from_fn(|k| ((PRIOR_RECORDINGS * RECORDING_SD[k].powi(2) + square(k)) / count).sqrt());
    Some(sd)
}
