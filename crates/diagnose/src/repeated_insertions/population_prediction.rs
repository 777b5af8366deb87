//! Predicts forces of new recordings: mean and band over draws of a population.

use super::insertion_phase::phase_at;
use super::random_effects_population::{Population, QUANTILES, is_in_air};
use super::segmented_recording::SegmentedRecording;
use stylet_identify::model::{DayParameters, Model, NO_RUPTURE, Parameter, RecordingParameters};
use stylet_record::Recording;
use stylet_stats::linear_algebra::CholeskyFactor;
use stylet_tissue::{ForceLawState, SensorInput, ShaftFriction};

/// Number of draws of a prediction; with the residual quantiles they give 640 values per sample.
pub const DRAWS: usize = 64;

/// Force (N) of the `k`-th new recording (from 1) with the motion of `run`, without residual.
#[must_use]
pub fn draw_force(
    population: &Population,
    run: &SegmentedRecording,
    k: usize,
    day: Option<usize>,
) -> Option<Vec<f64>> {
    draw_force_and_rupture(population, run, k, day).map(|f| f.0)
}

/// The same with the time (s) of the first rupture.
fn draw_force_and_rupture(
    population: &Population,
    run: &SegmentedRecording,
    k: usize,
    day: Option<usize>,
) -> Option<(Vec<f64>, f64)> {
    simulate_force(&population.draw(k, day), run)
}

/// Force (N) of a model with the motion of `run`, and the time (s) of the first rupture.
pub(super) fn simulate_force(model: &Model, run: &SegmentedRecording) -> Option<(Vec<f64>, f64)> {
    let r = &run.recording;
    let model = model.compile(0)?;
    let mut chain = model.chain.start(2.0 * r.sample_hz());
    let mut state = ForceLawState::default();
    let mut first_s = NO_RUPTURE;
    let force = (0..r.len())
        .map(|i| {
            let (t, z, v) = (
                r.time_s[i],
                r.position_m[i] * model.true_over_recorded,
                r.velocity_mps[i] * model.true_over_recorded,
            );
            let f = model.law.step(&mut state, t, z, v, |at| first_s = first_s.min(at.time_s)).total_n;
            if !model.has_measurement_chain {
                return f;
            }
            let reading = SensorInput { time_s: t, velocity_mps: v, tissue_n: f, ..SensorInput::default() };
            model.chain.step(&mut chain, &reading)
        })
        .collect::<Vec<f64>>();
    force.iter().all(|f| f.is_finite()).then_some((force, first_s))
}

/// A predicted force with its band.
#[derive(Clone, Debug, Default)]
pub struct PredictedForce {
    /// Mean force (N) per sample.
    pub mean_n: Vec<f64>,
    /// Lower end of the 90 % band (N).
    pub low_n: Vec<f64>,
    /// Upper end (N).
    pub high_n: Vec<f64>,
}

/// Standard normal quantile of the upper end of a 90 % band.
pub(super) const Z90: f64 = 1.644_853_626_951_472_2;

impl PredictedForce {
    /// Widens the band by an independent error with standard deviation `sd_n` (N) per sample.
    pub(super) fn widen(&mut self, sd_n: &[f64]) {
        for ((mean, sd), (low, high)) in
            self.mean_n.iter().zip(sd_n).zip(self.low_n.iter_mut().zip(&mut self.high_n))
        {
            *low = mean - libm::hypot(mean - *low, Z90 * sd);
            *high = mean + libm::hypot(*high - mean, Z90 * sd);
        }
    }
}

/// Predicts the force of a recording from its motion, on a known day or, for `None`, on a random one.
pub(crate) fn predict_force(
    population: &Population,
    run: &SegmentedRecording,
    day: Option<usize>,
    draws: usize,
) -> PredictedForce {
    let r = &run.recording;
    let forces: Vec<(Vec<f64>, f64)> =
        (1..=draws).filter_map(|k| draw_force_and_rupture(population, run, k, day)).collect();
    if forces.is_empty() {
        return PredictedForce::default();
    }
    let mut out = PredictedForce::default();
    let mut all = Vec::with_capacity(forces.len() * QUANTILES);
    for i in 0..r.len() {
        out.mean_n.push(forces.iter().map(|f| f.0[i]).sum::<f64>() / forces.len() as f64);
        all.clear();
        for (force, first_s) in &forces {
            let part = phase_at(run, r.time_s[i], *first_s) as usize;
            let pieces = if is_in_air(force[i]) {
                &population.air_quantiles_n
            } else {
                &population.residual_quantiles_n[part]
            };
            all.extend(pieces.iter().map(|left| force[i] + left));
        }
        let n = all.len();
        let (low, high) = (n / 20, n - 1 - n / 20);
        all.select_nth_unstable_by(low, f64::total_cmp);
        out.low_n.push(all[low]);
        all.select_nth_unstable_by(high, f64::total_cmp);
        out.high_n.push(all[high]);
    }
    if let Some(sd_n) = population
        .parameter_information
        .as_ref()
        .filter(|_| day.is_none())
        .and_then(|o| parameter_sd_n(population, o, run))
    {
        out.widen(&sd_n);
    }
    out
}

/// Standard deviation (N) of the force due to the uncertainty of the shared parameters, by finite
/// differences.
fn parameter_sd_n(
    population: &Population,
    information: &(Vec<Parameter>, CholeskyFactor),
    run: &SegmentedRecording,
) -> Option<Vec<f64>> {
    let (parameters, factor) = information;
    let mut model = population.model.clone();
    (model.per_recording, model.day_of) = (vec![RecordingParameters::default()], vec![model.days.len()]);
    model.days.push(DayParameters::default());
    model.rupture_times_s = vec![vec![NO_RUPTURE; model.layers()]];
    let center = simulate_force(&model, run)?.0;
    let slopes: Option<Vec<Vec<f64>>> = parameters
        .iter()
        .map(|n| {
            let x = model.get(n.role, 0);
            let step = if x + n.step > n.high { -n.step } else { n.step };
            let mut shifted = model.clone();
            shifted.set(n.role, 0, x + step);
            Some(simulate_force(&shifted, run)?.0.iter().zip(&center).map(|(t, h)| (t - h) / step).collect())
        })
        .collect();
    let slopes = slopes?;
    let sd = |i: usize| {
        let mut along = vec![0.0; factor.size()];
        along.iter_mut().zip(&slopes).for_each(|(a, s)| *a = s[i]);
        factor.forward_substitute(&along).iter().map(|y| y * y).sum::<f64>().sqrt()
    };
    Some((0..center.len()).map(sd).collect())
}

/// Shaft friction of the mean model, for compensation sample by sample with a given number of punctured layers.
#[must_use]
pub fn friction_model(population: &Population, recording: &Recording) -> Option<ShaftFriction> {
    let mut model = population.model.clone();
    model.per_recording = vec![RecordingParameters::default()];
    model.day_of = Vec::new();
    Some(ShaftFriction::new(model.compile(0)?.law, &[], recording.sample_hz()))
}

#[cfg(test)]
mod tests;
