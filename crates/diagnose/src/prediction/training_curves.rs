//! What the recordings that made a law show about it: their curves, the law's misfit, the spread between them.

use super::group_deviation::Values;
use super::insertion_course::{BINS, Curve, DepthRange, mean_curve, pooled};
use serde::{Deserialize, Serialize};

/// Recordings have one speed when it differs by at most this share.
const SPEED_TOLERANCE: f64 = 0.1;
/// Recordings have one stroke when it differs by at most this length (m).
const STROKE_TOLERANCE_M: f64 = 1e-3;
/// Two recordings are the same when their curves differ by at most this share of the largest force.
const SAME_RECORDING_SHARE: f64 = 1e-5;

/// A recording that took part in making the law.
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
    fn is_like(&self, speed_mps: f64, stroke_m: f64) -> bool {
        (self.speed_mps - speed_mps).abs() <= SPEED_TOLERANCE * speed_mps
            && (self.stroke_m - stroke_m).abs() <= STROKE_TOLERANCE_M
    }
}

/// What the recordings that made a law show about it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrainingSummary {
    /// Depths of the curves.
    pub range: DepthRange,
    /// The recordings.
    pub runs: Vec<TrainingRun>,
    /// RMS error (N) of the law with the mean residual of the other recordings.
    pub residual_rms_n: f64,
    /// Standard deviation (N) of the misfit that neither noise nor the scatter of parameters explains.
    pub discrepancy_sd_n: Curve,
    /// Correlation time of the misfit in s.
    pub correlation_s: f64,
    /// Standard deviations between recordings: surface (m), logarithms of force, friction, puncture force.
    pub recording_sd: Values,
}

/// Baselines without a model for one recording.
#[derive(Clone, Debug, Default)]
pub struct BaselineCurves {
    /// Mean of the recordings at this speed.
    pub mean: Option<Curve>,
    /// Mean of those at other speeds.
    pub stretched: Option<Curve>,
}

impl TrainingSummary {
    /// The training recording that has this curve.
    pub fn index_of(&self, force_n: &Curve) -> Option<usize> {
        let largest_n = force_n.iter().flatten().fold(0.0_f64, |m, f| m.max(f.abs()));
        self.runs.iter().position(|run| {
            run.force_n.iter().zip(force_n).all(|pair| match pair {
                (Some(a), Some(b)) => (a - b).abs() <= SAME_RECORDING_SHARE * largest_n,
                (None, None) => true,
                _ => false,
            })
        })
    }

    /// Logarithm of a speed over the nearest one of the training recordings.
    pub fn ln_speed_ratio(&self, speed_mps: f64) -> f64 {
        let ratios = self.runs.iter().map(|run| libm::log(speed_mps / run.speed_mps).abs());
        ratios.filter(|r| r.is_finite()).reduce(f64::min).unwrap_or(0.0)
    }

    /// Mean residual of the recordings without the one at index `except`: of those at this speed and stroke, or else of all.
    /// It is shrunk by the share of its square that its own scatter explains (James and Stein 1961), and zero for fewer
    /// than two recordings.
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

    /// Mean curves of the recordings without the one at index `except`.
    pub fn baselines(&self, speed_mps: f64, stroke_m: f64, except: Option<usize>) -> BaselineCurves {
        let (mut like, mut other) = (Vec::new(), Vec::new());
        for (_, run) in self.runs.iter().enumerate().filter(|(k, _)| Some(*k) != except) {
            if run.is_like(speed_mps, stroke_m) { &mut like } else { &mut other }.push(&run.force_n);
        }
        let mean = |runs: &[&Curve]| (!runs.is_empty()).then(|| mean_curve(runs));
        BaselineCurves { mean: mean(&like), stretched: mean(&other) }
    }
}
