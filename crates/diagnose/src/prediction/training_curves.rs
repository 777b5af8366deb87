//! Curves of the training recordings, with model discrepancy and scatter between recordings.

use super::group_deviation::Values;
use super::insertion_course::{BINS, Curve, DepthRange, mean_curve, pooled};
use crate::repeated_insertions::segmented_recording::{SPEED_TOLERANCE, STROKE_TOLERANCE_M};
use serde::{Deserialize, Serialize};

/// Largest difference of the curves of one and the same recording, as a share of the largest force.
const SAME_RECORDING_SHARE: f64 = 1e-5;
/// Resolution in N of the stored curves.
const STORED_STEP_N: f64 = 1e-6;

/// A training recording.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrainingRun {
    /// Name.
    pub name: String,
    /// Median speed of the advance in m/s.
    pub speed_mps: f64,
    /// Deepest position in m.
    pub stroke_m: f64,
    /// Measured force (N) over the course of the insertion.
    pub force_n: Curve,
    /// Measured minus predicted force (N).
    pub residual_n: Curve,
}

impl TrainingRun {
    /// Whether a recording at this speed and stroke is comparable.
    pub fn is_like(&self, speed_mps: f64, stroke_m: f64) -> bool {
        (self.speed_mps - speed_mps).abs() <= SPEED_TOLERANCE * speed_mps
            && (self.stroke_m - stroke_m).abs() <= STROKE_TOLERANCE_M
    }
}

/// Summary of the training recordings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrainingSummary {
    /// Range of positions of the curves.
    pub range: DepthRange,
    /// The recordings.
    pub runs: Vec<TrainingRun>,
    /// RMS error (N) of the model with the mean residual of the other recordings.
    pub residual_rms_n: f64,
    /// Standard deviation (N) of the discrepancy: error without noise and scatter of parameters.
    pub discrepancy_sd_n: Curve,
    /// Correlation time of the error in s.
    pub correlation_s: f64,
    /// Standard deviations between recordings: surface (m), logarithms of force, friction, puncture force.
    pub recording_sd: Values,
}

/// Model-free predictions of one recording.
#[derive(Clone, Debug, Default)]
pub struct BaselineCurves {
    /// Mean of the training recordings at this speed and stroke.
    pub mean: Option<Curve>,
    /// Mean of the others.
    pub stretched: Option<Curve>,
}

impl TrainingSummary {
    /// Index of the training recording with this curve.
    pub fn index_of(&self, force_n: &Curve) -> Option<usize> {
        let largest_n = force_n.iter().flatten().fold(0.0_f64, |m, f| m.max(f.abs()));
        self.runs.iter().position(|run| {
            run.force_n.iter().zip(force_n).all(|pair| match pair {
                (Some(a), Some(b)) => (a - b).abs() <= (SAME_RECORDING_SHARE * largest_n).max(STORED_STEP_N),
                (None, None) => true,
                _ => false,
            })
        })
    }

    /// Absolute logarithm of the ratio of a speed to the nearest one of the training recordings.
    pub fn ln_speed_ratio(&self, speed_mps: f64) -> f64 {
        let ratios = self.runs.iter().map(|run| libm::log(speed_mps / run.speed_mps).abs());
        ratios.filter(|r| r.is_finite()).reduce(f64::min).unwrap_or(0.0)
    }

    /// Mean residual (N) of the training recordings except `except`: of those at this speed and stroke if there are two, else of all. It is
    /// shrunk by the share of its square that its own scatter explains (James and Stein 1961), and zero for fewer than two recordings.
    pub fn mean_residual(&self, speed_mps: f64, stroke_m: f64, except: Option<usize>) -> Curve {
        let others = || self.runs.iter().enumerate().filter(move |(k, _)| Some(*k) != except);
        let like: Vec<&Curve> = others()
            .filter(|(_, run)| run.is_like(speed_mps, stroke_m))
            .map(|(_, run)| &run.residual_n)
            .collect();
        let chosen = if like.len() > 1 { like } else { others().map(|(_, run)| &run.residual_n).collect() };
        let n = chosen.len() as f64;
        let mean = mean_curve(&chosen);
        if chosen.len() < 2 {
            return mean.iter().map(|m| m.map(|_| 0.0)).collect();
        }
        let variance = |(k, m): (usize, &Option<f64>)| {
            let m = (*m)?;
            let square: f64 = chosen.iter().filter_map(|c| c[k]).map(|e| (e - m).powi(2)).sum();
            Some(square / (n - 1.0) / n)
        };
        let by_chance = pooled(&mean.iter().enumerate().map(variance).collect::<Curve>());
        let square = pooled(&mean.iter().map(|m| m.map(|m| m * m)).collect::<Curve>());
        let shrunk = |k: usize| {
            let (square, by_chance) = (square[k]?, by_chance[k]?);
            let share = if square > by_chance { 1.0 - by_chance / square } else { 0.0 };
            Some(share * mean[k]?)
        };
        (0..BINS).map(shrunk).collect()
    }

    /// Mean curves of the training recordings except `except`.
    pub fn baselines(&self, speed_mps: f64, stroke_m: f64, except: Option<usize>) -> BaselineCurves {
        let (mut like, mut other) = (Vec::new(), Vec::new());
        for (_, run) in self.runs.iter().enumerate().filter(|(k, _)| Some(*k) != except) {
            if run.is_like(speed_mps, stroke_m) { &mut like } else { &mut other }.push(&run.force_n);
        }
        let mean = |runs: &[&Curve]| (!runs.is_empty()).then(|| mean_curve(runs));
        BaselineCurves { mean: mean(&like), stretched: mean(&other) }
    }
}
