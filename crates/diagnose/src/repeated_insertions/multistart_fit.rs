//! Multi-start fit of repeated recordings with the stick-slip model. The objective has many local minima; about one start in three reaches
//! the best.

use super::segmented_recording::{SPEED_TOLERANCE, SegmentedRecording};
use super::start_values::{
    EXPECTED_DAY_FRICTION_SD, EXPECTED_DAY_SURFACE_SD_M, StartValues, is_rate_held, shaft_slip_start,
};
use crate::base_law_fit::COARSENING_FACTOR;
use rand::{RngExt, rngs::ChaCha8Rng};
use std::sync::Arc;
use stylet_identify::block_averages::BlockAverages;
use stylet_identify::discrepancy_noise::discrepancy_noise;
use stylet_identify::fit::{Effort, Fit, Linearization, fit_nonsmooth};
use stylet_identify::likelihood::FitData;
use stylet_identify::model::{EffectTerm, Model, ParameterRole};
use stylet_identify::noise::Noise;
use stylet_identify::update_event_times::update_event_times;
use stylet_record::sensor_artefacts::SensorArtefacts;
use stylet_stats::parallel::*;
use stylet_tissue::{AnyEffect, Effect, Tissue};

/// Block length (s) of repeated recordings: insertions repeat no more precisely than this.
pub const SET_BLOCK_S: f64 = 0.08;
/// Standard deviation of the initial noise, as a share of the largest force.
const INITIAL_NOISE_SHARE: f64 = 0.1;
/// Weight of the prior scatter between days, in days.
pub(super) const PRIOR_DAYS: f64 = 4.0;
/// Iterations of the screening fits, per noise update.
const SCREENING_ITERATIONS: [usize; 2] = [6, 6];
/// Iterations of the fits that continue, per noise update.
const CONTINUED_ITERATIONS: [usize; 2] = [6, 8];
/// Number of starts that continue after screening.
const CONTINUED_STARTS: usize = 8;
/// Largest number of distinct optima that are refined.
const MAX_OPTIMA: usize = 4;
/// Relative difference of the RMS residuals below which two optima are the same.
const SAME_OPTIMUM: f64 = 0.002;
/// Multiple of the best RMS residual above which an optimum is not refined.
const MAX_RMS_RATIO: f64 = 1.4;
/// Relative difference of the RMS residuals below which starts agree with the best.
const AGREEMENT: f64 = 0.03;

/// A fit of repeated recordings.
#[derive(Clone, Debug)]
pub struct SetFit {
    /// The fit.
    pub fit: Fit,
    /// Recordings in blocks, with the estimated noise.
    pub data: FitData,
    /// Times (s) of the force drops of every recording.
    pub drop_times_s: Vec<Vec<f64>>,
    /// Number of starts, and number of those that agree with the best.
    pub starts: (usize, usize),
}

impl SetFit {
    /// RMS residual (N) with the ruptures at the observed times.
    #[must_use]
    pub fn rms_n(&self) -> f64 {
        self.fit.rms_n(&self.data)
    }

    /// Fits another model to the same recordings, from its own values.
    pub(crate) fn refit_with(&self, model: &Model) -> Option<Self> {
        let (fit, data) = fit_with_noise_updates(model, self.data.clone(), &self.drop_times_s, &[6])?;
        Some(Self { fit, data, drop_times_s: self.drop_times_s.clone(), starts: self.starts })
    }
}

/// Recordings in blocks, without the samples that sensor artefacts exclude.
#[must_use]
pub fn set_blocks(recordings: &[&SegmentedRecording], artefacts: &SensorArtefacts) -> Vec<BlockAverages> {
    let none = Vec::new();
    recordings
        .par_iter()
        .enumerate()
        .map(|(r, run)| {
            BlockAverages::new(&run.recording, artefacts.exclude.get(r).unwrap_or(&none), SET_BLOCK_S)
        })
        .collect()
}

/// Blocks with the initial noise.
fn with_initial_noise(blocks: Vec<BlockAverages>) -> FitData {
    let largest = blocks.iter().flat_map(|b| &b.abs_force_n).fold(1e-6_f64, |m, f| m.max(*f));
    FitData::new(Arc::new(blocks), Noise::white(INITIAL_NOISE_SHARE * largest), 1e-3)
}

/// Fits a model from its own values and estimates the noise.
#[must_use]
pub fn fit_from(model: &Model, blocks: Vec<BlockAverages>, drops: Vec<Vec<f64>>) -> Option<SetFit> {
    let (fit, data) = fit_with_noise_updates(model, with_initial_noise(blocks), &drops, &[6, 8])?;
    Some(SetFit { fit, data, drop_times_s: drops, starts: (1, 1) })
}

/// Start values number `k`: the middle of the ranges for 0, else random.
fn start_values(k: usize, rng: &mut ChaCha8Rng) -> StartValues {
    let mut within = |(low, high): (f64, f64)| {
        let drawn = rng.random::<f64>();
        low + (high - low) * if k == 0 { 0.5 } else { drawn }
    };
    let mut times = |(low, high): (f64, f64)| libm::exp(within((libm::log(low), libm::log(high))));
    let (exponent, fast, slow, delay) =
        (times((4.0, 18.0)), times((0.03, 3.0)), times((4.0, 20.0)), times((6.0, 20.0)));
    StartValues {
        linear_share: within((0.1, 0.9)),
        hold_ratio: within((0.3, 0.9)),
        pull_ratio: within((0.3, 0.9)),
        kept_share: within((0.4, 1.0)),
        exponent,
        wear_per_m: [within((0.0, 80.0)), within((0.0, 120.0))],
        rate: within((-0.3, 0.1)),
        fractions: [within((0.02, 0.4)), within((0.02, 0.4))],
        time_constants_s: [fast, slow],
        delay_exponent: delay,
        surface_m: within((-1.5e-3, 5e-4)),
        // Deeper layers rupture at the visible drop (negative values), or at this depth without a drop.
        rupture_depth_m: Some(within((-4e-3, 6e-3))).filter(|m| *m > 0.0),
    }
}

/// Fits in rounds; before each but the first, noise, rupture times and scatter are updated from the previous fit. The data returned have the
/// noise of the last one.
pub(crate) fn fit_with_noise_updates(
    model: &Model,
    mut data: FitData,
    drops: &[Vec<f64>],
    rounds: &[usize],
) -> Option<(Fit, FitData)> {
    let mut best: Option<Fit> = None;
    for iterations in rounds {
        let mut from = best.as_ref().map_or(model, |b| &b.model).clone();
        move_day_trend_to_rate(&mut from, &data);
        if let Some(best) = &best {
            update_event_times(&mut from, &data, drops);
            update_scatter(&mut from, &data, best);
        }
        let effort = Effort { max_iterations: *iterations, min_gain_nats: 0.05 };
        let fitted = fit_nonsmooth(&from, &data, effort)?;
        data =
            data.with_noise(discrepancy_noise(&data.recordings, &fitted.residuals.residual_n, data.floor_n));
        best = Some(fitted);
    }
    Some((best?, data))
}

/// Logarithm of the advance speed (mm/s).
fn ln_speed(blocks: &BlockAverages) -> f64 {
    let fastest = blocks.pieces.iter().map(|p| p.velocity_mps).fold(0.0, f64::max);
    let advance = blocks.pieces.iter().map(|p| p.velocity_mps).filter(|v| *v > 0.5 * fastest);
    libm::log(1e3 * stylet_stats::median_of(advance))
}

/// Moves the part of the day effects on friction that is linear in the logarithm of speed to the rate exponent. The force is the same, but
/// the day effects are smaller, and a fit makes little progress along this valley of the objective.
fn move_day_trend_to_rate(model: &mut Model, data: &FitData) {
    let is_slip = |e: &usize| matches!(model.effects[*e].effect(), Some(AnyEffect::ShaftSlip(_)));
    let which: Vec<usize> = (0..model.effects.len()).filter(is_slip).collect();
    let speed =
        |day| model.day_of.iter().position(|d| *d == day).and_then(|r| data.recordings.get(r)).map(ln_speed);
    let days: Vec<(usize, f64)> =
        (0..model.days.len()).filter_map(|d| Some((d, speed(d).filter(|x| x.is_finite())?))).collect();
    let n = days.len() as f64;
    let (x, y) =
        days.iter().fold((0.0, 0.0), |(x, y), (d, s)| (x + s / n, y + model.days[*d].ln_friction / n));
    let (square, product) = days.iter().fold((0.0, 0.0), |(square, product), (d, s)| {
        (square + (s - x).powi(2), product + (s - x) * model.days[*d].ln_friction)
    });
    if which.is_empty()
        || which.iter().any(|e| is_rate_held(model, *e))
        || square < libm::log1p(SPEED_TOLERANCE).powi(2) / 2.0
    {
        return;
    }
    let slope = product / square;
    let level = y - slope * x;
    days.iter().for_each(|(d, s)| model.days[*d].ln_friction -= level + slope * s);
    for e in which {
        let term = &model.effects[e];
        if let Some(AnyEffect::ShaftSlip(mut s)) = term.effect() {
            s.scale_friction(libm::exp(level));
            s.rate += slope;
            model.effects[e] = EffectTerm::of(&s.into());
        }
    }
}

/// Updates the scatter between recordings and between days: mean square of the estimates plus their conditional variance (expectation
/// maximisation with the curvature of the fit). A parameter without information keeps its scatter.
fn update_scatter(model: &mut Model, data: &FitData, at: &Fit) {
    let linearization = Linearization::new(&at.model, data, &at.residuals);
    let (count, random_effects) = (data.recording_count(), linearization.per_recording.len());
    let conditional = |places: &[usize]| -> Vec<f64> {
        let factor = linearization.normal_matrix.submatrix(places).cholesky();
        (0..places.len())
            .map(|i| {
                let unit: Vec<f64> = (0..places.len()).map(|j| f64::from(u8::from(i == j))).collect();
                factor.solve(&unit)[i].max(0.0)
            })
            .collect()
    };
    let mut sums = vec![(0.0, 0.0); random_effects];
    for r in 0..count {
        // Random effects without information are skipped.
        let moves: Vec<usize> = (0..random_effects)
            .filter(|o| {
                linearization.normal_matrix.at(linearization.index_of(*o, r), linearization.index_of(*o, r))
                    > 0.0
            })
            .collect();
        let places: Vec<usize> = moves.iter().map(|o| linearization.index_of(*o, r)).collect();
        for (o, variance) in moves.iter().zip(conditional(&places)) {
            let x = at.model.get(linearization.per_recording[*o].role, r);
            sums[*o].0 += x * x + variance;
            sums[*o].1 += 1.0;
        }
    }
    for (n, (sum, count)) in linearization.per_recording.iter().zip(&sums) {
        let sd = (sum / f64::max(*count, 1.0)).sqrt();
        match n.role {
            ParameterRole::RecordingSurface => model.scatter.surface_m = sd,
            ParameterRole::RecordingFriction => model.scatter.ln_friction = sd,
            ParameterRole::RecordingEffect(k) => model.scatter.varying[k] = sd,
            _ => {}
        }
    }
    let mut days = [(0.0, 0.0); 2];
    for (i, n) in linearization.shared.iter().enumerate() {
        let kind = match n.role {
            ParameterRole::DaySurface(_) => 0,
            ParameterRole::DayFriction(_) => 1,
            _ => continue,
        };
        days[kind].0 += model.get(n.role, 0).powi(2) + conditional(&[i])[0];
        days[kind].1 += 1.0;
    }
    // The scatter between few days is uncertain: the prior value counts as `PRIOR_DAYS` further days.
    let spread = |(sum, n): (f64, f64), expected: f64| {
        ((sum + PRIOR_DAYS * expected * expected) / (n + PRIOR_DAYS)).sqrt()
    };
    model.scatter.day_surface_m = spread(days[0], EXPECTED_DAY_SURFACE_SD_M);
    model.scatter.day_ln_friction = spread(days[1], EXPECTED_DAY_FRICTION_SD);
}

/// Fits from every start, smallest RMS residual first.
fn fit_all(models: &[Model], data: &FitData, drops: &[Vec<f64>], rounds: &[usize]) -> Vec<(f64, Model)> {
    let one = |model: &Model| {
        let (fit, data) = fit_with_noise_updates(model, data.clone(), drops, rounds)?;
        Some((fit.rms_n(&data), fit.model))
    };
    let mut found: Vec<(f64, Model)> = models.par_iter().filter_map(one).collect();
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    found
}

/// For RMS residuals in ascending order: number that agree with the best, and indices of the distinct optima to refine.
fn distinct_optima(errors: &[f64]) -> (usize, Vec<usize>) {
    let best = errors.first().copied().unwrap_or(f64::NAN);
    let agree = errors.iter().filter(|e| **e < best * (1.0 + AGREEMENT)).count();
    let mut apart: Vec<usize> = Vec::new();
    for (k, e) in errors.iter().enumerate().filter(|(_, e)| **e < best * MAX_RMS_RATIO) {
        if apart.len() < MAX_OPTIMA && apart.iter().all(|f| *e > errors[*f] * (1.0 + SAME_OPTIMUM)) {
            apart.push(k);
        }
    }
    (agree, apart)
}

/// Start models of a multi-start fit with random start values.
#[must_use]
pub fn draw_starts(
    assumed: &Tissue,
    recordings: &[&SegmentedRecording],
    starts: usize,
    rng: &mut ChaCha8Rng,
) -> Vec<Model> {
    (0..starts.max(1)).map(|k| shaft_slip_start(assumed, recordings, &start_values(k, rng))).collect()
}

/// Multi-start fit: returns the distinct best optima, smallest RMS residual first.
///
/// The smallest residual may not predict best, so the caller compares held-out errors. The result does not depend on the number of threads.
#[must_use]
pub fn multistart_fit(
    starts: &[Model],
    recordings: &[&SegmentedRecording],
    artefacts: &SensorArtefacts,
) -> Vec<SetFit> {
    let fine = set_blocks(recordings, artefacts);
    let drops: Vec<Vec<f64>> =
        recordings.iter().map(|r| r.ruptures_s.iter().copied().filter(|t| t.is_finite()).collect()).collect();
    let coarse = with_initial_noise(fine.iter().map(|b| b.coarsened(COARSENING_FACTOR)).collect());
    // Most starts are dropped after screening.
    let mut found = fit_all(starts, &coarse, &drops, &SCREENING_ITERATIONS);
    found.truncate(CONTINUED_STARTS);
    let promising: Vec<Model> = found.into_iter().map(|f| f.1).collect();
    let found = fit_all(&promising, &coarse, &drops, &CONTINUED_ITERATIONS);
    let errors: Vec<f64> = found.iter().map(|f| f.0).collect();
    let (agree, apart) = distinct_optima(&errors);
    let whole = with_initial_noise(fine);
    let mut out: Vec<SetFit> = apart
        .par_iter()
        .filter_map(|k| {
            let (fit, data) =
                fit_with_noise_updates(&found[*k].1, whole.clone(), &drops, &[4, 8, 10, 6, 6, 6])?;
            Some(SetFit { fit, data, drop_times_s: drops.clone(), starts: (found.len(), agree) })
        })
        .collect();
    out.sort_by(|a, b| a.rms_n().total_cmp(&b.rms_n()));
    out
}

#[cfg(test)]
mod tests;
