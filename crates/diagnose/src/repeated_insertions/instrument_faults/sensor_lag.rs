//! Detects a delay or lag of the force sensor from the corners of the motion, where the needle stops and where the retraction begins. A
//! delay of the sensor or its clock shifts the corner of the force; a low-pass filter rounds it.
//!
//! Before a corner the force is a line, in position at the stop and in time at the reversal. After the reversal, a spring and a friction
//! that builds up over a length `delta` respond to the distance `u` travelled back: `f = a + b t + c L[u] + d L[1 - exp(-u / delta)]`, with
//! the delay in `u` and the low-pass filter `L`. After the stop the tissue relaxes, and `u` is the time since the stop. The coefficients
//! are fitted per recording; `delta` and the delay or lag are common to all.

use super::air_baseline::least_squares;
use crate::repeated_insertions::segmented_recording::SegmentedRecording;
use stylet_record::Recording;
use stylet_stats::parallel::*;
use stylet_stats::{interpolate, mean, sd, student_t};

/// Window (s) before and after a corner.
const WINDOW_S: (f64, f64) = (1.0, 0.8);
/// Time (s) before the reversal from which the needle is assumed not to have turned yet.
const STANDSTILL_S: f64 = 0.2;
/// Largest delay or lag (s) that is searched.
const MAX_LAG_S: f64 = 0.8;
/// Largest difference of the distances travelled in the thirds of the window before a corner from their mean, as a share of it, and what is
/// accepted in any case (m). At a varying speed the force before the corner is no line.
const MAX_UNEVENNESS: (f64, f64) = (0.04, 2e-5);
/// Step (s) of the search.
const STEP_S: f64 = 0.02;
/// Smallest delay or lag (s) attributed to the sensor; play and rounded corners of the drive cause shorter ones.
const MIN_LAG_S: f64 = 0.08;
/// Trial lengths over which the response builds up: friction after a reversal (m), relaxation after a stop (s).
const BUILD_UP_LENGTHS: [[f64; 5]; 2] = [[3e-4, 6e-4, 8e-4, 1e-3, 1.5e-3], [0.1, 0.2, 0.4, 0.8, 1.6]];
/// Memory of the low-pass filter, in time constants: its initial state has then decayed to less than 1 %.
const FILTER_MEMORY: f64 = 5.0;
/// Largest ratio of the mean square residual at the corners with a delay or lag to that without.
const MAX_RESIDUAL_RATIO: f64 = 0.9;

/// Model of the sensor dynamics.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LagModel {
    /// `time_delay`.
    PureDelay,
    /// `low_pass_lag`.
    LowPass,
}

/// A detected delay or lag.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DetectedLag {
    /// Model.
    pub model: LagModel,
    /// Delay or time constant (s).
    pub value_s: f64,
    /// Lower end of its 95 % interval over the recordings (s).
    pub low_s: f64,
    /// Upper end (s).
    pub high_s: f64,
}

/// Detects a delay or lag common to the recordings; `None` if it does not improve the fit enough.
pub fn detect_lag(recordings: &[&SegmentedRecording]) -> Option<DetectedLag> {
    let corners =
        |at: CornerKind| -> Vec<Corner> { recordings.iter().filter_map(|r| Corner::of(r, at)).collect() };
    let corners: Vec<Vec<Corner>> = [CornerKind::Reversal, CornerKind::Stop]
        .into_iter()
        .map(corners)
        .filter(|c| c.len() >= 2 && 2 * c.len() >= recordings.len())
        .collect();
    if corners.is_empty() {
        return None;
    }
    let samples: f64 = corners.iter().flatten().map(|c| c.time_s.len() as f64).sum();
    [LagModel::PureDelay, LagModel::LowPass]
        .into_iter()
        .map(|how| {
            let left: Vec<Vec<CornerResiduals>> =
                corners.iter().map(|c| c.par_iter().map(|c| c.residuals(how)).collect()).collect();
            (how, total_residual(&left, None), left)
        })
        .min_by(|a, b| minimum(&a.1).1.total_cmp(&minimum(&b.1).1))
        .and_then(|(how, all, left)| {
            let (by_s, height) = minimum(&all);
            // The interval is a jackknife over the recordings.
            let n = recordings.len() as f64;
            let others: Vec<f64> =
                recordings.iter().map(|r| minimum(&total_residual(&left, Some(&r.name))).0).collect();
            let half = student_t::quantile(0.975, n - 1.0) * sd(&others) * (n - 1.0) / n.sqrt();
            let shows = by_s > MIN_LAG_S && height - all[0] < samples * libm::log(MAX_RESIDUAL_RATIO);
            shows.then_some(DetectedLag {
                model: how,
                value_s: by_s,
                low_s: (by_s - half).max(0.0),
                high_s: by_s + half,
            })
        })
}

/// Objective of one corner per length of [`BUILD_UP_LENGTHS`] and per delay or lag: number of samples times the logarithm of the mean
/// square residual.
struct CornerResiduals {
    name: String,
    by: [Vec<f64>; 5],
}

/// Sum of the objective over corners and recordings except `but`, with each kind of corner at its best length.
fn total_residual(left: &[Vec<CornerResiduals>], but: Option<&str>) -> Vec<f64> {
    let at = |kind: &[CornerResiduals], k: usize| {
        let of = |d: usize| -> f64 {
            kind.iter().filter(|l| Some(l.name.as_str()) != but).map(|l| l.by[d][k]).sum()
        };
        (0..5).map(of).fold(f64::INFINITY, f64::min)
    };
    (0..left[0][0].by[0].len()).map(|k| left.iter().map(|kind| at(kind, k)).sum()).collect()
}

/// Position (s) and value of the minimum of a curve sampled at [`STEP_S`], refined by a parabola.
fn minimum(curve: &[f64]) -> (f64, f64) {
    let k = (0..curve.len()).min_by(|a, b| curve[*a].total_cmp(&curve[*b])).unwrap_or(0);
    let mut at = k as f64;
    if k > 0 && k + 1 < curve.len() {
        let (before, here, after) = (curve[k - 1], curve[k], curve[k + 1]);
        let bend = before - 2.0 * here + after;
        if bend > 0.0 {
            at += 0.5 * (before - after) / bend;
        }
    }
    (at * STEP_S, curve[k])
}

/// Kind of corner.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum CornerKind {
    /// Begin of the retraction.
    Reversal,
    /// End of the advance.
    Stop,
}

/// Force around a corner of one recording.
struct Corner<'a> {
    name: &'a str,
    recording: &'a Recording,
    at: CornerKind,
    /// Time (s) of the corner and its position (m).
    at_s: f64,
    turned_m: f64,
    /// Index of the first sample.
    first: usize,
    time_s: &'a [f64],
    force_n: &'a [f64],
}

impl<'a> Corner<'a> {
    fn of(run: &'a SegmentedRecording, at: CornerKind) -> Option<Self> {
        let r = &run.recording;
        let time = |k: usize| r.time_s.get(k).copied();
        let (stop_s, back_s) =
            (time(run.phases.deepest)?, time(run.phases.retraction).unwrap_or(f64::INFINITY));
        let at_s = if at == CornerKind::Reversal { back_s } else { stop_s };
        let (from_s, to_s) = (at_s - WINDOW_S.0, at_s + WINDOW_S.1);
        let alone = r.time_s[r.len() - 1] > to_s
            && match at {
                CornerKind::Stop => back_s > to_s,
                CornerKind::Reversal => stop_s < from_s || back_s - stop_s < MIN_LAG_S,
            };
        let first = r.time_s.partition_point(|t| *t < from_s);
        let end = r.time_s.partition_point(|t| *t < to_s);
        // A rupture inside the window would disturb the fit, also one that appears delayed.
        let torn = run.ruptures_s.iter().any(|t| (from_s - MAX_LAG_S..to_s).contains(t));
        let even = is_even(r, from_s, at_s - STANDSTILL_S);
        let turned_m = r.position_m.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        (alone && even && !torn && end - first > 4 * REGRESSORS).then(|| Self {
            name: &run.name,
            recording: r,
            at,
            at_s,
            turned_m,
            first,
            time_s: &r.time_s[first..end],
            force_n: &r.force_n[first..end],
        })
    }

    /// Objective for all lengths and all delays or lags.
    fn residuals(&self, how: LagModel) -> CornerResiduals {
        let n = self.time_s.len() as f64;
        let by = BUILD_UP_LENGTHS[self.at as usize].map(|delta| {
            let at = |k: usize| self.residual_square_sum(how, k as f64 * STEP_S, delta);
            (0..=(MAX_LAG_S / STEP_S) as usize).map(|k| n * libm::log((at(k) / n).max(1e-30))).collect()
        });
        CornerResiduals { name: self.name.to_owned(), by }
    }

    /// Residual sum of squares (N²) for one delay or lag.
    fn residual_square_sum(&self, how: LagModel, by_s: f64, delta: f64) -> f64 {
        let (delay_s, lag_s) = match how {
            LagModel::PureDelay => (by_s, 0.0),
            LagModel::LowPass => (0.0, by_s),
        };
        let (time, z) = (&self.recording.time_s, &self.recording.position_m);
        // The filter starts early enough to lose its initial state.
        let from = time.partition_point(|t| *t < self.time_s[0] - FILTER_MEMORY * lag_s);
        let mut slow = [z[from], 0.0, 0.0];
        let mut rows: Vec<[f64; REGRESSORS]> = Vec::with_capacity(self.time_s.len());
        for i in from..self.first + self.time_s.len() {
            let at_s = time[i] - delay_s;
            let at_m = interpolate(time, z, at_s);
            let u = match self.at {
                CornerKind::Stop => (at_s - self.at_s).max(0.0),
                CornerKind::Reversal if at_s < self.at_s - STANDSTILL_S => 0.0,
                CornerKind::Reversal => (self.turned_m - at_m).max(0.0),
            };
            // Without a lag the share is one.
            let share = if i == from { 1.0 } else { 1.0 - libm::exp(-(time[i] - time[i - 1]) / lag_s) };
            for (s, x) in slow.iter_mut().zip([at_m, u / delta, 1.0 - libm::exp(-u / delta)]) {
                *s += (x - *s) * share;
            }
            if i >= self.first {
                // Regressor before the corner: position at the stop, time at the reversal.
                let before = if self.at == CornerKind::Stop {
                    1e3 * (slow[0] - self.turned_m)
                } else {
                    time[i] - self.at_s
                };
                rows.push([1.0, before, slow[1], slow[2]]);
            }
        }
        least_squares(&rows, self.force_n).1.iter().map(|e| e * e).sum()
    }
}

/// Whether the needle travels equally far in each third of a time span.
fn is_even(r: &Recording, from_s: f64, to_s: f64) -> bool {
    let at_m = |k: u32| interpolate(&r.time_s, &r.position_m, from_s + f64::from(k) / 3.0 * (to_s - from_s));
    let thirds_m = [at_m(1) - at_m(0), at_m(2) - at_m(1), at_m(3) - at_m(2)];
    let middle_m = mean(&thirds_m);
    let tolerance_m = (MAX_UNEVENNESS.0 * middle_m.abs()).max(MAX_UNEVENNESS.1);
    thirds_m.iter().all(|travel_m| (travel_m - middle_m).abs() <= tolerance_m)
}

/// Number of regressors.
const REGRESSORS: usize = 4;

#[cfg(test)]
mod tests;
